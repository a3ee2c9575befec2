# SPDX-License-Identifier: Apache-2.0
"""Imports for the author of a law, an event or a controller: lanes, their functions, structs, and functions of a View.

A law that writes + - * / between lanes imports `add`, `sub`, `mul`, `div` too: Warp looks the operators up by name. The minus
before a lane or a 3-vector needs none.
"""

import functools

import warp as wp

from lgvi_kernels.lanes.arithmetic import (
    absolute,
    add,
    below,
    cross,
    div,
    dot,
    int_lane,
    lane,
    lane3,
    least,
    mul,
    neg,
    ones,
    positive,
    sub,
    vec3,
    whole,
)
from lgvi_kernels.lanes.functions import (
    SMALL_TURN,
    arctangent2,
    clamp,
    cosine,
    decay,
    exponential,
    fused,
    greatest,
    hyperbolic_tangent,
    logarithm,
    normals,
    normals3,
    quarter,
    root,
    rounded,
    sine,
    turned_by,
)
from lgvi_kernels.lanes.noise import normals_over, wandered
from lgvi_kernels.lanes.state import struct
from lgvi_kernels.lanes.view import (
    add_drag_at,
    add_outer,
    add_rows,
    command,
    end_of_half,
    gather1,
    gather3,
    heading_error,
    less_products,
    less_rows,
    ramp,
    remember,
    remembered,
    row1,
    row3,
    slope_against,
    slope_along,
    table1,
    table3,
    to_body,
    to_inertial,
    velocity_at,
)


def make_params(name, **groups):
    """The struct of a law as a function of (width, real), from names of its `lanes`, `vectors` and whole `words`, in order."""

    @functools.cache
    def params(width, real):
        kinds = {"lanes": lane(width, real), "vectors": lane3(width, real), "words": wp.int32}
        return struct(name, **{field: kinds[kind] for kind, names in groups.items() for field in names.split()})

    return params
