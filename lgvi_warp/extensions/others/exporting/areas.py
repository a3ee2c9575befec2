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
# A point on the antimeridian counts as so far to the east of it [deg].
ON_LIMIT = 1e-12


def areas(footprint: Footprint, plane: LocalPlane) -> Iterator[tuple[Region, list[Rings]]]:
    """Yield the regions with their polygons, the largest first, so that no region hides a smaller one."""
    for region in sorted(footprint.regions, key=lambda region: -region.share):
        polygons = [_on_map(polygon, plane) for polygon in region.polygons]
        yield region, [part for rings in polygons for part in divided(rings)]


def _on_map(polygon: tuple[np.ndarray, ...], plane: LocalPlane) -> Rings:
    """Convert the rings of a polygon to longitude and latitude; longitudes exceed 180 degrees if the polygon does."""
    rings: Rings = []
    for ring in polygon:
        latitude, longitude = plane.geodetic(ring[:, 0], ring[:, 1])
        longitude = np.unwrap(longitude, period=360.0)
        if not (np.isfinite(longitude).all() and abs(longitude[-1] - longitude[0]) < 180.0):
            raise SceneError(["regions: one holds a pole or reaches around the Earth. Draw it by lw.plots.footprint"])
        if rings:
            longitude += 360.0 * round((rings[0][:, 0].mean() - longitude.mean()) / 360.0)
        rings.append(np.stack([longitude, latitude], axis=1))
    return rings


def divided(rings: Rings) -> list[Rings]:
    """Divide a polygon at the antimeridian (RFC 7946, 3.1.9)."""
    first, last = (math.floor((end + 180.0) / 360.0) for end in (rings[0][:, 0].min(), rings[0][:, 0].max()))
    return [
        [ring - [360.0 * turn, 0.0] for ring in part]
        for turn in range(first, last + 1)
        for east in _beyond(rings, 360.0 * turn - 180.0, 1.0)
        for part in _beyond(east, 360.0 * turn + 180.0, -1.0)
    ]


def _beyond(polygon: Rings, limit: float, sign: float) -> list[Rings]:
    """Keep the parts of a polygon where sign * (longitude - limit) is positive.

    Along the limit, going north or south, the rings alternately enter this half and leave it. So the end of each chain of
    kept points is joined to the start of the same rank, and holes that reach the limit become part of the outer rings.
    """
    chains: list[np.ndarray] = []
    whole: Rings = []
    for ring in polygon:
        inside = sign * (ring[:-1, 0] - limit)
        inside[inside == 0.0] = sign * ON_LIMIT
        if (inside > 0.0).all():
            whole.append(ring)
        elif (inside > 0.0).any():
            begin = int(np.flatnonzero((inside > 0.0) & (np.roll(inside, 1) < 0.0))[0])
            points, inside = np.roll(ring[:-1], -begin, axis=0), np.roll(inside, -begin)
            before, earlier = np.roll(points, 1, axis=0), np.roll(inside, 1)
            with np.errstate(divide="ignore", invalid="ignore"):
                crossings = before + (points - before) * (earlier / (earlier - inside))[:, None]
            crossings[:, 0] = limit  # whatever the rounding
            turns = np.flatnonzero((inside > 0.0) != (earlier > 0.0))
            chains += [np.vstack([crossings[a], points[a:b], crossings[b]]) for a, b in turns.reshape(-1, 2)]
    if not chains:
        return [whole] if whole else []
    starts, ends = (np.argsort([chain[end, 1] for chain in chains]) for end in (0, -1))
    following = dict(zip(ends.tolist(), starts.tolist(), strict=True))
    outer = []
    while following:
        k, loop = next(iter(following)), []
        while k in following:
            loop.append(chains[k])
            k = following.pop(k)
        outer.append(np.vstack([*loop, loop[0][:1]]))
    outer = [ring for ring in outer if np.ptp(ring[:, 0]) > 0.0]
    return [[ring, *(hole for hole in whole if _holds(ring, hole[0]))] for ring in outer]


def _holds(ring: np.ndarray, place: np.ndarray) -> bool:
    """Whether a point is within a ring: a ray to the east crosses the ring an odd number of times."""
    a, b = ring[:-1], ring[1:]
    across = (a[:, 1] > place[1]) != (b[:, 1] > place[1])
    a, b = a[across], b[across]
    east = a[:, 0] + (b[:, 0] - a[:, 0]) * (place[1] - a[:, 1]) / (b[:, 1] - a[:, 1])
    return bool(np.count_nonzero(east > place[0]) % 2)
