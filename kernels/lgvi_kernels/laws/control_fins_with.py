# SPDX-License-Identifier: Apache-2.0
"""Control fins with more than control_fins.py has: a driver, a lag, a table of lift, or no angle of the flow."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws import fins
from lgvi_kernels.laws.driven import make_driven
from lgvi_kernels.laws.fins import add_fins, lift_and_drag, push_fin, speed_along
from lgvi_kernels.laws.scheduled import make_scheduled

# Rows of one fin that its forces need where the flow has no angle: the first of fins.ROWS. Behind those that a law has are
# limit, 1 / lag and limit of the rate.
STRAIGHT_ROWS = fins.MATRICES[0]


@functools.cache
def made(features):
    """The law of control fins with these features: "driven", "lag", "rate", "lift" (a table), "straight" (no flow angle)."""
    lift, straight = "lift" in features, "straight" in features
    first_of_motion = STRAIGHT_ROWS if straight else fins.ROWS
    rows = first_of_motion + 3
    name, places = (
        f"ControlFins_{'_'.join(features)}",
        (rows, first_of_motion, first_of_motion + 1, first_of_motion + 2),
    )
    following = make_driven(name, *places, features) if "driven" in features else make_scheduled(name, *places)
    place = following.place

    @wp.func
    def lift_at(view: Any, p: Any, angle: Any):
        """The table's value, with the sign of the angle."""
        value = table1(view, p.first + p.shared, p.size, absolute(angle))
        return positive(angle, value, -value)

    @wp.func
    def turned_lift_and_drag(view: Any, p: Any, i: int, at: int, ahead: Any, aside: Any):
        """(l, d) of fin i as of lift_and_drag, seen from its turned axes; ahead, aside: the flow along those not turned."""
        angle = place(view, p, i)
        c = cosine(angle)
        s = sine(angle)
        along = c * ahead + s * aside
        across = c * aside - s * ahead
        lift_size, drag_size = lift_and_drag(view, at, along, across)
        if wp.static(lift):
            speed = root(along * along + across * across)
            lift_size = row1(view, at + 12) * (speed * lift_at(view, p, arctangent2(across, along)))
        return lift_size, drag_size

    @wp.func
    def turned_damping(D: Any, view: Any, p: Any):
        """D = sum over fins, each seen from its turned axes, as in control_fins.py."""
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            l, d = turned_lift_and_drag(view, p, i, at, speed_along(view, at), speed_along(view, at + 6))  # noqa: E741
            remember(view, p.work + 2 * i, l)
            remember(view, p.work + 2 * i + 1, d)
        return add_fins(D, view, p.first, wp.static(rows), p.count, p.work)

    @wp.func
    def turned_push(w: Any, view: Any, p: Any):
        """w and the wrench of each fin."""
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            ahead = speed_along(view, at)
            aside = speed_along(view, at + 6)
            l, d = turned_lift_and_drag(view, p, i, at, ahead, aside)  # noqa: E741
            w = push_fin(w, view, at, ahead, aside, l, d)
        return w

    @wp.func
    def straight_up_and_back(view: Any, p: Any, i: int, at: int, along: Any):
        """Lift and drag over the speed u along the chord: (rho A / 2) slope d u, (rho A / 2) (drag + drag_normal d^2) |u|."""
        angle = place(view, p, i)
        turn = angle
        if wp.static(lift):
            turn = lift_at(view, p, angle)
        up = -(row1(view, at + 12) * (turn * along))
        back = (row1(view, at + 13) + row1(view, at + 14) * (angle * angle)) * absolute(along)
        return up, back

    @wp.func
    def straight_damping(D: Any, view: Any, p: Any):
        """D = sum over fins of lift along the normal and drag along the chord, both by the speed along the chord."""
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            up, back = straight_up_and_back(view, p, i, at, speed_along(view, at))
            chord = row3(view, at)
            about = row3(view, at + 3)
            force = up * row3(view, at + 6) + back * chord
            D = add_outer(D, force, up * row3(view, at + 9) + back * about, chord, about)
        return D

    @wp.func
    def straight_push(w: Any, view: Any, p: Any):
        """w and the wrench of each fin."""
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            along = speed_along(view, at)
            up, back = straight_up_and_back(view, p, i, at, along)
            normal = up * along
            chordwise = back * along
            w.force = w.force - normal * row3(view, at + 6) - chordwise * row3(view, at)
            w.torque = w.torque - normal * row3(view, at + 9) - chordwise * row3(view, at + 3)
        return w

    roles = {"evolve": following.evolve, "follow": following.follow, "report": following.report}
    roles |= (
        {"damping": straight_damping, "push": straight_push}
        if straight
        else {"damping": turned_damping, "push": turned_push}
    )
    return device(__name__, features, params=following.params, **roles)
