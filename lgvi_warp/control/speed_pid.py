# SPDX-License-Identifier: Apache-2.0
"""PI of the speed through the water."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import IntegralLaw
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class SpeedPID(IntegralLaw):
    """PI of the forward speed u through the water: X = kp e + ki I + drag u_d |u_d|, where e = u_d - u.

    u_d is the wanted speed. The law has no derivative part, since no acceleration is measured. The integral I grows by e
    times the period at each tick.

    Args:
        kp: Proportional gain [N s/m].
        ki: Integral gain [N/m]; 0 by default.
        drag: Feedforward coefficient, drag divided by the square of the speed [N s^2/m^2]; 0 by default.
        integral_limit: Largest size of I [m]; 1e6 by default.
        anti_windup: "conditional", the default, stops an integrator while the actuators do not deliver the whole demand
            and further integration would increase the undelivered part. "none" never stops an integrator.
    """

    type: ClassVar[str] = "speed_pid"
    needs: ClassVar[tuple[str, ...]] = ("speed",)
    demands: ClassVar[tuple[str, ...]] = ("X",)

    kp: Any = number((), "N s/m")
    ki: Any = number((), "N/m", 0.0)
    drag: Any = number((), "N s^2/m^2", 0.0)
    integral_limit: Any = number((), "m", 1e6, least=0.0)
