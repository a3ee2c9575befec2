# SPDX-License-Identifier: Apache-2.0
"""Model predictive control with unequal limits, soft limits of outputs and preview, by an interior-point method.

Beside linear_mpc.py, which has the model, the disturbance and the symmetric problem.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.arithmetic import any_positive
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.convergence import clear, count_unconverged
from lgvi_warp.extensions.others.device.linear_mpc import (
    DEMAND,
    SEEN,
    advance,
    cholesky,
    demanded,
    entry,
    look,
    place,
    see,
    see_later,
    slope_at,
    solve_factored,
    times,
    unconverged,
)

# Rows of the table as in linear_mpc.py, then of each of q outputs at each tick: its limit, the cost of a unit beyond it, what
# state and disturbance make of it (2 n), what the inputs make of it (k). With preview, what shifts of the reference make of
# the best inputs without limits and of the slope of the cost, (k, horizon n) each, and the lines of the outputs (q, n).
# Rows of the memory as in linear_mpc.py.
# Sides C v <= room are k inputs from above and from below, where `rated` their changes too, and the outputs, which may exceed
# theirs. Scratch rows of a side: slack, multiplier, excess, the rest of its cost (a unit's cost less the multiplier), room;
# what a step is to make of slack times multiplier, and of excess times the rest; its weight in Newton's matrix, and how far
# slack and excess are from its inputs. The rest is kept, not computed: near a solution it is far below the cost's round-off.
OF_SIDE = 9
SLACK, MULTIPLIER, EXCESS, REST, ROOM, TARGET, TARGET_OF_EXCESS, WEIGHT, MISSED = range(9)

params = make_params(
    "LimitedMPC",
    lanes="gain",
    words="first memory work unmet states inputs horizon iterations rated unconverged outputs shifts",
)


@wp.func
def hard_sides(p: Any):
    """Number of sides that are kept whatever it costs."""
    return 2 * p.horizon * p.inputs * (1 + p.rated)


@wp.func
def row_of_output(p: Any, outputs: int, t: int):
    """The first row of the output of a side."""
    return outputs + (t - hard_sides(p)) * (2 + 2 * p.states + p.horizon * p.inputs)


@wp.func
def inputs_of(p: Any, t: int):
    """Number of inputs that an output depends on: those before its tick."""
    return ((t - hard_sides(p)) // p.outputs + 1) * p.inputs


@wp.func
def side(y: Any, p: Any, outputs: int, v: int, t: int, zero: Any):
    """C v of a side."""
    k = p.horizon * p.inputs
    value = zero
    if t < hard_sides(p):
        i = t % k
        value = remembered(y, v + i)
        if t >= 2 * k:
            if i >= p.inputs:
                value = value - remembered(y, v + i - p.inputs)
        if (t // k) % 2 == 1:
            value = -value
    else:
        value = times(y, row_of_output(p, outputs, t) + 2 + 2 * p.states, v, inputs_of(p, t), zero)
    return value


@wp.func
def spread(y: Any, p: Any, outputs: int, to: int, t: int, value: Any):
    """Add C^T times a number of a side to rows of inputs."""
    k = p.horizon * p.inputs
    if t < hard_sides(p):
        i = t % k
        signed = value
        if (t // k) % 2 == 1:
            signed = -value
        remember(y, to + i, remembered(y, to + i) + signed)
        if t >= 2 * k:
            if i >= p.inputs:
                remember(y, to + i - p.inputs, remembered(y, to + i - p.inputs) - signed)
    else:
        at = row_of_output(p, outputs, t) + 2 + 2 * p.states
        for i in range(inputs_of(p, t)):
            remember(y, to + i, remembered(y, to + i) + row1(y, at + i) * value)


@wp.func(inline=False)
def factor(y: Any, p: Any, outputs: int, sides: int, L: int, zero: Any):
    """The Cholesky factor of H + C^T diag(weights) C, with inverses on its diagonal, from H in its place."""
    k = p.horizon * p.inputs
    m = p.inputs
    unity = ones(zero)
    weights = sides + wp.static(WEIGHT)
    size = wp.static(OF_SIDE)
    hard = hard_sides(p)
    for i in range(k):
        advance(
            y, L + entry(k, i, i), unity, remembered(y, weights + size * i) + remembered(y, weights + size * (k + i))
        )
        if p.rated > 0:
            up = weights + size * (2 * k + i)
            change = remembered(y, up) + remembered(y, up + size * k)
            advance(y, L + entry(k, i, i), unity, change)
            if i >= m:
                advance(y, L + entry(k, i - m, i - m), unity, change)
                advance(y, L + entry(k, i, i - m), unity, -change)
    for r in range(p.horizon * p.outputs):
        at = row_of_output(p, outputs, hard + r) + 2 + 2 * p.states
        share = remembered(y, weights + size * (hard + r))
        for i in range(inputs_of(p, hard + r)):
            for j in range(i + 1):
                advance(y, L + entry(k, i, j), unity, share * (row1(y, at + i) * row1(y, at + j)))
    cholesky(y, k, L)


@wp.func
def gap_of(y: Any, p: Any, outputs: int, at: int, t: int):
    """What a change of C v of 0 leaves of a side's equations: missed - target / multiplier + target of excess / rest."""
    gap = remembered(y, at + wp.static(MISSED)) - remembered(y, at + wp.static(TARGET)) / remembered(
        y, at + wp.static(MULTIPLIER)
    )
    if t >= hard_sides(p):
        gap = gap + remembered(y, at + wp.static(TARGET_OF_EXCESS)) / remembered(y, at + wp.static(REST))
    return gap


@wp.func
def moves(y: Any, p: Any, outputs: int, at: int, t: int, change: Any):
    """Change of slack, multiplier and excess of a side in a step that changes C v so."""
    multiplier = remembered(y, at + wp.static(MULTIPLIER))
    more = remembered(y, at + wp.static(WEIGHT)) * (change + gap_of(y, p, outputs, at, t))
    slack = -(remembered(y, at + wp.static(TARGET)) + remembered(y, at + wp.static(SLACK)) * more) / multiplier
    excess = more - more
    if t >= hard_sides(p):
        target = remembered(y, at + wp.static(TARGET_OF_EXCESS)) - remembered(y, at + wp.static(EXCESS)) * more
        excess = -target / remembered(y, at + wp.static(REST))
    return slack, more, excess


@wp.func(inline=False)
def step(y: Any, p: Any, outputs: int, slope: int, to: int, sides: int, L: int, zero: Any):
    """Newton's step of the inputs; 1 / its largest length that keeps all that must be positive so, at least 1."""
    k = p.horizon * p.inputs
    hard = hard_sides(p)
    count = hard + p.horizon * p.outputs
    for i in range(k):
        remember(y, to + i, -remembered(y, slope + i))
    for t in range(count):
        at = sides + wp.static(OF_SIDE) * t
        spread(y, p, outputs, to, t, -(remembered(y, at + wp.static(WEIGHT)) * gap_of(y, p, outputs, at, t)))
    solve_factored(y, k, L, to)
    most = ones(zero)
    for t in range(count):
        at = sides + wp.static(OF_SIDE) * t
        slack, more, excess = moves(y, p, outputs, at, t, side(y, p, outputs, to, t, zero))
        most = greatest(most, -slack / remembered(y, at + wp.static(SLACK)))
        most = greatest(most, -more / remembered(y, at + wp.static(MULTIPLIER)))
        if t >= hard:
            most = greatest(most, -excess / remembered(y, at + wp.static(EXCESS)))
            most = greatest(most, more / remembered(y, at + wp.static(REST)))
    return most


@wp.func(inline=False)
def begin(y: Any, p: Any, outputs: int, limits: int, lines: int, x: int, before: int, v: int, f: int, cost: int, sides: int,
          zero: Any):  # fmt: skip
    """Inputs of 0, slacks of the room or 1, and multipliers of one size, which is returned.

    lines: first row of the lines of outputs, which shifts of the reference change; 0 without preview.
    """
    unity = ones(zero)
    k = p.horizon * p.inputs
    m = p.inputs
    hard = hard_sides(p)
    size = row1(y, cost) * unity
    for i in range(k):
        size = greatest(size, absolute(remembered(y, f + i)))
        remember(y, v + i, zero)
    for t in range(hard + p.horizon * p.outputs):
        at = sides + wp.static(OF_SIDE) * t
        room = unity
        start = size
        rest = zero
        if t >= hard:
            row = row_of_output(p, outputs, t)
            room = row1(y, row) - times(y, row + 2, x, 2 * p.states, zero)
            if lines > 0:
                tick = (t - hard) // p.outputs
                line = lines + (t - hard) % p.outputs * p.states
                room = room - times(y, line, p.work + p.shifts + tick * p.states, p.states, zero)
            price = row1(y, row + 1) * unity
            start = least(size, y.h.dtype(0.5) * price)
            rest = price - start
        elif t >= 2 * k:
            i = t % k
            room = row1(y, limits + 2 * m + i % m) * unity
            if i < m:
                if t < 3 * k:
                    room = room + remembered(y, before + i)
                else:
                    room = room - remembered(y, before + i)
        elif t >= k:
            room = -row1(y, limits + m + t % m) * unity
        remember(y, at + wp.static(ROOM), room)
        remember(y, at + wp.static(SLACK), greatest(room, unity))
        remember(y, at + wp.static(MULTIPLIER), start)
        remember(y, at + wp.static(EXCESS), greatest(-room, unity))
        remember(y, at + wp.static(REST), rest)
    return size


@wp.func(inline=False)
def iterate(y: Any, p: Any, outputs: int, v: int, f: int, cost: int, sides: int, L: int, size: Any, busy: Any):
    """A step of Mehrotra's predictor and corrector, in the lanes above 0; returns those that have not converged before it."""
    unity = ones(busy)
    zero = unity - unity
    k = p.horizon * p.inputs
    hard = hard_sides(p)
    soft = p.horizon * p.outputs
    count = hard + soft
    slope = f + k
    to = slope + k
    gap = zero
    off = zero
    slope_at(y, k, f, cost, v, slope, L)
    for t in range(count):
        at = sides + wp.static(OF_SIDE) * t
        slack = remembered(y, at + wp.static(SLACK))
        multiplier = remembered(y, at + wp.static(MULTIPLIER))
        spread(y, p, outputs, slope, t, multiplier)
        missed = side(y, p, outputs, v, t, zero) + slack - remembered(y, at + wp.static(ROOM))
        softness = slack / multiplier
        gap = gap + slack * multiplier
        remember(y, at + wp.static(TARGET), slack * multiplier)
        if t >= hard:
            excess = remembered(y, at + wp.static(EXCESS))
            left = remembered(y, at + wp.static(REST))
            missed = missed - excess
            softness = softness + excess / left
            gap = gap + excess * left
            remember(y, at + wp.static(TARGET_OF_EXCESS), excess * left)
        # Relative to the room, which is far above 1 where inputs hardly move an output.
        off = greatest(off, absolute(missed) / greatest(unity, absolute(remembered(y, at + wp.static(ROOM)))))
        remember(y, at + wp.static(MISSED), missed)
        remember(y, at + wp.static(WEIGHT), unity / softness)
    share_of = y.h.dtype(1.0) / y.h.dtype(count + soft)
    gap = share_of * gap
    busy = unconverged(y, k, slope, gap, off, size, busy)
    if any_positive(busy):
        factor(y, p, outputs, sides, L, zero)
        length = unity / step(y, p, outputs, slope, to, sides, L, zero)
        ahead = zero
        for t in range(count):
            at = sides + wp.static(OF_SIDE) * t
            slack, more, excess = moves(y, p, outputs, at, t, side(y, p, outputs, to, t, zero))
            multiplier = remembered(y, at + wp.static(MULTIPLIER)) + length * more
            ahead = ahead + (remembered(y, at + wp.static(SLACK)) + length * slack) * multiplier
            if t >= hard:
                left = remembered(y, at + wp.static(REST)) - length * more
                ahead = ahead + (remembered(y, at + wp.static(EXCESS)) + length * excess) * left
                target = remembered(y, at + wp.static(TARGET_OF_EXCESS)) - excess * more
                remember(y, at + wp.static(TARGET_OF_EXCESS), target)
            remember(y, at + wp.static(TARGET), remembered(y, at + wp.static(TARGET)) + slack * more)
        share = share_of * ahead / gap
        aim = share * share * share * gap
        for t in range(count):
            at = sides + wp.static(OF_SIDE) * t
            remember(y, at + wp.static(TARGET), remembered(y, at + wp.static(TARGET)) - aim)
            if t >= hard:
                remember(y, at + wp.static(TARGET_OF_EXCESS), remembered(y, at + wp.static(TARGET_OF_EXCESS)) - aim)
        most = step(y, p, outputs, slope, to, sides, L, zero)
        length = positive(busy, least(unity, y.h.dtype(0.99) / most), zero)
        for t in range(count):
            at = sides + wp.static(OF_SIDE) * t
            slack, more, excess = moves(y, p, outputs, at, t, side(y, p, outputs, to, t, zero))
            advance(y, at + wp.static(SLACK), length, slack)
            advance(y, at + wp.static(MULTIPLIER), length, more)
            if t >= hard:
                advance(y, at + wp.static(EXCESS), length, excess)
                advance(y, at + wp.static(REST), length, -more)
        for i in range(k):
            advance(y, v + i, length, remembered(y, to + i))
    return busy


@wp.func
def foresee(s: Any, r: Any, y: Any, p: Any):
    """Keep how the errors of the reference s, y.start ticks ahead, differ from those of r as it goes on at its rates."""
    n = p.states
    j = y.start - 1
    if j < p.horizon:
        row = p.work + p.shifts + j * n
        time = y.h.dtype(y.start) * y.period
        see(s, y, p.work)
        for i in range(n):
            remember(y, row + i, remembered(y, p.work + place(y, p.first + i)))
        see_later(r, y, p.work, time)
        for i in range(n):
            remember(y, row + i, remembered(y, row + i) - remembered(y, p.work + place(y, p.first + i)))
    return s


@functools.cache
def made(features):
    """The law; with the feature "preview30" it looks so many ticks ahead."""
    ahead = sum(int(word.removeprefix("preview")) for word in features)

    @wp.func
    def control(w: Any, r: Any, y: Any, p: Any):
        """State, disturbance, the best inputs without limits and, where these break one, those within; then the first."""
        n = p.states
        m = p.inputs
        k = p.horizon * m
        matrices = p.first + n + m
        limits = matrices + n * n + n * m
        free = limits + 3 * m
        slope_of = free + 2 * n * k
        cost = slope_of + 2 * n * k
        outputs = cost + entry(k, k, k - 1)
        # Scratch: errors, demand; state and disturbance; the last inputs as parts of their limits; the best inputs; inputs, f,
        # slope and step of iterations; the sides; the factor.
        demand = p.work + wp.static(SEEN)
        x = demand + wp.static(DEMAND)
        before = x + 2 * n
        best_of = before + m
        v = best_of + k
        f = v + k
        sides = f + 3 * k
        count = hard_sides(p) + p.horizon * p.outputs
        L = sides + wp.static(OF_SIDE) * count
        unity = ones(w.force.x)
        zero = unity - unity
        look(r, y, p, limits, x, before, zero)
        over = -unity
        for i in range(k):
            best = times(y, free + 2 * n * i, x, 2 * n, zero)
            remember(y, best_of + i, best)
            remember(y, f + i, times(y, slope_of + 2 * n * i, x, 2 * n, zero))
            if wp.static(ahead > 0):
                of_shifts = outputs + p.horizon * p.outputs * (2 + 2 * n + k) + i * p.horizon * n
                shifts = p.work + p.shifts
                remember(y, best_of + i, times(y, of_shifts, shifts, p.horizon * n, remembered(y, best_of + i)))
                of_shifts += k * p.horizon * n
                remember(y, f + i, times(y, of_shifts, shifts, p.horizon * n, remembered(y, f + i)))
        lines = wp.static(0)
        if wp.static(ahead > 0):
            lines = outputs + p.horizon * p.outputs * (2 + 2 * n + k) + 2 * k * p.horizon * n
        size = begin(y, p, outputs, limits, lines, x, before, v, f, cost, sides, zero)
        for t in range(count):
            room = remembered(y, sides + wp.static(OF_SIDE) * t + wp.static(ROOM))
            over = greatest(over, side(y, p, outputs, best_of, t, zero) - room)
        if any_positive(over):
            busy = positive(over, unity, zero)
            turn = int(0)
            while turn < p.iterations and any_positive(busy):
                busy = iterate(y, p, outputs, v, f, cost, sides, L, size, busy)
                turn += 1
            count_unconverged(y, p.unconverged, busy)
            for i in range(m):
                remember(y, best_of + i, positive(over, remembered(y, v + i), remembered(y, best_of + i)))
        clear(y, v, L + entry(k, k, k - 1), zero)
        return demanded(w, y, p, limits, best_of, before, demand, zero)

    return device(
        __name__, features, params=params, control=control, foresee=foresee if ahead else None, AHEAD=ahead or None
    )
