"""Control fins that a controller drives: the lift and drag of control_fins.py."""

from typing import Any

import warp as wp

from lgvi_kernels.law import add, cosine, mul, sine, sub  # noqa: F401
from lgvi_kernels.laws import fins
from lgvi_kernels.laws.driven import make_driven
from lgvi_kernels.laws.fins import add_fins, note_lift_and_drag, speed_along

# Rows of one fin: those of fins.ROWS, limit, 1 / lag, limit of the rate.
ROWS = fins.ROWS + 3
driven = make_driven("DrivenFins", ROWS, fins.ROWS, fins.ROWS + 1, fins.ROWS + 2)
params, evolve, follow, report = driven.params, driven.evolve, driven.follow, driven.report
place = driven.place


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D = sum over fins, each seen from its turned axes, as in control_fins.py."""
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        angle = place(view, p, i)
        c = cosine(angle)
        s = sine(angle)
        along = speed_along(view, at)
        across = speed_along(view, at + 6)
        note_lift_and_drag(view, at, c * along + s * across, c * across - s * along, p.work + 2 * i)
    return add_fins(D, view, p.first, wp.static(ROWS), p.count, p.work)
