# SPDX-License-Identifier: Apache-2.0
"""Linear waves in water of one finite depth, a sum of components (Faltinsen 1990, table 2.1)."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

FLOW = "varying"

# Rows of one component: those of deep water, of which the speeds are over 1 - f^2, and f = e^(-k h).
ROWS = 9

# First row of its table, ROWS for each component, and count of components.
params = make_params("WavesFinite", words="first count")


@wp.func
def flow(f: Any, view: Any, p: Any):
    """u = a sigma (C cos theta along the heading, -S sin theta down), theta = k.x - omega t + phase; its slopes.

    C = cosh k(h - depth) / sinh k h = (e + f^2 / e) / (1 - f^2), S = sinh ... = (e - f^2 / e) / (1 - f^2), e = e^(-k depth).
    Above the still surface both are held at those of the surface, below the floor at those of the floor.
    """
    depth = view.b.z
    zero = ones(depth) - ones(depth)
    below = greatest(depth, zero)
    sunk = positive(depth, ones(depth), zero)
    for j in range(p.count):
        at = p.first + wp.static(ROWS) * j
        north = row1(view, at)
        east = row1(view, at + 1)
        k = row1(view, at + 2)
        omega = row1(view, at + 3)
        speed = row3(view, at + 5)
        floor = row1(view, at + 8)
        theta = north * view.b.x + east * view.b.y + fused(-(view.t * ones(omega)), omega, row1(view, at + 4))
        free = exponential(-(k * below))
        inside = positive(free - floor, sunk, zero)
        e = greatest(free, floor)
        z = floor * (floor / e)
        cosh = e + z
        sinh = e - z
        cos = cosine(theta)
        sin = sine(theta)
        c = cosh * cos
        s = sinh * sin
        u = vec3(c * speed.x, c * speed.y, -(s * speed.z))
        # -du/dtheta
        slope = vec3((cosh * sin) * speed.x, (cosh * sin) * speed.y, (sinh * cos) * speed.z)
        f.velocity = f.velocity + u
        f.rate = f.rate + omega * slope
        f.by_north = f.by_north - north * slope
        f.by_east = f.by_east - east * slope
        sc = sinh * cos
        f.by_depth = f.by_depth - (inside * k) * vec3(sc * speed.x, sc * speed.y, -((cosh * sin) * speed.z))
    return f
