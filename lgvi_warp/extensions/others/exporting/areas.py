# SPDX-License-Identifier: Apache-2.0
"""Regions of a footprint as polygons on a map, cut where they cross the antimeridian."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.places import LocalPlane

if TYPE_CHECKING:
    from lgvi_warp.uncertainty.footprint.answer import Footprint, Region

# Rings (k, 2) of longitudes and latitudes [deg]: the outer one counterclockwise, then those of holes, clockwise.
Rings = list[np.ndarray]


def areas(footprint: Footprint, plane: LocalPlane) -> Iterator[tuple[Region, list[Rings]]]:
    """Give the regions with their polygons, the largest first, so that no region hides a smaller one."""
    for region in sorted(footprint.regions, key=lambda region: -region.share):
        polygons = [_on_map(polygon, plane) for polygon in region.polygons]
        yield region, [part for rings in polygons for part in _cut(rings)]


def _on_map(polygon: tuple[np.ndarray, ...], plane: LocalPlane) -> Rings:
    """Convert the rings of a polygon; longitudes go on beyond 180 degrees where the polygon does."""
    rings: Rings = []
    for ring in polygon:
        latitude, longitude = plane.geodetic(ring[:, 0], ring[:, 1])
        longitude = np.unwrap(longitude, period=360.0)
        if not (np.isfinite(longitude).all() and abs(longitude[-1] - longitude[0]) < 180.0):
            raise SceneError(["regions: one holds a pole or reaches around the Earth; draw it by lw.plots.footprint"])
        if rings:
            longitude += 360.0 * round((rings[0][:, 0].mean() - longitude.mean()) / 360.0)
        rings.append(np.stack([longitude, latitude], axis=1))
    return rings


def _cut(rings: Rings) -> list[Rings]:
    """Divide a polygon at the antimeridian (RFC 7946, 3.1.9)."""
    first, last = (math.floor((end + 180.0) / 360.0) for end in (rings[0][:, 0].min(), rings[0][:, 0].max()))
    parts = []
    for turn in range(first, last + 1):
        middle = 360.0 * turn
        sides = [_beyond(_beyond(ring, 180.0 - middle), 180.0 + middle, -1.0) for ring in rings]
        parts.append([side - [middle, 0.0] for side in sides if len(side) > 3])
    return parts


def _beyond(ring: np.ndarray, limit: float, sign: float = 1.0) -> np.ndarray:
    """Keep the part of a ring where sign * longitude + limit is not negative (Sutherland & Hodgman 1974)."""
    inside = sign * ring[:, 0] + limit
    if (inside >= 0.0).all():
        return ring
    kept = []
    for a, b, of_a, of_b in zip(ring[:-1], ring[1:], inside[:-1], inside[1:], strict=True):
        kept += [a] if of_a >= 0.0 else []
        # On the antimeridian itself, whatever the rounding.
        kept += [np.array([-sign * limit, a[1] + (b[1] - a[1]) * of_a / (of_a - of_b)])] if of_a * of_b < 0.0 else []
    return np.array([*kept, *kept[:1]]).reshape(-1, 2)
