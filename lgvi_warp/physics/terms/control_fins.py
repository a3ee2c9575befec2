"""Control fins: fins that turn about their span to a command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, knots, number
from lgvi_warp.physics.terms.fins import Fins, fin_rows, side_by_side
from lgvi_warp.physics.terms.wrench import commands, first_row, refuse_idle

# From this rate on [rad/s] a limit counts as none.
UNLIMITED = 1e6


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlFins(Fins):
    """Fins that are turned about their span by a deflection, which follows a command.

    A positive deflection lifts along +normal where the flow comes from ahead. It is the command within `limit`, followed no
    faster than `rate_limit`; at t = 0 it equals the command. One number stands for n equal ones.

    Args:
        position, chord, normal, area, lift_slope, drag, drag_normal: As of `Fins`.
        limit: Largest deflection either way, (n,) [rad]; 0.35 by default.
        rate_limit: Largest rate of the deflection, (n,) [rad/s]; none by default.
        command: Deflection that is held, (n,) [rad].
        times: Times of the schedule, (k,) [s], rising.
        command_schedule: Deflections at these times, (k, n) [rad], linear between them; instead of `command`.

    Raises:
        SceneError: As `Fins`, and where times do not rise or the command is given twice.
    """

    type: ClassVar[str] = "control_fins"
    device: ClassVar[str] = "control_fins"
    timed: ClassVar[bool] = True

    limit: Any = number(("n",), "rad", 0.35, least=0.0)
    rate_limit: Any = number(("n",), "rad/s", UNLIMITED, least=0.0)
    command: Any = number(("n",), "rad", None)
    times: Any = number(("k",), "s", None, rising=True)
    command_schedule: Any = number(("k", "n"), "rad", None)

    def __post_init__(self) -> None:
        first = first_row(self.command_schedule)
        twice = self.command is not None and self.command_schedule is not None
        object.__setattr__(self, "_both", twice and not np.array_equal(first, self.command))
        if self.command is None:
            object.__setattr__(self, "command", first)
        self.repeat("limit", "rate_limit", "command")
        if self.command_schedule is None:
            object.__setattr__(self, "command_schedule", [self.command])
            object.__setattr__(self, "times", [0.0] if self.times is None else self.times)
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        """In addition, adds a fault where the command is given twice."""
        super().check(faults)
        if self.__dict__["_both"]:
            faults.add("command", self.command, "is given beside command_schedule", "keep one of them")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        """In addition, raises SceneError for members' numbers that would have no effect."""
        remedy = f"give {self.key}.rate_limit below {UNLIMITED:g} rad/s in the scene as well"
        refuse_idle(self, numbers, "rate_limit", numbers["rate_limit"] < UNLIMITED, remedy)
        return super().unphysical(numbers)

    @property
    def memory(self) -> bool:
        """Whether the rate of some fin is limited."""
        return bool(np.any(self.rate_limit < UNLIMITED))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """The device rows: those of each fin, then the command table of each fin."""
        fins = side_by_side([fin_rows(numbers, context), numbers["limit"][..., None], numbers["rate_limit"][..., None]])
        times, schedule = commands(numbers)
        count = schedule.shape[2]
        tables = [knots(times, schedule[:, :, i : i + 1]) for i in range(count)]
        rows = side_by_side([fins.reshape(len(fins), -1), *tables])
        values = {"count": count, "knots": times.shape[1] - 1, "limited": int(self.memory), "memory": 0}
        if not self.memory:
            return Packed(values, rows, work=2 * count)
        start = np.clip(_at_start(times, schedule), -numbers["limit"], numbers["limit"])
        return Packed(values, rows, start, 2 * count)


def _at_start(times: np.ndarray, schedule: np.ndarray) -> np.ndarray:
    """The commands (n, fins) [rad] at t = 0."""
    n = max(len(times), len(schedule))
    times, schedule = (np.broadcast_to(table, (n, *table.shape[1:])) for table in (times, schedule))
    return np.array(
        [[np.interp(0.0, t, column) for column in commands.T] for t, commands in zip(times, schedule, strict=True)]
    )
