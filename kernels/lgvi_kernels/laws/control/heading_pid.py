# SPDX-License-Identifier: Apache-2.0
"""PID of the heading: a moment about the body's z axis."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.integral import integral, keep_error

# Gains; first of two rows of the memory, I and the error; row of the moment N that was not delivered.
params = make_params("HeadingPID", lanes="kp ki kd integral_limit", words="memory unmet conditional")


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """N = kp e + ki I + kd (r_d - r), e the wanted heading less the measured one."""
    e = heading_error(r, y)
    total = integral(y, p.memory, p.integral_limit, remembered(y, p.unmet + 5), p.conditional)
    N = p.kp * e + p.ki * total + p.kd * (r.angular_velocity.z - y.angular_velocity.z)
    keep_error(y, p.memory, e)
    w.torque = vec3(w.torque.x, w.torque.y, w.torque.z + N)
    return w
