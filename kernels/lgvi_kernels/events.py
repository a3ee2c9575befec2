"""Events: conditions that stop a member. Each is a law with `distance(view, p)`, positive while the member goes on."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes import add, div, mul, ones, positive, sub  # noqa: F401
from lgvi_kernels.submaps import look, rotate

# Status of the first event of a scene; the next have the next numbers.
FIRST = 16


def make_watch(events, View, shifted):
    """(watch, passage) for these events, each a module with `distance`; their parameters are nested in `c.events`."""
    reached, passed = _chain(events, 0)

    @wp.func
    def see(x: Any, c: Any, h: Any):
        """The view from the user's origin."""
        view = look(View(), x, c, h)
        if wp.static(shifted):
            view.b = view.b + rotate(x, c.inertia.user_origin)
        return view

    @wp.func
    def watch(x: Any, c: Any, h: Any):
        """Raise the alarm of the lanes where a distance is no longer positive: the number of the event."""
        code = reached(see(x, c, h), c.events)
        x.alarm.code = positive(x.alarm.code, x.alarm.code, code)
        return x

    @wp.func
    def passage(before: Any, x: Any, c: Any, h: Any):
        """Square of the part of the step that was made when the event came, by linear interpolation of its distance."""
        f = passed(see(before, c, h), see(x, c, h), c.events)
        return f * f

    return watch, passage


@functools.cache
def _chain(events, number):
    """(reached, passed): the first event that is reached as a status (0: none), and the part of the step before it."""
    distance = events[0].distance
    more = len(events) > 1
    reached_next, passed_next = _chain(events[1:], number + 1) if more else (None, None)

    @wp.func
    def reached(view: Any, p: Any):
        d = distance(view, p.own)
        other = d - d
        if wp.static(more):
            other = reached_next(view, p.rest)
        return positive(d, other, view.h.dtype(wp.static(float(FIRST + number))) * ones(d))

    @wp.func
    def passed(before: Any, view: Any, p: Any):
        d0 = distance(before, p.own)
        d1 = distance(view, p.own)
        other = d1 - d1
        if wp.static(more):
            other = passed_next(before, view, p.rest)
        return positive(d1, other, positive(d0, d0 / (d0 - d1), d0 - d0))

    return reached, passed
