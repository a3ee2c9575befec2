# SPDX-License-Identifier: Apache-2.0
"""PID of the depth by way of the pitch angle (successive loop closure): a moment about the body's y axis."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.integral import integral, keep_error

# Gains; first of five rows of the memory, I and error of depth and of pitch, pitch beyond its limit; see Bus.
params = make_params(
    "DepthPID",
    lanes="kp ki pitch_limit kp_pitch ki_pitch kd_pitch k_heave depth_limit angle_limit",
    words="memory unmet conditional",
)


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """theta_d = -(kp e + ki I) within its limit; M = kp_pitch (theta_d - theta) + ki_pitch I_theta - kd_pitch q - k_heave w.

    Pitch up is positive, and depth grows downward: hence the sign. theta = asin of the forward axis' rise.
    """
    e = r.position.z - y.position.z
    # What the last tick wanted of the pitch beyond its limit stands where others have what was not delivered.
    total = integral(y, p.memory, p.depth_limit, -remembered(y, p.memory + 4), p.conditional)
    wanted = -(p.kp * e + p.ki * total)
    theta_d = clamp(wanted, -p.pitch_limit, p.pitch_limit)
    remember(y, p.memory + 4, wanted - theta_d)
    keep_error(y, p.memory, e)
    level = root(y.north.x * y.north.x + y.east.x * y.east.x)
    theta = arctangent2(-y.down.x, level)
    e_theta = theta_d - theta
    I_theta = integral(y, p.memory + 2, p.angle_limit, remembered(y, p.unmet + 4), p.conditional)
    M = p.kp_pitch * e_theta + p.ki_pitch * I_theta - p.kd_pitch * y.angular_velocity.y - p.k_heave * y.velocity.z
    keep_error(y, p.memory + 2, e_theta)
    w.torque = vec3(w.torque.x, w.torque.y + M, w.torque.z)
    return w
