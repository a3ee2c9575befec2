# SPDX-License-Identifier: Apache-2.0
"""Geometric PID of position and attitude."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.pose_error import (
    attitude_error,
    attitude_integral,
    balance,
    position_integral,
    rate_error,
    velocity_error,
)

# See pose_error.py.
params = make_params(
    "PosePID",
    lanes="position_limit attitude_limit net_weight",
    vectors="kp ki kd kr ki_r kw moment",
    words="memory unmet conditional",
)


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """f = R^T (kp e_b + ki I) + kd (R^T v_d - nu); tau = -kr e_R + kw (R^T R_d Omega_d - Omega) - ki_r I_R."""
    e = r.position - y.position
    e_R = attitude_error(r, y)
    total = position_integral(y, p, e)
    I_R = attitude_integral(y, p, e_R)
    force = to_body(y, p.kp * e + p.ki * total) + p.kd * velocity_error(r, y)
    torque = p.kw * rate_error(r, y) - p.kr * e_R - p.ki_r * I_R
    return balance(w, y, p, force, torque)
