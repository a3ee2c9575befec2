# SPDX-License-Identifier: Apache-2.0
"""Stratification of a hull that yields: B (1 + gradient x) (1 - compressibility x), x = d - d0: its deviation from B."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

POTENTIAL = True


@functools.cache
def params(width, real):
    """Params: stiffness, B (gradient - compressibility) [N/m]; curve, B gradient compressibility [N/m2]; as stratification."""
    Lane = lane(width, real)
    return struct(
        "StratificationCompressed", stiffness=Lane, curve=Lane, center=lane3(width, real), reference_depth=Lane
    )


@wp.func
def deviation_of(view: Any, p: Any):
    """x of the centre of buoyancy."""
    return view.b.z + dot(view.down, p.center) - p.reference_depth


@wp.func
def law(w: Any, view: Any, p: Any):
    """f = -(stiffness x - curve x^2) R^T e3 at the centre of buoyancy."""
    x = deviation_of(view, p)
    f = -(x * (p.stiffness - p.curve * x)) * view.down
    w.force = w.force + f
    w.torque = w.torque + cross(p.center, f)
    return w


@wp.func
def energy(u: Any, view: Any, p: Any):
    """U = stiffness x^2 / 2 - curve x^3 / 3."""
    x = deviation_of(view, p)
    third = view.t.dtype(wp.static(1.0 / 3.0)) * (p.curve * x)
    return u + (x * x) * (view.t.dtype(0.5) * p.stiffness - third)


@wp.func
def supply(s: Any, view: Any, p: Any):
    """s plus U, as of stratification: where the hull yields less than the water, U is least at the reference depth."""
    return energy(s, view, p)
