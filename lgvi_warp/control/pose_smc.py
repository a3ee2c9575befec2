# SPDX-License-Identifier: Apache-2.0
"""Sliding mode control of position and attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import PoseLaw
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseSMC(PoseLaw):
    """Integral sliding mode control of the pose, separately for each body axis (the form of Fossen 2021, 16.4, on SE(3)).

    For the position, s = (R^T v_d - nu) + 2 lambda R^T e_b + lambda^2 R^T I and f = k_d s + k_sigma sat(s / boundary). For
    the attitude, s_r = -(Omega - R^T R_d Omega_d) - 2 lambda_r e_R - lambda_r^2 I_R, and the moment has the same form as f.
    Symbols that are not explained here are those of `PosePID`, and sat(x) is x limited to [-1, 1].

    Args:
        lambda_: Rates at which position errors decay while s is 0 (3,) [1/s]; its name is `lambda` in a scene file.
        boundary: Half the thickness of the layer about s = 0 in which sat is linear (3,) [m/s].
        k_sigma: Gains of the switching part (3,) [N].
        k_d: Gains of the linear part (3,) [N s/m].
        lambda_r: As `lambda`, for the attitude (3,) [1/s].
        boundary_r: As `boundary`, for the attitude (3,) [rad/s].
        k_sigma_r: As `k_sigma`, for the attitude (3,) [N m].
        k_d_r: As `k_d`, for the attitude (3,) [N m s].
        integral_limit: Largest size of each entry of I, and of each entry of I_R, (2,) [m s, s]; 1e6 by default.
        feedforward: "restoring" balances weight, buoyancy and their moment at the measured attitude. It uses the scene's
            nominal numbers for every member. "none", the default, adds nothing.
        anti_windup: "conditional", the default, stops an integrator while the actuators do not deliver the whole demand
            and further integration would increase the undelivered part. The position's integrator stops for each body
            axis separately, since actuators act along body axes. "none" never stops an integrator.
    """

    type: ClassVar[str] = "pose_smc"

    lambda_: Any = number((3,), "1/s", least=0.0)
    boundary: Any = number((3,), "m/s", above=0.0)
    k_sigma: Any = number((3,), "N", least=0.0)
    k_d: Any = number((3,), "N s/m", least=0.0)
    lambda_r: Any = number((3,), "1/s", least=0.0)
    boundary_r: Any = number((3,), "rad/s", above=0.0)
    k_sigma_r: Any = number((3,), "N m", least=0.0)
    k_d_r: Any = number((3,), "N m s", least=0.0)
    integral_limit: Any = number((2,), "m s, s", (1e6, 1e6), least=0.0)
