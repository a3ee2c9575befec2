# SPDX-License-Identifier: Apache-2.0
"""The device code of the law: what the kernel calls for each packet of vehicles."""

from typing import Any

import warp as wp

# Warp looks the operators up in this module: `add` stands for + between lanes.
from lgvi_kernels.law import add, cross, dot, mul, root, sub, to_body  # noqa: F401

POTENTIAL = True


@wp.func
def law(w: Any, view: Any, p: Any):
    """Add the torque m x R^T B."""
    w.torque = w.torque + cross(p.moment, to_body(view, p.field))
    return w


@wp.func
def energy(u: Any, view: Any, p: Any):
    """Add the potential -m . R^T B."""
    return u - dot(p.moment, to_body(view, p.field))


@wp.func
def supply(s: Any, view: Any, p: Any):
    """Add the potential less its least value, -|m| |B|."""
    return energy(s, view, p) + root(dot(p.moment, p.moment) * dot(p.field, p.field))
