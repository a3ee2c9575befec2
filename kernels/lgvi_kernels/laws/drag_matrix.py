# SPDX-License-Identifier: Apache-2.0
"""Drag by 6x6 matrices: force_i = -sum_j (linear_ij + quadratic_ij |nu_j|) nu_j, advanced by the linearly implicit step V."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.patterns import less_whole, squares

# First row of its table; constant, quadratic: whether there is such a matrix. Rows: both (36 each).
params = make_params("DragMatrix", words="first constant quadratic")


@wp.func
def add_three(m: Any, view: Any, row: int):
    """m + a 3x3 matrix of the table, whose rows are 6 apart."""
    m.row0 = m.row0 + row3(view, row)
    m.row1 = m.row1 + row3(view, row + 6)
    m.row2 = m.row2 + row3(view, row + 12)
    return m


@wp.func
def add_columns(m: Any, view: Any, row: int, size: Any):
    """add_three, each column multiplied by its component of `size`."""
    m.row0 = m.row0 + size * row3(view, row)
    m.row1 = m.row1 + size * row3(view, row + 6)
    m.row2 = m.row2 + size * row3(view, row + 12)
    return m


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D = linear + quadratic diag |nu|."""
    if p.constant > 0:
        D.force_velocity = add_three(D.force_velocity, view, p.first)
        D.force_rate = add_three(D.force_rate, view, p.first + 3)
        D.torque_velocity = add_three(D.torque_velocity, view, p.first + 18)
        D.torque_rate = add_three(D.torque_rate, view, p.first + 21)
    if p.quadratic > 0:
        speeds = vec3(absolute(view.nu.x), absolute(view.nu.y), absolute(view.nu.z))
        rates = vec3(absolute(view.Om.x), absolute(view.Om.y), absolute(view.Om.z))
        D.force_velocity = add_columns(D.force_velocity, view, p.first + 36, speeds)
        D.force_rate = add_columns(D.force_rate, view, p.first + 39, rates)
        D.torque_velocity = add_columns(D.torque_velocity, view, p.first + 54, speeds)
        D.torque_rate = add_columns(D.torque_rate, view, p.first + 57, rates)
    return D


@wp.func
def push(w: Any, view: Any, p: Any):
    """w - linear (nu; Om) - quadratic (nu |nu|; Om |Om|)."""
    if p.constant > 0:
        w = less_whole(w, view, p.first, view.nu, view.Om)
    if p.quadratic > 0:
        w = less_whole(w, view, p.first + 36, squares(view.nu), squares(view.Om))
    return w
