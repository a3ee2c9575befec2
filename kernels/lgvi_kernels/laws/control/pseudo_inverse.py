# SPDX-License-Identifier: Apache-2.0
"""Allocation by a weighted pseudo-inverse: the efforts of least weighted squares that make the demand, as commands."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.efforts import ROWS, at_speed, make_command_for
from lgvi_kernels.laws.control.lost import since
from lgvi_kernels.laws.control.rest import ROWS as rest_rows
from lgvi_kernels.laws.control.rest import rest

# For each set of channels that may be lost together, the empty one first: rows of rest.py, and the lines (6) of the
# pseudo-inverse, one a channel. Then the rows of each channel (efforts.py), the curves and their inverses.
REST = rest_rows


# First rows of the table and of the commands; count; sets; shared: rows before the curves; size: of a curve.
# sided: whether polynomials astern are others than those ahead; odd: whether they are the same, with odd powers alone.
params = make_params("PseudoInverse", words="first commands count sets shared size sided odd")


@wp.func
def positive3(a: Any, b: Any, c: Any):
    """The vector b where a > 0, else c."""
    return vec3(positive(a, b.x, c.x), positive(a, b.y, c.y), positive(a, b.z, c.z))


@functools.cache
def made(features):
    """The allocation for efforts as of efforts.py.

    The feature "lost" says that channels may be known to be lost.
    """
    loses, command_for = "lost" in features, make_command_for(features)

    @wp.func
    def allocate_efforts(w: Any, y: Any, p: Any):
        """t = W^-1 B^T (B W^-1 B^T)^+ w; undelivered are (I - B B^+) w and B times what the commands cannot deliver of t."""
        undelivered = rest(w, y, p.first)
        stride = wp.static(REST) + 6 * p.count
        channels = p.first + p.sets * stride
        unity = ones(y.position.x)
        zero = unity - unity
        lost = zero
        if wp.static(loses):
            for i in range(p.count):
                at = channels + wp.static(ROWS) * i
                lost = lost + positive(since(y, row1(y, at + 10)), row1(y, at + 11), zero)
            for s in range(1, p.sets):
                other = rest(w, y, p.first + s * stride)
                chosen = y.h.dtype(0.5) * unity - absolute(lost - y.h.dtype(s) * unity)
                undelivered.force = positive3(chosen, other.force, undelivered.force)
                undelivered.torque = positive3(chosen, other.torque, undelivered.torque)
        for i in range(p.count):
            at = channels + wp.static(ROWS) * i
            line = p.first + wp.static(REST) + 6 * i
            effort = dot(row3(y, line), w.force) + dot(row3(y, line + 3), w.torque)
            if wp.static(loses):
                for s in range(1, p.sets):
                    turn = line + s * stride
                    other_effort = dot(row3(y, turn), w.force) + dot(row3(y, turn + 3), w.torque)
                    here = y.h.dtype(0.5) * unity - absolute(lost - y.h.dtype(s) * unity)
                    effort = positive(here, other_effort, effort)
            c = positive(effort, row1(y, at + 7), row1(y, at + 8))
            # A side without thrust has the coefficient 0, and gets no command.
            wanted = positive(c, absolute(effort) / c, zero)
            t = least(positive(effort, row1(y, at + 12), row1(y, at + 13)), wanted)
            remember(y, p.commands + i, positive(effort, t, -t))
            # Nothing is cut off, to the last digit, where the curve reaches the effort: anti-windup looks at the sign.
            cut = absolute(effort) - c * t
            cut = positive(wanted - t, cut, zero)
            cut = positive(c, cut, absolute(effort))
            cut = positive(effort, cut, -cut)
            undelivered.force = undelivered.force + cut * row3(y, at)
            undelivered.torque = undelivered.torque + cut * row3(y, at + 3)
        command_for(y, p, channels, wp.static(ROWS))
        return undelivered

    own_params, allocate = at_speed(params, allocate_efforts, features)
    return device(__name__, features, params=own_params, allocate=allocate)
