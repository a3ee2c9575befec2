# SPDX-License-Identifier: Apache-2.0
"""Thrusters with more than thrusters.py has: a driver, a limited rate, other curves, loss by the speed, torque."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws import thrust_curves
from lgvi_kernels.laws.driven import make_driven
from lgvi_kernels.laws.scheduled import make_scheduled
from lgvi_kernels.laws.thrust_curves import beyond

# Rows of one thruster: force and torque per newton (6), coefficient ahead and astern, dead band; of a propeller also its axis
# (3), loss of thrust ahead and astern, torque coefficient, loss of torque; then limit, 1 / lag, limit of the rate.
ROWS = 9
PROPELLER_ROWS = 16


@functools.cache
def made(features):
    """The law of thrusters with these features: "driven", "lag", "rate", "polynomial" or "table", "propeller"."""
    propeller, driven = "propeller" in features, "driven" in features
    tables = "table" in features
    shape = "table" if tables else "polynomial" if "polynomial" in features else "square"
    curve = getattr(thrust_curves, f"{shape}_curve")
    first_of_motion = PROPELLER_ROWS if propeller else ROWS
    rows = first_of_motion + 3
    name, places = f"Thrusters_{'_'.join(features)}", (rows, first_of_motion, first_of_motion + 1, first_of_motion + 2)
    following = make_driven(name, *places, features) if driven else make_scheduled(name, *places)
    place = following.place

    @wp.func
    def thruster_law(w: Any, view: Any, p: Any):
        """Thrust = c f(n beyond the dead band) along each thruster, and the torque about its axis."""
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            n = beyond(place(view, p, i), row1(view, at + 8))
            first = p.first + p.shared
            if wp.static(tables):
                first += i * (1 + 3 * p.size)
            thrust = positive(n, row1(view, at + 6), row1(view, at + 7)) * curve(view, first, p.size, n)
            w.force = w.force + thrust * row3(view, at)
            w.torque = w.torque + thrust * row3(view, at + 3)
            if wp.static(propeller):
                w.torque = w.torque + (row1(view, at + 14) * (n * absolute(n))) * row3(view, at + 9)
        return w

    @wp.func
    def thruster_damping(D: Any, view: Any, p: Any):
        """Thrust falls by c_u |n| u, torque by k_u |n| u, u the thruster's speed through the water along its direction."""
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

    roles = {"evolve": following.evolve, "follow": following.follow, "report": following.report}
    if propeller:
        roles |= {"damping": thruster_damping, "push": thruster_push}
    return device(__name__, features, params=following.params, law=thruster_law, **roles)
