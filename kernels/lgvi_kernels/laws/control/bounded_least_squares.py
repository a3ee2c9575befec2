# SPDX-License-Identifier: Apache-2.0
"""Allocation within limits: efforts whose wrench is nearest to the demand, among those that the actuators can make."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.arithmetic import any_positive
from lgvi_kernels.lanes.rotations import solve3
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.efforts import ROWS as effort_rows
from lgvi_kernels.laws.control.efforts import make_command_for
from lgvi_kernels.laws.control.lost import since
from lgvi_kernels.laws.control.rest import ROWS as rest_rows
from lgvi_kernels.laws.control.rest import rest

# Rows of rest.py, priorities of the components (6), the lines (6) of the pseudo-inverse, one a channel; then of each channel
# those of efforts.py, its wrench by priorities a (6), 1 / weight, and 1 / a.a.
EFFORTS = effort_rows
ROWS = EFFORTS + 8
REST = rest_rows
# What is added to the matrix of free channels, as a part of that of all: they may span less than six components.
LEAST = 1e-3
# An effort is at a limit where it is so near, as a part of the range.
AT_LIMIT = 1e-5
# A component of the error below this part of the demand is none: anti-windup looks at its sign.
DELIVERED = 1e-3


@functools.cache
def params(width, real):
    """Params: first rows of the table and of the commands; count; shared: rows before the curves; size: of a curve.

    sided: whether polynomials astern are others than those ahead; rounds, and sweeps in each.
    """
    words = ("first", "commands", "count", "shared", "size", "sided", "odd", "rounds", "sweeps")
    return struct("BoundedLeastSquares", **dict.fromkeys(words, wp.int32))


@wp.func
def by_priority(y: Any, row: int, v: Any):
    """A vector times the priorities of its components."""
    s = row3(y, row)
    return vec3(s.x * v.x, s.y * v.y, s.z * v.z)


@wp.func
def beyond3(v: Any, size: Any, enough: Any):
    """The components of v whose size is beyond what is enough; 0 for the others."""
    zero = enough - enough
    return vec3(
        positive(absolute(size.x) - enough, v.x, zero),
        positive(absolute(size.y) - enough, v.y, zero),
        positive(absolute(size.z) - enough, v.z, zero),
    )


@wp.func
def lowest(y: Any, at: int, zero: Any):
    """The effort of a channel at full command astern; 0 once it is known to be lost."""
    return positive(since(y, row1(y, at + 10)), zero, zero - row1(y, at + 8) * row1(y, at + 13))


@wp.func
def highest(y: Any, at: int, zero: Any):
    """The effort of a channel at full command ahead; 0 once it is known to be lost."""
    return positive(since(y, row1(y, at + 10)), zero, row1(y, at + 7) * row1(y, at + 12))


@wp.func
def free_channel(y: Any, t: Any, low: Any, high: Any, zero: Any):
    """1 where an effort is between its limits, else 0."""
    unity = ones(t)
    # A step up to a limit ends beside it by round-off.
    near = y.h.dtype(wp.static(AT_LIMIT)) * (high - low)
    return positive(high - near - t, positive(t - low - near, unity, zero), zero)


@wp.func
def solve_blocks(
    p0: Any, p1: Any, p2: Any, q0: Any, q1: Any, q2: Any, r0: Any, r1: Any, r2: Any, force: Any, torque: Any
):
    """(x, z) with [[P, Q], [Q^T, R]] (x; z) = (force; torque), P and R symmetric, by their rows."""
    x = solve3(p0, p1, p2, force)
    # Columns of P^-1 Q.
    a = solve3(p0, p1, p2, vec3(q0.x, q1.x, q2.x))
    b = solve3(p0, p1, p2, vec3(q0.y, q1.y, q2.y))
    c = solve3(p0, p1, p2, vec3(q0.z, q1.z, q2.z))
    qa = vec3(q0.x, q1.x, q2.x)
    qb = vec3(q0.y, q1.y, q2.y)
    qc = vec3(q0.z, q1.z, q2.z)
    s0 = r0 - vec3(dot(qa, a), dot(qa, b), dot(qa, c))
    s1 = r1 - vec3(dot(qb, a), dot(qb, b), dot(qb, c))
    s2 = r2 - vec3(dot(qc, a), dot(qc, b), dot(qc, c))
    z = solve3(s0, s1, s2, torque - vec3(dot(qa, x), dot(qb, x), dot(qc, x)))
    return x - (z.x * a + z.y * b + z.z * c), z


@functools.cache
def made(features):
    """The allocation for efforts as of efforts.py, which sweeps before each solution, or "redistributes" alone."""
    command_for, sweeping = make_command_for(features), "redistributes" not in features

    @wp.func
    def sweep(y: Any, p: Any, channels: int, r: Any, clipped: Any):
        """Move each effort in turn to where the error is least; r: the error, by priorities."""
        zero = clipped - clipped
        for i in range(p.count):
            at = channels + wp.static(ROWS) * i
            a = row3(y, at + wp.static(EFFORTS))
            m = row3(y, at + wp.static(EFFORTS) + 3)
            old = remembered(y, p.commands + i)
            t = old + (dot(a, r.force) + dot(m, r.torque)) * row1(y, at + wp.static(EFFORTS) + 7)
            t = positive(clipped, clamp(t, lowest(y, at, zero), highest(y, at, zero)), old)
            r.force = r.force - (t - old) * a
            r.torque = r.torque - (t - old) * m
            remember(y, p.commands + i, t)
        return r

    @wp.func
    def free_solution(y: Any, p: Any, channels: int, r: Any, zero: Any):
        """(x, z): efforts of free channels change by (a.x + m.z) / weight, the least change that makes r, if one does."""
        none = vec3(zero, zero, zero)
        p0 = none
        p1 = none
        p2 = none
        q0 = none
        q1 = none
        q2 = none
        r0 = none
        r1 = none
        r2 = none
        total = zero
        for i in range(p.count):
            at = channels + wp.static(ROWS) * i
            t = remembered(y, p.commands + i)
            a = row3(y, at + wp.static(EFFORTS))
            m = row3(y, at + wp.static(EFFORTS) + 3)
            cheap = row1(y, at + wp.static(EFFORTS) + 6) * ones(zero)
            total = total + cheap * (dot(a, a) + dot(m, m))
            share = cheap * free_channel(y, t, lowest(y, at, zero), highest(y, at, zero), zero)
            fa = share * a
            fm = share * m
            p0 = p0 + fa.x * a
            p1 = p1 + fa.y * a
            p2 = p2 + fa.z * a
            q0 = q0 + fa.x * m
            q1 = q1 + fa.y * m
            q2 = q2 + fa.z * m
            r0 = r0 + fm.x * m
            r1 = r1 + fm.y * m
            r2 = r2 + fm.z * m
        ridge = y.h.dtype(wp.static(LEAST / 6.0)) * total
        p0.x = p0.x + ridge
        p1.y = p1.y + ridge
        p2.z = p2.z + ridge
        r0.x = r0.x + ridge
        r1.y = r1.y + ridge
        r2.z = r2.z + ridge
        return solve_blocks(p0, p1, p2, q0, q1, q2, r0, r1, r2, r.force, r.torque)

    @wp.func
    def change_of(y: Any, at: int, t: Any, x: Any, z: Any, zero: Any):
        """How the solution changes an effort."""
        a = row3(y, at + wp.static(EFFORTS))
        m = row3(y, at + wp.static(EFFORTS) + 3)
        share = free_channel(y, t, lowest(y, at, zero), highest(y, at, zero), zero)
        return share * row1(y, at + wp.static(EFFORTS) + 6) * (dot(a, x) + dot(m, z))

    @wp.func
    def solve_again(y: Any, p: Any, channels: int, r: Any, clipped: Any):
        """Change the efforts of channels that are not at a limit, up to the first limit, or each up to its own."""
        zero = clipped - clipped
        unity = ones(clipped)
        x, z = free_solution(y, p, channels, r, zero)
        length = unity
        if wp.static(sweeping):
            for i in range(p.count):
                at = channels + wp.static(ROWS) * i
                t = remembered(y, p.commands + i)
                change = change_of(y, at, t, x, z, zero)
                room = positive(change, highest(y, at, zero) - t, t - lowest(y, at, zero))
                size = absolute(change)
                # room / size where that is below 1.
                length = positive(size * length - room, room / positive(size, size, unity), length)
        for i in range(p.count):
            at = channels + wp.static(ROWS) * i
            old = remembered(y, p.commands + i)
            t = old + length * change_of(y, at, old, x, z, zero)
            t = positive(clipped, clamp(t, lowest(y, at, zero), highest(y, at, zero)), old)
            r.force = r.force - (t - old) * row3(y, at + wp.static(EFFORTS))
            r.torque = r.torque - (t - old) * row3(y, at + wp.static(EFFORTS) + 3)
            remember(y, p.commands + i, t)
        return r

    @wp.func
    def allocate_within(w: Any, y: Any, p: Any):
        """Efforts t of least sum (priority (w - B t))^2 within the limits; undelivered is what they do not make of w."""
        undelivered = rest(w, y, p.first)
        lines = p.first + wp.static(REST + 6)
        channels = lines + 6 * p.count
        unity = ones(y.position.x)
        zero = unity - unity
        # The pseudo-inverse's efforts, each up to its limit: where none is cut off they stay, to the last digit.
        r = w
        r.force = vec3(zero, zero, zero)
        r.torque = r.force
        clipped = zero
        for i in range(p.count):
            at = channels + wp.static(ROWS) * i
            effort = dot(row3(y, lines + 6 * i), w.force) + dot(row3(y, lines + 6 * i + 3), w.torque)
            t = clamp(effort, lowest(y, at, zero), highest(y, at, zero))
            clipped = greatest(clipped, absolute(effort - t))
            r.force = r.force + (effort - t) * row3(y, at + wp.static(EFFORTS))
            r.torque = r.torque + (effort - t) * row3(y, at + wp.static(EFFORTS) + 3)
            remember(y, p.commands + i, t)
        if any_positive(clipped):
            for _ in range(p.rounds):
                if wp.static(sweeping):
                    for _k in range(p.sweeps):
                        r = sweep(y, p, channels, r, clipped)
                r = solve_again(y, p, channels, r, clipped)
        lacking = vec3(zero, zero, zero)
        turning = lacking
        for i in range(p.count):
            at = channels + wp.static(ROWS) * i
            effort = dot(row3(y, lines + 6 * i), w.force) + dot(row3(y, lines + 6 * i + 3), w.torque)
            # What is no number stays so, and the tick sees it.
            t = remembered(y, p.commands + i) + (effort - effort)
            lacking = lacking + (effort - t) * row3(y, at)
            turning = turning + (effort - t) * row3(y, at + 3)
            c = positive(t, row1(y, at + 7), row1(y, at + 8))
            # A side without thrust has the coefficient 0, and gets no command.
            remember(y, p.commands + i, positive(c, t / positive(c, c, unity), t))
        command_for(y, p, channels, wp.static(ROWS))
        first = p.first + wp.static(REST)
        wanted = by_priority(y, first, w.force)
        turned = by_priority(y, first + 3, w.torque)
        enough = y.h.dtype(wp.static(DELIVERED)) * root(dot(wanted, wanted) + dot(turned, turned))
        undelivered.force = undelivered.force + beyond3(lacking, by_priority(y, first, lacking), enough)
        undelivered.torque = undelivered.torque + beyond3(turning, by_priority(y, first + 3, turning), enough)
        return undelivered

    return device(__name__, features, params=params, allocate=allocate_within)
