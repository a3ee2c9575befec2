# SPDX-License-Identifier: Apache-2.0
"""Cross-flow drag of a slender hull: -c_i |w| w at each strip, w the flow across the hull's axis."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

# A, b, the unit vectors across the axis, axis x a = b; their arms r0 x a, r0 x b, r0 the station 0.
# Rows: for each of `count` strips its station [m] and rho / 2 times drag coefficient, breadth and length.
params = make_params("CrossFlow", vectors="a b a_arm b_arm", words="first count")


@wp.func
def add_across(D: Any, force: Any, arm: Any, by_station: Any, S0: Any, S1: Any, S2: Any):
    """D + S0 t0 t0^T + S1 (t0 t1^T + t1 t0^T) + S2 t1 t1^T, t0 = (force, arm), t1 = (0, by_station)."""
    D = add_outer(D, force, arm, S0 * force, S0 * arm + S1 * by_station)
    D.torque_velocity = add_rows(D.torque_velocity, by_station, S1 * force)
    D.torque_rate = add_rows(D.torque_rate, by_station, S1 * arm + S2 * by_station)
    return D


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D = sum over strips at x of s t t^T for both directions: s = c |w|, t = t0 + x t1 measuring the flow there."""
    along_a = dot(p.a, view.nu) + dot(p.a_arm, view.Om)
    along_b = dot(p.b, view.nu) + dot(p.b_arm, view.Om)
    # axis x a = b and axis x b = -a.
    a_by_station = dot(p.b, view.Om)
    b_by_station = -dot(p.a, view.Om)
    # The loop sums three numbers, the moments of s over the stations: their outer products with twists follow once.
    S0 = ones(along_a) - ones(along_a)
    S1 = S0
    S2 = S0
    for i in range(p.count):
        x = row1(view, p.first + 2 * i)
        v_a = along_a + x * a_by_station
        v_b = along_b + x * b_by_station
        s = row1(view, p.first + 2 * i + 1) * root(v_a * v_a + v_b * v_b)
        S0 = S0 + s
        S1 = S1 + s * x
        S2 = S2 + (s * x) * x
    D = add_across(D, p.a, p.a_arm, p.b, S0, S1, S2)
    return add_across(D, p.b, p.b_arm, p.a, S0, -S1, S2)


@wp.func
def push(w: Any, view: Any, p: Any):
    """w less the drag of each strip: c |w| w at its station."""
    along_a = dot(p.a, view.nu) + dot(p.a_arm, view.Om)
    along_b = dot(p.b, view.nu) + dot(p.b_arm, view.Om)
    a_by_station = dot(p.b, view.Om)
    b_by_station = -dot(p.a, view.Om)
    # The sums over strips of the drag along a and b, and of these times the station.
    Fa = ones(along_a) - ones(along_a)
    Fb = Fa
    Ma = Fa
    Mb = Fa
    for i in range(p.count):
        x = row1(view, p.first + 2 * i)
        v_a = along_a + x * a_by_station
        v_b = along_b + x * b_by_station
        s = row1(view, p.first + 2 * i + 1) * root(v_a * v_a + v_b * v_b)
        f_a = s * v_a
        f_b = s * v_b
        Fa = Fa + f_a
        Fb = Fb + f_b
        Ma = Ma + x * f_a
        Mb = Mb + x * f_b
    w.force = w.force - Fa * p.a - Fb * p.b
    w.torque = w.torque - Fa * p.a_arm - Fb * p.b_arm - Ma * p.b + Mb * p.a
    return w
