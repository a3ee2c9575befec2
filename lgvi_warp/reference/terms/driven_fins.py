"""Control fins that a controller drives."""

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.driven import Driven
from lgvi_warp.reference.terms.fins import Fins


class DrivenFins(Driven, Fins):
    """Numbers as those of the twin's `Fins`, and those of `Driven` in rad and rad/s."""

    def deflection(self, view: View) -> Array:
        """Where the fins are."""
        return self.place(view)
