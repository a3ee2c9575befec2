# SPDX-License-Identifier: Apache-2.0
"""Fixed fins: lift and drag of small wings, from the flow in the plane of their chord and normal."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.patterns import make_along, make_twist

# Rows of one fin: the twists that measure the speed along its chord c and normal n (6 and 6, each also the wrench of a unit
# force), then rho A / 2 times lift slope, drag coefficient and added drag coefficient; and as MATRICES say.
ROWS = 51
# Where in a fin's rows S = c c^T + n n^T (drag is d S) and W = n c^T - c n^T (lift is l W) begin, by blocks:
# force by velocity, S's diagonal and 23, 31, 12 and W's 23, 31, 12; force by rate, S's and W's three rows; torque by rate,
# as force by velocity. Torque by velocity follows, for S is symmetric and W antisymmetric.
MATRICES = (15, 24, 42)
# Less than any speed [m/s], and within float32.
STILL = 1e-30


# First row of its table, ROWS a fin, and count of fins; work: first of two rows a fin to work with.
params = make_params("Fins", words="first count work")


@wp.func
def speed_along(view: Any, row: int):
    """The velocity that the twist in six rows measures."""
    return dot(row3(view, row), view.nu) + dot(row3(view, row + 3), view.Om)


@wp.func
def add_twist(w: Any, view: Any, row: int, size: Any):
    """w plus the wrench in six rows times a size."""
    w.force = w.force + size * row3(view, row)
    w.torque = w.torque + size * row3(view, row + 3)
    return w


@wp.func
def lift_and_drag(view: Any, at: int, along: Any, across: Any):
    """(l, d) of a fin whose wrench is -l (along n - across c) - d (along c + across n).

    l = kl along across / V, d = kd V + kn across^2 / V; along and across are the flow along its chord c and normal n.
    """
    speed = root(along * along + across * across)
    over = across / greatest(speed, view.h.dtype(wp.static(STILL)) * ones(speed))
    return row1(view, at + 12) * (along * over), row1(view, at + 13) * speed + row1(view, at + 14) * (across * over)


@wp.func
def note_lift_and_drag(view: Any, at: int, along: Any, across: Any, noted: int):
    """Note l and d in rows of work, since add_fins goes through all fins once for each block."""
    lift, drag = lift_and_drag(view, at, along, across)
    remember(view, noted, lift)
    remember(view, noted + 1, drag)


@wp.func
def add_symmetric_and_antisymmetric(m: Any, diagonal: Any, s: Any, w: Any):
    """m + S + W, S given by its diagonal and 23, 31, 12, W by 23, 31, 12."""
    m.row0 = m.row0 + vec3(diagonal.x, s.z + w.z, s.y - w.y)
    m.row1 = m.row1 + vec3(s.z - w.z, diagonal.y, s.x + w.x)
    m.row2 = m.row2 + vec3(s.y + w.y, s.x - w.x, diagonal.z)
    return m


@wp.func
def add_block(m: Any, view: Any, first: int, stride: int, count: int, noted: int):
    """m + sum over fins of d S + l W, in the block of force by velocity or of torque by rate."""
    zero = ones(view.b.x) - ones(view.b.x)
    diagonal = vec3(zero, zero, zero)
    s = diagonal
    w = diagonal
    for i in range(count):
        at = first + stride * i
        lift = remembered(view, noted + 2 * i)
        drag = remembered(view, noted + 2 * i + 1)
        diagonal = diagonal + drag * row3(view, at)
        s = s + drag * row3(view, at + 3)
        w = w + lift * row3(view, at + 6)
    return add_symmetric_and_antisymmetric(m, diagonal, s, w)


@wp.func
def add_fins(D: Any, view: Any, first: int, stride: int, count: int, noted: int):
    """D + sum over fins of d S + l W, block by block: so the sums stay in registers."""
    d, m, t = wp.static(MATRICES[0]), wp.static(MATRICES[1]), wp.static(MATRICES[2])
    D.force_velocity = add_block(D.force_velocity, view, first + d, stride, count, noted)
    zero = ones(view.b.x) - ones(view.b.x)
    s0 = vec3(zero, zero, zero)
    s1 = s0
    s2 = s0
    w0 = s0
    w1 = s0
    w2 = s0
    for i in range(count):
        at = first + m + stride * i
        lift = remembered(view, noted + 2 * i)
        drag = remembered(view, noted + 2 * i + 1)
        s0 = s0 + drag * row3(view, at)
        s1 = s1 + drag * row3(view, at + 3)
        s2 = s2 + drag * row3(view, at + 6)
        w0 = w0 + lift * row3(view, at + 9)
        w1 = w1 + lift * row3(view, at + 12)
        w2 = w2 + lift * row3(view, at + 15)
    D.force_rate.row0 = D.force_rate.row0 + (s0 + w0)
    D.force_rate.row1 = D.force_rate.row1 + (s1 + w1)
    D.force_rate.row2 = D.force_rate.row2 + (s2 + w2)
    # The block torque by velocity is (S - W)^T of force by rate: S is symmetric, W antisymmetric.
    s0 = s0 - w0
    s1 = s1 - w1
    s2 = s2 - w2
    D.torque_velocity.row0 = D.torque_velocity.row0 + vec3(s0.x, s1.x, s2.x)
    D.torque_velocity.row1 = D.torque_velocity.row1 + vec3(s0.y, s1.y, s2.y)
    D.torque_velocity.row2 = D.torque_velocity.row2 + vec3(s0.z, s1.z, s2.z)
    D.torque_rate = add_block(D.torque_rate, view, first + t, stride, count, noted)
    return D


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D = sum over fins."""
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        note_lift_and_drag(view, at, speed_along(view, at), speed_along(view, at + 6), p.work + 2 * i)
    return add_fins(D, view, p.first, wp.static(ROWS), p.count, p.work)


WHOLE = (frozenset(range(6)), frozenset(range(6)))


def make_fin(chord, normal):
    """(flow, add_wrench) of a fin in whose twists these entries are not 0: of its chord, and of its normal.

    flow: (view, at) -> the flow along chord and normal; add_wrench: (w, view, at, chordwise, across) -> w and such a force.
    """
    whole = (chord, normal) == WHOLE
    along_chord, along_normal = (speed_along if whole else make_along(entries) for entries in (chord, normal))
    add_chord, add_normal = (add_twist if whole else make_twist(entries) for entries in (chord, normal))

    @wp.func
    def flow(view: Any, at: int):
        return along_chord(view, at), along_normal(view, at + 6)

    @wp.func
    def add_wrench(w: Any, view: Any, at: int, chordwise: Any, across: Any):
        return add_normal(add_chord(w, view, at, chordwise), view, at + 6, across)

    return flow, add_wrench


whole_flow, add_whole_wrench = make_fin(*WHOLE)


@wp.func
def push(w: Any, view: Any, p: Any):
    """w and the wrench of each fin."""
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        along, across = whole_flow(view, at)
        lift, drag = lift_and_drag(view, at, along, across)
        w = add_whole_wrench(w, view, at, lift * across - drag * along, -(lift * along) - drag * across)
    return w
