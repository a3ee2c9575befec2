# SPDX-License-Identifier: Apache-2.0
"""Forces and moments of a hull with wings from angle of attack and sideslip, as published for underwater gliders."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.extensions.gliders import DEVICE
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Polar(Term):
    """Drag, side force, lift and moments from angle of attack a and sideslip b (Graver 2005; Zhang et al. 2013).

    (u, v, w) is the velocity of the body's origin through the water, V its size, a = atan2(w, u), b = asin(v / V), and
    (p, q, r) is the angular velocity. In flow axes, the drag is (K_D0 + K_D a^2) V^2, the side force K_b b V^2 and the lift
    (K_L0 + K_L a) V^2. The roll, pitch and yaw moments are (K_MR b + K_p p) V^2, (K_M0 + K_M a + K_q q) V^2 and
    (K_MY b + K_r r) V^2. Coefficients have their published signs and are 0 by default.

    Args:
        drag: K_D0 [kg/m].
        drag_by_attack: K_D [kg/m/rad2].
        side_by_slip: K_b [kg/m/rad]; a negative value opposes the sideslip.
        lift: K_L0 [kg/m].
        lift_by_attack: K_L [kg/m/rad].
        roll_by_slip: K_MR [kg/rad].
        pitch: K_M0 [kg].
        pitch_by_attack: K_M [kg/rad]; a negative value turns the hull into the flow.
        yaw_by_slip: K_MY [kg/rad]; a positive value turns the hull into the flow.
        moment_by_rate: K_p, K_q, K_r, (3,) [kg s/rad]; negative values damp the rotation.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("torpedo", terms=[lw.terms.Polar(drag=7.19)], start={"velocity": [1.0, 0.0, 0.0]})
        >>> result = lw.solve(scene, h=0.05, t1=10.0)
        >>> print(f"{result.velocity[-1, 0, 0]:.4f} m/s")
        0.3296 m/s
    """

    type: ClassVar[str] = "polar"
    device: ClassVar[str] = f"{DEVICE}.polar"
    usual: ClassVar[Mapping[str, str]] = {"": "coefficients are as large as the vehicle makes them"}
    dissipative: ClassVar[bool] = False
    brakes: ClassVar[bool] = True

    drag: Any = number((), "kg/m", 0.0, least=0.0)
    drag_by_attack: Any = number((), "kg/m/rad2", 0.0, least=0.0)
    side_by_slip: Any = number((), "kg/m/rad", 0.0)
    lift: Any = number((), "kg/m", 0.0)
    lift_by_attack: Any = number((), "kg/m/rad", 0.0)
    roll_by_slip: Any = number((), "kg/rad", 0.0)
    pitch: Any = number((), "kg", 0.0)
    pitch_by_attack: Any = number((), "kg/rad", 0.0)
    yaw_by_slip: Any = number((), "kg/rad", 0.0)
    moment_by_rate: Any = number((3,), "kg s/rad", (0.0, 0.0, 0.0))

    def braking(self, numbers: Numbers, speeds: np.ndarray, water_density: np.ndarray) -> np.ndarray:
        # Minus the derivative of the wrench by the velocities, by differences.
        columns = []
        for axis in np.eye(6) * STEP:
            columns.append((wrench(numbers, speeds - axis) - wrench(numbers, speeds + axis)) / (2.0 * STEP))
        return np.stack(columns, axis=-1)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The user's axes and his origin in the kernel's; moment_by_rate stays along the user's.
        axes = {name: context.frame.vector(axis[None]) for name, axis in zip(AXES, np.eye(3), strict=True)}
        return Packed(dict(numbers) | axes | {"origin": context.frame.point(np.zeros((1, 3)))})


AXES = ("ahead", "aside", "below")
# Of differences [m/s, rad/s]; less than any speed [m/s]; the least s / V with which the axes y and z are formed.
STEP, STILL, LEAST_PART = 1e-6, 1e-30, 1e-3


def wrench(numbers: Numbers, twist: np.ndarray) -> np.ndarray:
    """Force and moment (n, 6) [N, N m] in body axes about the body's origin, at velocities (n, 6) [m/s, rad/s]."""
    nu, rate = twist[:, :3], twist[:, 3:]
    u, v, w = nu.T
    plane, speed = np.hypot(u, w), np.linalg.norm(nu, axis=1)
    a, b = np.arctan2(w, u), np.arctan2(v, plane)
    s = np.maximum(plane, np.maximum(LEAST_PART * speed, STILL))
    x = nu
    y = np.stack([-u * v, plane**2, -w * v], axis=-1) / s[:, None]
    z = np.stack([-w, 0.0 * u, u], axis=-1) * (speed / s)[:, None]
    k = numbers["moment_by_rate"] * rate
    along = (-numbers["drag"] - numbers["drag_by_attack"] * a**2, numbers["side_by_slip"] * b,
             -numbers["lift"] - numbers["lift_by_attack"] * a)  # fmt: skip
    about = (numbers["roll_by_slip"] * b + k[:, 0], numbers["pitch"] + numbers["pitch_by_attack"] * a + k[:, 1],
             numbers["yaw_by_slip"] * b + k[:, 2])  # fmt: skip
    force, moment = (
        sum(size[:, None] * axis for size, axis in zip(sizes, (x, y, z), strict=True)) for sizes in (along, about)
    )
    return np.asarray(speed[:, None] * np.concatenate([force, moment], axis=1))
