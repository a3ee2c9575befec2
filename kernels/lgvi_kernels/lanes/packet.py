# SPDX-License-Identifier: Apache-2.0
"""Functions of a whole packet between steps: renormalise, choose between two states lane by lane, find failures."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, dot, mul, ones, positive, sub, vec3  # noqa: F401

STEP_TOO_LARGE = 1
NON_FINITE = 3


@wp.func
def renormalise(x: Any, h: Any):
    """One step of R <- R (3 I - R^T R) / 2, towards the nearest orthogonal matrix, on the rows of R."""
    half = h.dtype(0.5)
    xy = half * dot(x.R0, x.R1)
    yz = half * dot(x.R1, x.R2)
    zx = half * dot(x.R2, x.R0)
    three = h.dtype(1.5) * ones(xy)
    R0 = (three - half * dot(x.R0, x.R0)) * x.R0 - xy * x.R1 - zx * x.R2
    R1 = (three - half * dot(x.R1, x.R1)) * x.R1 - xy * x.R0 - yz * x.R2
    R2 = (three - half * dot(x.R2, x.R2)) * x.R2 - zx * x.R0 - yz * x.R1
    x.R0 = R0
    x.R1 = R1
    x.R2 = R2
    return x


@wp.func
def choose_vectors(test: Any, yes: Any, no: Any):
    """The vectors of `yes` in the lanes where test > 0; all else, alarm and low parts too, is that of `no`."""
    no.R0 = positive(test, yes.R0, no.R0)
    no.R1 = positive(test, yes.R1, no.R1)
    no.R2 = positive(test, yes.R2, no.R2)
    no.b = positive(test, yes.b, no.b)
    no.p = positive(test, yes.p, no.p)
    no.pi = positive(test, yes.pi, no.pi)
    return no


@wp.func
def vectors_at_rest(x: Any):
    """The same vehicles at rest at the origin: where frozen lanes wait, so that they raise no more alarms."""
    zero = ones(x.b.x) - ones(x.b.x)
    x.b = vec3(zero, zero, zero)
    x.p = x.b
    x.pi = x.b
    x.R0 = vec3(ones(zero), zero, zero)
    x.R1 = vec3(zero, ones(zero), zero)
    x.R2 = vec3(zero, zero, ones(zero))
    return x


@wp.func
def probe(x: Any):
    """Zero in the lanes that are finite, not a number in the others."""
    # The sum is infinite or NaN where any of its terms is; s - s is then NaN.
    s = x.R0 + x.R1 + x.R2 + x.b + x.p + x.pi
    s = s - s
    return s.x + s.y + s.z


@wp.func
def turned_too_far(alarm: Any):
    """STEP_TOO_LARGE where half the angles of the turns, h |Om| / 4, reached 1: alarm.size holds the largest square of it.

    Beyond, the series of the tangent has no digit of the angle, and shears by it multiply rounding errors by its square.
    """
    unity = ones(alarm.size)
    over = alarm.size - unity
    alarm.code = positive(over, unity.dtype(wp.static(float(STEP_TOO_LARGE))) * unity, alarm.code)
    alarm.size = positive(over, alarm.size, unity - unity)
    return alarm


@wp.func
def failures(x: Any, frozen: Any):
    """The failure code of each lane that is not frozen yet, 0 where it is well."""
    unity = ones(frozen)
    zero = unity - unity
    # 1 where all is finite; where it is NaN, positive() takes its last argument.
    well = unity - probe(x)
    code = positive(x.alarm.code, x.alarm.code, positive(well, zero, unity.dtype(wp.static(float(NON_FINITE))) * unity))
    return positive(frozen, zero, code)


@wp.func
def put(out: Any, i: int, j: int, v: Any):
    """Write a 3-vector to out[i, j:j+3]."""
    out[i, j] = v.x
    out[i, j + 1] = v.y
    out[i, j + 2] = v.z
