# SPDX-License-Identifier: Apache-2.0
"""Tether: a spring from a fixed anchor to a point of the vehicle, slack below its rest length."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

POTENTIAL = True


@wp.func
def law(w: Any, view: Any, p: Any):
    """f = k max(|d| - L0, 0) d / |d| along d = anchor - (b + R a), at the point a."""
    d = p.anchor - view.b - to_inertial(view, p.attachment)
    # The least length keeps 0/0 away where the attachment is at the anchor: there is no pull.
    length = greatest(root(dot(d, d)), view.t.dtype(1e-30) * ones(d.x))
    pull = p.stiffness * greatest(ones(d.x) - p.rest_length / length, ones(d.x) - ones(d.x))
    f = to_body(view, pull * d)
    w.force = w.force + f
    w.torque = w.torque + cross(p.attachment, f)
    return w


@wp.func
def energy(u: Any, view: Any, p: Any):
    """U = k max(|d| - L0, 0)^2 / 2."""
    d = p.anchor - view.b - to_inertial(view, p.attachment)
    stretch = greatest(root(dot(d, d)) - p.rest_length, ones(d.x) - ones(d.x))
    return u + view.t.dtype(0.5) * (p.stiffness * stretch * stretch)


@wp.func
def supply(s: Any, view: Any, p: Any):
    """s plus U: its least value, 0, is where the tether is slack."""
    return energy(s, view, p)
