# SPDX-License-Identifier: Apache-2.0
"""Linear waves in water of one finite depth, a sum of components (Faltinsen 1990, table 2.1)."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.waves import add_sums, theta_of

FLOW = "varying"

# Rows of one component: those of deep water, of which the speed is over 1 - f^2, and f = e^(-k h).
ROWS = 9

# First row of its table, ROWS for each component, and count of components.
params = make_params("WavesFinite", words="first count")


@wp.func
def flow(f: Any, view: Any, p: Any):
    """u = a sigma (C cos theta along the heading, -S sin theta down); its slopes.

    C = cosh k(h - depth) / sinh k h = (e + f^2 / e) / (1 - f^2), S = sinh ... = (e - f^2 / e) / (1 - f^2), e = e^(-k depth).
    Above the still surface both are held at those of the surface, below the floor at those of the floor.
    """
    depth = view.b.z
    zero = ones(depth) - ones(depth)
    above = -greatest(depth, zero)
    inside = zero
    u, rate = vec3(zero, zero, zero), vec3(zero, zero, zero)
    level, steep = vec3(zero, zero, zero), vec3(zero, zero, zero)
    for j in range(p.count):
        at = p.first + wp.static(ROWS) * j
        north, east, k = row1(view, at), row1(view, at + 1), row1(view, at + 2)
        ahead, aside = row1(view, at + 5), row1(view, at + 6)
        floor = row1(view, at + 8)
        theta = theta_of(view, at)
        free = exponential(k * above)
        inside = greatest(inside, positive(free - floor, positive(depth, ones(depth), zero), zero))
        e = greatest(free, floor)
        z = floor * (floor / e)
        cos = row1(view, at + 7) * cosine(theta)
        sin = row1(view, at + 7) * sine(theta)
        cc = (e + z) * cos
        cs = (e + z) * sin
        sc = (e - z) * cos
        u = u + vec3(cc * ahead, cc * aside, -((e - z) * sin))
        rate = rate + row1(view, at + 3) * vec3(cs * ahead, cs * aside, sc)
        level = level + vec3((north * cs) * ahead, (east * cs) * aside, (north * cs) * aside)
        steep = steep + vec3(north * sc, east * sc, k * cs)
    return add_sums(f, u, rate, level, steep, inside)
