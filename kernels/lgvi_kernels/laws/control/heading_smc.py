# SPDX-License-Identifier: Apache-2.0
"""Integral sliding mode control of the heading."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.integral import integral, keep_error

# Gains, `rate` is lambda; first of two rows of the memory, I and the error; row of the moment N not delivered.
params = make_params(
    "HeadingSMC",
    lanes="rate boundary k_sigma k_d nomoto_gain nomoto_time integral_limit",
    words="memory unmet conditional",
)


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """N = (T a_v + r_v - k_d sigma - k_sigma sat(sigma / boundary)) / K.

    r_v = r_d + 2 lambda e + lambda^2 I, sigma = r - r_v; e and its rate are wanted less measured.
    """
    e = heading_error(r, y)
    total = integral(y, p.memory, p.integral_limit, remembered(y, p.unmet + 5), p.conditional)
    keep_error(y, p.memory, e)
    slower = r.angular_velocity.z - y.angular_velocity.z
    virtual = r.angular_velocity.z + p.rate * (e + e + p.rate * total)
    acceleration = r.angular_acceleration.z + p.rate * (slower + slower + p.rate * e)
    sigma = y.angular_velocity.z - virtual
    unity = ones(sigma)
    switched = p.k_sigma * clamp(sigma / p.boundary, -unity, unity)
    N = (p.nomoto_time * acceleration + virtual - p.k_d * sigma - switched) / p.nomoto_gain
    w.torque = vec3(w.torque.x, w.torque.y, w.torque.z + N)
    return w
