# SPDX-License-Identifier: Apache-2.0
"""A filter of the first order over what is measured."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.readings import make_reading, turn_to, turned

TURN = 6.283185307179586


# The time constant of each lane; first of its rows of the memory.
params = make_params("LowPass", lanes="time_constant", words="memory")


@wp.func
def share(y: Any, time_constant: Any):
    """1 - exp(-T / time constant): how far a filter goes towards its input over a period; 1 where the constant is 0.

    docs/theory/control_loop.md, (C7).
    """
    unity = ones(time_constant)
    x = least(y.period * unity / time_constant, y.h.dtype(50.0) * unity)
    return x * decay(x)


@functools.cache
def made(features):
    """The device code of a filter of what the only feature names (see readings.py)."""
    of = features[0]
    reading = make_reading(of)
    values, with_values, put, taken = reading.values, reading.with_values, reading.put, reading.taken

    @wp.func
    def towards(y: Any, z: Any, a: Any):
        """The old estimate z, and the part a of what is missing to y."""
        if wp.static(of == "attitude"):
            z = turned(z, a * turn_to(z, y))
        else:
            e = values(y) - values(z)
            if wp.static(of == "heading"):
                turn = y.h.dtype(wp.static(TURN)) * ones(a)
                e = vec3(e.x - turn * rounded(e.x / turn), e.y, e.z)
            z = with_values(z, values(z) + a * e)
        return z

    @wp.func
    def measure(y: Any, p: Any):
        """x <- x + (1 - exp(-T / time constant)) (measured - x), from the first reading on."""
        if y.step > y.start:
            y = towards(y, taken(y, p.memory), share(y, p.time_constant))
        put(y, p.memory)
        return y

    return device(__name__, features, params=params, measure=measure)
