# SPDX-License-Identifier: Apache-2.0
"""Surface and pressure of linear waves at a place, for laws and sensors that look at them."""

from typing import Any

import warp as wp

from lgvi_kernels.law import (  # noqa: F401
    add,
    cosine,
    div,
    exponential,
    fused,
    greatest,
    mul,
    neg,
    ones,
    row1,
    sine,
    sub,
    vec3,
)

# Rows of a wave in deep water: wavenumber north, east and in all [1/m], omega [rad/s], phase [rad], amplitude [m]; in water of
# a finite depth h the amplitude over 1 + f^2, and f = e^(-k h).
ROWS, ROWS_FINITE = 6, 7


@wp.func
def swell(view: Any, first: int, count: int, b: Any):
    """Elevation of the surface above b, and the acceleration of the water there over gravity, inertial axes; deep water."""
    zero = b.z - b.z
    below = greatest(b.z, zero)
    elevation = zero
    lean = vec3(zero, zero, zero)
    for j in range(count):
        at = first + wp.static(ROWS) * j
        north = row1(view, at)
        east = row1(view, at + 1)
        k = row1(view, at + 2)
        amplitude = row1(view, at + 5)
        theta = north * b.x + east * b.y + fused(-(view.t * ones(k)), row1(view, at + 3), row1(view, at + 4))
        crest = amplitude * cosine(theta)
        decayed = exponential(-(k * below))
        s = decayed * (amplitude * sine(theta))
        elevation = elevation + crest
        lean = lean + vec3(north * s, east * s, k * (decayed * crest))
    return elevation, lean


@wp.func
def swell_finite(view: Any, first: int, count: int, b: Any):
    """The same in water of a finite depth; below the floor as there."""
    zero = b.z - b.z
    unity = ones(b.z)
    below = greatest(b.z, zero)
    elevation = zero
    lean = vec3(zero, zero, zero)
    for j in range(count):
        at = first + wp.static(ROWS_FINITE) * j
        north = row1(view, at)
        east = row1(view, at + 1)
        k = row1(view, at + 2)
        amplitude = row1(view, at + 5)
        floor = row1(view, at + 6)
        theta = north * b.x + east * b.y + fused(-(view.t * unity), row1(view, at + 3), row1(view, at + 4))
        crest = amplitude * cosine(theta)
        e = greatest(exponential(-(k * below)), floor)
        z = floor * (floor / e)
        s = (e + z) * (amplitude * sine(theta))
        elevation = elevation + (unity + floor * floor) * crest
        lean = lean + vec3(north * s, east * s, k * ((e - z) * crest))
    return elevation, lean


@wp.func
def head(view: Any, first: int, count: int, b: Any):
    """Pressure of the waves at b over rho g [m], in deep water; above still water that of the surface."""
    below = greatest(b.z, b.z - b.z)
    total = below - below
    for j in range(count):
        at = first + wp.static(ROWS) * j
        k = row1(view, at + 2)
        angle = fused(-(view.t * ones(k)), row1(view, at + 3), row1(view, at + 4))
        theta = row1(view, at) * b.x + row1(view, at + 1) * b.y + angle
        total = total + exponential(-(k * below)) * (row1(view, at + 5) * cosine(theta))
    return total


@wp.func
def head_finite(view: Any, first: int, count: int, b: Any):
    """The same in water of a finite depth: a cosh k(h - depth) / cosh k h; below the floor as there."""
    below = greatest(b.z, b.z - b.z)
    total = below - below
    for j in range(count):
        at = first + wp.static(ROWS_FINITE) * j
        k = row1(view, at + 2)
        floor = row1(view, at + 6)
        angle = fused(-(view.t * ones(k)), row1(view, at + 3), row1(view, at + 4))
        theta = row1(view, at) * b.x + row1(view, at + 1) * b.y + angle
        e = greatest(exponential(-(k * below)), floor)
        total = total + (e + floor * (floor / e)) * (row1(view, at + 5) * cosine(theta))
    return total
