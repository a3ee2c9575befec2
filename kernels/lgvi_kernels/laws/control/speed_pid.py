# SPDX-License-Identifier: Apache-2.0
"""PI of the speed through the water, by a force along the body's x axis."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.integral import integral, keep_error

# Gains; first of two rows of the memory, I and the error; row of the force X that was not delivered.
params = make_params("SpeedPID", lanes="kp ki drag integral_limit", words="memory unmet conditional")


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """X = kp e + ki I + drag u_d |u_d|."""
    e = r.speed - y.water_velocity.x
    total = integral(y, p.memory, p.integral_limit, remembered(y, p.unmet), p.conditional)
    X = p.kp * e + p.ki * total + p.drag * (r.speed * absolute(r.speed))
    keep_error(y, p.memory, e)
    w.force = vec3(w.force.x + X, w.force.y, w.force.z)
    return w
