# SPDX-License-Identifier: Apache-2.0
"""Solving equation (24) in every lane: how many Newton steps, until when, and the alarm where there is no solution."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import any_positive, mul, ones, positive, sub  # noqa: F401
from lgvi_kernels.maps import moser_veselov as mv
from lgvi_kernels.maps import rotation as r

# name -> start of a fixed number of Newton steps, start of an iteration to the tolerance, then value, newton, excess,
# residual2 and rotation: the functions of rotation.py
SOLVERS = {
    "quartic": (
        r.quartic_linear,
        r.quartic_series,
        r.quartic_value,
        r.quartic_newton,
        r.quartic_excess,
        r.quartic_residual2,
        r.quartic_rotation,
    ),
    "cayley": (
        r.cayley_start,
        r.cayley_start,
        r.cayley_value,
        r.cayley_newton,
        r.vector_excess,
        r.vector_residual2,
        r.cayley_rotation,
    ),
    "newton": (
        r.newton_start,
        r.newton_start,
        r.newton_value,
        r.newton_newton,
        r.vector_excess,
        r.vector_residual2,
        r.newton_rotation,
    ),
    "moser_veselov": (
        mv.mv_explicit,
        mv.mv_explicit,
        mv.mv_value,
        mv.mv_newton,
        mv.mv_excess,
        mv.mv_residual2,
        mv.mv_rotation,
    ),
}

# At |J^-1 a| -> 1 the root is nearly double and a Newton step only halves the error: 40 steps exhaust float64.
MOST_ITERATIONS = 40

STEP_TOO_LARGE = 1
NOT_CONVERGED = 2


def _sloped(value, newton, rotation):
    """(F, u, a, J) -> the rotation of u after one Newton step more, from u without its slopes.

    Of a root the step leaves nothing but its slopes, by the equation alone: they are as good as the root, and what led to it
    needs none.
    """
    from lgvi_kernels.tangents.lanes import without_slopes

    @wp.func
    def sloped(F: Any, u: Any, a: Any, J: Any):
        known = without_slopes(u)
        return rotation(F, newton(known, value(known, a, J), a, J), a, J)

    return sloped


@functools.cache
def make_solve(real, solver, iterations, adaptive, checked, tangents=0):
    """(solve, solve_within), functions that solve equation (24) in every lane.

    solve: (F, alarm, a, J, tolerance) -> (F, alarm). solve_within: the same with one argument more after J, the square of a
    measure of the step's size, which must stay below 1 (see rotation.reach).

    `iterations` Newton steps are made in all lanes. `adaptive` goes on, in the lanes that need it, until the residual is
    below the tolerance: a lane's bits depend on that lane alone. `checked` raises the alarm of a lane whose equation has
    no certain solution (STEP_TOO_LARGE) or whose residual stays above the tolerance (NOT_CONVERGED). Both happen behind
    one test that a well-chosen step never passes.
    """
    fixed_start, adaptive_start, value, newton, excess, residual2, rotation = SOLVERS[solver]
    start = adaptive_start if adaptive else fixed_start
    if tangents:
        rotation = _sloped(value, newton, rotation)
    # The largest number below 1: tests are "> 0", and so 1 itself is beyond.
    below_one = 1.0 - 2.0**-53 if real == wp.float64 else 1.0 - 2.0**-24

    @wp.func
    def beyond(far: Any, unit: Any):
        """Positive where far >= 1."""
        return far - unit.dtype(wp.static(below_one)) * ones(far)

    @wp.func
    def raise_alarm(alarm: Any, far: Any, e: Any, r2: Any, unit: Any):
        """Note the first failure of each lane, and the square of the value that crossed its limit."""
        zero = ones(e) - ones(e)
        unconverged = unit.dtype(wp.static(float(NOT_CONVERGED))) * ones(e)
        too_large = unit.dtype(wp.static(float(STEP_TOO_LARGE))) * ones(e)
        over = beyond(far, unit)
        code = positive(over, too_large, positive(e, unconverged, zero))
        size = positive(code, positive(over, far, r2), zero)
        alarm.size = positive(alarm.code, alarm.size, size)
        alarm.code = positive(alarm.code, alarm.code, code)
        return alarm

    @wp.func
    def solve_within(F: Any, alarm: Any, a: Any, J: Any, far: Any, tolerance: Any):
        # u: the solver's parameter of F; v: the value of its equation; e: the excess of the residual over the tolerance.
        u = start(a, J)
        for _ in range(wp.static(iterations)):
            u = newton(u, value(u, a, J), a, J)
        if wp.static(adaptive or checked):
            v = value(u, a, J)
            e = excess(v, a, J, tolerance)
            # One test for both alarms: it is all that a well-chosen step pays.
            suspect = e
            if wp.static(checked):
                suspect = positive(e, e, beyond(far, tolerance))
            if any_positive(suspect):
                if wp.static(adaptive):
                    k = int(0)
                    while k < wp.static(MOST_ITERATIONS) and any_positive(e):
                        u = positive(e, newton(u, v, a, J), u)
                        v = value(u, a, J)
                        e = excess(v, a, J, tolerance)
                        k += 1
                if wp.static(checked):
                    alarm = raise_alarm(alarm, far, e, residual2(v, a, J), tolerance)
        return rotation(F, u, a, J), alarm

    @wp.func
    def solve(F: Any, alarm: Any, a: Any, J: Any, tolerance: Any):
        return solve_within(F, alarm, a, J, r.reach(a, J), tolerance)

    return solve, solve_within
