# SPDX-License-Identifier: Apache-2.0
"""Faults of actuators and of sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.declared import checked, declared, flag, text
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.control.base import SAME_TIME, Bus, MeasuringPart, Sending, first_step
from lgvi_warp.control.delay import MOST_PERIODS
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number

KINDS = ("gain", "offset", "stuck", "freeze", "slow", "delay", "intermittent")
# The channel that stands for all of a part.
ALL = "all"
# Readings whose differences are within half a turn.
ANGLES = ("heading", "attitude")


def _kinds(faults: Faults, key: str, value: Any) -> None:
    """Add a fault unless the value is one of KINDS or a list of them."""
    words = [value] if isinstance(value, str) else items_of(value)
    if not words:
        faults.add(key, value, "is no kind of fault", f"give one or a list of {', '.join(KINDS)}")
    for word in words or ():
        faults.choice(key, word, KINDS)


def _is_channel(value: Any) -> bool:
    return is_whole(value, -MOST_PERIODS) or (isinstance(value, str) and value == ALL)


@dataclass(frozen=True, eq=False, kw_only=True)
class Fault(Sending):
    """A fault of an actuator or of a sensor: between two times it changes the command or the reading x.

    | kind | change of the command or reading x |
    | --- | --- |
    | gain | x <- gain x + offset: the actuator is dead at a gain of 0 and weak at a gain below 1 |
    | offset | x <- x + offset |
    | stuck | x <- value; without a value, an actuator keeps its position and a sensor its last reading |
    | freeze | the last command or reading repeats |
    | slow | x follows with a first-order lag, starting from the last command or reading |
    | delay | x arrives later; until the first delayed x arrives, the last command or reading repeats |
    | intermittent | while on: a command changes as with "gain"; the last reading repeats; estimators get no reading |

    The fault begins at the first tick at or after `time` and ends at the first tick at or after `until`. A sensor's fault
    acts directly after the sensor, on the reading that has arrived. If an estimator takes the readings, the fault
    changes what it receives, and the kinds "stuck", "freeze", "slow" and "delay" use only new readings. Laws are not
    informed of a fault, and their integrals continue.

    Args:
        of: Key of the term or of the sensor that has the fault.
        channel: Index of the channel, from 0, or "all"; 0 by default. For a sensor, a channel is a number in its
            reading: an attitude has roll, pitch and yaw [rad]. With an estimator, a channel of a `DVL` is a beam; an
            `IMU` has the means of specific force (0 to 2) [m/s^2] and angular rate (3 to 5) [rad/s] over a period.
        kind: Kind of fault, or a list of kinds from which `choice` selects; "gain" by default.
        choice: Index of the kind in the list `kind`, from 0; 0 by default.
        time: Time at which the fault begins [s]; 0 by default; inf for never.
        until: Time at which the fault ends [s]; inf, the default, for a fault without end.
        gain: Factor on the command or reading; 0 by default.
        offset: Number added to the command or reading, in its unit; 0 by default.
        value: Command or reading of a channel that is stuck; by default the position or reading at the onset.
        time_constant: Time constant of kind "slow" [s]; 1 by default.
        delay: Delay of kind "delay" [s], to the nearest tick; 1 by default.
        duty: Fraction of each period, from its start, in which kind "intermittent" is on; 0.5 by default.
        period: Time from one onset to the next of kind "intermittent" [s], to the nearest tick; 1 by default.
        known: Whether the allocation excludes an actuator's channel from `time` to the end of the run; False by default.

    Raises:
        SceneError: If `of` is not a text, `channel` is not a whole number, a kind is unknown, `until` is not after `time`,
            `known` is neither true nor false, or a number is invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> dead = lw.control.Fault(of="thrusters", channel=1, time=20.0, known=True)
        >>> float(dead.gain), dead.known
        (0.0, True)
        >>> either = lw.control.Fault(of="rudder", kind=["stuck", "slow"], time=20.0, until=30.0)
        >>> drawn = {"fault.choice": lw.distributions.Choice([0, 1])}
    """

    type: ClassVar[str] = "fault"
    every_feature: ClassVar[tuple[str, ...]] = ("until", "duty", "held", "placed", "late", "lost")

    of: str = text("is not a text", "give the name of an actuator or of a sensor", "")
    channel: int | str = checked(
        _is_channel, "is not a whole number", 'give the number of a channel, from 0, or "all"', 0
    )
    kind: Any = declared(_kinds, "gain")
    choice: Any = number((), "1", 0.0, least=0.0, integer=True)
    time: Any = number((), "s", 0.0, least=0.0, infinite=True)
    until: Any = number((), "s", np.inf, above=0.0, infinite=True)
    gain: Any = number((), "1", 0.0)
    offset: Any = number((), "unit", 0.0)
    value: Any = number((), "unit", None, optional=True)
    time_constant: Any = number((), "s", 1.0, least=0.0)
    delay: Any = number((), "s", 1.0, least=0.0)
    duty: Any = number((), "1", 0.5, least=0.0, most=1.0)
    period: Any = number((), "s", 1.0, above=0.0)
    known: bool = flag(False)

    # The sensor or the actuator that has it; set for a part of a scene.
    sensor: ClassVar[Any] = None
    actuator: ClassVar[Any] = None

    @property
    def kinds_listed(self) -> tuple[str, ...]:
        """Kinds from which `choice` selects."""
        return (self.kind,) if isinstance(self.kind, str) else tuple(self.kind)

    def check(self, faults: Faults) -> None:
        if self.value is not None and "stuck" not in self.kinds_listed:
            faults.add("value", self.value, "is of a fault of the kind stuck", 'give kind = "stuck", or leave it out')
        if self.known and np.isfinite(self.until):
            problem = "ends a fault that the allocation knows, which leaves the channel out for good"
            faults.add("until", float(self.until), problem, "leave out until, or known")
        for name, bad in self.unphysical(
            {name: np.array([value]) for name, value in self.parameters().items()}
        ).items():
            if bad.any() and name == "choice":
                faults.add(
                    name, float(self.choice), "is no number of a kind", f"give 0 to {len(self.kinds_listed) - 1}"
                )
            elif bad.any():
                problem = f"is not after time = {float(self.time):g}"
                faults.add(name, float(getattr(self, name)), problem, "give a later one, or leave it out")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        bad = super().unphysical(numbers)
        time, until, choice = (numbers[name] for name in ("time", "until", "choice"))
        bad["until"] = bad["until"] | (np.isfinite(time) & (until <= time))
        bad["choice"] = bad["choice"] | (np.rint(choice) >= len(self.kinds_listed))
        if hasattr(self, "bus"):
            bad["delay"] = bad["delay"] | (numbers["delay"] > MOST_PERIODS * self.bus.period)
        return bad

    def wired(self, bus: Bus, others: Mapping[str, Term]) -> Any:
        part, hit = super().wired(bus, others), others[self.of]
        object.__setattr__(part, "sensor" if isinstance(hit, MeasuringPart) else "actuator", hit)
        return part

    @property
    def ticks_before(self) -> int:
        return 1 + int(np.max(self.delay) / self.bus.period) if set(self.kinds_listed) - {"gain", "offset"} else 0

    @property
    def _is_handed(self) -> bool:
        """Whether an estimator takes the readings that the fault changes."""
        return self.of in self.bus.handed

    @property
    def _flags(self) -> int:
        """Number of rows by which the sensor marks new readings for an estimator; 0 without an estimator."""
        return self.sensor.handed_flags if self._is_handed else 0

    def _is(self, numbers: Numbers) -> dict[str, np.ndarray]:
        """{kind: mask (1 or n,) of the members with it}, and a mask for each branch of the device code."""
        kinds = np.array(self.kinds_listed)[np.rint(numbers["choice"]).astype(int)]
        have = {word: kinds == word for word in KINDS}
        at_value = have["stuck"] & (self.value is not None)
        stays = (have["stuck"] & ~at_value) | have["freeze"]
        reads = self.sensor is not None and not self._is_handed
        moves = self.actuator is not None and self.actuator.memory
        held = stays | have["slow"] | (have["intermittent"] & reads)
        ways = {"held": held, "late": have["delay"], "placed": have["stuck"] & ~at_value & moves}
        return have | ways | {"lost": have["intermittent"] & bool(self._flags), "at value": at_value}

    def features(self, numbers: Numbers) -> tuple[str, ...]:
        # What some member's fault has.
        ways = self._is(numbers)
        acting = ways | {"until": np.isfinite(numbers["until"]), "duty": ways["intermittent"] & (numbers["duty"] < 1.0)}
        return tuple(name for name in self.every_feature if np.any(acting[name]))

    def device_in(self, aligned: bool) -> Any:
        # The device code for a command, for numbers in rows, or for what the sensor reads.
        sensor = self.sensor
        if sensor is None:
            return f"fault:{','.join(('delayed' if self.bus.delayed else 'command', *self.chosen))}"
        in_rows = self._is_handed or sensor.key in self.bus.ranges
        more = ["angle"] if sensor.reading in ANGLES and "held" in self.chosen else []
        more += ["flagged"] if self._flags else []
        return f"fault:{','.join(('rows' if in_rows else sensor.reading, *self.chosen, *more))}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Numbers by member, times in ticks; the rows that it changes.
        bus, sensor, h = self.bus, self.sensor, context.h
        ways, T = self._is(numbers), bus.period
        summed = T if self._is_handed and sensor.sums else 1.0
        late, slow = np.rint(numbers["delay"] / T), np.maximum(numbers["time_constant"], 1e-30 * T)
        value = numbers["value"] if self.value is not None else np.zeros(1)
        gain = np.where(ways["offset"], 1.0, np.where(ways["at value"], 0.0, numbers["gain"]))
        offset = summed * np.where(ways["at value"], value, numbers["offset"])
        cycle, duty = (
            np.maximum(np.rint(numbers["period"] / T), 1.0),
            np.where(ways["intermittent"], numbers["duty"], 1.0),
        )
        values: dict[str, Any] = {"begin": _tick(numbers["time"], h, T), "gain": gain, "offset": offset}
        acting: dict[str, dict[str, Any]] = {
            "until": {"end": _tick(numbers["until"], h, T)},
            "duty": {"cycle": cycle, "on": np.ceil(duty * cycle - SAME_TIME)},
            "held": {"holds": 1.0 * ways["held"], "share": np.where(ways["slow"], -np.expm1(-T / slow), 0.0)},
            "placed": {"stuck": 1.0 * ways["placed"]},
            "late": {"late": 1.0 * ways["late"], "ticks": late},
            "lost": {"loses": 1.0 * ways["lost"]},
        }
        for name in self.chosen:
            values |= acting[name]
        lanes = dict(zip(values, repeated(*values.values()), strict=True))
        sets = int(np.max(np.where(ways["late"], late, 0.0))) + 1 if "late" in self.chosen else 0
        size, first, flags = self._count, 0 if self.channel == ALL else int(self.channel), self._flags
        keeps = ("held" in self.chosen) + sets + bool(flags and {"held", "late"} & set(self.chosen))
        count = size if self.channel == ALL else 1
        row, flag = first, 0
        if sensor is None:
            row += bus.commands[self.of][0]
        elif self._is_handed:
            row += bus.handed[self.of]
            flag = bus.handed[self.of] + size + min(first, max(flags - 1, 0))
        elif self.of in bus.ranges:
            row += bus.ranges[self.of]
        rows = {"row": row, "count": count, "acting": bus.acting + row, "before": bus.acting + bus.channels + row}
        rows |= {"channel": first, "flag": flag, "flags": int(flags > 1), "sets": sets, "memory": 0, "work": 0}
        if "placed" in self.chosen:
            # To be the row where the actuator is: the engine knows it.
            rows["place_row"] = bus.report + row
        reads = sensor is not None and not self._is_handed and self.of not in bus.ranges
        memory = np.zeros((1, count * keeps)) if keeps else None
        return Packed(lanes | rows, memory=memory, work=size * reads)

    @property
    def _count(self) -> int:
        """Number of channels of the faulty actuator or sensor."""
        return int(self.sensor.fault_channels(self._is_handed) if self.sensor else self.actuator.channels)


def _tick(time: np.ndarray, h: float, period: float) -> np.ndarray:
    """Index of the first tick at or after times [s]."""
    return np.ceil(first_step(time, h) / max(1, round(period / h)) - SAME_TIME)
