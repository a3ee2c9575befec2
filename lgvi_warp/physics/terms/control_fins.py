"""Control fins: fins that turn about their span to a command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.actuators import UNLIMITED, packed_driven
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, knots, number, rows_of, side_by_side
from lgvi_warp.physics.terms.fins import Fins, fin_rows
from lgvi_warp.physics.terms.wrench import at_start, commands, first_row, refuse_idle


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
    driven_fields: ClassVar[tuple[str, ...]] = ("command", "times", "command_schedule")

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
        self.repeat(rows_of(self.position), "limit", "rate_limit", "command")
        if self.command_schedule is None:
            object.__setattr__(self, "command_schedule", [self.command])
            object.__setattr__(self, "times", [0.0] if self.times is None else self.times)
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        """In addition, adds a fault where the command is given twice."""
        super().check(faults)
        if self.__dict__["_both"]:
            faults.add("command", self.command, "is given beside command_schedule", "keep one of them")

    @property
    def has_square_curve(self) -> bool:
        """Whether effort goes as the command squared."""
        return False

    @property
    def channels(self) -> int:
        """One for each fin."""
        return len(self.limit)

    @property
    def own_commands(self) -> bool:
        """Whether it has a schedule, or a command other than 0."""
        return len(self.command_schedule) > 1 or bool(np.any(self.command))

    def effect(self, numbers: Numbers, parameters: Numbers, speed: np.ndarray) -> np.ndarray:
        """The wrench of each fin's lift by its deflection [1/rad] at a speed ahead, about the body's origin.

        Args:
            numbers: The term's numbers by field.
            parameters: All parameters of the scene.
            speed: Speed ahead (1 or n,) [m/s].

        Returns:
            (1 or n, 6, channels).
        """
        position, chord, normal = repeated(numbers["position"], numbers["chord"], numbers["normal"])
        chord = chord / np.linalg.norm(chord, axis=-1, keepdims=True)
        normal = normal - np.sum(normal * chord, axis=-1, keepdims=True) * chord
        normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
        density = parameters["environment.water_density"]
        size = 0.5 * (density * speed**2)[:, None] * numbers["area"] * numbers["lift_slope"]
        # The flow along the chord is that of the speed ahead.
        lift = (size * chord[..., 0] ** 2)[..., None] * normal
        return np.swapaxes(np.concatenate([lift, np.cross(position, lift)], axis=-1), -1, -2)

    def curve(self, numbers: Numbers) -> tuple[np.ndarray, ...]:
        """How the angle follows from a command: it is the command.

        Args:
            numbers: The term's numbers by field.

        Returns:
            1 ahead and astern, and a dead band of 0, each (1, channels).
        """
        unit = np.ones((1, self.channels))
        return unit, unit, 0.0 * unit

    def device_in(self, aligned: bool) -> str:
        """The code for a schedule, or for the commands of a controller."""
        return "control_fins" if self.driver is None else "control_fins_driven"

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        """In addition, raises SceneError for members' numbers that would have no effect."""
        if self.driver is None:
            remedy = f"give {self.key}.rate_limit below {UNLIMITED:g} rad/s in the scene as well"
            refuse_idle(self, numbers, "rate_limit", numbers["rate_limit"] < UNLIMITED, remedy)
        return super().unphysical(numbers)

    @property
    def memory(self) -> bool:
        """Whether the rate of some fin is limited."""
        return bool(np.any(self.rate_limit < UNLIMITED))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """The device rows: those of each fin, then the command table of each fin."""
        if self.driver is not None:
            return packed_driven(self, numbers, fin_rows(numbers, context), 2 * self.channels)
        fins = side_by_side(fin_rows(numbers, context), numbers["limit"][..., None], numbers["rate_limit"][..., None])
        times, schedule = commands(numbers)
        count = schedule.shape[2]
        tables = [knots(times, schedule[:, :, i : i + 1]) for i in range(count)]
        rows = side_by_side(fins.reshape(len(fins), -1), *tables)
        values = {"count": count, "knots": times.shape[1] - 1, "limited": int(self.memory), "memory": 0}
        if not self.memory:
            return Packed(values, rows, work=2 * count)
        start = np.clip(at_start(times, schedule), -numbers["limit"], numbers["limit"])
        return Packed(values, rows, start, 2 * count)
