# SPDX-License-Identifier: Apache-2.0
"""Regular grids: the cell that a place is in, and the depth of a sea floor, bilinear between the nodes and held outside."""

from typing import Any

import warp as wp

from lgvi_kernels.law import (  # noqa: F401
    add,
    below,
    div,
    gather1,
    greatest,
    lane,
    least,
    mul,
    ones,
    positive,
    sub,
    whole,
)

AXES = ("north", "east")


@wp.func
def cell_of(x: Any, origin: Any, inverse: Any, last: Any):
    """The cell that x is in, how far it is through it, 0 to 1, and 1 / spacing: of the nearest where x is outside, then 0."""
    unity = ones(x)
    zero = unity - unity
    u = (x - origin) * inverse
    # Of NaN the first.
    held = positive(u, positive(u - last, last, u), zero)
    cell = greatest(least(below(held), last - unity), zero)
    return cell, held - cell, positive(u, positive(last - u, inverse, zero), zero)


def grid_fields(width, real):
    """Fields of a struct: place of the first node, 1 / spacing and last node along north and east.

    Rows: depths (north, east), from `first` on, of which across_north and across_east are the distances in rows.
    """
    lanes = [f"{name}_{axis}" for name in ("origin", "inverse", "last") for axis in AXES]
    words = ("first", *(f"across_{axis}" for axis in AXES))
    return dict.fromkeys(lanes, lane(width, real)) | dict.fromkeys(words, wp.int32)


@wp.func
def floor_at(view: Any, p: Any, north: Any, east: Any):
    """Depth of the floor, and its slopes by north and by east, 0 outside."""
    i, x, by_x = cell_of(north, p.origin_north, p.inverse_north, p.last_north)
    j, y, by_y = cell_of(east, p.origin_east, p.inverse_east, p.last_east)
    at = p.across_north * whole(i) + p.across_east * whole(j)
    c00 = gather1(view, p.first, at)
    c01 = gather1(view, p.first + p.across_east, at)
    c10 = gather1(view, p.first + p.across_north, at)
    c11 = gather1(view, p.first + p.across_north + p.across_east, at)
    # By east, then by north.
    e0 = c01 - c00
    e1 = c11 - c10
    c0 = c00 + y * e0
    c1 = c10 + y * e1
    return c0 + x * (c1 - c0), by_x * (c1 - c0), by_y * (e0 + x * (e1 - e0))
