# SPDX-License-Identifier: Apache-2.0
"""Thrusters along a schedule or behind a controller: curves, dead band, lag, limited rate, loss by the speed, torque."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws import thrust_curves
from lgvi_kernels.laws.driven import make_driven
from lgvi_kernels.laws.patterns import make_twist, make_unrolled, pattern_words, patterns_of
from lgvi_kernels.laws.scheduled import make_scheduled
from lgvi_kernels.laws.thrust_curves import beyond

# Rows of one thruster: force and torque per newton (6), coefficient ahead and astern, dead band; of a propeller also its axis
# (3), loss of thrust ahead and astern, torque coefficient, loss of torque; then limit, 1 / lag, limit of the rate.
ROWS = 9
PROPELLER_ROWS = 16

# Further whole numbers of thrusters that take power or not: power: the place of its rows among those that all share;
# power_size: intervals of a table. Of a shaft each thruster has two rows: power per |n|^3, and the loss per n |n| and speed.
WORDS = {False: ("plain",), True: ("plain", "power", "power_size")}


@functools.cache
def made(features):
    """The law of thrusters with these features: "scheduled" or "driven", "lag", "rate", a curve, "propeller", and power.

    Power is "watts" of a table, or that of the "shaft".

    The curve is "table", "powers9" of a polynomial with nine powers, and else the square. p.plain: whether in all members
    there is no dead band, and both sides are alike: one coefficient, and one odd curve. What is left out then adds exactly 0.
    """
    propeller, tables = "propeller" in features, "table" in features
    of_shaft, powered = "shaft" in features, bool({"shaft", "watts"} & set(features))
    patterns = patterns_of(features, "f")
    powers = sum(int(word.removeprefix("powers")) for word in features if word.startswith("powers"))
    first_of_motion = PROPELLER_ROWS if propeller else ROWS
    rows = first_of_motion + 3
    name = f"Thrusters_{'_'.join(word for word in features if word not in pattern_words(features))}"
    places = (rows, first_of_motion, first_of_motion + 1, first_of_motion + 2)
    make = make_driven if "driven" in features else make_scheduled
    following = make(name, *places, features, WORDS[powered], len(patterns))
    place, look_up, behind = following.place, following.look_up, following.behind

    def make_law(plain):
        """The sum over the thrusters, which are plain or not."""
        curve = thrust_curves.table_curve if tables else thrust_curves.square_curve
        curve = thrust_curves.make_polynomial_curve(powers, plain) if powers else curve

        @wp.func
        def thrust_of(view: Any, p: Any, i: int):
            """(thrust, command beyond the dead band) of thruster i."""
            at = p.first + wp.static(rows) * i
            n = place(view, p, i)
            factor = row1(view, at + 6)
            if wp.static(not plain):
                n = beyond(n, row1(view, at + 8))
                factor = positive(n, factor, row1(view, at + 7))
            first = p.first + p.shared
            if wp.static(tables):
                first += i * (1 + 3 * p.size)
            return factor * curve(view, p, first, n), n

        def make_add(i, add_twist):
            """The part of thruster i, whose wrench of a unit of thrust has few numbers."""

            @wp.func
            def add_thruster(w: Any, view: Any, p: Any):
                thrust, n = thrust_of(view, p, wp.static(i))
                return add_twist(w, view, p.first + wp.static(rows * i), thrust)

            return add_thruster

        if patterns:
            return make_unrolled([make_add(i, make_twist(*entries)) for i, entries in enumerate(patterns)])

        @wp.func
        def summed(w: Any, view: Any, p: Any):
            for i in range(p.count):
                at = p.first + wp.static(rows) * i
                thrust, n = thrust_of(view, p, i)
                w.force = w.force + thrust * row3(view, at)
                w.torque = w.torque + thrust * row3(view, at + 3)
                if wp.static(propeller):
                    w.torque = w.torque + (row1(view, at + 14) * (n * absolute(n))) * row3(view, at + 9)
            return w

        return summed

    known = make_law("sided" not in features)
    of_any, of_plain = (known, known) if patterns else (make_law(False), make_law(True))

    @wp.func
    def thruster_law(w: Any, view: Any, p: Any):
        """Thrust = c f(n beyond the dead band) along each thruster, and the torque about its axis."""
        if wp.static(look_up is not None):
            look_up(view, p)
        if wp.static(bool(patterns)):
            w = known(w, view, p)
        elif p.plain > 0:
            w = of_plain(w, view, p)
        else:
            w = of_any(w, view, p)
        return w

    @wp.func
    def settle(w: Any, view: Any, p: Any):
        """Keep the wrench of all thrusters at this time; w: no wrench."""
        own = thruster_law(w, view, p)
        at = behind(p)
        remember(view, at, own.force.x)
        remember(view, at + 1, own.force.y)
        remember(view, at + 2, own.force.z)
        remember(view, at + 3, own.torque.x)
        remember(view, at + 4, own.torque.y)
        remember(view, at + 5, own.torque.z)
        return w

    @wp.func
    def settled_law(w: Any, view: Any, p: Any):
        at = behind(p)
        w.force = w.force + vec3(remembered(view, at), remembered(view, at + 1), remembered(view, at + 2))
        w.torque = w.torque + vec3(remembered(view, at + 3), remembered(view, at + 4), remembered(view, at + 5))
        return w

    @wp.func
    def thruster_damping(D: Any, view: Any, p: Any):
        """Thrust falls by c_u |n| u, torque by k_u |n| u, u the thruster's speed through the water along its direction."""
        if wp.static(look_up is not None):
            look_up(view, p)
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            n = beyond(place(view, p, i), row1(view, at + 8))
            size = absolute(n)
            along = row3(view, at)
            about = row3(view, at + 3)
            thrust = size * positive(n, row1(view, at + 12), row1(view, at + 13))
            torque = size * row1(view, at + 15)
            D = add_outer(D, thrust * along, thrust * about + torque * row3(view, at + 9), along, about)
        return D

    @wp.func
    def thruster_push(w: Any, view: Any, p: Any):
        """The same loss of thrust and of torque."""
        if wp.static(look_up is not None):
            look_up(view, p)
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            n = beyond(place(view, p, i), row1(view, at + 8))
            along = row3(view, at)
            about = row3(view, at + 3)
            speed = absolute(n) * (dot(along, view.nu) + dot(about, view.Om))
            thrust = speed * positive(n, row1(view, at + 12), row1(view, at + 13))
            w.force = w.force - thrust * along
            w.torque = w.torque - thrust * about - (speed * row1(view, at + 15)) * row3(view, at + 9)
        return w

    @wp.func
    def thruster_power(watts: Any, view: Any, p: Any):
        """The sum of what each takes at its command beyond the dead band, after lag and limits."""
        if wp.static(look_up is not None):
            look_up(view, p)
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            n = beyond(place(view, p, i), row1(view, at + 8))
            if wp.static(of_shaft):
                along = row3(view, at)
                about = row3(view, at + 3)
                a = dot(along, view.nu) + dot(about, view.Om)
                shaft = p.first + p.shared + p.power + 2 * i
                taken = absolute(n) * (row1(view, shaft) * n * n - row1(view, shaft + 1) * n * a)
                # What drives the shaft gives nothing back.
                watts = watts + greatest(taken, n - n)
            else:
                watts = watts + table1(view, p.first + p.shared + p.power + i * (1 + 3 * p.power_size), p.power_size, n)
        return watts

    roles = {"evolve": following.evolve, "follow": following.follow, "report": following.report, "held": following.held}
    if propeller:
        roles |= {"damping": thruster_damping, "push": thruster_push}
    if powered:
        roles |= {"power": thruster_power}
    return device(
        __name__, features, params=following.params, law=thruster_law, settle=settle, settled_law=settled_law, **roles
    )
