"""A set-point: a place, a heading and a speed that are wanted all the time."""

from typing import Any

import warp as wp

from lgvi_kernels.law import cosine, neg, ones, sine, sub, vec3  # noqa: F401


@wp.func
def guide(r: Any, y: Any, p: Any):
    """Position, an upright attitude of this heading, and speed."""
    c = cosine(p.heading)
    s = sine(p.heading)
    zero = ones(c) - ones(c)
    r.position = vec3(p.position.x, p.position.y, p.depth)
    r.north = vec3(c, -s, zero)
    r.east = vec3(s, c, zero)
    r.down = vec3(zero, zero, ones(c))
    r.speed = p.speed
    return r
