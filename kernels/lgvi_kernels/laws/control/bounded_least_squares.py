# SPDX-License-Identifier: Apache-2.0
"""Allocation within limits: efforts whose wrench is nearest to the demand, among those that the actuators can make."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.arithmetic import any_positive
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.convergence import by_digits, clear, count_unconverged
from lgvi_kernels.laws.control.efforts import ROWS as effort_rows
from lgvi_kernels.laws.control.efforts import at_speed, make_command_for
from lgvi_kernels.laws.control.lost import since
from lgvi_kernels.laws.control.rest import ROWS as rest_rows
from lgvi_kernels.laws.control.rest import rest

# Rows: those of rest.py; in the order of priority, lines (6) of the components of the demand over the arm, priorities (6) and
# 1 / these^2 (6); the arm; the lines (6) of the solution without limits, one a channel. Then of each channel those of
# efforts.py, its column (6) in that order times the root of 1 / weight, and this root.
LINES_OF_DEMAND = rest_rows
PRIORITIES = LINES_OF_DEMAND + 36
ARM = PRIORITIES + 12
SOLUTION = ARM + 1
EFFORTS = effort_rows
ROWS = EFFORTS + 7
# Scratch rows: the state of each channel (1, -1: at its limit ahead, astern; 0: free) and its goal; the demand, its error b,
# z, c and the slopes, 6 each; the matrices L, E and M; orthonormal lines of the channels (6, channels).
VECTORS, MATRICES = 30, 108


# First rows of the table, of the commands and of the scratch; count; shared: rows before the curves.
# size: of a curve; sided: whether polynomials astern are others than those ahead; iterations: at most; unconverged: row.
params = make_params(
    "BoundedLeastSquares",
    words="first commands count shared size sided odd work iterations unconverged",
)


@wp.func
def beyond3(v: Any, enough: Any):
    """The components of v whose size is beyond what is enough; 0 for the others."""
    zero = enough - enough
    return vec3(
        positive(absolute(v.x) - enough, v.x, zero),
        positive(absolute(v.y) - enough, v.y, zero),
        positive(absolute(v.z) - enough, v.z, zero),
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
def solve_triangle(y: Any, L: int, count: int, b: int, z: int):
    """z with L z = b; the diagonal of L holds inverses, 0 in the lines that are left out."""
    for i in range(count):
        remember(y, z + i, remembered(y, L + 6 * i + i) * less_products(y, L + 6 * i, z, i, remembered(y, b + i)))


@wp.func
def column(y: Any, p: Any, channels: int, i: int, row: int):
    """A component of the scaled column of a channel."""
    return row1(y, channels + wp.static(ROWS) * i + wp.static(EFFORTS) + row)


@wp.func(inline=False)
def orthogonalise(y: Any, p: Any, channels: int, six: int, L: int, lines: int, zero: Any):
    """The lines of the free channels' columns = L (orthonormal lines), by Gram & Schmidt; L has inverses on its diagonal.

    A line that depends on those of higher priority has an inverse of 0. Weighted rows need no scaling: each line has its own
    error, however large the priorities are.
    """
    unity = ones(zero)
    dependent = by_digits(y, y.h.dtype(1e-9), y.h.dtype(3e-4))
    for i in range(six):
        size = zero
        for k in range(p.count):
            a = positive(absolute(remembered(y, p.work + k)), zero, column(y, p, channels, k, i))
            size = size + a * a
            remember(y, lines + i * p.count + k, a)
        remember(y, L + 7 * i, size)
    # Each line leaves all later ones at once: their products do not wait for one another.
    for j in range(six):
        line = lines + j * p.count
        left = zero - less_products(y, line, line, p.count, zero)
        enough = left - (dependent * dependent) * remembered(y, L + 7 * j)
        inverse = positive(enough, unity / root(positive(left, left, unity)), zero)
        remember(y, L + 7 * j, inverse)
        for k in range(p.count):
            remember(y, line + k, inverse * remembered(y, line + k))
        for i in range(j + 1, six):
            other = lines + i * p.count
            c = zero - less_products(y, other, line, p.count, zero)
            remember(y, L + 6 * i + j, c)
            less_rows(y, other, c, line, p.count)


@wp.func(inline=False)
def errors(y: Any, p: Any, six: int, L: int, b: int, noise: Any, zero: Any):
    """y = S^2 r of the least sum of squares of S r, r = b - L z: what b has beside the span of L, weighted by S.

    Lines that depend on others of higher priority have the multiples E of these: r of the former is c = b - E b less what the
    latter give in, and (I + K K^T) v = S c, K = S E S^-1, is a well-conditioned problem.
    """
    unity = ones(zero)
    z = b + 6
    c = b + 12
    slopes = b + 18
    E = L + 36
    M = L + 72
    priority = p.first + wp.static(PRIORITIES)
    solve_triangle(y, L, six, b, z)
    for i in range(six):
        kept = remembered(y, L + 7 * i)
        rest_of = less_products(y, L + 6 * i, z, i, remembered(y, b + i))
        rest_of = positive(kept, zero, positive(absolute(rest_of) - noise, rest_of, zero))
        remember(y, c + i, row1(y, priority + i) * rest_of)
        for m in range(i):
            j = i - 1 - m
            e = remembered(y, L + 6 * i + j)
            for k in range(j + 1, i):
                e = e - remembered(y, E + 6 * i + k) * remembered(y, L + 6 * k + j)
            remember(y, E + 6 * i + j, positive(kept, zero, e * remembered(y, L + 7 * j)))
    # M = I + K K^T, and its Cholesky factor in its place, with inverses on the diagonal.
    for i in range(six):
        s = row1(y, priority + i)
        for j in range(i + 1):
            entry = zero
            for k in range(j):
                product = remembered(y, E + 6 * i + k) * remembered(y, E + 6 * j + k)
                entry = entry + product * row1(y, priority + 6 + k)
            entry = (s * row1(y, priority + j)) * entry
            if i == j:
                entry = root(less_products(y, M + 6 * i, M + 6 * i, i, unity + entry))
                remember(y, M + 7 * i, unity / entry)
            else:
                remember(y, M + 6 * i + j, remembered(y, M + 7 * j) * less_products(y, M + 6 * i, M + 6 * j, j, entry))
    solve_triangle(y, M, six, c, slopes)
    for m in range(six):
        i = six - 1 - m
        v = remembered(y, slopes + i)
        for k in range(i + 1, six):
            v = v - remembered(y, M + 6 * k + i) * remembered(y, slopes + k)
        remember(y, slopes + i, v * remembered(y, M + 7 * i))
    for i in range(six):
        remember(y, slopes + i, row1(y, priority + i) * remembered(y, slopes + i))
    for j in range(six):
        total = remembered(y, slopes + j)
        for i in range(j + 1, six):
            total = total - remembered(y, E + 6 * i + j) * remembered(y, slopes + i)
        remember(y, slopes + j, total)


@wp.func
def gain_of(y: Any, p: Any, channels: int, k: int, slopes: int, flat: Any, width: Any):
    """The slope of a channel away from its limit; 0 where it is flat, and of a channel without a range."""
    zero = width - width
    slope = zero
    steep = zero
    for i in range(6):
        a = column(y, p, channels, k, i)
        slope = slope + a * remembered(y, slopes + i)
        steep = steep + absolute(a)
    gain = zero - remembered(y, p.work + k) * slope
    return positive(width, positive(gain - flat * steep, gain, zero), zero)


@wp.func(inline=False)
def iterate(y: Any, p: Any, channels: int, six: int, demand: int, busy: Any):
    """A step of the active set to the least error of the free channels, up to the first limit; else others leave theirs.

    Returns: above 0 in the lanes that have not found the least error.
    """
    unity = ones(busy)
    zero = unity - unity
    goals = p.work + p.count
    priority = p.first + wp.static(PRIORITIES)
    b = demand + 6
    L = demand + wp.static(VECTORS)
    lines = L + wp.static(MATRICES)
    orthogonalise(y, p, channels, six, L, lines, zero)
    noise = zero
    for i in range(six):
        r = remembered(y, demand + i)
        noise = greatest(noise, absolute(r))
        for k in range(p.count):
            held = positive(absolute(remembered(y, p.work + k)), remembered(y, p.commands + k), zero)
            r = r - column(y, p, channels, k, i) * held
        remember(y, b + i, r)
    errors(y, p, six, L, b, by_digits(y, y.h.dtype(1e-12), y.h.dtype(2e-6)) * noise, zero)
    steepest = zero
    for i in range(six):
        slope = remembered(y, b + 18 + i)
        steepest = greatest(steepest, absolute(slope))
        given = slope * row1(y, priority + 6 + i)
        given = positive(remembered(y, L + 7 * i), given, zero)
        remember(y, b + i, remembered(y, b + i) - given)
    solve_triangle(y, L, six, b, b + 6)
    beside = by_digits(y, y.h.dtype(1e-13), y.h.dtype(2e-6))
    length = unity
    first = zero - unity
    for k in range(p.count):
        at = channels + wp.static(ROWS) * k
        scale = row1(y, at + wp.static(EFFORTS) + 6)
        low = lowest(y, at, zero) / scale
        high = highest(y, at, zero) / scale
        x = remembered(y, p.commands + k)
        goal = zero
        for i in range(six):
            goal = goal + remembered(y, lines + i * p.count + k) * remembered(y, b + 6 + i)
        goal = positive(absolute(remembered(y, p.work + k)), x, goal)
        remember(y, goals + k, goal)
        # Beyond the limit by round-off is at the limit.
        size = absolute(goal - x)
        room = positive(goal - x, high - x, x - low)
        over = size - room - beside * (high - low)
        ratio = positive(over, room / positive(size, size, unity), unity)
        nearer = positive(over, length - ratio, zero)
        first = positive(nearer, y.h.dtype(k) * unity, first)
        length = positive(nearer, ratio, length)
    blocked = first + y.h.dtype(0.5) * unity
    flat = by_digits(y, y.h.dtype(1e-9), y.h.dtype(1e-4)) * steepest
    worst = zero
    freed = zero
    for k in range(p.count):
        at = channels + wp.static(ROWS) * k
        scale = row1(y, at + wp.static(EFFORTS) + 6)
        low = lowest(y, at, zero) / scale
        high = highest(y, at, zero) / scale
        x = remembered(y, p.commands + k)
        goal = remembered(y, goals + k)
        moved = clamp(x + length * (goal - x), low, high)
        here = y.h.dtype(0.5) * unity - absolute(first - y.h.dtype(k) * unity)
        end = positive(goal - x, high, low)
        moved = positive(here, end, moved)
        state = remembered(y, p.work + k)
        found = positive(here, positive(goal - x, unity, zero - unity), state)
        remember(y, p.commands + k, positive(busy, moved, x))
        remember(y, p.work + k, positive(busy, found, state))
        gain = gain_of(y, p, channels, k, b + 18, flat, high - low)
        freed = positive(gain - worst, y.h.dtype(k) * unity, freed)
        worst = greatest(worst, gain)
    # Where no limit was met, the channel of the steepest slope away from its limit goes to its least error, the others held,
    # and so does each whose least error is at its other limit.
    free = positive(blocked, zero, positive(worst, busy, zero))
    if any_positive(free):
        for k in range(p.count):
            at = channels + wp.static(ROWS) * k
            scale = row1(y, at + wp.static(EFFORTS) + 6)
            low = lowest(y, at, zero) / scale
            high = highest(y, at, zero) / scale
            width = high - low
            gain = positive(free, gain_of(y, p, channels, k, b + 18, flat, width), zero)
            curvature = zero
            for i in range(six):
                a = row1(y, priority + i) * column(y, p, channels, k, i)
                curvature = curvature + a * a
            across = gain - (width - beside * width) * curvature
            here = y.h.dtype(0.5) * unity - absolute(freed - y.h.dtype(k) * unity)
            gain = positive(across, gain, positive(here, gain, zero))
            state = remembered(y, p.work + k)
            x = remembered(y, p.commands + k)
            step = state * positive(across, width, gain / positive(gain, curvature, unity))
            step = positive(gain, step, zero)
            remember(y, p.commands + k, positive(gain, positive(across, positive(state, low, high), x - step), x))
            remember(y, p.work + k, positive(gain, positive(across, zero - state, zero), state))
            for i in range(six):
                s = row1(y, priority + i)
                change = (s * s) * (column(y, p, channels, k, i) * step)
                remember(y, b + 18 + i, remembered(y, b + 18 + i) + change)
                flat = greatest(flat, by_digits(y, y.h.dtype(1e-9), y.h.dtype(1e-4)) * absolute(change))
    return positive(blocked, busy, free)


@functools.cache
def made(features):
    """The allocation for efforts as of efforts.py."""
    command_for = make_command_for(features)

    @wp.func(inline=False)
    def solve_within(w: Any, y: Any, p: Any, channels: int, clipped: Any):
        """The efforts of least error, in the lanes where some effort of the fast solution was cut off."""
        unity = ones(clipped)
        zero = unity - unity
        # Not a constant: loops over it stay loops.
        six = int(6)
        demand = p.work + 2 * p.count
        for i in range(six):
            line = p.first + wp.static(LINES_OF_DEMAND) + 6 * i
            remember(y, demand + i, dot(row3(y, line), w.force) + dot(row3(y, line + 3), w.torque))
        for k in range(p.count):
            at = channels + wp.static(ROWS) * k
            t = remembered(y, p.commands + k)
            inside = positive(t - lowest(y, at, zero), zero, zero - unity)
            remember(y, p.work + k, positive(highest(y, at, zero) - t, inside, unity))
            remember(y, p.commands + k, t / row1(y, at + wp.static(EFFORTS) + 6))
        busy = clipped
        step = int(0)
        while step < p.iterations and any_positive(busy):
            busy = iterate(y, p, channels, six, demand, busy)
            step += 1
        count_unconverged(y, p.unconverged, busy)
        for k in range(p.count):
            at = channels + wp.static(ROWS) * k
            t = remembered(y, p.commands + k) * row1(y, at + wp.static(EFFORTS) + 6)
            remember(y, p.commands + k, clamp(t, lowest(y, at, zero), highest(y, at, zero)))
        clear(y, p.work, p.work + 8 * p.count + wp.static(VECTORS + MATRICES), zero)

    @wp.func
    def allocate_within(w: Any, y: Any, p: Any):
        """Efforts t of least sum (priority (w - B t))^2 within the limits; undelivered is what they do not make of w."""
        undelivered = rest(w, y, p.first)
        lines = p.first + wp.static(SOLUTION)
        channels = lines + 6 * p.count
        unity = ones(y.position.x)
        zero = unity - unity
        # Those of least error without limits, each up to its own: where none is cut off they stay, to the last digit.
        clipped = zero
        for i in range(p.count):
            at = channels + wp.static(ROWS) * i
            effort = dot(row3(y, lines + 6 * i), w.force) + dot(row3(y, lines + 6 * i + 3), w.torque)
            t = clamp(effort, lowest(y, at, zero), highest(y, at, zero))
            clipped = greatest(clipped, absolute(effort - t))
            remember(y, p.commands + i, t)
        if any_positive(clipped):
            solve_within(w, y, p, channels, clipped)
        lacking = vec3(zero, zero, zero)
        turning = lacking
        for i in range(p.count):
            at = channels + wp.static(ROWS) * i
            effort = dot(row3(y, lines + 6 * i), w.force) + dot(row3(y, lines + 6 * i + 3), w.torque)
            # What is no number stays so, and the tick sees it.
            t = remembered(y, p.commands + i) + (effort - effort)
            t = positive(clipped, t, effort)
            lacking = lacking + (effort - t) * row3(y, at)
            turning = turning + (effort - t) * row3(y, at + 3)
            c = positive(t, row1(y, at + 7), row1(y, at + 8))
            # A side without thrust has the coefficient 0, and gets no command.
            remember(y, p.commands + i, positive(c, t / positive(c, c, unity), t))
        command_for(y, p, channels, wp.static(ROWS))
        # Components below round-off of the demand count as delivered: anti-windup looks at their sign.
        arm = row1(y, p.first + wp.static(ARM))
        size = root(dot(w.force, w.force) + dot(w.torque, w.torque) / (arm * arm))
        enough = by_digits(y, y.h.dtype(1e-10), y.h.dtype(5e-5)) * size
        undelivered.force = beyond3(undelivered.force + lacking, enough)
        undelivered.torque = beyond3(undelivered.torque + turning, arm * enough)
        return undelivered

    own_params, allocate = at_speed(params, allocate_within, features)
    return device(__name__, features, params=own_params, allocate=allocate)
