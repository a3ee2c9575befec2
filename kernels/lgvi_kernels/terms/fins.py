"""Fixed fins: lift and drag of small wings, from the flow in the plane of their chord and normal."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lane_math import greatest, root
from lgvi_kernels.lanes import add, div, dot, mul, ones, sub  # noqa: F401
from lgvi_kernels.state import struct
from lgvi_kernels.view import add_outer, row1, row3

# Rows of one fin: the twists that measure the speed along its chord and normal (6 and 6, each also the wrench of a unit
# force), then rho A / 2 times lift slope, drag coefficient and added drag coefficient.
ROWS = 15
# Less than any speed [m/s], and within float32.
STILL = 1e-30


@functools.cache
def params(width, real):
    """Params: first row of its table, ROWS a fin, and count of fins."""
    return struct("Fins", first=wp.int32, count=wp.int32)


@wp.func
def speed_along(view: Any, row: int):
    """The velocity that the twist in these rows measures."""
    return dot(row3(view, row), view.nu) + dot(row3(view, row + 3), view.Om)


@wp.func
def add_fin(D: Any, view: Any, at: int, along: Any, across: Any):
    """D + a fin's -l (along n - across c) - d (along c + across n), l = kl along across / V, d = kd V + kn across^2 / V.

    along and across are the flow along its chord c and normal n, turned with it or not; the directions in the rows are not
    turned: lift and drag are across and along the flow, so of the fin's angle they feel l and d alone.
    """
    speed = root(along * along + across * across)
    over = across / greatest(speed, view.h.dtype(wp.static(STILL)) * ones(speed))
    lift = row1(view, at + 12) * (along * over)
    drag = row1(view, at + 13) * speed + row1(view, at + 14) * (across * over)
    c = row3(view, at)
    c_arm = row3(view, at + 3)
    n = row3(view, at + 6)
    n_arm = row3(view, at + 9)
    D = add_outer(D, c, c_arm, drag * c - lift * n, drag * c_arm - lift * n_arm)
    return add_outer(D, n, n_arm, lift * c + drag * n, lift * c_arm + drag * n_arm)


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D = sum over fins."""
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        D = add_fin(D, view, at, speed_along(view, at), speed_along(view, at + 6))
    return D
