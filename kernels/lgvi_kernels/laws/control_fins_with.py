# SPDX-License-Identifier: Apache-2.0
"""Control fins: fins that turn about their span to a command, within a limit, with a lag and no faster than a rate.

Explicit methods keep what depends on the time alone, once for all stages at that time (`settle`).
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.arithmetic import any_positive
from lgvi_kernels.law import *
from lgvi_kernels.laws import fins
from lgvi_kernels.laws.driven import make_driven
from lgvi_kernels.laws.fins import add_fins, lift_and_drag, make_fin, speed_along
from lgvi_kernels.laws.patterns import make_unrolled, pattern_words, patterns_of
from lgvi_kernels.laws.scheduled import make_scheduled

# Rows of one fin that its forces need where the flow has no angle: the first of fins.ROWS. Behind those that a law has are
# limit, 1 / lag and limit of the rate.
STRAIGHT_ROWS = fins.MATRICES[0]


# Rows that are kept of each fin.
KEPT = 5


@functools.cache
def made(features):
    """The law of control fins with these features.

    "driven", "lag", "rate", "lift" (a table), "straight" (no flow angle), and the entries of each fin (see fins.make_fin).
    """
    lift, straight, patterns = "lift" in features, "straight" in features, patterns_of(features, "cn")
    first_of_motion = STRAIGHT_ROWS if straight else fins.ROWS
    rows, count = first_of_motion + 3, len(patterns)
    name = f"ControlFins_{'_'.join(word for word in features if word not in pattern_words(features))}"
    places = (rows, first_of_motion, first_of_motion + 1, first_of_motion + 2)
    make = make_driven if "driven" in features else make_scheduled
    following = make(name, *places, features, count=count)
    place, look_up, behind = following.place, following.look_up, following.behind

    @wp.func
    def ready(view: Any, p: Any):
        """Let `place` know where fins are that do not move towards their commands."""
        if wp.static(look_up is not None):
            look_up(view, p)

    @wp.func
    def lift_at(view: Any, p: Any, angle: Any):
        """The table's value, with the sign of the angle."""
        value = table1(view, p.first + p.shared, p.size, absolute(angle))
        return positive(angle, value, -value)

    @wp.func
    def turned_lift_and_drag(view: Any, p: Any, at: int, ahead: Any, aside: Any, c: Any, s: Any):
        """(l, d) of a fin as of lift_and_drag, seen from axes turned by an angle of this cosine and sine.

        ahead, aside: the flow along those not turned.
        """
        along = c * ahead + s * aside
        across = c * aside - s * ahead
        lift_size, drag_size = lift_and_drag(view, at, along, across)
        if wp.static(lift):
            speed = root(along * along + across * across)
            lift_size = row1(view, at + 12) * (speed * lift_at(view, p, arctangent2(across, along)))
        return lift_size, drag_size

    @wp.func
    def turned_damping(D: Any, view: Any, p: Any):
        """D = sum over fins, each seen from its turned axes c' = cos c + sin n, n' = cos n - sin c.

        S and W are those of the axes that are not turned: lift and drag are across and along the flow, so of a fin's angle
        they feel l and d alone.
        """
        ready(view, p)
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            angle = place(view, p, i)
            c = cosine(angle)
            s = sine(angle)
            l, d = turned_lift_and_drag(view, p, at, speed_along(view, at), speed_along(view, at + 6), c, s)  # noqa: E741
            remember(view, behind(p) + 2 * i, l)
            remember(view, behind(p) + 2 * i + 1, d)
        return add_fins(D, view, p.first, wp.static(rows), p.count, behind(p))

    @wp.func
    def straight_up_and_back(view: Any, p: Any, i: int):
        """Lift along the normal and drag along the chord, over u |u|, u the speed along the chord.

        (rho A / 2) slope d, to be taken times u, and (rho A / 2) (drag + drag_normal d^2), times |u|.
        """
        at = p.first + wp.static(rows) * i
        angle = place(view, p, i)
        turn = angle
        if wp.static(lift):
            turn = lift_at(view, p, angle)
        return -(row1(view, at + 12) * turn), row1(view, at + 13) + row1(view, at + 14) * (angle * angle)

    @wp.func
    def straight_damping(D: Any, view: Any, p: Any):
        """D = sum over fins of lift along the normal and drag along the chord, both by the speed along the chord."""
        ready(view, p)
        for i in range(p.count):
            at = p.first + wp.static(rows) * i
            along = speed_along(view, at)
            up, back = straight_up_and_back(view, p, i)
            up = up * along
            back = back * absolute(along)
            chord = row3(view, at)
            about = row3(view, at + 3)
            force = up * row3(view, at + 6) + back * chord
            D = add_outer(D, force, up * row3(view, at + 9) + back * about, chord, about)
        return D

    @wp.func
    def kept(view: Any, p: Any, i: int):
        """Cosine and sine of the angle of fin i, or straight_up_and_back: its wrench at this time follows from them."""
        if wp.static(straight):
            return straight_up_and_back(view, p, i)
        else:
            angle = place(view, p, i)
            return cosine(angle), sine(angle)

    @wp.func
    def first_kept(p: Any, i: int):
        """The first row of what is kept of fin i; before it there are two rows of each fin for the matrix of damping.

        Both numbers of `kept`, and of fins that turn cosine, sine and angle at the start of the step.
        """
        return behind(p) + 2 * p.count + wp.static(KEPT) * i

    @wp.func
    def settle(w: Any, view: Any, p: Any):
        ready(view, p)
        for i in range(wp.static(count) if wp.static(count > 0) else p.count):
            a, b = kept(view, p, i)
            at = first_kept(p, i)
            remember(view, at, a)
            remember(view, at + 1, b)
            if wp.static(not straight):
                remember(view, at + 2, a)
                remember(view, at + 3, b)
                remember(view, at + 4, place(view, p, i))
        return w

    @wp.func
    def settle_later(w: Any, view: Any, p: Any):
        """The same later in the step: in all but a few steps fins have turned little since its start."""
        ready(view, p)
        most = view.b.x.dtype(wp.static(SMALL_TURN)) * ones(view.b.x)
        far = -most
        for i in range(wp.static(count) if wp.static(count > 0) else p.count):
            at = first_kept(p, i)
            turn = place(view, p, i) - remembered(view, at + 4)
            far = greatest(far, absolute(turn) - most)
            c, s = turned_by(remembered(view, at + 2), remembered(view, at + 3), turn)
            remember(view, at, c)
            remember(view, at + 1, s)
        if any_positive(far):
            # Lanes that have turned little keep their bits, whatever their neighbours do.
            for i in range(p.count):
                at = first_kept(p, i)
                own = absolute(place(view, p, i) - remembered(view, at + 4)) - most
                a, b = kept(view, p, i)
                remember(view, at, positive(own, a, remembered(view, at)))
                remember(view, at + 1, positive(own, b, remembered(view, at + 1)))
        return w

    def make_add(entries):
        """(w, view, p, i, a, b) -> w and the wrench of fin i with these entries; a, b: what is kept of it."""
        flow, add_wrench = make_fin(*entries)

        @wp.func
        def add_fin(w: Any, view: Any, p: Any, i: int, a: Any, b: Any):
            at = p.first + wp.static(rows) * i
            ahead, aside = flow(view, at)
            if wp.static(straight):
                return add_wrench(w, view, at, -((b * absolute(ahead)) * ahead), -((a * ahead) * ahead))
            else:
                l, d = turned_lift_and_drag(view, p, at, ahead, aside, a, b)  # noqa: E741
                return add_wrench(w, view, at, l * aside - d * ahead, -(l * ahead) - d * aside)

        return add_fin

    def make_push(kept_before):
        """The wrench of all fins; kept_before: what it needs at this time is kept."""

        def make_alone(i, entries):
            add_fin = make_add(entries)

            @wp.func
            def alone(w: Any, view: Any, p: Any):
                if wp.static(kept_before):
                    at = first_kept(p, wp.static(i))
                    return add_fin(w, view, p, wp.static(i), remembered(view, at), remembered(view, at + 1))
                else:
                    a, b = kept(view, p, wp.static(i))
                    return add_fin(w, view, p, wp.static(i), a, b)

            return alone

        add_fin = make_add(fins.WHOLE)

        @wp.func
        def in_turn(w: Any, view: Any, p: Any):
            for i in range(p.count):
                if wp.static(kept_before):
                    w = add_fin(
                        w, view, p, i, remembered(view, first_kept(p, i)), remembered(view, first_kept(p, i) + 1)
                    )
                else:
                    a, b = kept(view, p, i)
                    w = add_fin(w, view, p, i, a, b)
            return w

        each = in_turn
        if patterns:
            each = make_unrolled([make_alone(i, entries) for i, entries in enumerate(patterns)])

        @wp.func
        def push(w: Any, view: Any, p: Any):
            if wp.static(not kept_before):
                ready(view, p)
            return each(w, view, p)

        return push

    return device(
        __name__,
        features,
        params=following.params,
        evolve=following.evolve,
        follow=following.follow,
        report=following.report,
        damping=straight_damping if straight else turned_damping,
        push=make_push(False),
        settle=settle,
        settle_later=None if straight else settle_later,
        settled_push=make_push(True),
        held=following.held,
    )
