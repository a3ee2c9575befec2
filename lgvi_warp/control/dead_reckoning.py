# SPDX-License-Identifier: Apache-2.0
"""Dead reckoning, an estimator of the position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.common.declared import word
from lgvi_warp.control.base import MeasuringPart
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number

# Weights of the velocities of the last tick and of this one.
RULES = {"trapezoid": (0.5, 0.5), "euler": (1.0, 0.0)}
VELOCITIES = ("velocity", "water_velocity")
DEPTHS = ("reckoned", "measured")


@dataclass(frozen=True, eq=False, kw_only=True)
class DeadReckoning(MeasuringPart):
    """Dead reckoning: integrate the measured velocity, from the measured position at the first tick.

    List it after the sensors that it uses. Without a position sensor, the integration starts at the true position.

    Args:
        rule: "trapezoid", the default, integrates the mean of the velocities at the previous and the present tick; "euler"
            integrates the velocity at the previous tick.
        velocity: "velocity", the default, integrates the velocity over ground. "water_velocity" integrates the velocity
            through the water, so that the estimate drifts in a current.
        depth: "reckoned", the default, computes the depth from the velocity, like north and east; "measured" uses the
            measured depth.
        start_error: Error added to the position at the first tick, (3,) [m], inertial axes; 0 by default.

    Raises:
        SceneError: If an option has an unknown value, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "dead_reckoning"
    memory_rows: ClassVar[int] = 6

    rule: str = word("trapezoid", known=RULES)
    velocity: str = word("velocity", known=VELOCITIES)
    depth: str = word("reckoned", known=DEPTHS)
    start_error: Any = number((3,), "m", (0.0, 0.0, 0.0))

    @property
    def estimates_position(self) -> bool:
        return True

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The weights of the rule, what it takes, the start's error, and the rows of position and velocity.
        last, now = RULES[self.rule]
        words = {
            "through_water": int(self.velocity == "water_velocity"),
            "measured_depth": int(self.depth == "measured"),
        }
        values = {"weight": last, "weight_now": now, "start_error": numbers["start_error"], **words}
        return Packed(values, memory=self.first_memory)
