# SPDX-License-Identifier: Apache-2.0
"""Guidance round a circle about a place."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, upright
from lgvi_warp.reference.rotation import Array


def circled(
    r: Reference, y: Measurement, center: Array, radius: float, look_ahead: float, speed: float, clockwise: bool
) -> Reference:
    """Guide around a circle: along its tangent, turned towards it by atan((distance - radius) / look_ahead)."""
    sense = 1.0 if clockwise else -1.0
    out = y.position[:2] - np.asarray(center)[:2]
    bearing, distance = np.arctan2(out[1], out[0]), np.hypot(*out)
    turn = np.arctan((distance - radius) / look_ahead)
    tangent = bearing + sense * np.pi / 2.0
    rate = sense * np.cos(turn) * speed / max(distance, radius)
    outward, ahead = upright(bearing)[:, 0], upright(tangent)[:, 0]
    return replace(
        r,
        position=np.asarray(center) + radius * outward,
        velocity=speed * ahead,
        R=upright(tangent + sense * turn),
        angular_velocity=np.array([0.0, 0.0, rate]),
        speed=speed,
    )


class Loiter(Part):
    """Attributes as in `lw.control.Loiter`."""

    clockwise = True

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Guide onto the circle, and around it."""
        return circled(r, y, self.center, self.radius, self.look_ahead, self.speed, self.clockwise)
