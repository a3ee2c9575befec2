# SPDX-License-Identifier: Apache-2.0
"""A current on a regular grid in north, east and depth, and in time: linear in each between its nodes, held outside."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.cells import cell_of
from lgvi_kernels.law import *

FLOW = "varying"


# Origin, inverse spacing and last node along north, east and depth, and the same in time; which scenario.
# Rows: velocities (scenario, time, north, east, depth, 3), of which north, east, depth, time and scenario are the distances
# in rows, 0 along an axis of one node.
params = make_params(
    "CurrentField",
    lanes="start inverse_time last_time chosen",
    vectors="origin inverse last",
    words="first north east depth time scenario",
)


@wp.func
def in_cell(f: Any, view: Any, p: Any, at: Any, row: int, parts: Any, inverse: Any):
    """f with the velocity and its slopes by north, east and depth in one cell, linear in each."""
    first = p.first + row
    c00 = gather3(view, first, at)
    c01 = gather3(view, first + p.east, at)
    c10 = gather3(view, first + p.north, at)
    c11 = gather3(view, first + p.north + p.east, at)
    d00 = gather3(view, first + p.depth, at) - c00
    d01 = gather3(view, first + p.east + p.depth, at) - c01
    d10 = gather3(view, first + p.north + p.depth, at) - c10
    d11 = gather3(view, first + p.north + p.east + p.depth, at) - c11
    # By depth, then by east, then by north.
    c00 = c00 + parts.z * d00
    c01 = c01 + parts.z * d01
    c10 = c10 + parts.z * d10
    c11 = c11 + parts.z * d11
    d0 = d00 + parts.y * (d01 - d00)
    d1 = d10 + parts.y * (d11 - d10)
    e0 = c01 - c00
    e1 = c11 - c10
    c0 = c00 + parts.y * e0
    c1 = c10 + parts.y * e1
    f.velocity = c0 + parts.x * (c1 - c0)
    f.by_north = inverse.x * (c1 - c0)
    f.by_east = inverse.y * (e0 + parts.x * (e1 - e0))
    f.by_depth = inverse.z * (d0 + parts.x * (d1 - d0))
    return f


@wp.func
def mixed(part: Any, a: Any, b: Any):
    """a, and b as far as part says."""
    return a + part * (b - a)


def make_flow(timed):
    """The flow of a field, which changes in time or not."""

    @wp.func
    def field_flow(f: Any, view: Any, p: Any):
        """u, du/dt and du/db of the cell that the vehicle is in."""
        i, x, dx = cell_of(view.b.x, p.origin.x, p.inverse.x, p.last.x)
        j, y, dy = cell_of(view.b.y, p.origin.y, p.inverse.y, p.last.y)
        k, z, dz = cell_of(view.b.z, p.origin.z, p.inverse.z, p.last.z)
        parts = vec3(x, y, z)
        inverse = vec3(dx, dy, dz)
        at = p.north * whole(i) + p.east * whole(j) + p.depth * whole(k) + p.scenario * whole(p.chosen)
        if wp.static(timed):
            n, t, dt = cell_of(view.t * ones(x), p.start, p.inverse_time, p.last_time)
            at = at + p.time * whole(n)
        water = in_cell(f, view, p, at, 0, parts, inverse)
        if wp.static(timed):
            later = in_cell(f, view, p, at, p.time, parts, inverse)
            f.rate = f.rate + dt * (later.velocity - water.velocity)
            water.velocity = mixed(t, water.velocity, later.velocity)
            water.by_north = mixed(t, water.by_north, later.by_north)
            water.by_east = mixed(t, water.by_east, later.by_east)
            water.by_depth = mixed(t, water.by_depth, later.by_depth)
        f.velocity = f.velocity + water.velocity
        f.by_north = f.by_north + water.by_north
        f.by_east = f.by_east + water.by_east
        f.by_depth = f.by_depth + water.by_depth
        return f

    return field_flow


flow = make_flow(False)


@functools.cache
def made(features):
    """The same of a field that changes in time."""
    return device(__name__, features, params=params, flow=make_flow(True), FLOW=FLOW)
