# SPDX-License-Identifier: Apache-2.0
"""Height of the surface at a time, for laws, events and sensors that look at the depth below it."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.arithmetic import struct
from lgvi_kernels.law import add, cosine, fused, make_params, mul, ones, row1, table1, vec3  # noqa: F401

# Fields of a struct: where among a law's own rows those of the tide begin; knots after the first, and harmonics. Rows: of
# `table1`, heights over time; then of each harmonic its amplitude [m], omega [rad/s] and phase [rad].
FIELDS = ("tide_row", "tide_knots", "tide_harmonics")
ROLES = ("law", "damping", "push", "flow", "evolve", "follow")
# What a law keeps that follows the tide; a potential that depends on time is none.
KEPT = ("FLOW", "NOISE", "FOLLOWS_PLACE", "report")


@wp.func
def rise(view: Any, p: Any):
    """Height of the surface above the depth 0 [m]."""
    at = p.first + p.tide_row
    unity = ones(view.b.z)
    height = table1(view, at, p.tide_knots, view.t * unity)
    at += 1 + 3 * p.tide_knots
    for j in range(p.tide_harmonics):
        angle = fused(view.t * unity, row1(view, at + 3 * j + 1), row1(view, at + 3 * j + 2))
        height = height + row1(view, at + 3 * j) * cosine(angle)
    return height


@wp.func
def raised(view: Any, p: Any):
    """The View from a depth below the surface."""
    view.b = vec3(view.b.x, view.b.y, view.b.z + rise(view, p))
    return view


@functools.cache
def in_tide(law):
    """A law, or an event, for which the surface is that of a tide: the same functions of the depth below it."""
    roles = {role: _held(getattr(law, role)) for role in ROLES if hasattr(law, role)}
    if hasattr(law, "distance"):
        roles["distance"] = _held_distance(law.distance)
    kept = {name: getattr(law, name) for name in KEPT if hasattr(law, name)}

    def params(width, real, *kinds):
        own = law.params(width, real, *kinds)
        fields = {name: item.type for name, item in own.vars.items()}
        return struct(f"{own.key}InTide", **fields | dict.fromkeys(("first", *FIELDS), wp.int32))

    return device(law.__name__, ("in_tide",), params=params, **kept, **roles)


def _held(role):
    @wp.func
    def held(w: Any, view: Any, p: Any):
        return role(w, raised(view, p), p)

    return held


def _held_distance(distance):
    @wp.func
    def held_distance(view: Any, p: Any):
        return distance(raised(view, p), p)

    return held_distance


params = make_params("Tide", words="first")


@wp.func
def law(w: Any, view: Any, p: Any):
    """No force: other laws read the tide, by rows of their own."""
    return w
