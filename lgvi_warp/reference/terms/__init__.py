"""Laws: frozen parameters with `wrench(z, b)`, the force and torque in body axes, and `potential(z, b)`.

z = R^T e3 (3,) is the downward vertical in body axes, b (3,) the position [m] in inertial axes.
"""

from typing import Protocol

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight


class Law(Protocol):
    """What a body sums."""

    def wrench(self, z: Array, b: Array) -> tuple[Array, Array]:
        """f(b, R) (3,) [N] and mU(b, R) (3,) [N m], body axes."""

    def potential(self, z: Array, b: Array) -> float:
        """U(b, R) [J]."""


__all__ = ["Law", "Restoring", "Weight"]
