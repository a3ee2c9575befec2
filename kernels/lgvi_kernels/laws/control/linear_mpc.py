# SPDX-License-Identifier: Apache-2.0
"""Model predictive control: the best inputs over a horizon within their limits, by a fixed number of iterations of ADMM."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import any_positive
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.integral import remember3, remembered3
from lgvi_kernels.laws.control.pose_error import attitude_error, rate_error, velocity_error

# Errors that may be states, in the order in which `see` writes them; components of a demand.
SEEN = 12
DEMAND = 6

# Rows of the table, with n states, m inputs and k = horizon m: places of the states, of the inputs; A, B; limits of inputs and
# of their changes (as parts of these), m each; the best inputs without limits (k, 2 n) of state and disturbance; what they are
# in an iteration, (k, 2 n); and what an iteration does (k, k).
# Rows of the memory: whether it has begun; the state (n), the inputs (m) and the disturbance (n); t of each input (k), and of
# each change (k).


@functools.cache
def params(width, real):
    """Params: the gain of the disturbance; first rows of table, memory, scratch and of what was not delivered; counts.

    rated: whether changes of inputs have limits.
    """
    words = ("first", "memory", "work", "unmet", "states", "inputs", "horizon", "iterations", "rated")
    return struct("LinearMPC", gain=lane(width, real), **dict.fromkeys(words, wp.int32))


@wp.func
def see(r: Any, y: Any, row: int):
    """Write all errors, measured less wanted."""
    remember3(y, row, y.position - r.position)
    remember3(y, row + 3, attitude_error(r, y))
    remember3(y, row + 6, neg(velocity_error(r, y)))
    remember3(y, row + 9, neg(rate_error(r, y)))


@wp.func
def place(y: Any, row: int):
    """A whole number of the table, the same in all lanes."""
    return int(row1(y, row)[0])


@wp.func
def times(y: Any, row: int, at: int, count: int, total: Any):
    """total + a line of the table times rows of the memory."""
    for j in range(count):
        total = total + row1(y, row + j) * remembered(y, at + j)
    return total


@wp.func
def reflected(t: Any, limit: Any):
    """2 z - t, z being t within its limit."""
    z = clamp(t, -limit, limit)
    return z + z - t


@wp.func
def beyond(t: Any, limit: Any):
    """What of t is beyond its limit."""
    return t - clamp(t, -limit, limit)


@wp.func
def estimate(y: Any, p: Any, x: int, matrices: int):
    """The disturbance d: what the model of a period lacks, by a filter of first order."""
    n = p.states
    m = p.inputs
    last = p.memory + 1
    begun = remembered(y, p.memory)
    for i in range(n):
        d = remembered(y, last + n + m + i)
        lacking = remembered(y, x + i) - d
        lacking = lacking - times(y, matrices + i * n, last, n, d - d)
        lacking = lacking - times(y, matrices + n * n + i * m, last + n, m, d - d)
        remember(y, last + n + m + i, d + begun * (p.gain * lacking))


@wp.func(inline=False)
def iterate(y: Any, p: Any, limits: int, does: int, t: int, fixed: int, rhs: int, before: int):
    """One iteration: v = W (2 z - t) + fixed, the part of v that stays, and t = v + t - z."""
    m = p.inputs
    k = p.horizon * m
    unity = ones(remembered(y, t))
    for i in range(k):
        q = reflected(remembered(y, t + i), unity)
        if p.rated > 0:
            limit = row1(y, limits + m + i % m)
            q = q + reflected(remembered(y, t + k + i), limit)
            if i < m:
                q = q + remembered(y, before + i)
            if i + m < k:
                q = q - reflected(remembered(y, t + k + i + m), limit)
        remember(y, rhs + i, q)
    for i in range(k):
        v = times(y, does + i * k, rhs, k, remembered(y, fixed + i))
        old = remembered(y, t + i)
        remember(y, t + i, v + beyond(old, unity))
        if p.rated > 0:
            change = v
            if i < m:
                change = v - remembered(y, before + i)
            else:
                change = v - remembered(y, rhs + k + i - m)
            remember(y, rhs + k + i, v)
            limit = row1(y, limits + m + i % m)
            remember(y, t + k + i, change + beyond(remembered(y, t + k + i), limit))


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """State, disturbance, the best inputs without limits and, where these do not keep them, ADMM; then the first of them."""
    n = p.states
    m = p.inputs
    k = p.horizon * m
    matrices = p.first + n + m
    limits = matrices + n * n + n * m
    free = limits + 2 * m
    fixed_of = free + 2 * n * k
    does = fixed_of + 2 * n * k
    # Scratch: errors, demand; state and disturbance; the last inputs as parts of their limits; v, fixed, rhs, and v again.
    demand = p.work + wp.static(SEEN)
    x = demand + wp.static(DEMAND)
    before = x + 2 * n
    v = before + m
    fixed = v + k
    rhs = fixed + k
    last = p.memory + 1
    t = last + 2 * n + m
    unity = ones(w.force.x)
    zero = unity - unity
    see(r, y, p.work)
    for i in range(n):
        remember(y, x + i, remembered(y, p.work + place(y, p.first + i)))
    for i in range(m):
        # What was not delivered of the last demand did not act.
        u = remembered(y, last + n + i) - remembered(y, p.unmet + place(y, p.first + n + i))
        remember(y, last + n + i, u)
        remember(y, before + i, u / row1(y, limits + i))
    estimate(y, p, x, matrices)
    for i in range(n):
        remember(y, x + n + i, remembered(y, last + n + m + i))
        remember(y, last + i, remembered(y, x + i))
    over = -unity
    for i in range(k):
        best = times(y, free + 2 * n * i, x, 2 * n, zero)
        remember(y, v + i, best)
        over = greatest(over, absolute(best) - unity)
        if p.rated > 0:
            change = best
            if i < m:
                change = best - remembered(y, before + i)
            else:
                change = best - remembered(y, v + i - m)
            over = greatest(over, absolute(change) - row1(y, limits + m + i % m))
    # From where the last tick ended, a period later.
    for i in range(k - m):
        remember(y, t + i, remembered(y, t + i + m))
        if p.rated > 0:
            remember(y, t + k + i, remembered(y, t + k + i + m))
    if any_positive(over):
        for i in range(k):
            remember(y, fixed + i, times(y, fixed_of + 2 * n * i, x, 2 * n, zero))
        for _ in range(p.iterations):
            iterate(y, p, limits, does, t, fixed, rhs, before)
    # A lane leaves nothing behind that others made it calculate.
    for i in range(3 * k):
        remember(y, fixed + i, zero)
    for i in range(k):
        best = remembered(y, v + i)
        remember(y, t + i, positive(over, remembered(y, t + i), best))
        if p.rated > 0:
            change = best
            if i < m:
                change = best - remembered(y, before + i)
            else:
                change = best - remembered(y, v + i - m)
            remember(y, t + k + i, positive(over, remembered(y, t + k + i), change))
    for i in range(wp.static(DEMAND)):
        remember(y, demand + i, zero)
    for i in range(m):
        u = remembered(y, t + i)
        if p.rated > 0:
            step = row1(y, limits + m + i)
            last_u = remembered(y, before + i)
            u = clamp(u, last_u - step, last_u + step)
        u = clamp(u, -unity, unity) * row1(y, limits + i)
        remember(y, last + n + i, u)
        remember(y, demand + place(y, p.first + n + i), u)
    remember(y, p.memory, unity)
    w.force = w.force + remembered3(y, demand)
    w.torque = w.torque + remembered3(y, demand + 3)
    return w
