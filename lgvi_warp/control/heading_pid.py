# SPDX-License-Identifier: Apache-2.0
"""PID of the heading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import IntegralLaw
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class HeadingPID(IntegralLaw):
    """PID of the heading: moment N = kp e + ki I + kd (wanted rate - r), where e is the wanted minus the measured heading.

    e is in [-pi, pi], and r is the yaw rate. The integral I grows by e times the period at each tick.

    Args:
        kp: Proportional gain [N m/rad].
        ki: Integral gain [N m/(rad s)]; 0 by default.
        kd: Gain of the yaw rate error [N m s/rad]; 0 by default.
        integral_limit: Largest size of I [rad s]; 1e6 by default.
        anti_windup: "conditional", the default, stops an integrator while the actuators do not deliver the whole demand
            and further integration would increase the undelivered part. "none" never stops an integrator.

    Examples:
        >>> import lgvi_warp as lw
        >>> controller = lw.Controller(
        ...     period=0.1,
        ...     guidance=[lw.control.SetPoint(heading=0.5)],
        ...     laws=[lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0)],
        ...     allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 0]])],
        ... )
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]}, controller=controller)
        >>> heading = lw.solve(scene, h=0.05, t1=60.0).euler[-1, 0, 2]
        >>> print(f"{heading:.2f} rad")
        0.44 rad
    """

    type: ClassVar[str] = "heading_pid"
    needs: ClassVar[tuple[str, ...]] = ("heading",)
    demands: ClassVar[tuple[str, ...]] = ("N",)

    kp: Any = number((), "N m/rad")
    ki: Any = number((), "N m/(rad s)", 0.0)
    kd: Any = number((), "N m s/rad", 0.0)
    integral_limit: Any = number((), "rad s", 1e6, least=0.0)
