# SPDX-License-Identifier: Apache-2.0
"""Weight less buoyancy: f = net R^T e3, from the potential U = -net b3 (section IV of Nordkvist & Sanyal 2010)."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

POTENTIAL = True
SEPARABLE = True


@functools.cache
def params(width, real):
    """Params: net, weight less buoyancy (m - rho V) g [N], formed in float64 on the host because it cancels."""
    Lane = lane(width, real)

    @wp.struct
    class Weight:
        net: Lane

    return Weight


@wp.func
def law(w: Any, view: Any, p: Any):
    """f(b, R) = net R^T e3. docs/theory/integrator.md, (I2)."""
    w.force = w.force + p.net * view.down
    return w


@wp.func
def energy(u: Any, view: Any, p: Any):
    """U = -net b3."""
    return u - p.net * view.b.z


@wp.func
def steady_force(w: Any, view: Any, p: Any):
    """The force in inertial axes, which never changes: net e3."""
    w.force.z = w.force.z + p.net
    return w


@wp.func
def steady_size(s: Any, view: Any, p: Any):
    """s plus |net|: the potential of a steady force has no least value, so its size bounds the energy that it gives."""
    return s + absolute(p.net)
