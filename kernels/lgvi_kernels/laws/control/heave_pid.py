# SPDX-License-Identifier: Apache-2.0
"""PID of the depth by a force along the body's z axis."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.integral import integral, keep_error

# Gains; first of two rows of the memory, I and the error; row of the force Z that was not delivered.
params = make_params("HeavePID", lanes="kp ki kd integral_limit", words="memory unmet conditional")


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """Z = kp e + ki I + kd (wanted - measured rate of the depth)."""
    e = r.position.z - y.position.z
    total = integral(y, p.memory, p.integral_limit, remembered(y, p.unmet + 2), p.conditional)
    Z = p.kp * e + p.ki * total + p.kd * (r.velocity.z - dot(y.down, y.velocity))
    keep_error(y, p.memory, e)
    w.force = vec3(w.force.x, w.force.y, w.force.z + Z)
    return w
