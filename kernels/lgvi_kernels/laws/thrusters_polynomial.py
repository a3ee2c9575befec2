# SPDX-License-Identifier: Apache-2.0
"""Thrusters whose thrust is a polynomial of the command, one ahead and one astern; all else is as in thrusters.py."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.thrust_curves import powers_of
from lgvi_kernels.laws.thrusters import ROWS, evolve, follow, place_of  # noqa: F401


@functools.cache
def params(width, real):
    """Params: those of thrusters.py, and powers, the degree of the polynomials.

    Rows: those of thrusters.py, then the polynomial ahead and the one astern, from the first power up.
    """
    words = ("first", "memory", "count", "knots", "lagged", "powers")
    return struct("ThrustersPolynomial", **dict.fromkeys(words, wp.int32))


@wp.func
def polynomial_law(w: Any, view: Any, p: Any):
    """Thrust = c+ f+(max(n - band, 0)) - c- f-(max(-n - band, 0)) along each thruster."""
    zero = ones(view.b.x) - ones(view.b.x)
    curve = p.first + p.count * (wp.static(ROWS) + 1 + 3 * p.knots)
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        n = place_of(view, p, i)
        band = row1(view, at + 8)
        ahead = powers_of(view, curve, p.powers, greatest(n - band, zero))
        astern = powers_of(view, curve + p.powers, p.powers, greatest(-n - band, zero))
        thrust = row1(view, at + 6) * ahead - row1(view, at + 7) * astern
        w.force = w.force + thrust * row3(view, at)
        w.torque = w.torque + thrust * row3(view, at + 3)
    return w


# By a name of its own, so that the numbers by which Warp tells functions of one name apart stay those of other scenes.
law = polynomial_law
