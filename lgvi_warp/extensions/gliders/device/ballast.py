# SPDX-License-Identifier: Apache-2.0
"""Ballast that is held: a constant vertical force at a point of the body, from the potential U = -(net b3 + lever.R^T e3)."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

POTENTIAL = True
SEPARABLE = True


@functools.cache
def params(width, real):
    """Params: net, the sum of all forces, downward [N]; lever, the sum of points times forces [N m], kernel's axes."""
    return struct("Ballast", net=lane(width, real), lever=lane3(width, real))


@wp.func
def law(w: Any, view: Any, p: Any):
    """f = net R^T e3, torque = lever x R^T e3."""
    w.force = w.force + p.net * view.down
    w.torque = w.torque + cross(p.lever, view.down)
    return w


@wp.func
def energy(u: Any, view: Any, p: Any):
    """U = -(net b3 + lever.R^T e3)."""
    return u - p.net * view.b.z - dot(p.lever, view.down)


@wp.func
def steady_force(w: Any, view: Any, p: Any):
    """The force in inertial axes, which never changes: net e3."""
    w.force.z = w.force.z + p.net
    return w


@wp.func
def supply(s: Any, view: Any, p: Any):
    """s plus what the attitude alone can give: the lever's part is least, -|lever|, where the lever hangs down."""
    return s + root(dot(p.lever, p.lever)) - dot(p.lever, view.down)


@wp.func
def steady_size(s: Any, view: Any, p: Any):
    """s plus |net|: the part of the depth has no least value."""
    return s + absolute(p.net)
