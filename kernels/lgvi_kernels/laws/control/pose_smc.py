# SPDX-License-Identifier: Apache-2.0
"""Sliding mode control of position and attitude."""

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

# See pose_error.py; rate and rate_r are lambda and lambda_r.
params = make_params(
    "PoseSMC",
    lanes="position_limit attitude_limit net_weight",
    vectors="rate boundary k_sigma k_d lambda_r boundary_r k_sigma_r k_d_r moment",
    words="memory unmet conditional",
)


@wp.func
def saturated(v: Any):
    """Each number of a vector within -1 and 1."""
    unity = ones(v.x)
    return vec3(clamp(v.x, -unity, unity), clamp(v.y, -unity, unity), clamp(v.z, -unity, unity))


@wp.func
def sliding(rate: Any, velocity: Any, e: Any, total: Any):
    """s = velocity + 2 lambda e + lambda^2 I, all of them wanted less measured, in body axes."""
    return velocity + rate * (e + e + rate * total)


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """f = k_d s + k_sigma sat(s / boundary); the same of the attitude."""
    e = r.position - y.position
    e_R = attitude_error(r, y)
    total = position_integral(y, p, e)
    I_R = attitude_integral(y, p, e_R)
    s = sliding(p.rate, velocity_error(r, y), to_body(y, e), to_body(y, total))
    force = p.k_d * s + p.k_sigma * saturated(s / p.boundary)
    s = sliding(p.lambda_r, rate_error(r, y), neg(e_R), neg(I_R))
    torque = p.k_d_r * s + p.k_sigma_r * saturated(s / p.boundary_r)
    return balance(w, y, p, force, torque)
