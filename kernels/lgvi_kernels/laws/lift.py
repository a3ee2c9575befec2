# SPDX-License-Identifier: Apache-2.0
"""Lift of a hull: force_i = -u sum_j matrix_ij nu_j, u the speed ahead."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.patterns import less_whole

# First row of its table. Rows: the twist that measures the speed ahead u (6), the matrix (36).
params = make_params("Lift", words="first")


@wp.func
def add_three(m: Any, view: Any, row: int, u: Any):
    """m + u times a 3x3 matrix of the table, whose rows are 6 apart."""
    m.row0 = m.row0 + u * row3(view, row)
    m.row1 = m.row1 + u * row3(view, row + 6)
    m.row2 = m.row2 + u * row3(view, row + 12)
    return m


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D = u times the matrix: one multiplication an element, however many of its columns are zero."""
    u = dot(row3(view, p.first), view.nu) + dot(row3(view, p.first + 3), view.Om)
    D.force_velocity = add_three(D.force_velocity, view, p.first + 6, u)
    D.force_rate = add_three(D.force_rate, view, p.first + 9, u)
    D.torque_velocity = add_three(D.torque_velocity, view, p.first + 24, u)
    D.torque_rate = add_three(D.torque_rate, view, p.first + 27, u)
    return D


@wp.func
def push(w: Any, view: Any, p: Any):
    """w - u matrix (nu; Om)."""
    u = dot(row3(view, p.first), view.nu) + dot(row3(view, p.first + 3), view.Om)
    return less_whole(w, view, p.first + 6, u * view.nu, u * view.Om)
