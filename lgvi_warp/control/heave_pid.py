# SPDX-License-Identifier: Apache-2.0
"""PID of the depth with a heave force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import IntegralLaw
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class HeavePID(IntegralLaw):
    """PID of the depth with a heave force: Z = kp e + ki I + kd (wanted - measured depth rate).

    e is the wanted minus the measured depth. The integral I grows by e times the period at each tick. The law suits
    vehicles with actuators that push up and down.

    Args:
        kp: Proportional gain [N/m].
        ki: Integral gain [N/(m s)]; 0 by default.
        kd: Gain of the error of the depth rate, the downward velocity over ground [N s/m]; 0 by default.
        integral_limit: Largest size of I [m s]; 1e6 by default.
        anti_windup: "conditional", the default, stops an integrator while the actuators do not deliver the whole demand
            and further integration would increase the undelivered part. "none" never stops an integrator.
    """

    type: ClassVar[str] = "heave_pid"
    needs: ClassVar[tuple[str, ...]] = ("depth",)
    demands: ClassVar[tuple[str, ...]] = ("Z",)

    kp: Any = number((), "N/m")
    ki: Any = number((), "N/(m s)", 0.0)
    kd: Any = number((), "N s/m", 0.0)
    integral_limit: Any = number((), "m s", 1e6, least=0.0)
