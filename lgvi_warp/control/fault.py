# SPDX-License-Identifier: Apache-2.0
"""Faults of actuators and of sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.common.declared import checked, flag, text
from lgvi_warp.control.base import Bus, Sending, first_step
from lgvi_warp.control.sensor import RANGE, Sensor
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number


def _is_int(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


@dataclass(frozen=True, eq=False, kw_only=True)
class Fault(Sending):
    """A fault of one channel of an actuator or of a sensor: from a time on, x <- gain * x + offset, x its command or reading.

    gain = 0 is dead, or stuck at the offset; 0.5 is weak; gain = 1 with an offset is biased. It begins at the first tick at or
    after its time. A sensor's fault acts right after the sensor, on what has arrived of its reading.

    Args:
        of: Key of the term or of the sensor.
        channel: Number of the channel, from 0; of a sensor, of its reading: an attitude has roll, pitch and yaw [rad].
        time: When it begins [s]; 0 by default; inf for never.
        gain: Factor of the command or reading; 0 by default.
        offset: Added to it, in its unit; 0 by default.
        known: Of an actuator: whether the allocation leaves the channel out from then on; False by default.

    Raises:
        SceneError: Where `of` is no text, `channel` no whole number, or `known` neither true nor false; and as `Term`.

    Examples:
        >>> import lgvi_warp as lw
        >>> dead = lw.control.Fault(of="thrusters", channel=1, time=20.0, known=True)
        >>> float(dead.gain), dead.known
        (0.0, True)
    """

    type: ClassVar[str] = "fault"

    of: str = text("is not a text", "give the name of an actuator or of a sensor", "")
    channel: int = checked(_is_int, "is not a whole number", "give the number of a channel, from 0", 0)
    time: Any = number((), "s", 0.0, least=0.0, infinite=True)
    gain: Any = number((), "1", 0.0)
    offset: Any = number((), "unit", 0.0)
    known: bool = flag(False)

    # The sensor that has it; set for a part of a scene.
    sensor: ClassVar[Any] = None

    def wired(self, bus: Bus, others: Mapping[str, Term]) -> Any:
        part, measuring = super().wired(bus, others), others[self.of]
        object.__setattr__(part, "sensor", measuring if isinstance(measuring, Sensor) else None)
        return part

    def device_in(self, aligned: bool) -> Any:
        # The device code for a command, or for what the sensor reads.
        return "fault" if self.sensor is None else f"sensor_fault:{self.sensor.of}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The numbers, and the rows of the command or the channel of the reading.
        begin = first_step(numbers["time"], context.h)
        members_numbers = {"begin": begin, "gain": numbers["gain"], "offset": numbers["offset"]}
        if self.sensor is not None and self.sensor.of == RANGE:
            return Packed(members_numbers | {"row": self.bus.ranges[self.of]})
        if self.sensor is not None:
            return Packed(members_numbers | {"channel": self.channel})
        fresh = self.bus.commands[self.of][0] + self.channel
        rows = {"fresh": fresh, "acting": 0, "before": 0, "delayed": int(self.bus.delayed)}
        if self.bus.delayed:
            rows |= {"acting": self.bus.acting + fresh, "before": self.bus.acting + self.bus.channels + fresh}
        return Packed(members_numbers | rows)
