# SPDX-License-Identifier: Apache-2.0
"""PID of the depth through the pitch angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import IntegralLaw
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class DepthPID(IntegralLaw):
    """PID of the depth by successive loop closure: an outer loop from depth to pitch, an inner loop from pitch to a moment M.

    The wanted pitch is theta_d = -(kp e + ki I), within the pitch limit, where e is the wanted minus the measured depth.
    The sign is negative because pitch up is positive and depth grows downward. The demand is
    M = kp_pitch (theta_d - theta) + ki_pitch I_theta - kd_pitch q - k_heave w, where theta is the measured pitch. The law
    suits vehicles that move forward.

    Args:
        kp: Gain from depth to pitch [rad/m].
        ki: Gain from I, the integral of the depth error, to pitch [rad/(m s)]; 0 by default.
        pitch_limit: Largest size of the wanted pitch [rad]; 0.5 by default.
        kp_pitch: Gain of the pitch error [N m/rad].
        ki_pitch: Gain of I_theta, the integral of the pitch error [N m/(rad s)]; 0 by default.
        kd_pitch: Gain of the pitch rate q [N m s/rad]; 0 by default.
        k_heave: Gain of the heave velocity w [N s]; 0 by default.
        integral_limit: Largest sizes of I and of I_theta, (2,) [m s, rad s]; 1e6 by default.
        anti_windup: "conditional", the default, stops I_theta while the actuators do not deliver the whole moment M and
            further integration would increase the undelivered part. It stops I while -(kp e + ki I) is
            beyond the pitch limit and further integration would increase the excess. "none" never stops an integrator.

    Examples:
        >>> import lgvi_warp as lw
        >>> law = lw.control.DepthPID(kp=0.1, kp_pitch=10.0, kd_pitch=8.0, pitch_limit=0.4)
        >>> law.needs, law.demands
        (('depth',), ('M',))
    """

    type: ClassVar[str] = "depth_pid"
    needs: ClassVar[tuple[str, ...]] = ("depth",)
    demands: ClassVar[tuple[str, ...]] = ("M",)
    # The last row is for what the wanted pitch has beyond its limit.
    memory_rows: ClassVar[int] = 5
    limits: ClassVar[tuple[str, ...]] = ("depth_limit", "angle_limit")

    kp: Any = number((), "rad/m")
    ki: Any = number((), "rad/(m s)", 0.0)
    pitch_limit: Any = number((), "rad", 0.5, least=0.0)
    kp_pitch: Any = number((), "N m/rad")
    ki_pitch: Any = number((), "N m/(rad s)", 0.0)
    kd_pitch: Any = number((), "N m s/rad", 0.0)
    k_heave: Any = number((), "N s", 0.0)
    integral_limit: Any = number((2,), "m s, rad s", (1e6, 1e6), least=0.0)
