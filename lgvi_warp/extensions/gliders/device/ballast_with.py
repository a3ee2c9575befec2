# SPDX-License-Identifier: Apache-2.0
"""Ballast along a schedule or behind a controller: volumes that change, with a lag and at a limited rate."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.sums import carried
from lgvi_kernels.law import *
from lgvi_kernels.laws.driven import make_driven
from lgvi_kernels.laws.scheduled import make_scheduled
from lgvi_warp.extensions.gliders.device.density import column, relative_density

# Rows of one volume: buoyancy of 1 m3 [N] and the same times the point (3); then limit, 1 / lag, limit of the rate.
ROWS = 7
# Where the pumps' work is accounted: then 1 / efficiency, behind the point. Memory of each volume behind those of all: the
# volume at the last look [m3], and the water's pressure there [N/m2], below 0 before the first.
POWERED_ROWS, INVERSE, TALLY = 8, 4, 2


def make_work(following, profiled):
    """The roles evolve and follow, which also account p dV / efficiency where a volume rises."""
    evolve, follow, place, commanded = following.evolve, following.follow, following.place, following.commanded
    look_up = following.look_up
    straight = commanded is not None and evolve is None

    @wp.func
    def account(view: Any, p: Any, i: int, volume: Any, middle: Any):
        """Add what volume i took since the last look. middle: above 0 where the pressure is that of the time between."""
        at = p.first + wp.static(POWERED_ROWS) * i
        tally = p.memory + p.tally + wp.static(TALLY) * i
        zero = volume - volume
        weight = row1(view, at) * view.b.z + dot(row3(view, at + 1), view.down)
        if wp.static(profiled):
            weight = row1(view, at) * column(view, p.first + p.shared, p.size, weight / row1(view, at))
        pressure = greatest(weight, zero)
        last = remembered(view, tally + 1)
        before = positive(last + ones(last), positive(middle, pressure, last), pressure)
        risen = greatest(volume - remembered(view, tally), zero)
        remember(view, tally, volume)
        remember(view, tally + 1, pressure)
        energy = row1(view, at + wp.static(INVERSE)) * (risen * (volume.dtype(0.5) * (before + pressure)))
        if p.account_row >= 0:
            used, low = carried(remembered(view, p.account_row), remembered(view, p.account_row + 1), energy)
            remember(view, p.account_row, used)
            remember(view, p.account_row + 1, low)

    @wp.func
    def work_evolve(state: Any, view: Any, p: Any):
        """The work of a step, with the pressure of its middle."""
        if wp.static(evolve is not None):
            state = evolve(state, view, p)
        if view.second > 0:
            for i in range(p.count):
                volume = ones(view.b.x)
                if wp.static(straight):
                    volume = commanded(view, p, i, view.t + view.h.dtype(0.5) * view.h)
                else:
                    volume = place(view, p, i)
                account(view, p, i, volume, ones(volume))
        return state

    @wp.func
    def work_follow(state: Any, view: Any, p: Any):
        """The work since the last look, with the mean of the pressures at both."""
        if wp.static(follow is not None):
            state = follow(state, view, p)
        if wp.static(look_up is not None):
            look_up(view, p)
        for i in range(p.count):
            volume = place(view, p, i)
            account(view, p, i, volume, volume - volume)
        return state

    return {"evolve": work_evolve, "follow": work_follow}


@functools.cache
def made(features):
    """The law of ballast with these features: "scheduled" or "driven", "lag", "rate", "power", "profile"."""
    make, powered = make_driven if "driven" in features else make_scheduled, "power" in features
    profiled = "profile" in features
    words, rows = (("account_row", "tally"), POWERED_ROWS) if powered else ((), ROWS)
    following = make(f"Ballast_{'_'.join(features)}", rows, rows - 3, rows - 2, rows - 1, features, words)
    place, look_up = following.place, following.look_up

    @wp.func
    def ballast_law(w: Any, view: Any, p: Any):
        """f = -(sum of buoyancies) R^T e3, and its moment."""
        if wp.static(look_up is not None):
            look_up(view, p)
        lift = ones(view.b.x) - ones(view.b.x)
        lever = vec3(lift, lift, lift)
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            volume = place(view, p, i)
            if wp.static(profiled):
                depth = view.b.z + dot(row3(view, at + 1), view.down) / row1(view, at)
                volume = volume * relative_density(view, p.first + p.shared, p.size, depth)
            lift = lift + volume * row1(view, at)
            lever = lever + volume * row3(view, at + 1)
        w.force = w.force - lift * view.down
        w.torque = w.torque - cross(lever, view.down)
        return w

    roles = {"evolve": following.evolve, "follow": following.follow, "report": following.report}
    if powered:
        roles |= make_work(following, profiled) | {"FOLLOWS_PLACE": True}
    return device(__name__, features, params=following.params, law=ballast_law, **roles)
