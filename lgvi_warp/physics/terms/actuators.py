# SPDX-License-Identifier: Apache-2.0
"""Common parts of actuators that follow a controller or a schedule, with lag and rate limit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import STEEP, Numbers, Packed, Term, side_by_side
from lgvi_warp.physics.terms.wrench import at_start, commands

# 1 / time constant of a channel without lag: faster than any step, and within float32. A limit of a rate that counts as none.
FAST, UNLIMITED = 1e20, 1e6
# A time [s] after all others, and within float32.
FOREVER = 1e30
# Rows to work with of the piece of a schedule in use, beside two of each channel: IN_USE in lgvi_kernels/laws/scheduled.py.
PIECE_ROWS = 4
# Fields of a schedule of commands, which stands in place of `command`.
SCHEDULE = ("times", "command_schedule")


def are_finite(values: Any) -> bool:
    """Return whether values are finite numbers."""
    try:
        return bool(np.all(np.isfinite(np.asarray(values, float))))
    except (TypeError, ValueError):
        return False


@dataclass(frozen=True, eq=False, kw_only=True)
class Commanded(Term):
    """Base class of terms with n units, a constant `command` (n,) or `command_schedule` (k, n) at `times` (k,). Abstract."""

    timed: ClassVar[bool] = True
    driven_fields: ClassVar[tuple[str, ...]] = ("command", *SCHEDULE)

    def settle_commands(self: Any, count: int) -> None:
        """Set the schedule from constant commands, or the commands from the schedule, before the fields are checked."""
        first = first_row(self.command_schedule)
        both = self.command is not None and self.command_schedule is not None
        object.__setattr__(self, "commanded_twice", both and not np.array_equal(first, self.command))
        if self.command is None:
            # What is wrong with a schedule is told of it alone.
            object.__setattr__(self, "command", first if are_finite(first) else [0.0] * count)
        self.repeat(count, "command")
        if self.command_schedule is None:
            object.__setattr__(self, "following", SCHEDULE if self.times is None else ())
            object.__setattr__(self, "command_schedule", [self.command])
            object.__setattr__(self, "times", [0.0] if self.times is None else self.times)

    def __post_init__(self) -> None:
        super().__post_init__()
        # What is held does not look at the time.
        object.__setattr__(self, "timed", not self.holds)

    @property
    def slow(self) -> bool:
        """Whether some channel follows its command with a lag or a rate limit."""
        raise NotImplementedError

    @property
    def memory(self) -> bool:
        # A slow channel that begins at a command that is held stays there: nothing is to be remembered.
        return self.slow and (self.driver is not None or not self.holds)

    @property
    def holds(self: Any) -> bool:
        """Whether the commands are constant, so that the field `command` acts; otherwise the schedule acts."""
        return len(self.command_schedule) == 1

    @property
    def idle_fields(self) -> tuple[str, ...]:
        """Fields of the commands that follow from the other fields."""
        return SCHEDULE if self.holds else ("command",)

    @property
    def own_commands(self: Any) -> bool:
        # Whether it has a schedule, or a command other than 0.
        return not self.holds or bool(np.any(self.command))

    def with_fields(self, fields: Mapping[str, Any]) -> Any:
        # Of its commands those that follow from the others are left out.
        left_out = ("command",) if fields.keys() & set(SCHEDULE) else self.idle_fields
        return super().with_fields(dict.fromkeys(left_out) | dict(fields))

    def to_dict(self) -> dict[str, Any]:
        # Of its commands what acts.
        return {key: value for key, value in super().to_dict().items() if key not in self.idle_fields}


def motion(term: Any) -> dict[str, bool]:
    """Whether a driven actuator's channels have a lag and a rate limit, with the scene's numbers."""
    lag, rate = term.time_constant, term.rate_limit
    return {
        "lag": lag is not None and bool(np.any(lag > 0.0)),
        "rate": rate is not None and bool(np.any(rate < UNLIMITED)),
    }


def refuse_unread(term: Any, numbers: Numbers) -> None:
    """Refuse members' lags and rate limits (n, channels) of a driven actuator if the scene has none."""
    faults, features = Faults(f"{term.key}."), motion(term)
    acting = {"lag": ("time_constant", lambda x: x > 0.0), "rate": ("rate_limit", lambda x: x < UNLIMITED)}
    for feature, (name, acts) in acting.items():
        values = numbers.get(name)
        if values is not None and not features[feature] and np.any(acts(values)):
            fault = "does not act: the scene has none"
            faults.add(
                name, values[np.any(acts(values), axis=-1)][0], fault, f"give {term.key}.{name} in the scene as well"
            )
    faults.raise_if_any()


def packed_following(
    term: Any, numbers: Numbers, blocks: np.ndarray, shared: np.ndarray | None = None, size: int = 0, work: int = 0,
    words: Mapping[str, int] | None = None, start: float = 0.0,
) -> Packed:  # fmt: skip
    """Pack an actuator whose device code comes from lgvi_kernels.laws.driven or .scheduled.

    numbers: {field: (m, ...)} of `limit`, `time_constant` and `rate_limit` if given, and the schedule if not driven.
    blocks: Other rows of each channel, (m, channels, rows). shared: Rows after those of all channels, (m, rows).
    work: Number of the device code's own scratch rows. words: Further whole numbers of the device struct.
    start: Start time of members [s].
    Returns: Rows of each channel (blocks, limit, 1 / lag, rate limit), schedules, and shared rows. The memory holds the
        positions of channels that move, at first 0 for a driven actuator, else the command at the start.
    """
    limit = numbers["limit"]
    none = np.zeros_like(limit)
    with np.errstate(divide="ignore"):
        time = numbers.get("time_constant", none)
        lag = np.where(time > 0.0, 1.0 / time, FAST)
    rate = numbers.get("rate_limit", none + UNLIMITED)
    channels = side_by_side(blocks, *(value[..., None] for value in (limit, lag, rate)))
    count = channels.shape[1]
    rows = [channels.reshape(len(channels), -1)]
    values = {"count": count, "alike": int(np.all(lag == lag[:, :1])), **(words or {})}
    work += 0 if term.driver is not None else PIECE_ROWS + 2 * count
    values |= {} if work else {"work": 0}
    places = np.zeros((1, count))
    if term.driver is not None:
        values |= term.driver.values_of(term.key)
    else:
        times, schedule = commands(numbers)
        places = np.clip(at_start(times, schedule, start), -limit, limit)
        times, schedule = within_limits(times, schedule, limit)
        rows.append(pieces(times, schedule))
        values |= {"knots": times.shape[1] - 1}
    values |= {"shared": sum(part.shape[1] for part in rows), "size": size}
    rows += [] if shared is None else [shared]
    if not term.memory:
        return Packed(values | {"memory": 0}, side_by_side(*rows), work=work)
    return Packed(values, side_by_side(*rows), places, work)


def within_limits(times: np.ndarray, schedule: np.ndarray, limit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clip schedules (1 or n, k, units) to limits (1 or n, units), and add the times at which they reach the limits.

    Returns: Times and commands. If only some members reach a limit, the others have one time twice.
    """
    if np.all(np.abs(schedule) <= limit[:, None]):
        return times, schedule
    times, schedule, limit = repeated(times, schedule, limit[:, None])
    change, span = np.diff(schedule, axis=1), np.diff(times, axis=1)[..., None]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        reached = np.concatenate([(side * limit - schedule[:, :-1]) / change for side in (-1.0, 1.0)], axis=2)
    # Where the parts between two times at which some member's command reaches a limit begin: (n, crossings).
    inside = (reached > 0.0) & (reached < 1.0)
    interval, column = np.nonzero(inside.any(axis=0))
    part = np.where(inside, reached, 0.0)[:, interval, column]
    times = np.concatenate([times, times[:, interval] + part * span[:, interval, 0]], axis=1)
    crossed = schedule[:, interval] + part[..., None] * change[:, interval]
    schedule = np.clip(np.concatenate([schedule, crossed], axis=1), -limit, limit)
    order = np.argsort(times, axis=1, kind="stable")
    return np.take_along_axis(times, order, axis=1), np.take_along_axis(schedule, order[..., None], axis=1)


def pieces(times: np.ndarray, schedule: np.ndarray) -> np.ndarray:
    """Rows of schedules (1 or n, k, units) in the form that lgvi_kernels.laws.scheduled reads.

    times: (1 or n, k) [s]; equal times are a jump.
    """
    times, schedule = repeated(times, schedule)
    span = np.diff(times, axis=1)
    steepness = np.divide(1.0, span, out=np.full_like(span, STEEP), where=span > 0.0)
    ends = np.pad(times, ((0, 0), (0, 1)), constant_values=FOREVER)
    values = np.concatenate([schedule[:, :1], schedule], axis=1)
    changes = np.pad(np.diff(schedule, axis=1), ((0, 0), (1, 1), (0, 0)))
    commands = np.stack([values, changes], axis=-1).reshape(*ends.shape, -1)
    each = np.concatenate([ends[..., None], np.pad(steepness, ((0, 0), (1, 1)))[..., None], commands], axis=-1)
    return each.reshape(len(each), -1)


def first_row(schedule: Any) -> Any:
    """Commands (units,) at the first time of a schedule (k, units); 0.0 if there is no valid schedule."""
    try:
        return np.atleast_2d(np.array(schedule, dtype=np.float64))[0] if schedule is not None else 0.0
    except (TypeError, ValueError, IndexError, OverflowError):
        return 0.0


def refuse_idle(term: Any, numbers: Numbers, rate: str, remembers: np.ndarray, remedy: str) -> None:
    """Refuse members' numbers (n, ...) that would have no effect, since the scene's kernel does not read them.

    Unless a controller drives the term, these are `command` in a scene with a schedule, and a schedule in a scene with a
    constant command. In addition, numbers `rate` that need a memory (`remembers`, (n, units)) if the scene has none.
    """
    faults = Faults(f"{term.key}.")
    unread = {}
    if term.driver is None:
        acts = "command" if term.holds else "command_schedule"
        unread = {name: (numbers[name] != getattr(term, name), f"a {acts}", f"vary {term.key}.{acts}")
                  for name in term.idle_fields}  # fmt: skip
    if not term.slow:
        unread[rate] = (remembers, "none", remedy)
    for name, (bad, alternative, what_to_do) in unread.items():
        if np.any(bad):
            i = int(bad.reshape(len(bad), -1).any(axis=1).argmax())
            fault = f"does not act: the scene has {alternative}"
            faults.add(f"{name} of member {i}", numbers[name][i], fault, what_to_do)
    faults.raise_if_any()
