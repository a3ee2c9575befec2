# SPDX-License-Identifier: Apache-2.0
"""Linear feedback of the whole state."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.pose_error import attitude_error, rate_error, velocity_error

# First row of the table, which has K (6, 12) line by line.
params = make_params("StateFeedback", words="first")


@wp.func
def line(y: Any, row: int, b: Any, e_R: Any, nu: Any, Om: Any):
    """A line of K times the error."""
    return dot(row3(y, row), b) + dot(row3(y, row + 3), e_R) + dot(row3(y, row + 6), nu) + dot(row3(y, row + 9), Om)


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """w = K (-x), x = (b - b_d, e_R, nu - R^T v_d, Omega - R^T R_d Omega_d)."""
    b = r.position - y.position
    e_R = neg(attitude_error(r, y))
    nu = velocity_error(r, y)
    Om = rate_error(r, y)
    at = p.first
    w.force = w.force + vec3(
        line(y, at, b, e_R, nu, Om), line(y, at + 12, b, e_R, nu, Om), line(y, at + 24, b, e_R, nu, Om)
    )
    w.torque = w.torque + vec3(
        line(y, at + 36, b, e_R, nu, Om), line(y, at + 48, b, e_R, nu, Om), line(y, at + 60, b, e_R, nu, Om)
    )
    return w
