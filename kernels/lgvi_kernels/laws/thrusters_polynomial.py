# SPDX-License-Identifier: Apache-2.0
"""Thrusters whose thrust is a polynomial of the command, one ahead and one astern; all else is as in thrusters.py."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.thrusters import ROWS, commanded, evolve, follow  # noqa: F401


@functools.cache
def params(width, real):
    """Params: those of thrusters.py, and powers, the degree of the polynomials.

    Rows: those of thrusters.py, then the polynomial ahead and the one astern, from the first power up.
    """
    return struct(
        "ThrustersPolynomial",
        first=wp.int32,
        memory=wp.int32,
        count=wp.int32,
        knots=wp.int32,
        lagged=wp.int32,
        powers=wp.int32,
    )


@wp.func
def polynomial_at(view: Any, first: int, powers: int, w: Any):
    """p1 w + p2 w^2 + ..., by Horner's rule."""
    value = w - w
    for i in range(powers):
        value = (value + row1(view, first + powers - 1 - i)) * w
    return value


@wp.func
def polynomial_law(w: Any, view: Any, p: Any):
    """Thrust = c+ f+(max(n - band, 0)) - c- f-(max(-n - band, 0)) along each thruster."""
    zero = ones(view.b.x) - ones(view.b.x)
    curve = p.first + p.count * (wp.static(ROWS) + 1 + 3 * p.knots)
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        n = zero
        if p.lagged > 0:
            n = remembered(view, p.memory + i)
        else:
            n = commanded(view, p, i, view.t)
        band = row1(view, at + 8)
        ahead = polynomial_at(view, curve, p.powers, greatest(n - band, zero))
        astern = polynomial_at(view, curve + p.powers, p.powers, greatest(-n - band, zero))
        thrust = row1(view, at + 6) * ahead - row1(view, at + 7) * astern
        w.force = w.force + thrust * row3(view, at)
        w.torque = w.torque + thrust * row3(view, at + 3)
    return w


# By a name of its own, so that the numbers by which Warp tells functions of one name apart stay those of other scenes.
law = polynomial_law
