# SPDX-License-Identifier: Apache-2.0
"""Model predictive control: the best inputs over a horizon within their limits, by an interior-point method."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import any_positive
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.convergence import by_digits, clear, count_unconverged
from lgvi_kernels.laws.control.integral import remember3, remembered3
from lgvi_kernels.laws.control.pose_error import attitude_error, rate_error, velocity_error

# Errors that may be states, in the order in which `see` writes them; components of a demand; numbers of a reference.
SEEN = 12
DEMAND = 6
WANTED = 18

# Rows of the table, with n states, m inputs and k = horizon m: places of the states, of the inputs; A, B; largest
# inputs, and as parts of these the least ones and the limits of changes, m each; the best inputs without limits (k, 2 n) of
# state and disturbance; the slope of the cost, (k, 2 n); and its matrix, column by column down from the diagonal.
# Rows of the memory: whether it has begun; the state (n), the inputs (m) and the disturbance (n); the reference (WANTED).
# Constraints |C v - middle| <= half are the k inputs, then where `rated` their k changes. Each has twelve scratch rows, two by
# two, above and below: slacks, multipliers, 1 / slacks, what a step is to make of slack times multiplier, 1 / multipliers, and
# how far the slacks are from what the inputs leave.
OF_EACH = 12


# The gain of the disturbance; first rows of table, memory, scratch and of what was not delivered; counts.
# rated: whether changes of inputs have limits.
params = make_params(
    "LinearMPC",
    lanes="gain",
    words="first memory work unmet states inputs horizon iterations rated unconverged",
)


@wp.func
def see(r: Any, y: Any, row: int):
    """Write all errors, measured less wanted."""
    remember3(y, row, y.position - r.position)
    remember3(y, row + 3, attitude_error(r, y))
    remember3(y, row + 6, neg(velocity_error(r, y)))
    remember3(y, row + 9, neg(rate_error(r, y)))


@wp.func
def see_later(r: Any, y: Any, row: int, time: Any):
    """Write all errors against a reference that went on at its rates for a time."""
    see(r, y, row)
    remember3(y, row, remembered3(y, row) - time * r.velocity)
    turn = to_body(y, to_inertial(r, r.angular_velocity))
    remember3(y, row + 3, remembered3(y, row + 3) - time * turn)


@wp.func
def keep_wanted(r: Any, y: Any, row: int):
    """Keep a reference for the next tick."""
    remember3(y, row, r.position)
    remember3(y, row + 3, r.velocity)
    remember3(y, row + 6, r.north)
    remember3(y, row + 9, r.east)
    remember3(y, row + 12, r.down)
    remember3(y, row + 15, r.angular_velocity)


@wp.func
def kept_wanted(r: Any, y: Any, row: int):
    """The reference of the last tick."""
    r.position = remembered3(y, row)
    r.velocity = remembered3(y, row + 3)
    r.north = remembered3(y, row + 6)
    r.east = remembered3(y, row + 9)
    r.down = remembered3(y, row + 12)
    r.angular_velocity = remembered3(y, row + 15)
    return r


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
def estimate(r: Any, y: Any, p: Any, matrices: int):
    """The disturbance d: what the model of a period lacks, by a filter of first order.

    The model predicts errors against the last reference, which goes on at its rates: what guidance changed is no disturbance.
    """
    n = p.states
    m = p.inputs
    last = p.memory + 1
    wanted = last + 2 * n + m
    begun = remembered(y, p.memory)
    see_later(kept_wanted(r, y, wanted), y, p.work, y.period)
    keep_wanted(r, y, wanted)
    for i in range(n):
        d = remembered(y, last + n + m + i)
        lacking = remembered(y, p.work + place(y, p.first + i)) - d
        lacking = lacking - times(y, matrices + i * n, last, n, d - d)
        lacking = lacking - times(y, matrices + n * n + i * m, last + n, m, d - d)
        remember(y, last + n + m + i, d + begun * (p.gain * lacking))


@wp.func
def half(y: Any, p: Any, limits: int, j: int, unity: Any):
    """Half of the width of a constraint."""
    k = p.horizon * p.inputs
    width = unity
    if j >= k:
        width = row1(y, limits + 2 * p.inputs + j % p.inputs) * unity
    return width


@wp.func
def constrained(y: Any, p: Any, v: int, before: int, j: int):
    """C v of a constraint; rows `before` hold the inputs before the first, or, of a step, 0."""
    k = p.horizon * p.inputs
    i = j
    if j >= k:
        i = j - k
    value = remembered(y, v + i)
    if j >= k:
        if i < p.inputs:
            value = value - remembered(y, before + i)
        else:
            value = value - remembered(y, v + i - p.inputs)
    return value


@wp.func
def spread(y: Any, p: Any, to: int, j: int, value: Any):
    """Add C^T times a number of a constraint to rows of inputs."""
    k = p.horizon * p.inputs
    i = j
    if j >= k:
        i = j - k
    remember(y, to + i, remembered(y, to + i) + value)
    if j >= k:
        if i >= p.inputs:
            remember(y, to + i - p.inputs, remembered(y, to + i - p.inputs) - value)


@wp.func
def entry(k: int, i: int, j: int):
    """The place of a number of a symmetric matrix of k lines, i >= j, column by column down from the diagonal."""
    return (j * (2 * k - j - 1)) // 2 + i


@wp.func(inline=False)
def cholesky(y: Any, k: int, L: int):
    """The Cholesky factor of a matrix in its place, with inverses on its diagonal.

    Four numbers of a column at once: their sums do not wait for one another. Rows behind the last of a column are read, not
    used. In `while` loops, since the step of a `range` is a number that each turn adds.
    """
    least_pivot = by_digits(y, y.h.dtype(1e-15), y.h.dtype(1e-7))
    for j in range(k):
        diagonal = L + entry(k, j, j)
        i = int(j)
        while i < k:
            at = diagonal + i - j
            a = remembered(y, at)
            b = remembered(y, at + 1)
            c = remembered(y, at + 2)
            d = remembered(y, at + 3)
            smallest = least_pivot * absolute(a)
            line = int(L + i)
            other = int(L + j)
            q = int(0)
            while q < j:
                known = remembered(y, other)
                a = a - remembered(y, line) * known
                b = b - remembered(y, line + 1) * known
                c = c - remembered(y, line + 2) * known
                d = d - remembered(y, line + 3) * known
                q += 1
                line += k - q
                other += k - q
            if i == j:
                remember(y, at, ones(a) / root(positive(a - smallest, a, smallest)))
            else:
                remember(y, at, a * remembered(y, diagonal))
            if i + 1 < k:
                remember(y, at + 1, b * remembered(y, diagonal))
            if i + 2 < k:
                remember(y, at + 2, c * remembered(y, diagonal))
            if i + 3 < k:
                remember(y, at + 3, d * remembered(y, diagonal))
            i += 4


@wp.func(inline=False)
def solve_factored(y: Any, k: int, L: int, to: int):
    """Solve with the Cholesky factor, in place."""
    for j in range(k):
        at = L + entry(k, j, j)
        known = remembered(y, to + j) * remembered(y, at)
        remember(y, to + j, known)
        less_rows(y, to + j + 1, known, at + 1, k - 1 - j)
    for m in range(k):
        j = k - 1 - m
        at = L + entry(k, j, j)
        left = less_products(y, at + 1, to + j + 1, m, remembered(y, to + j))
        remember(y, to + j, left * remembered(y, at))


@wp.func(inline=False)
def slope_at(y: Any, k: int, f: int, cost: int, v: int, slope: int, L: int):
    """The slope of the cost at inputs; leaves the cost's matrix in L."""
    for i in range(k):
        remember(y, slope + i, -remembered(y, f + i))
    q = int(0)
    while q < entry(k, k, k - 1):
        remember(y, L + q, row1(y, cost + q))
        q += 1
    for j in range(k):
        at = L + entry(k, j, j)
        less_rows(y, slope + j, remembered(y, v + j), at, k - j)
        remember(y, slope + j, less_products(y, at + 1, v + j + 1, k - 1 - j, remembered(y, slope + j)))
    for i in range(k):
        remember(y, slope + i, -remembered(y, slope + i))


@wp.func
def unconverged(y: Any, k: int, slope: int, gap: Any, off: Any, size: Any, busy: Any):
    """The busy lanes whose gap, sides or slope are not yet small enough; the others are 0."""
    zero = busy - busy
    steep = zero
    for i in range(k):
        steep = greatest(steep, absolute(remembered(y, slope + i)))
    rest = greatest(gap - by_digits(y, y.h.dtype(1e-15), y.h.dtype(1e-7)) * size, zero)
    close = by_digits(y, y.h.dtype(1e-9), y.h.dtype(1e-4))
    rest = greatest(rest, greatest(off - close * ones(busy), steep - close * size))
    return positive(rest, busy, zero)


@wp.func(inline=False)
def look(r: Any, y: Any, p: Any, limits: int, x: int, before: int, zero: Any):
    """State, disturbance and the last inputs, as parts of their limits."""
    n = p.states
    m = p.inputs
    last = p.memory + 1
    unity = ones(zero)
    see(r, y, p.work)
    for i in range(n):
        remember(y, x + i, remembered(y, p.work + place(y, p.first + i)))
    for i in range(m):
        # What was not delivered of the last demand did not act.
        u = remembered(y, last + n + i) - remembered(y, p.unmet + place(y, p.first + n + i))
        remember(y, last + n + i, u)
        u = u / row1(y, limits + i)
        if p.rated > 0:
            # From beyond the limits they go back at once.
            reach = y.h.dtype(0.999) * row1(y, limits + 2 * m + i) * unity
            u = clamp(u, row1(y, limits + m + i) * unity - reach, unity + reach)
        remember(y, before + i, u)
    estimate(r, y, p, limits - n * n - n * m)
    for i in range(n):
        remember(y, x + n + i, remembered(y, last + n + m + i))
        remember(y, last + i, remembered(y, x + i))


@wp.func(inline=False)
def demanded(w: Any, y: Any, p: Any, limits: int, best_of: int, before: int, demand: int, zero: Any):
    """Demand the first of the best inputs, within all limits."""
    n = p.states
    m = p.inputs
    last = p.memory + 1
    unity = ones(zero)
    for i in range(wp.static(DEMAND)):
        remember(y, demand + i, zero)
    for i in range(m):
        u = remembered(y, best_of + i)
        if p.rated > 0:
            step = row1(y, limits + 2 * m + i)
            last_u = remembered(y, before + i)
            u = clamp(u, last_u - step, last_u + step)
        u = clamp(u, row1(y, limits + m + i) * unity, unity) * row1(y, limits + i)
        remember(y, last + n + i, u)
        remember(y, demand + place(y, p.first + n + i), u)
    remember(y, p.memory, unity)
    w.force = w.force + remembered3(y, demand)
    w.torque = w.torque + remembered3(y, demand + 3)
    return w


@wp.func(inline=False)
def factor(y: Any, p: Any, sides: int, L: int, zero: Any):
    """The Cholesky factor of H + C^T diag(multipliers / slacks) C, with inverses on its diagonal, from H in its place."""
    k = p.horizon * p.inputs
    m = p.inputs
    unity = ones(zero)
    for i in range(k):
        advance(y, L + entry(k, i, i), unity, weight(y, sides, i))
        if p.rated > 0:
            change = weight(y, sides, k + i)
            advance(y, L + entry(k, i, i), unity, change)
            if i >= m:
                advance(y, L + entry(k, i - m, i - m), unity, change)
                advance(y, L + entry(k, i, i - m), unity, -change)
    cholesky(y, k, L)


@wp.func
def weight(y: Any, sides: int, j: int):
    """Multipliers over slacks of a constraint."""
    at = sides + wp.static(OF_EACH) * j
    return remembered(y, at + 2) * remembered(y, at + 4) + remembered(y, at + 3) * remembered(y, at + 5)


@wp.func
def missed(y: Any, p: Any, limits: int, at: int, v: int, before: int, j: int, unity: Any):
    """How far the slacks of a constraint are from what its inputs leave, above and below."""
    width = half(y, p, limits, j, unity)
    value = constrained(y, p, v, before, j)
    return value + remembered(y, at) - width, remembered(y, at + 1) - value - width


@wp.func
def moves(y: Any, at: int, change: Any):
    """How slacks and multipliers of a constraint change in a step that changes C v so."""
    d1 = -remembered(y, at + 10) - change
    d2 = change - remembered(y, at + 11)
    m1 = -(remembered(y, at + 6) + remembered(y, at + 2) * d1) * remembered(y, at + 4)
    m2 = -(remembered(y, at + 7) + remembered(y, at + 3) * d2) * remembered(y, at + 5)
    return d1, d2, m1, m2


@wp.func
def advance(y: Any, row: int, length: Any, change: Any):
    """Change a number by a step, in the lanes that make one."""
    old = remembered(y, row)
    remember(y, row, positive(length, old + length * change, old))


@wp.func(inline=False)
def step(y: Any, p: Any, slope: int, to: int, sides: int, L: int, none: int, zero: Any):
    """Newton's step of the inputs; 1 / its largest length that keeps slacks and multipliers above 0, at least 1."""
    unity = ones(zero)
    k = p.horizon * p.inputs
    count = k + p.rated * k
    for i in range(k):
        remember(y, to + i, -remembered(y, slope + i))
    for j in range(count):
        at = sides + wp.static(OF_EACH) * j
        a = (remembered(y, at + 2) * remembered(y, at + 10) - remembered(y, at + 6)) * remembered(y, at + 4)
        b = (remembered(y, at + 3) * remembered(y, at + 11) - remembered(y, at + 7)) * remembered(y, at + 5)
        spread(y, p, to, j, b - a)
    solve_factored(y, k, L, to)
    most = unity
    for j in range(count):
        at = sides + wp.static(OF_EACH) * j
        d1, d2, m1, m2 = moves(y, at, constrained(y, p, to, none, j))
        most = greatest(most, greatest(-d1 * remembered(y, at + 4), -d2 * remembered(y, at + 5)))
        most = greatest(most, greatest(-m1 * remembered(y, at + 8), -m2 * remembered(y, at + 9)))
    return most


@wp.func(inline=False)
def begin(y: Any, p: Any, limits: int, v: int, f: int, cost: int, sides: int, zero: Any):
    """Inputs of 0, slacks of half the width, and multipliers of one size, which is returned."""
    unity = ones(zero)
    k = p.horizon * p.inputs
    size = row1(y, cost) * unity
    for i in range(k):
        size = greatest(size, absolute(remembered(y, f + i)))
        remember(y, v + i, zero)
    for j in range(k + p.rated * k):
        at = sides + wp.static(OF_EACH) * j
        width = half(y, p, limits, j, unity)
        remember(y, at, width)
        remember(y, at + 1, width)
        remember(y, at + 2, size)
        remember(y, at + 3, size)
    return size


@wp.func(inline=False)
def iterate(y: Any, p: Any, limits: int, v: int, f: int, cost: int, sides: int, L: int, before: int, none: int,
            size: Any, busy: Any):  # fmt: skip
    """A step of Mehrotra's predictor and corrector, in the lanes above 0; returns those that have not converged before it."""
    unity = ones(busy)
    zero = unity - unity
    k = p.horizon * p.inputs
    count = k + p.rated * k
    slope = f + k
    to = slope + k
    gap = zero
    off = zero
    slope_at(y, k, f, cost, v, slope, L)
    for j in range(count):
        at = sides + wp.static(OF_EACH) * j
        spread(y, p, slope, j, remembered(y, at + 2) - remembered(y, at + 3))
        r1, r2 = missed(y, p, limits, at, v, before, j, unity)
        remember(y, at + 10, r1)
        remember(y, at + 11, r2)
        off = greatest(off, greatest(absolute(r1), absolute(r2)))
        for q in range(2):
            slack = remembered(y, at + q)
            multiplier = remembered(y, at + 2 + q)
            product = slack * multiplier
            inverse = unity / product
            gap = gap + product
            remember(y, at + 4 + q, multiplier * inverse)
            remember(y, at + 6 + q, product)
            remember(y, at + 8 + q, slack * inverse)
    gap = (y.h.dtype(0.5) / y.h.dtype(count)) * gap
    busy = unconverged(y, k, slope, gap, off, size, busy)
    if any_positive(busy):
        factor(y, p, sides, L, zero)
        length = unity / step(y, p, slope, to, sides, L, none, zero)
        ahead = zero
        for j in range(count):
            at = sides + wp.static(OF_EACH) * j
            d1, d2, m1, m2 = moves(y, at, constrained(y, p, to, none, j))
            ahead = ahead + (remembered(y, at) + length * d1) * (remembered(y, at + 2) + length * m1)
            ahead = ahead + (remembered(y, at + 1) + length * d2) * (remembered(y, at + 3) + length * m2)
            remember(y, at + 6, remembered(y, at + 6) + d1 * m1)
            remember(y, at + 7, remembered(y, at + 7) + d2 * m2)
        share = (y.h.dtype(0.5) / y.h.dtype(count)) * ahead / gap
        aim = share * share * share * gap
        for j in range(count):
            at = sides + wp.static(OF_EACH) * j
            remember(y, at + 6, remembered(y, at + 6) - aim)
            remember(y, at + 7, remembered(y, at + 7) - aim)
        most = step(y, p, slope, to, sides, L, none, zero)
        length = positive(busy, least(unity, y.h.dtype(0.99) / most), zero)
        for j in range(count):
            at = sides + wp.static(OF_EACH) * j
            d1, d2, m1, m2 = moves(y, at, constrained(y, p, to, none, j))
            advance(y, at, length, d1)
            advance(y, at + 1, length, d2)
            advance(y, at + 2, length, m1)
            advance(y, at + 3, length, m2)
        for i in range(k):
            advance(y, v + i, length, remembered(y, to + i))
    return busy


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """State, disturbance, the best inputs without limits and, where these do not keep them, those within; then the first."""
    n = p.states
    m = p.inputs
    k = p.horizon * m
    matrices = p.first + n + m
    limits = matrices + n * n + n * m
    free = limits + 3 * m
    slope_of = free + 2 * n * k
    cost = slope_of + 2 * n * k
    # Scratch: errors, demand; state and disturbance; the last inputs as parts of their limits; the best inputs; inputs, f,
    # slope and step of iterations, and m zeros; the constraints; the factor, behind which three rows are read.
    demand = p.work + wp.static(SEEN)
    x = demand + wp.static(DEMAND)
    before = x + 2 * n
    best_of = before + m
    v = best_of + k
    f = v + k
    none = f + 3 * k
    sides = none + m
    L = sides + wp.static(OF_EACH) * (k + p.rated * k)
    unity = ones(w.force.x)
    zero = unity - unity
    look(r, y, p, limits, x, before, zero)
    over = -unity
    for i in range(k):
        best = times(y, free + 2 * n * i, x, 2 * n, zero)
        remember(y, best_of + i, best)
        over = greatest(over, absolute(best) - unity)
        if p.rated > 0:
            change = best
            if i < m:
                change = best - remembered(y, before + i)
            else:
                change = best - remembered(y, best_of + i - m)
            over = greatest(over, absolute(change) - row1(y, limits + 2 * m + i % m))
    if any_positive(over):
        for i in range(k):
            remember(y, f + i, times(y, slope_of + 2 * n * i, x, 2 * n, zero))
        size = begin(y, p, limits, v, f, cost, sides, zero)
        busy = positive(over, unity, zero)
        turn = int(0)
        while turn < p.iterations and any_positive(busy):
            busy = iterate(y, p, limits, v, f, cost, sides, L, before, none, size, busy)
            turn += 1
        count_unconverged(y, p.unconverged, busy)
        for i in range(m):
            remember(y, best_of + i, positive(over, remembered(y, v + i), remembered(y, best_of + i)))
        clear(y, v, L + entry(k, k, k - 1), zero)
    return demanded(w, y, p, limits, best_of, before, demand, zero)
