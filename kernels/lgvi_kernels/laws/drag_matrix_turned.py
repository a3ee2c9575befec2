# SPDX-License-Identifier: Apache-2.0
"""Drag by 6x6 matrices (drag_matrix) where the axes or the origin are not those of the kernel."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.drag_matrix import add_three
from lgvi_kernels.laws.patterns import less_whole

# First row of its table; constant, whether there is a linear matrix; count of columns of the quadratic one.
# Rows: the linear matrix (36), then for each column the twist that measures its velocity (6) and its wrench (6).
params = make_params("DragMatrixTurned", words="first constant count")


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D = linear + sum over columns of |nu_j| times the column."""
    if p.constant > 0:
        D.force_velocity = add_three(D.force_velocity, view, p.first)
        D.force_rate = add_three(D.force_rate, view, p.first + 3)
        D.torque_velocity = add_three(D.torque_velocity, view, p.first + 18)
        D.torque_rate = add_three(D.torque_rate, view, p.first + 21)
    for j in range(p.count):
        at = p.first + 36 + 12 * j
        velocity = row3(view, at)
        rate = row3(view, at + 3)
        size = absolute(dot(velocity, view.nu) + dot(rate, view.Om))
        D = add_outer(D, size * row3(view, at + 6), size * row3(view, at + 9), velocity, rate)
    return D


@wp.func
def push(w: Any, view: Any, p: Any):
    """w - linear (nu; Om) - sum over columns of v |v| times the column, v its velocity."""
    if p.constant > 0:
        w = less_whole(w, view, p.first, view.nu, view.Om)
    for j in range(p.count):
        at = p.first + 36 + 12 * j
        v = dot(row3(view, at), view.nu) + dot(row3(view, at + 3), view.Om)
        size = absolute(v) * v
        w.force = w.force - size * row3(view, at + 6)
        w.torque = w.torque - size * row3(view, at + 9)
    return w
