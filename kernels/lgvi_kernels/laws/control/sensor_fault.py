# SPDX-License-Identifier: Apache-2.0
"""A fault of a sensor: from a time on one number of its reading is another one."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.lost import since
from lgvi_kernels.laws.control.readings import make_reading

# First step, gain and offset of each lane; number of the channel.
params = make_params("SensorFault", lanes="begin gain offset", words="channel")


# Params of an altimeter's fault: first step, gain and offset of each lane; row of the reading.
range_params = make_params("RangeFault", lanes="begin gain offset", words="row")


@wp.func
def measure_range(y: Any, p: Any):
    """As any sensor's fault, of the reading of an altimeter."""
    reading = remembered(y, p.row)
    remember(y, p.row, positive(since(y, p.begin), p.gain * reading + p.offset, reading))
    return y


@functools.cache
def made(features):
    """The device code of a fault of a sensor, which reads what the only feature names (see readings.py), or "range"."""
    of = features[0]
    if of == "range":
        return device(__name__, features, params=range_params, measure=measure_range)
    reading = make_reading(of)
    values, with_values = reading.values, reading.with_values

    @wp.func
    def measure(y: Any, p: Any):
        """From the first tick at or after its time on: reading <- gain * reading + offset."""
        begun = since(y, p.begin)
        v = values(y)
        if p.channel == 0:
            v.x = positive(begun, p.gain * v.x + p.offset, v.x)
        if p.channel == 1:
            v.y = positive(begun, p.gain * v.y + p.offset, v.y)
        if p.channel == 2:
            v.z = positive(begun, p.gain * v.z + p.offset, v.z)
        if wp.static(of == "attitude"):
            # Angles there and back are not the same bits: lanes without the fault keep theirs.
            z = with_values(y, v)
            y.north = positive(begun, z.north, y.north)
            y.east = positive(begun, z.east, y.east)
            y.down = positive(begun, z.down, y.down)
        else:
            y = with_values(y, v)
        return y

    return device(__name__, features, params=params, measure=measure)
