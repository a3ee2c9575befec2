# SPDX-License-Identifier: Apache-2.0
"""A mass that moves in the vehicle: its weight acts where it is, not where the vehicle counts it."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws.driven import make_driven

# Rows of one channel of a controller: limit, 1 / lag, limit of the rate. Behind those of all channels: weight, mass, the
# reference place, from there to the center of turns, direction of sliding, axis of turns; then the path, from that place.
CHANNEL_ROWS = 3
WEIGHT, MASS, REFERENCE, CENTER, DIRECTION, AXIS, PATH = 0, 1, 2, 5, 8, 11, 14
# Memory behind the places of all channels, three rows: the mean velocity in the vehicle over the last step [m/s].


def path_params(width, real):
    """Params of a mass without channels: first row, memory, and `size`, count of knots of the path after the first."""
    return struct("MovingMass", **dict.fromkeys(("first", "memory", "count", "shared", "size"), wp.int32))


def make_place(slides, turns, channel):
    """(view, p, t) -> from the reference place to where the mass is, along its path at t.

    channel: (view, p, i) -> where channel i is; sliding comes first. None where there are no channels.
    """

    @wp.func
    def moved(view: Any, p: Any, t: Any):
        at = p.first + p.shared
        r = table3(view, at + wp.static(PATH), p.size, t * ones(view.b.x))
        if wp.static(slides):
            r = r + channel(view, p, 0) * row3(view, at + wp.static(DIRECTION))
        if wp.static(turns):
            # Rodrigues' formula about the axis, of the place from the center.
            center = row3(view, at + wp.static(CENTER))
            axis = row3(view, at + wp.static(AXIS))
            angle = channel(view, p, wp.static(int(slides)))
            q = r - center
            along = dot(axis, q) * axis
            r = center + along + cosine(angle) * (q - along) + sine(angle) * cross(axis, q)
        return r

    return moved


def make_inertia(moved, driven):
    """The roles of a mass whose inertia moves with it. driven: the functions of its channels, or None."""
    follow = driven.follow if driven else None

    @wp.func
    def whereabouts(view: Any, p: Any):
        """The mass, its reference place and its place."""
        at = p.first + p.shared
        reference = row3(view, at + wp.static(REFERENCE))
        return row1(view, at + wp.static(MASS)), reference, reference + moved(view, p, view.t)

    @wp.func
    def carried_inertia(D: Any, view: Any, p: Any):
        """m (J(r)^T J(r) - J(r0)^T J(r0)), J(r) = [I, -hat(r)]."""
        m, reference, r = whereabouts(view, p)
        return add_drag_at(add_drag_at(D, m, r), -m, reference)

    @wp.func
    def carried_momentum(w: Any, view: Any, p: Any):
        """m v and r x m v, v the velocity in the vehicle."""
        m, reference, r = whereabouts(view, p)
        at = p.memory + p.count
        v = m * vec3(remembered(view, at), remembered(view, at + 1), remembered(view, at + 2))
        w.force = w.force + v
        w.torque = w.torque + cross(r, v)
        return w

    @wp.func
    def depart(state: Any, view: Any, p: Any):
        """Remember the mean velocity of the step that begins: what recoils then moves as far as the mass does."""
        start = moved(view, p, view.t)
        first_channel = ones(view.b.x)
        second_channel = first_channel
        if wp.static(driven is not None):
            first_channel = remembered(view, p.memory)
            if p.count > 1:
                second_channel = remembered(view, p.memory + 1)
            state = follow(state, view, p)
        end = moved(view, p, view.t + view.h)
        if wp.static(driven is not None):
            remember(view, p.memory, first_channel)
            if p.count > 1:
                remember(view, p.memory + 1, second_channel)
        if view.h > view.h.dtype(0.0):
            v = (view.h.dtype(1.0) / view.h) * (end - start)
            at = p.memory + p.count
            remember(view, at, v.x)
            remember(view, at + 1, v.y)
            remember(view, at + 2, v.z)
        return state

    return {"carried_inertia": carried_inertia, "carried_momentum": carried_momentum, "depart": depart}


@functools.cache
def made(features):
    """The law of a moving mass with these features: "path", always, "driven", "slide", "turn", "lag", "rate", "inertia"."""
    driven, params, channel = None, path_params, None
    if "driven" in features:
        driven = make_driven(f"MovingMass_{'_'.join(features)}", CHANNEL_ROWS, 0, 1, 2, features)
        params, channel = driven.params, driven.place
    moved = make_place("slide" in features, "turn" in features, channel)

    @wp.func
    def moving_mass_law(w: Any, view: Any, p: Any):
        """(r - r0) x m g R^T e3: the force stays, and a couple is the same about all points."""
        weight = row1(view, p.first + p.shared + wp.static(WEIGHT))
        w.torque = w.torque + weight * cross(moved(view, p, view.t), view.down)
        return w

    roles = {"evolve": driven.evolve, "follow": driven.follow, "report": driven.report} if driven else {}
    roles |= make_inertia(moved, driven) if "inertia" in features else {}
    return device(__name__, features, params=params, law=moving_mass_law, **roles)
