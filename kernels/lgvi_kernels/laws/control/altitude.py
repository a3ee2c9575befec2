# SPDX-License-Identifier: Apache-2.0
"""Guidance at an altitude above the sea floor, which an altimeter or the chart knows."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.cells import floor_at, grid_fields
from lgvi_kernels.law import *

LIMITS = ("altitude", "shallowest", "deepest")
# A forward axis that is shorter than this in the horizontal plane has no heading.
UPRIGHT = 1e-6


@wp.func
def above(r: Any, floor: Any, p: Any):
    """The wanted depth above a floor."""
    wanted = greatest(least(floor - p.altitude, p.deepest), p.shallowest)
    r.position = vec3(r.position.x, r.position.y, wanted)
    return r


@wp.func
def by_altimeter(r: Any, y: Any, p: Any):
    """Above where the beam meets the floor, by the measured depth and attitude."""
    hit = p.point + remembered(y, p.row) * p.beam
    return above(r, y.position.z + dot(y.down, hit), p)


@wp.func
def by_chart(r: Any, y: Any, p: Any):
    """Above the floor here or ahead, the shallower."""
    x = y.north.x
    z = y.east.x
    size = greatest(root(x * x + z * z), y.h.dtype(wp.static(UPRIGHT)) * ones(x))
    way = p.look_ahead / size
    here, _north, _east = floor_at(y, p, y.position.x, y.position.y)
    ahead, _by_north, _by_east = floor_at(y, p, y.position.x + way * x, y.position.y + way * z)
    return above(r, least(here, ahead), p)


@functools.cache
def made(features):
    """The device code by the source of what is known, "altimeter" or "chart"."""
    charted = "chart" in features

    def params(width, real):
        """Params: altitude and limits of the depth; look-ahead and floor of the chart, or beam and row of its reading."""
        own = dict.fromkeys(LIMITS, lane(width, real))
        if charted:
            return struct("AltitudeByChart", **own, look_ahead=lane(width, real), **grid_fields(width, real))
        beam = dict.fromkeys(("beam", "point"), lane3(width, real))
        return struct("AltitudeByAltimeter", **own, **beam, row=wp.int32)

    return device(__name__, features, params=params, guide=by_chart if charted else by_altimeter)
