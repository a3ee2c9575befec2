# SPDX-License-Identifier: Apache-2.0
"""An altimeter: the range to the sea floor along a beam, with the errors of a sensor."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.cells import floor_at, grid_fields
from lgvi_kernels.law import *
from lgvi_kernels.laws.control import sensor

# Places along the beam at which the floor is looked up; and a rate at which the beam comes nearer to it that counts as none.
LOOKS = 10
LEVEL = 1e-6


@wp.func
def looked_at(y: Any, p: Any, start: Any, beam: Any, s: Any):
    """Height above the floor, s along the beam, and how fast it falls along it."""
    depth, by_north, by_east = floor_at(y, p, start.x + s * beam.x, start.y + s * beam.y)
    return depth - start.z - s * beam.z, beam.z - by_north * beam.x - by_east * beam.y


@wp.func(inline=False)
def range_to_floor(y: Any, p: Any, start: Any, beam: Any):
    """Newton's method within a bracket, halved where a step leaves it; `most` without a floor within reach."""
    unity = ones(start.x)
    low = unity - unity
    high = p.most
    s = low
    for _look in range(wp.static(LOOKS)):
        height, closing = looked_at(y, p, start, beam, s)
        low = positive(height, s, low)
        high = positive(height, high, s)
        slow = y.h.dtype(wp.static(LEVEL)) * unity
        step = s + height / positive(absolute(closing) - slow, closing, slow)
        outside = greatest(low - step, step - high)
        s = positive(outside, y.h.dtype(0.5) * (low + high), step)
    beyond, _fall = looked_at(y, p, start, beam, p.most)
    return positive(beyond, p.most, s)


@functools.cache
def made(features):
    """The device code of an altimeter. features: "range", and those of a sensor (see sensor.py)."""
    errors = sensor.made(("depth", *features[1:]))
    fields, measure_errors = errors.fields, errors.measure

    def params(width, real):
        """Params: those of a sensor; the beam in body axes, its start and its reach; row of the reading; the floor."""
        vectors = dict.fromkeys(("beam", "point"), lane3(width, real))
        own = fields(width, real) | vectors | {"most": lane(width, real), "row": wp.int32}
        return struct("Altimeter", **own, **grid_fields(width, real))

    @wp.func
    def measure(y: Any, p: Any):
        """Write the reading into its row; the errors are those of a sensor that reads it as a depth."""
        start = y.position + to_inertial(y, p.point)
        reading = range_to_floor(y, p, start, to_inertial(y, p.beam))
        z = y
        z.position = vec3(y.position.x, y.position.y, reading)
        z = measure_errors(z, p)
        remember(y, p.row, clamp(z.position.z, reading - reading, p.most))
        return y

    return device(__name__, features, params=params, measure=measure)
