# SPDX-License-Identifier: Apache-2.0
"""Control fins, which turn about their span and follow a command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common import declared
from lgvi_warp.common.arguments import flag
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.actuators import (
    UNLIMITED,
    Commanded,
    motion,
    packed_following,
    refuse_idle,
    refuse_unread,
)
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, knots, number, rows_of
from lgvi_warp.physics.terms.fins import Fins, fin_rows, unit_directions

# Rows to work with of each fin: two for damping, and KEPT in lgvi_kernels/laws/control_fins_with.py.
WORK_ROWS = 7


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlFins(Commanded, Fins):
    """n fins that turn about their span; each deflection follows a command.

    A positive deflection lifts along +normal if the flow comes from ahead. The deflection follows the command within
    `limit`, after a first-order lag and at most at `rate_limit`; at t = 0 it equals the command. A single number stands for
    n equal numbers.

    Args:
        position: Point at which each fin's force acts, (n, 3) [m] from the body's origin.
        chord: Direction from trailing to leading edge, (n, 3), of any length but 0.
        normal: Direction of lift, (n, 3), of any length but 0; its component along the chord is removed.
        area: Area A, (n,) [m2].
        drag: Drag coefficient along the flow, (n,).
        drag_normal: Factor of sin^2 a in the drag coefficient, where a is the angle of attack, (n,); 0 by default.
        lift_slope: Slope of the lift coefficient, (n,) [1/rad]. With a table of lift, it is a factor on the coefficients of
            the table, 1 by default.
        lift_angles: Angles of attack of a table of lift, (k,) [rad], rising from 0; by default there is no table.
        lift_coefficients: Lift coefficients at these angles, (k,) [1], linear between the angles and constant beyond the
            last one. At negative angles they have the opposite sign.
        flow_angle: Whether the angle of the flow adds to the deflection, True by default. If False, let d be the deflection
            and u the flow along the chord: the lift is rho A/2 lift_slope d u^2, and the drag is
            rho A/2 (drag + drag_normal d^2) |u| u, where rho is the density of the water.
        limit: Largest size of the deflection, (n,) [rad]; 0.35 by default.
        rate_limit: Largest rate of the deflection, (n,) [rad/s]; by default there is no limit.
        time_constant: Time constant of the lag of the deflection, (n,) [s]; by default there is no lag.
        command: Constant deflection, (n,) [rad].
        times: Times of the schedule, (k,) [s], rising.
        command_schedule: Deflections at these times, (k, n) [rad], linear between them; instead of `command`.

    Raises:
        SceneError: If times or angles do not rise, the command is given twice, neither a slope nor a table of lift is given,
            chord and normal are parallel, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "control_fins"
    device: ClassVar[str] = "fins"

    lift_slope: Any = number(("n",), "1/rad", None, least=0.0)
    lift_angles: Any = number(("a",), "rad", None, least=0.0, rising=True, optional=True)
    lift_coefficients: Any = number(("a",), "1", None, optional=True)
    flow_angle: bool = declared.flag(True)
    limit: Any = number(("n",), "rad", 0.35, least=0.0)
    rate_limit: Any = number(("n",), "rad/s", UNLIMITED, least=0.0)
    time_constant: Any = number(("n",), "s", None, least=0.0, optional=True)
    command: Any = number(("n",), "rad", None)
    times: Any = number(("k",), "s", None, rising=True)
    command_schedule: Any = number(("k", "n"), "rad", None)

    def __post_init__(self) -> None:
        if self.lift_slope is None:
            if self.lift_coefficients is None:
                raise refusal(f"{self.key}.lift_slope", None, "is missing", "give it [1/rad], or a table of lift")
            object.__setattr__(self, "lift_slope", np.ones(rows_of(self.position)))
        if not flag(f"{self.key}.flow_angle", self.flow_angle):
            # Lift then does work.
            object.__setattr__(self, "dissipative", False)
        count = rows_of(self.position)
        self.settle_commands(count)
        self.repeat(count, "limit", "rate_limit", "time_constant")
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        super().check(faults)
        if vars(self)["commanded_twice"]:
            faults.add("command", self.command, "is given beside command_schedule", "keep one of them")
        if (self.lift_angles is None) != (self.lift_coefficients is None):
            alone = "lift_angles" if self.lift_coefficients is None else "lift_coefficients"
            faults.add(alone, getattr(self, alone), "is given alone", "give lift_angles and lift_coefficients, or none")
        elif self.lift_angles is not None and (self.lift_angles[0] != 0.0 or self.lift_coefficients[0] != 0.0):
            first = (self.lift_angles[0], self.lift_coefficients[0])
            faults.add("lift_angles", first, "does not begin with no lift at 0", "let both tables begin with 0")

    def to_dict(self) -> dict[str, Any]:
        # In addition, `flow_angle` only where it is false.
        return {key: value for key, value in super().to_dict().items() if key != "flow_angle" or not value}

    @property
    def channels(self) -> int:
        return len(self.limit)

    def effect(self, numbers: Numbers, parameters: Numbers, speed: np.ndarray) -> np.ndarray:
        # The wrench of each fin's lift by its deflection [1/rad] at a speed ahead, about the body's origin.
        position, chord, normal = repeated(numbers["position"], numbers["chord"], numbers["normal"])
        chord, normal = unit_directions({"chord": chord, "normal": normal})
        density = parameters["environment.water_density"]
        # Astern the flow meets the other edge: lift by the angle of the flow turns round, other lift keeps its side.
        square = speed * np.abs(speed) if self.flow_angle else speed**2
        size = 0.5 * (density * square)[:, None] * numbers["area"] * numbers["lift_slope"]
        if self.lift_angles is not None:
            size = size * (numbers["lift_coefficients"][:, 1] / numbers["lift_angles"][:, 1])[:, None]
        # The flow along the chord is that of the speed ahead.
        lift = (size * chord[..., 0] ** 2)[..., None] * normal
        return np.swapaxes(np.concatenate([lift, np.cross(position, lift)], axis=-1), -1, -2)

    def device_in(self, aligned: bool) -> str:
        driven = self.driver is not None
        # Members may bring in a limited rate where the scene has a lag.
        motions = motion(self) if driven else {"lag": self.time_constant is not None, "rate": True}
        kinds = {"lift": self.lift_angles is not None, "straight": not self.flow_angle}
        if self.stands and not any(kinds.values()):
            return "fins"
        features = {"driven": driven} | {name: acts and self.memory for name, acts in motions.items()} | kinds
        return f"control_fins_with:{','.join(name for name, present in features.items() if present)}"

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, raises SceneError for members' numbers that would have no effect.
        remedy = f"give {self.key}.rate_limit below {UNLIMITED:g} rad/s in the scene as well"
        refuse_idle(self, numbers, "rate_limit", numbers["rate_limit"] < UNLIMITED, remedy)
        if self.driver is not None:
            refuse_unread(self, numbers)
        bad = super().unphysical(numbers)
        for name in ("lift_angles", "lift_coefficients"):
            if name in bad:
                bad[name] = bad[name] | (numbers[name][:, 0] != 0.0)
        return bad

    @property
    def stands(self) -> bool:
        """Whether every fin keeps its start deflection, because its command is constant."""
        return self.driver is None and self.holds

    @property
    def slow(self) -> bool:
        # Whether fins lag, or the rate of one is limited.
        return bool(self.time_constant is not None or np.any(self.rate_limit < UNLIMITED))

    @property
    def pattern_device(self) -> str:  # type: ignore[override]
        """Device code of few fins, which leaves out zeros."""
        device = self.device_in(True)
        return Fins.pattern_device if device == "fins" else device

    def entries(self, numbers: Numbers) -> tuple[str, ...]:
        # Of fins that turn, in the axes that do not turn with them.
        return super().entries(self._turned(numbers) if self.device_in(True) == "fins" else numbers)

    def _turned(self, numbers: Numbers) -> Numbers:
        """The numbers of equivalent fixed fins, whose chords and normals are turned by the constant commands."""
        chord, normal = unit_directions(numbers)
        angle = np.clip(numbers["command"], -numbers["limit"], numbers["limit"])[..., None]
        c, s = np.cos(angle), np.sin(angle)
        return {**numbers, "chord": c * chord + s * normal, "normal": c * normal - s * chord}

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The device rows: those of each fin, then the pieces of their commands, then a table of lift.
        if self.device_in(context.aligned) == "fins":
            return super().packed(self._turned(numbers), context)
        blocks = fin_rows(numbers, context, matrices=self.flow_angle)
        table, size = None, 0
        if self.lift_angles is not None:
            angles, lifts = numbers["lift_angles"], numbers["lift_coefficients"]
            table, size = knots(angles, lifts[..., None]), angles.shape[1] - 1
        return packed_following(self, numbers, blocks, table, size, WORK_ROWS * self.channels, start=context.time)
