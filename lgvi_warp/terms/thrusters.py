"""Thrusters with a quadratic thrust curve, dead band, saturation and first-order lag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.errors import Faults
from lgvi_warp.terms.base import Numbers, Packed, Setting, Term, knots, quantity
from lgvi_warp.terms.wrench import commands, first_row, not_rising, refuse_idle, rising


@dataclass(frozen=True, eq=False, kw_only=True)
class Thrusters(Term):
    """n thrusters, each with thrust = c+ max(u - band, 0)^2 - c- max(-u - band, 0)^2 along its direction (Fossen 2021, 9).

    position: (n, 3) [m] from the body's origin; direction: (n, 3), any length but 0; coefficient: (n,) [N per unit of
    command squared] ahead, coefficient_astern: (n,), the same by default; dead_band, limit: (n,) of the command;
    time_constant: (n,) [s] of the first-order lag from command to u, 0 for none; command: (n,), held, or with times (k,)
    [s], rising: command_schedule (k, n), linear between. The unit of command is the user's: 1, V or rad/s.
    """

    type: ClassVar[str] = "thrusters"
    device: ClassVar[str] = "thrusters"
    timed: ClassVar[bool] = True

    position: Any = quantity(("n", 3), "m")
    direction: Any = quantity(("n", 3), "1")
    coefficient: Any = quantity(("n",), "N per unit^2", least=0.0)
    coefficient_astern: Any = quantity(("n",), "N per unit^2", None, least=0.0)
    dead_band: Any = quantity(("n",), "unit", None, least=0.0)
    limit: Any = quantity(("n",), "unit", None, least=0.0)
    time_constant: Any = quantity(("n",), "s", None, least=0.0)
    command: Any = quantity(("n",), "unit", None)
    times: Any = quantity(("k",), "s", None)
    command_schedule: Any = quantity(("k", "n"), "unit", None)

    def __post_init__(self) -> None:
        n = len(np.atleast_1d(np.asarray(self.coefficient, dtype=object)))
        defaults = {"coefficient_astern": self.coefficient, "dead_band": np.zeros(n), "limit": np.full(n, 1e6),
                    "time_constant": np.zeros(n)}  # fmt: skip
        scheduled = self.command_schedule is not None
        first = first_row(self.command_schedule)
        both = scheduled and self.command is not None and not np.array_equal(self.command, first)
        if scheduled:
            defaults["command"] = first
        else:
            held = 0.0 if self.command is None else self.command
            held = np.full(n, held) if np.ndim(np.asarray(held, dtype=object)) == 0 else held
            defaults |= {"command": held, "times": [0.0], "command_schedule": [held]}
        for name, value in defaults.items():
            if getattr(self, name) is None:
                alone = np.ndim(np.asarray(value, dtype=object)) == 0
                object.__setattr__(self, name, np.full(n, value) if alone else value)
            elif np.ndim(np.asarray(getattr(self, name), dtype=object)) == 0 and name != "command_schedule":
                object.__setattr__(self, name, np.full(n, getattr(self, name)))
        object.__setattr__(self, "_both", both)
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        """Directions need a length, times must rise, a command is given in one way."""
        zero = np.flatnonzero(np.linalg.norm(self.direction, axis=1) == 0.0)
        if len(zero):
            remedy = "give the direction that the thrust pushes the vehicle, such as [1, 0, 0]"
            faults.add(f"direction[{zero[0]}]", self.direction[zero[0]], "has zero length", remedy)
        rising(faults, "times", self.times)
        if self.__dict__["_both"]:
            faults.add("command", self.command, "differs from the first of command_schedule", "keep one of them")

    def unphysical(self, own: Numbers) -> dict[str, np.ndarray]:
        """Also a direction without length and times that do not rise. Raises SceneError for numbers that would not act."""
        bad = super().unphysical(own)
        bad["direction"] = bad["direction"] | np.any(~np.any(own["direction"], axis=-1), axis=-1)
        bad["times"] = bad["times"] | not_rising(own["times"])
        remedy = f"give {self.key}.time_constant above 0 [s] in the scene as well"
        refuse_idle(self, own, "time_constant", own["time_constant"] > 0.0, remedy)
        return bad

    @property
    def memory(self) -> bool:
        """Whether some thruster lags."""
        return bool(np.any(self.time_constant > 0.0))

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """Rows as the device code has them: each thruster's, then each one's commands."""
        direction = own["direction"] / np.linalg.norm(own["direction"], axis=-1, keepdims=True)
        arms = np.cross(own["position"] + 0.0 * direction, direction + 0.0 * own["position"])
        force, torque = setting.frame.vector(direction), setting.frame.torque(arms, direction + 0.0 * arms)
        with np.errstate(divide="ignore"):
            rate = np.where(own["time_constant"] > 0.0, 1.0 / own["time_constant"], FAST)
        numbers = [own[key] for key in ("coefficient", "coefficient_astern", "dead_band", "limit")]
        parts = [force, torque, *(x[..., None] for x in (*numbers, rate))]
        times, schedule = commands(own)
        n = max(*(len(part) for part in parts), len(times), len(schedule))
        whole = [np.broadcast_to(part, (n, *part.shape[1:])) for part in parts]
        rows = [np.concatenate(whole, axis=2).reshape(n, -1)]
        for i in range(schedule.shape[2]):
            table = knots(times, schedule[:, :, i : i + 1])
            rows.append(np.broadcast_to(table, (n, table.shape[1])))
        count = schedule.shape[2]
        values = {"count": count, "knots": times.shape[1] - 1, "lagged": int(self.memory)}
        if not self.memory:
            return Packed(values | {"memory": 0}, np.concatenate(rows, axis=1))
        first = np.stack([np.interp(0.0, t, c) for t, c in _columns(times, schedule)])
        start = np.clip(first.reshape(-1, count), -own["limit"], own["limit"])
        return Packed(values, np.concatenate(rows, axis=1), start)


# 1 / time constant of a thruster without a lag, among others that have one: faster than any step, and within float32.
FAST = 1e20


def _columns(times: np.ndarray, schedule: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """(times, commands) of each thruster of each member."""
    n = max(len(times), len(schedule))
    return [(times[i % len(times)], column) for i in range(n) for column in schedule[i % len(schedule)].T]
