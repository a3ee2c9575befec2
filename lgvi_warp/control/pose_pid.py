# SPDX-License-Identifier: Apache-2.0
"""PID of position and attitude on SE(3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import PoseLaw
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class PosePID(PoseLaw):
    """Geometric PID of the pose, without Euler angles, stable from almost every attitude (Bullo & Murray 1995).

    The demand is f = R^T (kp e_b + ki I) + kd (R^T v_d - nu) and tau = -kr e_R - kw (Omega - R^T R_d Omega_d) - ki_r I_R.
    The errors are e_b = b_d - b and e_R = vee(R_d^T R - R^T R_d) / 2; the index d marks wanted values. The integrals I and
    I_R grow by e_b and e_R times the period at each tick. b: position, R: attitude (body to inertial axes), nu and Omega:
    velocity and angular velocity in body axes, v_d: wanted velocity in inertial axes, vee: inverse of `lw.notation.hat`.

    Args:
        kp: Gains of the position error (3,) [N/m], inertial axes.
        ki: Gains of I (3,) [N/(m s)], inertial axes; 0 by default.
        kd: Gains of the velocity error (3,) [N s/m], body axes.
        kr: Gains of the attitude error (3,) [N m], body axes.
        ki_r: Gains of I_R (3,) [N m/s], body axes; 0 by default.
        kw: Gains of the angular velocity error (3,) [N m s], body axes.
        integral_limit: Largest size of each entry of I, and of each entry of I_R, (2,) [m s, s]; 1e6 by default.
        feedforward: "restoring" balances weight, buoyancy and their moment at the measured attitude. It uses the scene's
            nominal numbers for every member. "none", the default, adds nothing.
        anti_windup: "conditional", the default, stops an integrator while the actuators do not deliver the whole demand
            and further integration would increase the undelivered part. The position's integrator stops for each body
            axis separately, since actuators act along body axes. "none" never stops an integrator.

    Examples:
        >>> import lgvi_warp as lw
        >>> law = lw.control.PosePID(kp=[50.0] * 3, kd=[80.0] * 3, kr=[10.0] * 3, kw=[8.0] * 3, feedforward="restoring")
        >>> hold = lw.control.SetPoint(position=[0.0, 0.0, 5.0], heading=0.0)
        >>> scene = lw.Scene.named("bluerov2_heavy", controller=lw.Controller(period=0.1, guidance=[hold], laws=[law]))
        >>> [part.key for part in scene.controller.parts]
        ['set_point', 'pose_pid', 'pseudo_inverse']
    """

    type: ClassVar[str] = "pose_pid"

    kp: Any = number((3,), "N/m")
    ki: Any = number((3,), "N/(m s)", (0.0, 0.0, 0.0))
    kd: Any = number((3,), "N s/m")
    kr: Any = number((3,), "N m")
    ki_r: Any = number((3,), "N m/s", (0.0, 0.0, 0.0))
    kw: Any = number((3,), "N m s")
    integral_limit: Any = number((2,), "m s, s", (1e6, 1e6), least=0.0)
