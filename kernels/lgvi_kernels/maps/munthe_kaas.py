# SPDX-License-Identifier: Apache-2.0
"""Moves on the rotation group by a Runge-Kutta method's slopes, R <- R exp(h a Om), and the method of Munthe-Kaas."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, div, dot, mul, ones, sub  # noqa: F401
from lgvi_kernels.lanes.functions import root, sine
from lgvi_kernels.lanes.rotations import rodrigues, transpose_apply
from lgvi_kernels.maps.accounting import spend

# Added under a root that is divided by: the least that keeps 0/0 away.
TINY = {wp.float64: 1e-300, wp.float32: 1e-36}


def make_turned(Rotation, real):
    """R exp(hat(v)) of a rotation vector v. docs/theory/rotation.md, (R1)."""

    @wp.func
    def turned(x: Any, v: Any):
        """Rodrigues' formula: exp = I + sin n / n hat(v) + 1/2 (sin(n/2) / (n/2))^2 hat(v)^2, n = |v|."""
        square = dot(v, v)
        half = real(0.5)
        # n of v = 0 is not 0 but so small that the quotients of sines are 1.
        n = root(square + real(wp.static(TINY[real])) * ones(square))
        sinc_half = sine(half * n) / (half * n)
        F = rodrigues(Rotation(), v, sine(n) / n, half * sinc_half * sinc_half)
        x.R0 = transpose_apply(F, x.R0)
        x.R1 = transpose_apply(F, x.R1)
        x.R2 = transpose_apply(F, x.R2)
        return x

    return turned


def make_act(turned):
    """Action of the group on a state. docs/theory/runge_kutta.md, (K11)."""

    @wp.func
    def act(x: Any, k: Any, s: Any):
        """R exp(s hat(Om)), and (b, p, pi) + s k."""
        x.b = x.b + s * k.b
        x.p = x.p + s * k.p
        x.pi = x.pi + s * k.pi
        return turned(x, s * k.Om)

    return act


def make_munthe_kaas(rates, act, turned, timed, recall, accounted=False):
    """Munthe-Kaas & Owren (1999): order 4 with two commutators. recall: of half a step, see make_recall.

    docs/theory/runge_kutta.md, (K10).

    accounted: the energy used is summed (see accounting.py).
    """

    @wp.func
    def later(y: Any, x: Any, h: Any):
        if wp.static(timed):
            y.time = x.time + wp.float64(h)
        return y

    @wp.func
    def moved(x: Any, k: Any, s: Any, bracket: Any):
        """(b, p, pi) + s k, R exp(s hat(Om) + hat(bracket))."""
        x.b = x.b + s * k.b
        x.p = x.p + s * k.p
        x.pi = x.pi + s * k.pi
        return turned(x, s * k.Om + bracket)

    @wp.func
    def step(x: Any, c: Any, h: Any):
        """Hairer, Lubich & Wanner, IV.8, in body axes, so that the signs of the commutators are opposite."""
        half = h.dtype(0.5) * h
        k1 = rates(x, c, h)
        y = later(act(x, k1, half), x, half)
        if wp.static(recall is not None):
            y = recall(y, c, h)
        k2 = rates(y, c, h)
        k3 = rates(later(moved(x, k2, half, (h.dtype(0.125) * h * h) * cross(k1.Om, k2.Om)), x, half), c, h)
        y = later(act(x, k3, h), x, h)
        if wp.static(recall is not None):
            y = recall(y, c, h)
        k4 = rates(y, c, h)
        two = h.dtype(2.0)
        k = k1
        k.b = k1.b + two * (k2.b + k3.b) + k4.b
        k.p = k1.p + two * (k2.p + k3.p) + k4.p
        k.pi = k1.pi + two * (k2.pi + k3.pi) + k4.pi
        k.Om = k1.Om + two * (k2.Om + k3.Om) + k4.Om
        sixth = h / h.dtype(6.0)
        if wp.static(accounted):
            spend(c, sixth * (k1.power + two * (k2.power + k3.power) + k4.power))
        y = moved(x, k, sixth, (half * sixth) * cross(k1.Om, k4.Om))
        return later(y, x, h)

    return step
