# SPDX-License-Identifier: Apache-2.0
"""Laws of one vehicle, in the user's body axes and about the user's origin: numbers and the methods of `Law`."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lgvi_warp.reference.rotation import Array


@dataclass(frozen=True)
class View:
    """Inputs of a law.

    R (3, 3) body to inertial; b (3,) [m] of the body's origin; nu (3,) [m/s] and Om (3,) [rad/s], body axes, relative
    to the water; t [s]; h [s], the length of the kick; step and member, the keys of random numbers; memory (rows,) of
    the law itself.
    """

    R: Array
    b: Array
    nu: Array
    Om: Array
    t: float = 0.0
    h: float = 0.0
    step: int = 0
    member: int = 0
    memory: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def down(self) -> Array:
        """z = R^T e3, the downward vertical in body axes."""
        return self.R[2]


@dataclass(frozen=True)
class Flow:
    """The water: velocity u (3,) [m/s], du/dt (3,) [m/s2] and gradient G_ij = du_i/db_j (3, 3) [1/s], inertial axes."""

    velocity: Array
    rate: Array
    gradient: Array

    def __add__(self, other: "Flow") -> "Flow":
        return Flow(self.velocity + other.velocity, self.rate + other.rate, self.gradient + other.gradient)


# The water at a point (3,) [m] of the body, body axes.
WaterAt = Callable[[Array], Flow]
STILL = Flow(np.zeros(3), np.zeros(3), np.zeros((3, 3)))


class Law:
    """Base class of laws, which does nothing. A subclass overrides its roles; its numbers are as in lgvi_warp."""

    potential_force = False  # whether `wrench` follows from `potential`
    in_order: tuple[str, ...] = ()  # numbers that may be given without their names

    def __init__(self, *values: Any, **numbers: Any) -> None:
        vars(self).update(dict(zip(self.in_order, values, strict=True)) if values else {}, **numbers)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"{type(self).__name__} has no number {name!r}")

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Force [N] and torque [N m] from position, attitude and time, body axes."""
        return np.zeros(3), np.zeros(3)

    def damping(self, view: View) -> Array:
        """D (6, 6) with (force; torque) = -D (nu; Om)."""
        return np.zeros((6, 6))

    def flow(self, view: View) -> Flow:
        """Motion of the water at view.b."""
        return STILL

    def load(self, view: View, water_at: WaterAt) -> tuple[Array, Array]:
        """D (6, 6) and w (6,) with (force; torque) = w - D (nu; Om), of a law with access to the water."""
        return np.zeros((6, 6)), np.zeros(6)

    def carried(self, view: View) -> tuple[Array, Array]:
        """D (6, 6), the change of the vehicle's inertia, and w (6,), the momentum of masses that move in it, body axes."""
        return np.zeros((6, 6)), np.zeros(6)

    def depart(self, view: View) -> Array:
        """Memory for the step of length view.h that begins at view.t."""
        return view.memory

    def power(self, view: View) -> float:
        """Power that the law uses [W]."""
        return 0.0

    def spent(self, view: View, memory: Array) -> float:
        """Energy [J] that the law uses while its memory becomes `memory`, in addition to its power."""
        return 0.0

    def potential(self, view: View) -> float:
        """Potential energy U(b, R) [J]; 0 by default."""
        return 0.0

    def beside(self, laws: tuple["Law", ...]) -> "Law":
        """The law adapted to all laws of a vehicle, if it depends on them."""
        return self

    def start(self) -> Array:
        """Memory at t = 0."""
        return np.zeros(0)

    def evolve(self, view: View, second: bool) -> Array:
        """Memory after the first or second half of a kick of length view.h; view.t is the middle of the kick."""
        return view.memory

    def follow(self, view: View) -> Array:
        """Exact memory at view.t, from the memory view.h earlier; a function of time and memory alone."""
        return view.memory
