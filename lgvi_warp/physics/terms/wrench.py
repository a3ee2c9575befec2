# SPDX-License-Identifier: Apache-2.0
"""A force and torque in body axes, constant or by a schedule."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import ragged
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import JUMP_EARLY, Numbers, Packed, PackingContext, Term, knots, number, side_by_side

SHAPES = ("linear", "steps")


@dataclass(frozen=True, eq=False, kw_only=True)
class Wrench(Term):
    """Constant force and torque in body axes, about the body's origin.

    Args:
        force: Force, (3,) [N]; 0 by default.
        torque: Torque, (3,) [N m]; 0 by default.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("torpedo", terms=[lw.terms.Wrench(force=[5.0, 0.0, 0.0])])
        >>> scene.parameters()["wrench.force"]
        array([5., 0., 0.])
    """

    type: ClassVar[str] = "wrench"
    strengths: ClassVar[tuple[str, ...]] = ("force", "torque")

    force: Any = number((3,), "N", (0.0, 0.0, 0.0))
    torque: Any = number((3,), "N m", (0.0, 0.0, 0.0))

    def drive(self) -> np.ndarray:
        # The sizes of force and torque.
        return np.abs(np.concatenate([self.force, self.torque]))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Force and torque about the origin of the forces, in the kernel's axes.
        force, torque = numbers["force"], numbers["torque"]
        return Packed({"force": context.frame.vector(force), "torque": context.frame.torque(torque, force)})


@dataclass(frozen=True, eq=False, kw_only=True)
class WrenchSchedule(Term):
    """Force and torque in body axes, about the body's origin, from a table over time.

    Before the first time and after the last the values are constant.

    Args:
        times: Times, (k,) [s], rising.
        force: Forces at these times, (k, 3) [N].
        torque: Torques at these times, (k, 3) [N m]; 0 by default.
        interpolation: "linear", the default, between the times; or "steps", with each value constant until the next time.

    Raises:
        SceneError: If times do not rise, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "wrench_schedule"
    timed: ClassVar[bool] = True

    times: Any = number(("k",), "s", rising=True)
    force: Any = number(("k", 3), "N")
    torque: Any = number(("k", 3), "N m", None)
    interpolation: str = word("linear", known=SHAPES)

    def __post_init__(self) -> None:
        if self.torque is None:
            object.__setattr__(self, "torque", np.zeros(() if ragged(self.force) else np.shape(self.force)))
        super().__post_init__()

    @property
    def jumps(self) -> bool:
        """Whether the values jump at the times; a run must reach these times at whole steps."""
        return self.interpolation == "steps"

    def drive(self) -> np.ndarray:
        # The largest sizes of force and torque in the schedule.
        return np.abs(np.concatenate([self.force, self.torque], axis=1)).max(axis=0)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Two tables: the force, and the torque about the origin of the forces.
        force = context.frame.vector(numbers["force"])
        torque = context.frame.torque(*repeated(numbers["torque"], numbers["force"]))
        times = numbers["times"] - JUMP_EARLY * context.h if self.jumps else numbers["times"]
        tables = [knots(times, values, self.jumps) for values in (force, torque)]
        return Packed({"count": numbers["times"].shape[1] - 1}, side_by_side(*tables))


def commands(numbers: Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Times (n, k) [s] and commands (n, k, units) of a term; a constant command is a schedule of one row."""
    schedule = numbers["command_schedule"]
    return numbers["times"], numbers["command"][:, None, :] if schedule.shape[1] == 1 else schedule


def at_start(times: np.ndarray, schedule: np.ndarray, start: float = 0.0) -> np.ndarray:
    """Commands (n, columns) at the time `start` [s] of schedules (1 or n, k, columns) with times (1 or n, k) [s]."""
    members = zip(*repeated(times, schedule), strict=True)
    return np.array([[np.interp(start, at, column) for column in commands.T] for at, commands in members])
