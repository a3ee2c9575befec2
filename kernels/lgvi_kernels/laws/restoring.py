# SPDX-License-Identifier: Apache-2.0
"""Restoring moment: mU = -B r x R^T e3, from the potential U = B r.R^T e3 (section IV of Nordkvist & Sanyal 2010)."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

POTENTIAL = True
SEPARABLE = True


@functools.cache
def params(width, real):
    """Params: moment [N m], buoyancy times its lever less weight times its own, from the origin of the forces."""
    Lane3 = lane3(width, real)

    @wp.struct
    class Restoring:
        moment: Lane3

    return Restoring


@wp.func
def law(w: Any, view: Any, p: Any):
    """mU(b, R) = -B r x R^T e3. docs/theory/integrator.md, (I3)."""
    w.torque = w.torque - cross(p.moment, view.down)
    return w


@wp.func
def energy(u: Any, view: Any, p: Any):
    """U = B r.R^T e3."""
    return u + dot(p.moment, view.down)


@wp.func
def steady_force(w: Any, view: Any, p: Any):
    """w: a moment alone has no force."""
    return w


@wp.func
def supply(s: Any, view: Any, p: Any):
    """s plus U + B |r|: U is least, -B |r|, where the vehicle hangs upright."""
    return energy(s, view, p) + root(dot(p.moment, p.moment))
