# SPDX-License-Identifier: Apache-2.0
"""The body's origin sinks to the sea floor: flat, or on a grid."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.cells import floor_at, grid_fields
from lgvi_kernels.law import *

# Params of a flat floor: where members stop.
params = make_params("numbers_floor", lanes="depth")


@wp.func
def distance(view: Any, p: Any):
    """Height above the floor [m]."""
    return p.depth - view.b.z


@wp.func
def distance_to_grid(view: Any, p: Any):
    """Height above where members stop [m]."""
    depth, by_north, by_east = floor_at(view, p, view.b.x, view.b.y)
    return depth - p.clearance - view.b.z


@functools.cache
def made(features):
    """The same of a floor on a grid."""

    @functools.cache
    def grid_params(width, real):
        return struct("FloorGrid", clearance=lane(width, real), **grid_fields(width, real))

    return device(__name__, features, params=grid_params, distance=distance_to_grid)
