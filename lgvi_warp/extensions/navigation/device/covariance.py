# SPDX-License-Identifier: Apache-2.0
"""A symmetric matrix of a filter in rows of the memory, its lower half row by row, in blocks of three; in place, in lanes.

The number of its rows is an argument, never a constant: Warp would write the loops out. 3x3 matrices are three columns.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import element, set_element
from lgvi_kernels.law import *


@wp.func
def entry(i: int, j: int):
    """Where the number (i, j) is."""
    high = wp.max(i, j)
    return high * (high + 1) // 2 + wp.min(i, j)


@wp.func
def get3(rows: Any, k: int, at: int):
    """Three rows of the memory of packet k."""
    return vec3(element(rows, k, at, 0), element(rows, k, at, 1), element(rows, k, at, 2))


@wp.func
def put3(rows: Any, k: int, at: int, v: Any):
    """Write three rows of the memory of packet k."""
    set_element(rows, k, at, 0, v.x)
    set_element(rows, k, at, 1, v.y)
    set_element(rows, k, at, 2, v.z)


@wp.func
def column(rows: Any, k: int, first: int, block: int, c: int):
    """Numbers (3 block, c) to (3 block + 2, c) of the matrix whose first row is `first`."""
    i = 3 * block
    return vec3(
        element(rows, k, first + entry(i, c), 0),
        element(rows, k, first + entry(i + 1, c), 0),
        element(rows, k, first + entry(i + 2, c), 0),
    )


@wp.func
def put_column(rows: Any, k: int, first: int, block: int, c: int, v: Any):
    """Write them."""
    i = 3 * block
    set_element(rows, k, first + entry(i, c), 0, v.x)
    set_element(rows, k, first + entry(i + 1, c), 0, v.y)
    set_element(rows, k, first + entry(i + 2, c), 0, v.z)


@wp.func
def put_diagonal(rows: Any, k: int, first: int, block: int, a: Any, b: Any, c: Any):
    """Write a block of the diagonal, of which a, b and c are the columns: its lower half counts."""
    i = 3 * block
    set_element(rows, k, first + entry(i, i), 0, a.x)
    set_element(rows, k, first + entry(i + 1, i), 0, a.y)
    set_element(rows, k, first + entry(i + 2, i), 0, a.z)
    set_element(rows, k, first + entry(i + 1, i + 1), 0, b.y)
    set_element(rows, k, first + entry(i + 2, i + 1), 0, b.z)
    set_element(rows, k, first + entry(i + 2, i + 2), 0, c.z)


@wp.func
def combined(v: Any, a: Any, b: Any, c: Any):
    """M v, of the columns of M."""
    return v.x * a + v.y * b + v.z * c


@wp.func(inline=False)
def add_block(rows: Any, k: int, first: int, size: int, i: int, j: int, a: Any, b: Any, c: Any):
    """The covariance after x_i <- x_i + M x_j, of blocks i and j; a, b, c: the columns of M."""
    u0 = column(rows, k, first, i, 3 * j)
    u1 = column(rows, k, first, i, 3 * j + 1)
    u2 = column(rows, k, first, i, 3 * j + 2)
    for m in range(size):
        if m // 3 != i:
            v = column(rows, k, first, i, m) + combined(column(rows, k, first, j, m), a, b, c)
            put_column(rows, k, first, i, m, v)
    # Now (i, j) is new; P_ii + M P_ij^T + P_ij' M^T.
    w0 = column(rows, k, first, i, 3 * j)
    w1 = column(rows, k, first, i, 3 * j + 1)
    w2 = column(rows, k, first, i, 3 * j + 2)
    d0 = column(rows, k, first, i, 3 * i) + combined(vec3(u0.x, u1.x, u2.x), a, b, c)
    d1 = column(rows, k, first, i, 3 * i + 1) + combined(vec3(u0.y, u1.y, u2.y), a, b, c)
    d2 = column(rows, k, first, i, 3 * i + 2) + combined(vec3(u0.z, u1.z, u2.z), a, b, c)
    d0 = d0 + combined(vec3(a.x, b.x, c.x), w0, w1, w2)
    d1 = d1 + combined(vec3(a.y, b.y, c.y), w0, w1, w2)
    d2 = d2 + combined(vec3(a.z, b.z, c.z), w0, w1, w2)
    put_diagonal(rows, k, first, i, d0, d1, d2)


@wp.func(inline=False)
def turn_block(rows: Any, k: int, first: int, size: int, i: int, a: Any, b: Any, c: Any):
    """The covariance after x_i <- M x_i."""
    for m in range(size):
        if m // 3 != i:
            put_column(rows, k, first, i, m, combined(column(rows, k, first, i, m), a, b, c))
    # M P_ii, then times M^T.
    w0 = combined(column(rows, k, first, i, 3 * i), a, b, c)
    w1 = combined(column(rows, k, first, i, 3 * i + 1), a, b, c)
    w2 = combined(column(rows, k, first, i, 3 * i + 2), a, b, c)
    d0 = combined(vec3(a.x, b.x, c.x), w0, w1, w2)
    d1 = combined(vec3(a.y, b.y, c.y), w0, w1, w2)
    d2 = combined(vec3(a.z, b.z, c.z), w0, w1, w2)
    put_diagonal(rows, k, first, i, d0, d1, d2)


@wp.func(inline=False)
def add_noise(rows: Any, k: int, first: int, i: int, q: Any, a: Any, b: Any, c: Any):
    """The covariance of x_i plus M diag(q) M^T."""
    d0 = column(rows, k, first, i, 3 * i) + combined(q * vec3(a.x, b.x, c.x), a, b, c)
    d1 = column(rows, k, first, i, 3 * i + 1) + combined(q * vec3(a.y, b.y, c.y), a, b, c)
    d2 = column(rows, k, first, i, 3 * i + 2) + combined(q * vec3(a.z, b.z, c.z), a, b, c)
    put_diagonal(rows, k, first, i, d0, d1, d2)


@wp.func(inline=False)
def copy_block(rows: Any, k: int, first: int, size: int, i: int, j: int, taken: Any):
    """The covariance after x_i <- x_j, in the lanes where `taken` is positive."""
    for m in range(size):
        if m // 3 != i:
            v = column(rows, k, first, j, m)
            put_column(rows, k, first, i, m, positive(taken, v, column(rows, k, first, i, m)))
    for m in range(3):
        c = column(rows, k, first, j, 3 * j + m)
        put_column(rows, k, first, i, 3 * i + m, positive(taken, c, column(rows, k, first, i, 3 * i + m)))


@wp.func(inline=False)
def foreseen(
    rows: Any,
    k: int,
    first: int,
    x: int,
    work: int,
    size: int,
    b: int,
    hb: Any,
    hv: Any,
    ht: Any,
    hw: Any,
    z: Any,
):
    """One number measured, as the estimate foresees it; P h goes into the rows from `work` on.

    x: first row of the error. b, hb: a block and its part of h; hv, ht, hw: those of blocks 1, 2 and 4. z: what was measured
    less what the estimate before all updates expects.

    Returns: the innovation, and h P h, its variance but for that of the reading.
    """
    for j in range(size):
        g = dot(hb, column(rows, k, first, b, j)) + dot(hv, column(rows, k, first, 1, j))
        g = g + dot(ht, column(rows, k, first, 2, j)) + dot(hw, column(rows, k, first, 4, j))
        set_element(rows, k, work + j, 0, g)
    seen = dot(hb, get3(rows, k, work + 3 * b)) + dot(hv, get3(rows, k, work + 3))
    seen = seen + dot(ht, get3(rows, k, work + 6)) + dot(hw, get3(rows, k, work + 12))
    innovation = z - dot(hb, get3(rows, k, x + 3 * b)) - dot(hv, get3(rows, k, x + 3))
    innovation = innovation - dot(ht, get3(rows, k, x + 6)) - dot(hw, get3(rows, k, x + 12))
    return innovation, seen


@wp.func(inline=False)
def updated(rows: Any, k: int, first: int, x: int, work: int, size: int, innovation: Any, seen: Any, r: Any, new: Any):
    """The error and the covariance after such a number, in the lanes where `new` is positive, in Joseph's form.

    r: the variance of the reading. Returns: that of the innovation.
    """
    unity = ones(r)
    s = seen + r
    over = positive(new, unity / s, unity - unity)
    for i in range(size):
        g_i = element(rows, k, work + i, 0)
        gain = over * g_i
        rest = g_i - gain * seen - gain * r
        for j in range(i + 1):
            g_j = element(rows, k, work + j, 0)
            at = first + i * (i + 1) // 2 + j
            set_element(rows, k, at, 0, element(rows, k, at, 0) - gain * g_j - rest * (over * g_j))
        set_element(rows, k, x + i, 0, element(rows, k, x + i, 0) + gain * innovation)
    return s


@wp.func(inline=False)
def widened(rows: Any, k: int, first: int, work: int, size: int, seen: Any, factor: Any):
    """The covariance P + (factor - 1) P h h^T P / (h P h), of which h sees `factor` times as much; and P h of it."""
    unity = ones(seen)
    part = (factor - unity) / seen
    for i in range(size):
        g_i = part * element(rows, k, work + i, 0)
        for j in range(i + 1):
            at = first + i * (i + 1) // 2 + j
            set_element(rows, k, at, 0, element(rows, k, at, 0) + g_i * element(rows, k, work + j, 0))
    for i in range(size):
        set_element(rows, k, work + i, 0, factor * element(rows, k, work + i, 0))


@wp.func(inline=False)
def squared_size(rows: Any, k: int, first: int, size: int, e: int, work: int):
    """e^T P^-1 e of the first `size` rows of P, by its Cholesky factor. e: first row of the vector, which is overwritten.

    work: first of as many rows as P has.
    """
    total = element(rows, k, e, 0) - element(rows, k, e, 0)
    for i in range(size):
        at = i * (i + 1) // 2
        z = element(rows, k, e + i, 0)
        d = element(rows, k, first + at + i, 0)
        for j in range(i):
            below_j = j * (j + 1) // 2
            s = element(rows, k, first + at + j, 0)
            for m in range(j):
                s = s - element(rows, k, work + at + m, 0) * element(rows, k, work + below_j + m, 0)
            # The diagonal has its inverse.
            s = s * element(rows, k, work + below_j + j, 0)
            set_element(rows, k, work + at + j, 0, s)
            d = d - s * s
            z = z - s * element(rows, k, e + j, 0)
        scale = ones(d) / root(d)
        z = z * scale
        set_element(rows, k, work + at + i, 0, scale)
        set_element(rows, k, e + i, 0, z)
        total = total + z * z
    return total
