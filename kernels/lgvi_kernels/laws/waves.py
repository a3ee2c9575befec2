# SPDX-License-Identifier: Apache-2.0
"""Linear waves in deep water, a sum of components (Faltinsen 1990, table 2.1; Newman 1977, 6.2)."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

FLOW = "varying"

# Rows of one component: wavenumber north, east and in all [1/m], omega [rad/s], phase [rad],
# speed of the water at the surface, a omega, north, east and in all [m/s].
ROWS = 8


# First row of its table, ROWS for each component, and count of components.
params = make_params("Waves", words="first count")


@wp.func
def flow(f: Any, view: Any, p: Any):
    """u = a omega e^(-k depth) (cos theta along the heading, -sin theta down), theta = k.x - omega t + phase; its slopes.

    Above the still surface, where e^(-k depth) would grow without bound, it is held at 1 and has no slope by depth.
    """
    depth = view.b.z
    zero = ones(depth) - ones(depth)
    below = greatest(depth, zero)
    inside = positive(depth, ones(depth), zero)
    for j in range(p.count):
        at = p.first + wp.static(ROWS) * j
        north = row1(view, at)
        east = row1(view, at + 1)
        k = row1(view, at + 2)
        omega = row1(view, at + 3)
        speed = row3(view, at + 5)
        theta = north * view.b.x + east * view.b.y + fused(-(view.t * ones(omega)), omega, row1(view, at + 4))
        decayed = exponential(-(k * below))
        c = decayed * cosine(theta)
        s = decayed * sine(theta)
        u = vec3(c * speed.x, c * speed.y, -(s * speed.z))
        # -du/dtheta
        slope = vec3(s * speed.x, s * speed.y, c * speed.z)
        f.velocity = f.velocity + u
        f.rate = f.rate + omega * slope
        f.by_north = f.by_north - north * slope
        f.by_east = f.by_east - east * slope
        f.by_depth = f.by_depth - (inside * k) * u
    return f
