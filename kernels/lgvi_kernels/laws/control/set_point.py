# SPDX-License-Identifier: Apache-2.0
"""A set-point: a place, a heading and a speed that are wanted all the time."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

# Numbers, and whether place, depth (level), heading (turn) and speed (pace) are wanted.
params = make_params("SetPoint", vectors="position", lanes="depth heading speed", words="place level turn pace")


@wp.func
def headed(r: Any, c: Any, s: Any):
    """r with an upright attitude of the heading whose cosine and sine are c and s."""
    zero = ones(c) - ones(c)
    r.north = vec3(c, -s, zero)
    r.east = vec3(s, c, zero)
    r.down = vec3(zero, zero, ones(c))
    return r


@wp.func
def guide(r: Any, y: Any, p: Any):
    """Position, an upright attitude of this heading, and speed."""
    if p.place > 0:
        r.position = p.position
    if p.level > 0:
        r.position = vec3(r.position.x, r.position.y, p.depth)
    if p.turn > 0:
        r = headed(r, cosine(p.heading), sine(p.heading))
    if p.pace > 0:
        r.speed = p.speed
    return r
