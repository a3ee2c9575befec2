# SPDX-License-Identifier: Apache-2.0
"""Linear waves in deep water, a sum of components (Faltinsen 1990, table 2.1; Newman 1977, 6.2)."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

FLOW = "varying"

# Rows of one component: wavenumber north, east and in all [1/m], omega [rad/s], phase [rad], its heading north and east,
# and the speed of the water at the surface, a omega [m/s].
ROWS = 8


# First row of its table, ROWS for each component, and count of components.
params = make_params("Waves", words="first count")


@wp.func
def theta_of(view: Any, at: int):
    """theta = k.x - omega t + phase of the component whose rows begin at `at`."""
    at_origin = fused(-(view.t * ones(view.b.x)), row1(view, at + 3), row1(view, at + 4))
    return row1(view, at) * view.b.x + row1(view, at + 1) * view.b.y + at_origin


@wp.func
def add_sums(f: Any, u: Any, rate: Any, level: Any, steep: Any, inside: Any):
    """Add velocity, its rate and its slopes, which are symmetric since the water does not turn.

    level: -du/dx north of north, east of east, east of north. steep: -du/dx down of north and of east, du/dx down of down.
    inside: 1 where the waves change with depth, else 0.
    """
    f.velocity = f.velocity + u
    f.rate = f.rate + rate
    f.by_north = f.by_north - vec3(level.x, level.z, steep.x)
    f.by_east = f.by_east - vec3(level.z, level.y, steep.y)
    f.by_depth = f.by_depth + inside * vec3(-steep.x, -steep.y, steep.z)
    return f


@wp.func
def flow(f: Any, view: Any, p: Any):
    """u = a omega e^(-k depth) (cos theta along the heading, -sin theta down); its slopes.

    Above the still surface, where e^(-k depth) would grow without bound, it is held at 1 and has no slope by depth.
    """
    depth = view.b.z
    zero = ones(depth) - ones(depth)
    above = -greatest(depth, zero)
    u, rate = vec3(zero, zero, zero), vec3(zero, zero, zero)
    level, steep = vec3(zero, zero, zero), vec3(zero, zero, zero)
    for j in range(p.count):
        at = p.first + wp.static(ROWS) * j
        north, east, k = row1(view, at), row1(view, at + 1), row1(view, at + 2)
        ahead, aside = row1(view, at + 5), row1(view, at + 6)
        theta = theta_of(view, at)
        speed = row1(view, at + 7) * exponential(k * above)
        c = speed * cosine(theta)
        s = speed * sine(theta)
        u = u + vec3(c * ahead, c * aside, -s)
        rate = rate + row1(view, at + 3) * vec3(s * ahead, s * aside, c)
        level = level + vec3((north * s) * ahead, (east * s) * aside, (north * s) * aside)
        steep = steep + vec3(north * c, east * c, k * s)
    return add_sums(f, u, rate, level, steep, positive(depth, ones(depth), zero))
