# SPDX-License-Identifier: Apache-2.0
"""A buoyancy engine: a pump that takes a volume to one of two values, and turns at two depths.

It remembers the volume and where it goes, and its depth when it looked last. Where the depth passes a turning depth from one
look to the next, the time between is divided there, by a straight line: so the turn is no matter of the step's end.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.sums import carried
from lgvi_kernels.law import *
from lgvi_warp.extensions.gliders.device.density import column, relative_density

# follow() looks at the depth of each stage.
FOLLOWS_PLACE = True
# Rows of its memory: the volume now [m3]; 1 where it goes up, -1 where it goes down; volume and depth at its last look, and
# the time since then [s], below 0 before the first.
NOW, SIDE, VOLUME, DEPTH, SINCE = 0, 1, 2, 3, 4
# With a pump whose work is accounted also the water's pressure at the last look [N/m2].
PRESSURE = 5
NUMBERS = ("pump_rate", "volume_down", "volume_up", "depth_top", "depth_bottom", "gradient", "reference_depth")


@functools.cache
def params(width, real):
    """Params: weight, the buoyancy of 1 m3 [N]; point where it acts [m]; origin, whose depth counts; rest as of the Term."""
    Lane, Lane3 = lane(width, real), lane3(width, real)
    names = (*NUMBERS, "weight")
    lanes = dict.fromkeys(names, Lane)
    return struct("BuoyancyEngine", point=Lane3, origin=Lane3, memory=wp.int32, **lanes)


@wp.func
def volume_now(view: Any, p: Any):
    """V at the end of the last part of a step [m3]."""
    return remembered(view, p.memory + wp.static(NOW))


@wp.func
def law(w: Any, view: Any, p: Any):
    """f = -rho g (1 + gradient (d - d0)) V R^T e3 at the point, d its depth."""
    deviation = view.b.z + dot(view.down, p.point) - p.reference_depth
    f = -(p.weight * (fused(p.gradient, deviation, ones(deviation)) * volume_now(view, p))) * view.down
    w.force = w.force + f
    w.torque = w.torque + cross(p.point, f)
    return w


@wp.func
def law_in_profile(w: Any, view: Any, p: Any):
    """The same by a table of the density."""
    share = relative_density(view, p.first, p.density_knots, view.b.z + dot(view.down, p.point))
    f = -(p.weight * (share * volume_now(view, p))) * view.down
    w.force = w.force + f
    w.torque = w.torque + cross(p.point, f)
    return w


@wp.func
def pumped(p: Any, volume: Any, side: Any, time: Any):
    """The volume after a time towards the one for this side."""
    most = time * p.pump_rate
    return volume + clamp(positive(side, p.volume_up, p.volume_down) - volume, -most, most)


@wp.func
def met(view: Any, p: Any, side: Any, depth: Any, time: Any):
    """(beyond, until): above 0 where the depth is past that of the turn, and how long after the last look it met it.

    By a straight line of the depth over the time since then; 0 where it was past it before.
    """
    unity = ones(depth)
    looked = remembered(view, p.memory + wp.static(SINCE)) + unity
    before = positive(looked, remembered(view, p.memory + wp.static(DEPTH)), depth)
    beyond = positive(side, p.depth_top - depth, depth - p.depth_bottom)
    was_beyond = positive(side, p.depth_top - before, before - p.depth_bottom)
    change = positive(beyond, beyond - was_beyond, unity)
    return beyond, positive(was_beyond, unity - unity, time * (-was_beyond / change))


@wp.func
def pumped_and_turned(view: Any, p: Any, depth: Any, time: Any):
    """(volume, side) after the time since the last look: it turns where a straight line of the depth meets a turning depth."""
    side = remembered(view, p.memory + wp.static(SIDE))
    volume = remembered(view, p.memory + wp.static(VOLUME))
    beyond, until = met(view, p, side, depth, time)
    turned = pumped(p, pumped(p, volume, side, until), -side, time - until)
    return positive(beyond, turned, pumped(p, volume, side, time)), positive(beyond, -side, side)


@wp.func
def looked_since(view: Any, p: Any):
    """The time since the last look [s], 0 before the first."""
    since = remembered(view, p.memory + wp.static(SINCE))
    return greatest(since, since - since)


@wp.func
def note(view: Any, p: Any, volume: Any, side: Any, depth: Any, since: Any):
    """Remember a look, and the volume `since` after it."""
    remember(view, p.memory + wp.static(NOW), pumped(p, volume, side, since))
    remember(view, p.memory + wp.static(SIDE), side)
    remember(view, p.memory + wp.static(VOLUME), volume)
    remember(view, p.memory + wp.static(DEPTH), depth)
    remember(view, p.memory + wp.static(SINCE), since)


@wp.func
def evolve(state: Any, view: Any, p: Any):
    """Before the kick, the volume in its middle; after it, where the water has carried the vehicle, the look that is kept."""
    half = view.h.dtype(0.5) * view.h * ones(view.b.x)
    depth = view.b.z + dot(view.down, p.origin)
    volume, side = pumped_and_turned(view, p, depth, looked_since(view, p) + half)
    if view.second > 0:
        note(view, p, volume, side, depth, half)
    else:
        remember(view, p.memory + wp.static(NOW), volume)
    return state


@wp.func
def follow(state: Any, view: Any, p: Any):
    """A look at each stage."""
    depth = view.b.z + dot(view.down, p.origin)
    time = looked_since(view, p) + view.h * ones(depth)
    volume, side = pumped_and_turned(view, p, depth, time)
    note(view, p, volume, side, depth, time - time)
    return state


# The pump's work ------------------------------------------------------------------------------------------------------


def make_params_of(features):
    """Params: with "power" the pump's efficiency, and the row of the account of the energy used, below 0 where there is none.

    With "profile": rows of the table of the density.
    """
    powered, profiled = "power" in features, "profile" in features
    names = (*NUMBERS, "weight", *("efficiency",) * powered)
    words = ("memory", *("account_row",) * powered, *("first", "density_knots") * profiled)

    @functools.cache
    def params(width, real):
        lanes, Lane3 = dict.fromkeys(names, lane(width, real)), lane3(width, real)
        name = f"BuoyancyEngine{'Powered' * powered}{'InProfile' * profiled}"
        return struct(name, point=Lane3, origin=Lane3, **dict.fromkeys(words, wp.int32), **lanes)

    return params


@wp.func
def pressure_at(view: Any, p: Any):
    """The weight of the water above the point per area [N/m2], 0 above the surface."""
    depth = view.b.z + dot(view.down, p.point)
    middle = depth.dtype(0.5) * depth - p.reference_depth
    pressure = p.weight * (depth * fused(p.gradient, middle, ones(depth)))
    return greatest(pressure, depth - depth)


@wp.func
def pay(view: Any, p: Any, work: Any):
    """Account the energy that the pump takes for its work [J], in a scene that has an account."""
    if p.account_row >= 0:
        used, low = carried(remembered(view, p.account_row), remembered(view, p.account_row + 1), work / p.efficiency)
        remember(view, p.account_row, used)
        remember(view, p.account_row + 1, low)


@wp.func
def risen_since(view: Any, p: Any, volume: Any):
    """How much volume the pump has pushed out since the end of the last part of a step [m3]."""
    side = remembered(view, p.memory + wp.static(SIDE))
    before = pumped(p, remembered(view, p.memory + wp.static(VOLUME)), side, looked_since(view, p))
    return greatest(volume - before, volume - volume)


@wp.func
def pressure_in_profile(view: Any, p: Any):
    """The same by a table of the density."""
    depth = view.b.z + dot(view.down, p.point)
    return greatest(p.weight * column(view, p.first, p.density_knots, depth), depth - depth)


def make_powered(pressure_at):
    """The roles evolve and follow of a pump whose work is accounted."""

    @wp.func
    def powered_evolve(state: Any, view: Any, p: Any):
        """As evolve; the work p dV of a step, with the pressure of its middle."""
        if view.second > 0:
            half = view.h.dtype(0.5) * view.h * ones(view.b.x)
            depth = view.b.z + dot(view.down, p.origin)
            volume, side = pumped_and_turned(view, p, depth, looked_since(view, p) + half)
            ahead = greatest(pumped(p, volume, side, half) - volume, half - half)
            pay(view, p, pressure_at(view, p) * (risen_since(view, p, volume) + ahead))
        return evolve(state, view, p)

    @wp.func
    def powered_follow(state: Any, view: Any, p: Any):
        """As follow; the work p dV since the last look, with the pressure in the middle of the time of the pump."""
        depth = view.b.z + dot(view.down, p.origin)
        time = view.h * ones(depth)
        volume, side = pumped_and_turned(view, p, depth, time)
        beyond, until = met(view, p, remembered(view, p.memory + wp.static(SIDE)), depth, time)
        risen = risen_since(view, p, volume)
        pressure = pressure_at(view, p)
        looked = remembered(view, p.memory + wp.static(SINCE)) + ones(depth)
        before = positive(looked, remembered(view, p.memory + wp.static(PRESSURE)), pressure)
        middle = positive(beyond, until, time - time) + depth.dtype(0.5) * (risen / p.pump_rate)
        pay(view, p, risen * (before + (middle / time) * (pressure - before)))
        remember(view, p.memory + wp.static(PRESSURE), pressure)
        return follow(state, view, p)

    return {"evolve": powered_evolve, "follow": powered_follow}


@functools.cache
def made(features):
    """The same engine with "power" or "profile"."""
    roles = {"law": law, "evolve": evolve, "follow": follow}
    profiled = "profile" in features
    if profiled:
        roles["law"] = law_in_profile
    if "power" in features:
        roles |= make_powered(pressure_in_profile if profiled else pressure_at)
    return device(__name__, features, params=make_params_of(features), FOLLOWS_PLACE=True, **roles)
