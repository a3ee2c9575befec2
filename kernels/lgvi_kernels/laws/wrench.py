"""A constant wrench in body axes."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import add, lane3, struct  # noqa: F401


@functools.cache
def params(width, real):
    """Params: force [N] and torque [N m] about the origin of the forces."""
    return struct("HeldWrench", force=lane3(width, real), torque=lane3(width, real))


@wp.func
def law(w: Any, view: Any, p: Any):
    """phi = force, tau = torque."""
    w.force = w.force + p.force
    w.torque = w.torque + p.torque
    return w
