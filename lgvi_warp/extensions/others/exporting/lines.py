# SPDX-License-Identifier: Apache-2.0
"""Tracks as lines on a map: positions and times of each member until its end, cut at the antimeridian."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lgvi_warp.store.exporting.tracks import Tracks


@dataclass(frozen=True, eq=False)
class MapLine:
    """The track of a member.

    member: Index in its ensemble. status: Outcome as a word. end_time: Time at which the member ended [s].
    points: Longitude, latitude [deg], height [m] and time [s], (p, 4); points that are not finite are left out.
    """

    member: int
    status: str
    end_time: float
    points: np.ndarray

    @property
    def parts(self) -> list[np.ndarray]:
        """The points in parts that do not cross the antimeridian."""
        return cut(self.points)


def lines(tracks: Tracks, purpose: str) -> Iterator[MapLine]:
    """Read the lines of the members, in groups of members."""
    tracks.needing(("position",), purpose)
    plane = tracks.needing_origin(purpose)
    statuses, ends = tracks.statuses(), tracks.of_members("end_time")
    for rows in tracks.pieces(7):
        positions = np.asarray(tracks.sample("position", rows), dtype=np.float64)
        for i, member in enumerate(range(rows.start, rows.stop)):
            index, times = tracks.path(member)
            latitude, longitude = plane.geodetic(positions[index, i, 0], positions[index, i, 1])
            points = np.stack([longitude, latitude, 0.0 - positions[index, i, 2], times], axis=1)
            points = points[np.isfinite(points).all(axis=1)]
            yield MapLine(int(tracks.members[member]), statuses[member], float(ends[member]), points)


def cut(points: np.ndarray) -> list[np.ndarray]:
    """Divide points (p, 4) at crossings of the antimeridian; the parts on both sides end on it.

    Latitude, height and time are interpolated by longitude (RFC 7946, 3.1.9).
    """
    parts, first = [], 0
    begin: list[np.ndarray] = []
    for i in np.flatnonzero(np.abs(np.diff(points[:, 0])) > 180.0).tolist():
        before, after = points[i], points[i + 1]
        side = np.copysign(180.0, before[0])
        way = after[0] + 2.0 * side - before[0]
        middle = before + (after - before) * ((side - before[0]) / way if way else 0.0)
        parts.append(np.concatenate([*begin, points[first : i + 1], [[side, *middle[1:]]]]))
        begin, first = [np.array([[-side, *middle[1:]]])], i + 1
    return [*parts, np.concatenate([*begin, points[first:]])]
