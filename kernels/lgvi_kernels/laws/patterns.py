# SPDX-License-Identifier: Apache-2.0
"""Products of 6x6 matrices of a law's table with the velocities, of which only the entries that are not zero make code."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *


def entries_of(words, kind):
    """The entries (i, j) that words such as "q15" name: the kind of the matrix, its row, its column."""
    return tuple((int(word[1]), int(word[2])) for word in words if word[0] == kind)


def make_row(columns):
    """(total, view, row, nu, Om) -> total less the row's product with (nu; Om), whose other columns are zero."""

    @wp.func
    def less_row(total: Any, view: Any, row: int, nu: Any, Om: Any):
        if wp.static(0 in columns):
            total = total - row1(view, row) * nu.x
        if wp.static(1 in columns):
            total = total - row1(view, row + 1) * nu.y
        if wp.static(2 in columns):
            total = total - row1(view, row + 2) * nu.z
        if wp.static(3 in columns):
            total = total - row1(view, row + 3) * Om.x
        if wp.static(4 in columns):
            total = total - row1(view, row + 4) * Om.y
        if wp.static(5 in columns):
            total = total - row1(view, row + 5) * Om.z
        return total

    return less_row


def make_less(entries):
    """(w, view, first, nu, Om) -> the wrench w less a matrix times (nu; Om); entries: (i, j) of those that are not zero."""
    rows = [make_row(frozenset(j for k, j in entries if k == i)) for i in range(6)]
    fx, fy, fz, tx, ty, tz = rows

    @wp.func
    def less(w: Any, view: Any, first: int, nu: Any, Om: Any):
        f = w.force
        t = w.torque
        w.force = vec3(
            fx(f.x, view, first, nu, Om), fy(f.y, view, first + 6, nu, Om), fz(f.z, view, first + 12, nu, Om)
        )
        w.torque = vec3(
            tx(t.x, view, first + 18, nu, Om), ty(t.y, view, first + 24, nu, Om), tz(t.z, view, first + 30, nu, Om)
        )
        return w

    return less


def make_along(entries):
    """(view, row) -> the velocity that the twist in six rows measures, of which the other numbers are zero."""
    less = make_row(entries)

    @wp.func
    def along(view: Any, row: int):
        return -less(ones(view.b.x) - ones(view.b.x), view, row, view.nu, view.Om)

    return along


def make_twist(entries):
    """(w, view, row, size) -> w plus the wrench in six rows times a size; its other numbers are zero."""

    @wp.func
    def twist(w: Any, view: Any, row: int, size: Any):
        f = w.force
        t = w.torque
        if wp.static(0 in entries):
            f.x = f.x + size * row1(view, row)
        if wp.static(1 in entries):
            f.y = f.y + size * row1(view, row + 1)
        if wp.static(2 in entries):
            f.z = f.z + size * row1(view, row + 2)
        if wp.static(3 in entries):
            t.x = t.x + size * row1(view, row + 3)
        if wp.static(4 in entries):
            t.y = t.y + size * row1(view, row + 4)
        if wp.static(5 in entries):
            t.z = t.z + size * row1(view, row + 5)
        w.force = f
        w.torque = t
        return w

    return twist


def pattern_words(words):
    """Words such as "1f4": entry 4 of what "f" names, of unit 1 of an actuator."""
    return [word for word in words if word[0].isdigit()]


def patterns_of(words, kinds):
    """Unit by unit of an actuator its entries of each kind, as pattern_words name them; none where no word does."""
    named = [(int(word[:-2]), word[-2], int(word[-1])) for word in pattern_words(words)]
    units = range(1 + max((unit for unit, _, _ in named), default=-1))
    return [tuple(frozenset(j for u, k, j in named if (u, k) == (unit, kind)) for kind in kinds) for unit in units]


def make_unrolled(functions):
    """(w, view, p) -> w after all these functions of the same arguments, the first one first; w where there is none."""
    if not functions:

        @wp.func
        def unchanged(w: Any, view: Any, p: Any):
            return w

        return unchanged
    *before, last = functions
    if not before:
        return last
    rest = make_unrolled(before)

    @wp.func
    def unrolled(w: Any, view: Any, p: Any):
        return last(rest(w, view, p), view, p)

    return unrolled


# Every entry of a matrix.
FULL = tuple((i, j) for i in range(6) for j in range(6))
less_whole = make_less(FULL)


@wp.func
def squares(v: Any):
    """v |v|, component by component."""
    return vec3(absolute(v.x) * v.x, absolute(v.y) * v.y, absolute(v.z) * v.z)
