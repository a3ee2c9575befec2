# SPDX-License-Identifier: Apache-2.0
"""What laws do with a View: turn vectors, read their table and memory, find velocities at a point, sum damping."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import (  # noqa: F401
    absolute,
    add,
    any_positive,
    cross,
    div,
    dot,
    element,
    entry_of,
    gathered,
    gathered3,
    mul,
    neg,
    ones,
    pieces_of,
    positive,
    rows_less_products,
    rows_less_rows,
    set_element,
    sub,
    vec3,
)
from lgvi_kernels.lanes.functions import arctangent2, clamp, fused


@wp.func
def to_body(view: Any, v: Any):
    """R^T v: a vector of inertial axes in body axes."""
    return v.x * view.north + v.y * view.east + v.z * view.down


@wp.func
def to_inertial(view: Any, v: Any):
    """R v: a vector of body axes in inertial axes."""
    return vec3(dot(view.north, v), dot(view.east, v), dot(view.down, v))


@wp.func
def slope_along(water: Any, v: Any):
    """G v: how fast the water's velocity changes along v, inertial axes."""
    return v.x * water.by_north + v.y * water.by_east + v.z * water.by_depth


@wp.func
def slope_against(water: Any, v: Any):
    """G^T v: how the water's velocity along v changes, inertial axes."""
    return vec3(dot(water.by_north, v), dot(water.by_east, v), dot(water.by_depth, v))


@wp.func
def velocity_at(view: Any, r: Any):
    """nu + Om x r: the velocity of the body's point r through the water, body axes [m/s]."""
    return view.nu + cross(view.Om, r)


@wp.func
def heading_error(wanted: Any, view: Any):
    """The heading of one attitude less that of another [rad], in [-pi, pi], from their forward axes, without Euler angles."""
    c = wanted.north.x * view.north.x + wanted.east.x * view.east.x
    s = wanted.east.x * view.north.x - wanted.north.x * view.east.x
    return arctangent2(s, c)


@wp.func
def row1(view: Any, row: int):
    """One number of the law's table."""
    return entry_of(view.b.x, view.table, view.entry, row, 0)


@wp.func
def row3(view: Any, row: int):
    """Three rows of the law's table as a vector."""
    like = view.b.x
    t = view.table
    i = view.entry
    return vec3(entry_of(like, t, i, row, 0), entry_of(like, t, i, row, 1), entry_of(like, t, i, row, 2))


@wp.func
def gather1(view: Any, row: int, index: Any):
    """The number of row `row + index` of the law's table, each lane at an index of its own (see whole)."""
    return gathered(view.b.x, view.table, view.entry, row, 0, index)


@wp.func
def gather3(view: Any, row: int, index: Any):
    """Three rows from `row + index` on, as a vector, each lane at an index of its own."""
    return gathered3(view.b.x, view.table, view.entry, row, index)


@wp.func
def remembered(view: Any, row: int):
    """One number that the law remembers."""
    return element(view.memory, view.packet, row, 0)


@wp.func
def remember(view: Any, row: int, value: Any):
    """Write a number that the law remembers, for later in this step or for the next ones."""
    set_element(view.memory, view.packet, row, 0, value)


@wp.func
def less_products(view: Any, a: int, b: int, count: int, total: Any):
    """total less the sum of products of remembered numbers, from a and from b on."""
    return rows_less_products(view.memory, view.packet, a, b, count, total)


@wp.func
def less_rows(view: Any, target: int, f: Any, source: int, count: int):
    """Take f times remembered numbers from `source` on from those from `target` on."""
    rows_less_rows(view.memory, view.packet, target, f, source, count)


@wp.func
def ramp(view: Any, row: int, x: Any):
    """How far x is from one knot to the next, 0 to 1, from the two rows that hold the knot and 1 / the distance."""
    unity = ones(x)
    t = view.table
    i = view.entry
    return clamp((x - entry_of(x, t, i, row, 0)) * entry_of(x, t, i, row, 1), unity - unity, unity)


@wp.func
def table1(view: Any, first: int, count: int, x: Any):
    """A table's value at x: row `first` holds the first value, then 3 rows a knot: knot, 1 / distance, difference."""
    # A sum over all segments: nothing to search, and each lane may be in a segment of its own.
    value = row1(view, first)
    for i in range(pieces_of(view.table, first, count, 1, 3)):
        at = first + 1 + 3 * i
        value = fused(ramp(view, at, x), entry_of(x, view.table, view.entry, at, 2), value)
    return value


@wp.func
def table3(view: Any, first: int, count: int, x: Any):
    """table1 for vectors: 3 rows for the first value, then 5 rows a knot: knot, 1 / distance, 3 differences."""
    value = row3(view, first)
    for i in range(pieces_of(view.table, first, count, 3, 5)):
        at = first + 3 + 5 * i
        change = vec3(
            entry_of(x, view.table, view.entry, at, 2),
            entry_of(x, view.table, view.entry, at, 3),
            entry_of(x, view.table, view.entry, at, 4),
        )
        value = value + ramp(view, at, x) * change
    return value


@wp.func
def command(view: Any, first: int, count: int, limit: Any, t: Any):
    """A command from its table (see table1) at the time t, kept within a limit."""
    return clamp(table1(view, first, count, t * ones(limit)), -limit, limit)


@wp.func
def end_of_half(view: Any):
    """(time, length) of the end of this half of a kick, for laws that remember; view.t is the middle of the whole kick."""
    half = view.h.dtype(0.5) * view.h
    t = view.t
    if view.second > 0:
        t = view.t + half
    return t, half


@wp.func
def add_outer(D: Any, force: Any, torque: Any, velocity: Any, rate: Any):
    """D + (force; torque) (velocity; rate)^T: a wrench in proportion to one velocity, which the twist measures."""
    D.force_velocity = add_rows(D.force_velocity, force, velocity)
    D.force_rate = add_rows(D.force_rate, force, rate)
    D.torque_velocity = add_rows(D.torque_velocity, torque, velocity)
    D.torque_rate = add_rows(D.torque_rate, torque, rate)
    return D


@wp.func
def add_drag_at(D: Any, s: Any, r: Any):
    """D plus the resistance s [N s/m] to the velocity of the body's point r, whatever its direction."""
    unity = ones(s)
    zero = unity - unity
    x = vec3(unity, zero, zero)
    y = vec3(zero, unity, zero)
    z = vec3(zero, zero, unity)
    D = add_outer(D, s * x, s * cross(r, x), x, cross(r, x))
    D = add_outer(D, s * y, s * cross(r, y), y, cross(r, y))
    return add_outer(D, s * z, s * cross(r, z), z, cross(r, z))


@wp.func
def add_rows(m: Any, a: Any, b: Any):
    """m + a b^T."""
    m.row0 = m.row0 + a.x * b
    m.row1 = m.row1 + a.y * b
    m.row2 = m.row2 + a.z * b
    return m
