# SPDX-License-Identifier: Apache-2.0
"""Contact with the sea floor at points of the hull: springs and dampers along and across it, within a cone of friction.

The spring across the floor is anchored where the point came to rest. Where it would pull harder than friction holds, the
anchor is dragged along: so what is at rest stays there, without creep.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.cells import floor_at, grid_fields
from lgvi_kernels.law import *

# Follows the place of each stage.
FOLLOWS_PLACE = True
# Rows of the memory of a point: its anchor [m], inertial axes, and 1 once there is one.
MEMORY = 4
# How far the spring along the floor may be stretched, over what friction holds at rest. In the middle of an explicit kick the
# dampers of a vehicle at rest have a force of their own: without this part points just within the cone would creep.
SLACK = 1.25


@functools.cache
def params(width, real):
    """Params: stiffness [N/m], damping [N s/m] and friction; `count` points [m] in rows; the floor."""
    lanes = dict.fromkeys(("stiffness", "damping", "friction"), lane(width, real))
    words = dict.fromkeys(("points", "count", "memory"), wp.int32)
    return struct("BottomContact", **lanes, **words, **grid_fields(width, real))


@wp.func
def touched(view: Any, p: Any, i: int):
    """(arm [m] in body axes, place, upward normal of the floor below it in inertial axes, how deep it is in the floor)."""
    arm = row3(view, p.first + p.points + 3 * i)
    place = view.b + to_inertial(view, arm)
    depth, by_north, by_east = floor_at(view, p, place.x, place.y)
    unity = ones(depth)
    size = unity / root(unity + by_north * by_north + by_east * by_east)
    return arm, place, vec3(by_north * size, by_east * size, -size), (place.z - depth) * size


@wp.func
def stretch(view: Any, p: Any, i: int, place: Any, n: Any, sunk: Any):
    """Distance of the point from its anchor along the floor, as far as the spring may be stretched."""
    at = p.memory + wp.static(MEMORY) * i
    anchor = vec3(remembered(view, at), remembered(view, at + 1), remembered(view, at + 2))
    s = remembered(view, at + 3) * (place - anchor)
    s = s - dot(s, n) * n
    return held_within(s, sunk.dtype(wp.static(SLACK)) * (p.friction * greatest(sunk, sunk - sunk)))


@wp.func
def held_within(v: Any, most: Any):
    """v, or as long as `most` where it is longer."""
    size = root(dot(v, v))
    return positive(size - most, most / positive(size - most, size, ones(size)), ones(size)) * v


@wp.func
def drag_along(view: Any, p: Any):
    """Let the anchors follow the points that slide, and those that are off the floor."""
    for i in range(p.count):
        arm, place, n, sunk = touched(view, p, i)
        anchor = place - stretch(view, p, i, place, n, sunk)
        at = p.memory + wp.static(MEMORY) * i
        remember(view, at, anchor.x)
        remember(view, at + 1, anchor.y)
        remember(view, at + 2, anchor.z)
        remember(view, at + 3, ones(sunk))


@wp.func
def evolve(state: Any, view: Any, p: Any):
    """After the kick, where its force was: before it the water has not carried the vehicle there yet."""
    if view.second > 0:
        drag_along(view, p)
    return state


@wp.func
def follow(state: Any, view: Any, p: Any):
    """At each stage."""
    drag_along(view, p)
    return state


def seeing(water_at):
    """Its functions, which look at the water: velocities over ground are those through the water and the water's."""

    @wp.func
    def contact_push(w: Any, view: Any, p: Any, sea: Any):
        """Push out of the floor, never into it, and along it springs and dampers within the cone of friction."""
        for i in range(p.count):
            arm, place, n, sunk = touched(view, p, i)
            s = to_body(view, stretch(view, p, i, place, n, sunk))
            n = to_body(view, n)
            water = water_at(view, arm, sea)
            v = velocity_at(view, arm) + to_body(view, water.velocity)
            zero = sunk - sunk
            into = dot(n, v)
            normal = positive(sunk, greatest(p.stiffness * sunk - p.damping * into, zero), zero)
            across = -(p.stiffness * s + p.damping * (v - into * n))
            f = normal * n + held_within(across, p.friction * normal)
            w.force = w.force + f
            w.torque = w.torque + cross(arm, f)
        return w

    @wp.func
    def contact_load(D: Any, w: Any, view: Any, p: Any, sea: Any):
        """The same, with no part in D: so the push that friction follows is the push of the same step."""
        return D, contact_push(w, view, p, sea)

    return {"load": contact_load, "push": contact_push}
