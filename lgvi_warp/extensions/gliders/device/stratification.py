# SPDX-License-Identifier: Apache-2.0
"""Buoyancy that varies with depth, B (1 + gradient (d - d0)): here its deviation from B, which weight.py has."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

POTENTIAL = True


@functools.cache
def params(width, real):
    """Params: stiffness, B times gradient [N/m]; center of buoyancy [m, body axes]; reference depth d0 [m]."""
    Lane = lane(width, real)
    return struct("Stratification", stiffness=Lane, center=lane3(width, real), reference_depth=Lane)


@wp.func
def law(w: Any, view: Any, p: Any):
    """f = -B gradient (d - d0) R^T e3 at the centre of buoyancy, d its depth: from U = B gradient (d - d0)^2 / 2."""
    depth = view.b.z + dot(view.down, p.center)
    f = -(p.stiffness * (depth - p.reference_depth)) * view.down
    w.force = w.force + f
    w.torque = w.torque + cross(p.center, f)
    return w


@wp.func
def energy(u: Any, view: Any, p: Any):
    """U = B gradient (d - d0)^2 / 2."""
    deviation = view.b.z + dot(view.down, p.center) - p.reference_depth
    return u + view.t.dtype(0.5) * (p.stiffness * deviation * deviation)


@wp.func
def supply(s: Any, view: Any, p: Any):
    """s plus U: its least value, 0, is at the reference depth."""
    return energy(s, view, p)
