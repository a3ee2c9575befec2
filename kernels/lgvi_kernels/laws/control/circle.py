# SPDX-License-Identifier: Apache-2.0
"""The way onto a circle about a place, and round it."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.set_point import headed


@wp.func
def circled(r: Any, y: Any, centre: Any, radius: Any, look_ahead: Any, speed: Any, sense: Any):
    """r round a circle: its tangent, turned towards the circle by atan((distance - radius) / look_ahead).

    sense: 1 clockwise from above, -1 counter-clockwise.
    """
    unity = ones(radius)
    zero = unity - unity
    north = y.position.x - centre.x
    east = y.position.y - centre.y
    distance = root(north * north + east * east)
    # From the centre itself north is outward.
    c = positive(distance, north / distance, unity)
    s = positive(distance, east / distance, zero)
    aside = distance - radius
    size = root(look_ahead * look_ahead + aside * aside)
    along = look_ahead / size
    inward = aside / size
    x = -(sense * s)
    z = sense * c
    r = headed(r, along * x - inward * c, along * z - inward * s)
    r.angular_velocity = vec3(zero, zero, sense * along * speed / greatest(distance, radius))
    r.position = vec3(centre.x + radius * c, centre.y + radius * s, centre.z)
    r.velocity = vec3(speed * x, speed * z, zero)
    r.speed = speed
    return r
