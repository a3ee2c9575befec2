"""Thrusters that a controller drives: the thrust curve of thrusters.py, or a polynomial."""

from typing import Any

import warp as wp

from lgvi_kernels.law import add, greatest, mul, neg, ones, row1, row3, sub  # noqa: F401
from lgvi_kernels.laws.driven import make_driven

# Rows of one thruster: force and torque per newton (6), coefficient forward and backward, dead band, limit, 1 / lag, limit of
# the rate.
ROWS = 12
driven = make_driven("DrivenThrusters", ROWS, 9, 10, 11)
params, evolve, follow, report = driven.params, driven.evolve, driven.follow, driven.report
place = driven.place


@wp.func
def law(w: Any, view: Any, p: Any):
    """Thrust = c+ max(n - band, 0)^2 - c- max(-n - band, 0)^2 along each thruster."""
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        n = place(view, p, i)
        zero = ones(n) - ones(n)
        band = row1(view, at + 8)
        ahead = greatest(n - band, zero)
        astern = greatest(-n - band, zero)
        thrust = row1(view, at + 6) * (ahead * ahead) - row1(view, at + 7) * (astern * astern)
        w.force = w.force + thrust * row3(view, at)
        w.torque = w.torque + thrust * row3(view, at + 3)
    return w
