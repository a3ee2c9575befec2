"""An ideal actuator: the wrench that a controller commands."""

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.following import Following


class ControlWrench(Following):
    """Numbers as those of `lw.ControlWrench`, and of `Following`; command (6,)."""

    driven = True

    def wrench(self, view: View) -> tuple[Array, Array]:
        """The place of each component."""
        n = self.place(view)
        return n[:3], n[3:]
