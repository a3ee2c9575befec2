# SPDX-License-Identifier: Apache-2.0
"""From the effort of a channel to its command: what allocations by efforts have in common.

Efforts are "linear" in the command, its "square", a polynomial ("powers9" with nine powers) or a "table". Rows of a channel:
the wrench of a unit of effort (6), limit of the command, coefficient ahead and astern, dead band, the time from which it is
known to be lost, what this adds to the number of a set of lost channels, and the largest effort ahead and astern, without the
coefficient.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.thrust_curves import make_polynomial_inverses

ROWS = 14


def make_sizes_for(features):
    """(y, p, i, j, t, u) -> the sizes of the commands of channels i and j, less the dead band, for efforts t and u.

    t, u: efforts over the coefficients of the channels, below 0 astern.
    """
    linear, tables = "linear" in features, "table" in features
    powers = sum(int(word.removeprefix("powers")) for word in features if word.startswith("powers"))
    alike, apart, odd = (None,) * 3
    if powers:
        alike, apart = (make_polynomial_inverses(powers, sided, False) for sided in (False, True))
        odd = make_polynomial_inverses(powers, False, True)

    @wp.func
    def size_by_table(y: Any, p: Any, i: int, t: Any):
        """By the tables of channel i, one a side."""
        inverse = p.first + p.shared + (p.count + 2 * i) * (1 + 3 * p.size)
        size = absolute(t)
        return positive(t, table1(y, inverse, p.size, size), table1(y, inverse + 1 + 3 * p.size, p.size, size))

    @wp.func
    def sizes_for(y: Any, p: Any, i: int, j: int, t: Any, u: Any):
        v = absolute(t)
        w = absolute(u)
        if wp.static(powers > 0):
            curves = p.first + p.shared
            inverses = curves + wp.static(2 * powers)
            if p.odd > 0:
                v, w = odd(y, inverses, curves, v, w, t, u)
            elif p.sided > 0:
                v, w = apart(y, inverses, curves, v, w, t, u)
            else:
                v, w = alike(y, inverses, curves, v, w, t, u)
        elif wp.static(tables):
            v = size_by_table(y, p, i, t)
            w = size_by_table(y, p, j, u)
        elif wp.static(not linear):
            v = root(v)
            w = root(w)
        return v, w

    return sizes_for


def make_command_for(features):
    """(y, p, channels, rows): the rows of the commands hold efforts over their coefficients; put there what makes these.

    channels: first row of the first channel; rows: of each.
    """
    sizes_for = make_sizes_for(features)

    @wp.func
    def put_command(y: Any, p: Any, at: int, i: int, t: Any, size: Any):
        """The size of a command, its dead band added, within the limit; an effort of 0 gets none."""
        effort = absolute(t)
        # In this order what is no number stays so, and the tick sees it.
        size = least(row1(y, at + 6), positive(effort, size + row1(y, at + 9), effort))
        remember(y, p.commands + i, positive(t, size, -size))

    @wp.func
    def command_for(y: Any, p: Any, channels: int, rows: int):
        # Two at a time: each is a long chain of numbers that wait for each other.
        for k in range((p.count + 1) // 2):
            i = 2 * k
            j = wp.min(i + 1, p.count - 1)
            t = remembered(y, p.commands + i)
            u = remembered(y, p.commands + j)
            v, w = sizes_for(y, p, i, j, t, u)
            put_command(y, p, channels + rows * i, i, t, v)
            put_command(y, p, channels + rows * j, j, u, w)

    return command_for


def at_speed(params, allocate, features):
    """(params, allocate) of an allocation; with the feature "measured" its efforts make wrenches in proportion to speed^2.

    Those of its rows are then the ones at 1 m/s.
    """
    if "measured" not in features:
        return params, allocate

    @functools.cache
    def params_at_speed(width, real):
        """Params: those of the allocation, the least speed, and the sign of the effect astern."""
        own = {name: var.type for name, var in params(width, real).vars.items()}
        return struct("AtSpeed", **own, least_speed=lane(width, real), astern=lane(width, real))

    @wp.func
    def allocate_at_speed(w: Any, y: Any, p: Any):
        """The demand over the square of the measured speed ahead, at least `least_speed`; what is left, times it."""
        size = greatest(absolute(y.water_velocity.x), p.least_speed)
        square = positive(-y.water_velocity.x, p.astern, ones(size)) * size * size
        inverse = ones(square) / square
        w.force = inverse * w.force
        w.torque = inverse * w.torque
        undelivered = allocate(w, y, p)
        undelivered.force = square * undelivered.force
        undelivered.torque = square * undelivered.torque
        return undelivered

    return params_at_speed, allocate_at_speed
