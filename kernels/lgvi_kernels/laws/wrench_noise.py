# SPDX-License-Identifier: Apache-2.0
"""White noise of force and torque along the user's body axes: the impulse over a step h is S sqrt(h) xi."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

NOISE = True


@functools.cache
def params(width, real, Key):
    """Params: for each of the user's axes, the noise's force and torques, in the kernel's axes.

    forcex to forcez [N s^1/2]; momentx to momentz: its torque about the origin of the forces; torquex to torquez [N m s^1/2];
    key: of the random numbers (see lanes/noise.py).
    """
    Lane3 = lane3(width, real)
    columns = {f"{kind}{axis}": Lane3 for kind in ("force", "moment", "torque") for axis in "xyz"}
    return struct("WrenchNoise", **columns, key=Key)


@wp.func
def law(w: Any, view: Any, p: Any):
    """S xi / sqrt(h): held over the kick, so that the impulse's variance is S^2 h."""
    unity = ones(view.b.x)
    size = unity / root(view.h * unity)
    f = size * normals_over(view, p.key, 0)
    m = size * normals_over(view, p.key, 1)
    w.force = w.force + (f.x * p.forcex + f.y * p.forcey + f.z * p.forcez)
    w.torque = w.torque + (f.x * p.momentx + f.y * p.momenty + f.z * p.momentz)
    w.torque = w.torque + (m.x * p.torquex + m.y * p.torquey + m.z * p.torquez)
    return w
