"""Laws: frozen parameters with `wrench(z, b)`, the force and torque in body axes, and `potential(z, b)`."""

from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight

__all__ = ["Restoring", "Weight"]
