# SPDX-License-Identifier: Apache-2.0
"""Contact with the sea floor, for vehicles that land, rest or slide on it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.extensions.sea import DEVICE
from lgvi_warp.physics import vehicle
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import Array, Numbers, Packed, PackingContext, Term, number, own
from lgvi_warp.physics.terms.floor import REST, Floor

# Largest angle [rad] by which the stiffest contact turns in a step, and largest part of a velocity that its dampers take.
ANGLE, PART = 1.0, 1.0
# Least part of critical damping, over the square of that angle. By when in a step a point touches, an explicit step returns
# up to 1 + angle^2 / 4 of the energy of a bounce; a damper takes 2 pi times its part: 1 / 8 pi to first order, and a margin.
LEAST = 0.08


@dataclass(frozen=True, eq=False, kw_only=True)
class BottomContact(Term):
    """Contact of hull points with a floor whose `contact` is "rest": springs, dampers and dry friction.

    The floor pushes a point at the depth d below it with the force stiffness * d + damping * (speed into the floor), and
    never pulls. Along the floor, a spring and a damper hold the point with a force of at most friction times this push; if
    a larger force were needed, the point slides. A vehicle at rest stays at rest.

    The step h limits stiffness and damping. At these limits, the phase of the vehicle's fastest oscillation on all its
    points advances by 1 rad in a step, and its speed decays within one step. The limits are the defaults, so a shorter step
    makes a harder floor. At rest, a net weight W sinks in by W h^2 / m or more, where m is the mass including added mass.

    Args:
        points: Points of the hull that may touch the floor, (k, 3) [m] from the body's origin.
        friction: Coefficient of friction, the tangent of the friction angle; 0.5 by default.
        stiffness: Stiffness of the floor at each point [N/m]; by default the limit for the step.
        damping: Damping at each point [N s/m]; by default critical damping. The step sets an upper bound, and a lower bound
            below which a bounce could gain energy.
        floor: Name of the floor; "", the default, stands for the only floor whose `contact` is "rest".

    Raises:
        SceneError: If a number is invalid (see `Term`). A scene refuses this term if it has no such floor, or several such
            floors and `floor` names none of them.

    Examples:
        >>> import lgvi_warp as lw
        >>> feet = [[0.4, 0.4, 0.5], [0.4, -0.4, 0.5], [-0.4, 0.4, 0.5], [-0.4, -0.4, 0.5]]
        >>> lander = lw.terms.BottomContact(points=feet, friction=0.6)
        >>> lander.floor
        ''
    """

    type: ClassVar[str] = "bottom_contact"
    device: ClassVar[str] = f"{DEVICE}.bottom_contact"
    # By its cone it takes energy, although its matrix of damping alone does not tell.
    brakes: ClassVar[bool] = True
    usual: ClassVar[Mapping[str, Any]] = {
        "friction": (5.0, "the angle of friction is below 70 degrees"),
        "stiffness": "the step limits it",
        "damping": "the step limits it",
    }
    # The floor; set for a term of a scene.
    ground: ClassVar[Any] = None

    points: Any = number(("k", 3), "m")
    friction: Any = number((), "1", 0.5, least=0.0)
    stiffness: Any = number((), "N/m", None, above=0.0, optional=True)
    damping: Any = number((), "N s/m", None, least=0.0, optional=True)
    floor: str = ""

    @property
    def memory(self) -> bool:
        return True

    def beside(self, terms: Sequence[Term]) -> Any:
        # Knows its floor.
        able = {term.key: term for term in terms if isinstance(term, Floor) and term.contact == REST}
        faults = Faults()
        if self.floor and self.floor not in able:
            remedy = closest(self.floor, able) if able else f'give the floor contact = "{REST}"'
            faults.add(f"{self.key}.floor", self.floor, f'is not a floor with contact = "{REST}"', remedy)
        elif not self.floor and len(able) != 1:
            problem = f"does not say which of {len(able)} floors" if able else "needs a floor"
            remedy = f'give one, such as [[events]] type = "floor", depth = 40.0, contact = "{REST}"'
            faults.add(f"{self.key}.floor", self.floor, problem, f"name one: {', '.join(able)}" if able else remedy)
        faults.raise_if_any()
        ground = able[self.floor] if self.floor else next(iter(able.values()))
        if ground is self.ground:
            return self
        term = copy.copy(self)
        object.__setattr__(term, "ground", ground)
        return term

    def braking(self, numbers: Numbers, speeds: Array, water_density: Array) -> Array:
        # No step is too long for it.
        return np.zeros((len(speeds), 6, 6))

    def stiffest(self, numbers: Numbers, parameters: Numbers, h: float) -> tuple[Array, Array]:
        """Stiffness and damping at each point for a step.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            parameters: All parameters of the scene, by name.
            h: Step [s].

        Returns:
            Stiffness (n,) [N/m] and damping (n,) [N s/m].
        """
        points, inertia = repeated(numbers["points"], vehicle.inertia6(parameters))
        springs = np.zeros((len(points), 6, 6))
        for r in np.moveaxis(points, 1, 0):
            # The velocity of a point is [I, -hat(r)] (nu; Om).
            G = np.concatenate([np.broadcast_to(np.eye(3), (len(r), 3, 3)), -hat(r)], axis=2)
            springs += np.swapaxes(G, 1, 2) @ G
        # The largest 1 / mass that all points together move.
        total = np.abs(np.linalg.eigvals(np.linalg.solve(inertia, springs))).max(axis=1)
        k, c = (ANGLE / h) ** 2 / total, PART / h / total
        k = np.minimum(numbers["stiffness"], k) if "stiffness" in numbers else k
        # Aperiodic, where nothing else is asked for; at least what a bounce may gain by the step.
        critical = 2.0 * np.sqrt(k / total)
        return k, np.clip(numbers.get("damping", critical), LEAST * h**2 * total * k * critical, c)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        k, c = self.stiffest(numbers, context.parameters, context.h)
        points = context.frame.point(numbers["points"])
        count = points.shape[1]
        values = {"stiffness": k, "damping": c, "friction": numbers["friction"], "count": count}
        ground = self.ground.packed_grid(own(self.ground, context.parameters), values)
        rows = points.reshape(len(points), -1)
        words = {"points": ground.rows.shape[1]}
        memory = np.zeros((1, 4 * count))
        return Packed(ground.values | words, (ground.rows, rows), memory)


def hat(r: Array) -> Array:
    """Matrices (n, 3, 3) of the cross product with vectors (n, 3)."""
    out = np.zeros((*r.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[:, i, j], out[:, j, i] = -r[:, k], r[:, k]
    return out
