# SPDX-License-Identifier: Apache-2.0
"""Steps that each packet chooses for a tolerance: error norm, step control, and the status of lanes that fail."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import absolute, add, div, dot, mul, ones, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.functions import greatest, root
from lgvi_kernels.maps.accounting import spend

NON_FINITE = 3
STEP_TOO_SMALL = 5

# Step control of Hairer, Norsett & Wanner (HNW), Solving Ordinary Differential Equations I, II.4, and Hairer & Wanner II,
# IV.2, as in their code DOP853: safety factor, exponent of the error before, smallest and largest factor of a step.
SAFETY = 0.9
BETA = 0.04
SHRINK, GROW = 0.333, 6.0

# Steps tried from one step of the grid to the next, and the smallest as a part of that: beyond, the member has failed.
MOST_TRIED = 100_000
SMALLEST = {wp.float64: 1e-12, wp.float32: 1e-6}
# Added under a root that is divided by, so that 0/0 does not occur.
TINY = 1e-36


@wp.func
def one_over(y: Any, new: Any, rtol: Any, atol: Any):
    """1 / (atol + rtol max(|y|, |new|)) of each number."""
    unity = ones(y)
    return unity / (atol * unity + rtol * greatest(absolute(y), absolute(new)))


@wp.func
def one_over3(y: Any, new: Any, rtol: Any, atol: Any):
    """The same of a 3-vector's components."""
    return vec3(one_over(y.x, new.x, rtol, atol), one_over(y.y, new.y, rtol, atol), one_over(y.z, new.z, rtol, atol))


@wp.func
def square(a: Any, b: Any):
    """Sum of the squares of a_i b_i."""
    q = a * b
    return dot(q, q)


def make_errors(Rates, moves):
    """(y, new, slopes, h, rtol, atol) -> mean square of the estimates over the tolerance, HNW (4.11), one for each of moves.

    docs/theory/runge_kutta.md, (K7).

    moves: the functions (rates, slopes, h) -> rates that estimate an error.
    """
    first, last, double = moves[0], moves[-1], len(moves) > 1

    @wp.func
    def mean_square(e: Any, w: Any):
        s = square(e.b, w.b) + square(e.R0, w.R0) + square(e.R2, w.R2) + square(e.p, w.p) + square(e.pi, w.pi)
        return s.dtype(1.0 / 15.0) * s

    @wp.func
    def errors(y: Any, new: Any, k: Any, h: Any, rtol: Any, atol: Any):
        """The error over the tolerance; of two estimates as in HNW II.10, e5^2 / sqrt(e5^2 + e3^2 / 100)."""
        w = Rates()
        w.b = one_over3(y.b, new.b, rtol, atol)
        w.R0 = one_over3(y.R0, new.R0, rtol, atol)
        w.R2 = one_over3(y.R2, new.R2, rtol, atol)
        w.p = one_over3(y.p, new.p, rtol, atol)
        w.pi = one_over3(y.pi, new.pi, rtol, atol)
        fifth = mean_square(first(Rates(), k, h), w)
        if wp.static(double):
            third = mean_square(last(Rates(), k, h), w)
            tiny = h.dtype(wp.static(TINY)) * ones(fifth)
            return fifth / root(fifth + h.dtype(0.01) * third + tiny)
        else:
            return root(fifth)

    return errors


def make_verdicts(width, real):
    """(worst_of, given_up): the error by which a packet chooses its step, and the lanes that it goes on without."""

    @wp.func
    def worst_of(error: Any, code: Any):
        """The largest error of the lanes that are well; what is not a number counts as huge."""
        worst = real(0.0)
        for j in range(wp.static(width)):
            if not code[j] > real(0.0):
                e = error[j]
                if not e < real(1e10):
                    e = real(1e10)
                worst = wp.max(worst, e)
        return worst

    @wp.func
    def given_up(alarm: Any, error: Any, most: Any, taken: Any):
        """The lanes whose error exceeds `most` get their status, and no longer count: the others go on without them."""
        code = alarm.code
        size = alarm.size
        for j in range(wp.static(width)):
            if not code[j] > real(0.0):
                if not error[j] < real(1e10):
                    code[j] = real(wp.static(float(NON_FINITE)))
                elif error[j] > most:
                    code[j] = real(wp.static(float(STEP_TOO_SMALL)))
                    size[j] = taken * taken
        alarm.code = code
        alarm.size = size
        return alarm

    return worst_of, given_up


def make_adaptive(stages, finish, errors, estimate, width, real, timed, copy_memory, recall, used=None):
    """From one step of the grid to the next, by steps that the packet's worst lane decides.

    docs/theory/runge_kutta.md, (K8).

    copy_memory: (constants, source, target), where a law remembers (see maps/explicit.py); else None. recall, used:
        as of make_fixed there.
    """
    # Of PI control: this exponent is that of the step's own error, BETA that of the error before.
    power = 0.75 * BETA - 1.0 / estimate
    worst_of, given_up = make_verdicts(width, real)

    @wp.func
    def step(x: Any, c: Any, h: Any):
        """HNW II.4 with PI control: steps are shortened to end at h, and not to leave a tiny one for the end."""
        start = x.time
        done = real(0.0)
        # 0 asks for a new start: at the beginning of a run, and for a part of a step (see advance/retry.py).
        stride = x.pace.stride
        before = x.pace.before
        if not stride > real(0.0):
            stride = h
            before = real(1e-4)
        tried = int(0)
        while done < h:
            remaining = h - done
            taken = remaining
            if remaining > real(1.0001) * stride:
                taken = wp.min(stride, real(0.5) * remaining)
            k = stages(x, c, taken)
            new = finish(x, k, taken)
            error = errors(x, new, k, taken, c.tolerance, c.force_tolerance)
            worst = worst_of(error, x.alarm.code)
            factor = real(wp.static(SAFETY)) * wp.pow(wp.max(worst, real(1e-10)), real(wp.static(power)))
            factor = factor * wp.pow(wp.max(before, real(1e-4)), real(wp.static(BETA)))
            factor = wp.clamp(factor, real(wp.static(SHRINK)), real(wp.static(GROW)))
            tried += 1
            x.pace.tried = x.pace.tried + real(1.0)
            if worst <= real(1.0):
                if wp.static(used is not None):
                    spend(c, used(ones(error) - ones(error), k, taken))
                new.pace = x.pace
                new.alarm = x.alarm
                x = new
                x.pace.made = x.pace.made + real(1.0)
                before = worst
                if taken == remaining:
                    done = h
                else:
                    done = done + taken
                # A step that was shortened to end at h says little about the next.
                if taken < stride:
                    stride = wp.max(stride, taken * factor)
                else:
                    stride = taken * factor
                if wp.static(timed):
                    x.time = start + wp.float64(done)
                if wp.static(recall is not None):
                    x = recall(x, c, taken)
            else:
                stride = taken * wp.min(real(1.0), factor)
                if wp.static(copy_memory is not None):
                    copy_memory(c, 1, 0)
                if not stride > real(wp.static(SMALLEST[real])) * h:
                    x.alarm = given_up(x.alarm, error, real(1.0), taken)
                    stride = remaining
            if tried >= wp.static(MOST_TRIED):
                x.alarm = given_up(x.alarm, error, real(0.5) * worst, taken)
                stride = h
                tried = 0
        x.pace.stride = stride
        x.pace.before = before
        return x

    return step
