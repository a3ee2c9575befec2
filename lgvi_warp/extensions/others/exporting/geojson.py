# SPDX-License-Identifier: Apache-2.0
"""Tracks of members, or regions of a footprint, as a GeoJSON file (RFC 7946) with one feature for each.

A track has its member's outcome and the times of its points. A region has its probability and its area.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.files import new_text_file
from lgvi_warp.common.places import LocalPlane
from lgvi_warp.criteria.files import finite_or_none
from lgvi_warp.extensions.others.exporting.areas import areas
from lgvi_warp.extensions.others.exporting.lines import MapLine, lines
from lgvi_warp.store.exporting.tracks import Report, Tracks

if TYPE_CHECKING:
    from lgvi_warp.uncertainty.footprint.answer import Footprint

# Programs read such a file whole.
MOST_MEMBERS = 1000


def write(tracks: Tracks, target: Path, report: Report) -> None:
    """Write a collection of features, one after the other."""
    with new_text_file(target) as file:
        start = {} if tracks.environment.start is None else {"start": f"{tracks.moments(np.zeros(()))}Z"}
        file.write(json.dumps({"type": "FeatureCollection", "source": tracks.source} | start)[:-1])
        file.write(', "features": [')
        for done, line in enumerate(lines(tracks, "a map")):
            file.write(",\n" if done else "\n")
            file.write(json.dumps(_feature(line), allow_nan=False))
            report((done + 1) / tracks.count)
        file.write("\n]}\n")


def _feature(line: MapLine) -> dict[str, Any]:
    """The feature of a member: its line, and the times of its points."""
    geometry, times = _geometry(line)
    properties = {"member": line.member, "status": line.status, "end_time": line.end_time, "times": times}
    return {"type": "Feature", "id": line.member, "geometry": geometry, "properties": properties}


def _geometry(line: MapLine) -> tuple[dict[str, Any] | None, Any]:
    """The geometry of a line, and its times [s] in the same lists; None without points, a point for one."""
    if len(line.points) == 0:
        return None, []
    if len(line.points) == 1:
        return {"type": "Point", "coordinates": line.points[0, :3].tolist()}, line.points[0, 3].tolist()
    places, times = zip(*((part[:, :3].tolist(), part[:, 3].tolist()) for part in line.parts), strict=True)
    if len(places) == 1:
        return {"type": "LineString", "coordinates": places[0]}, times[0]
    return {"type": "MultiLineString", "coordinates": list(places)}, list(times)


def write_regions(footprint: Footprint, plane: LocalPlane, target: Path, report: Report) -> None:
    """Write a feature for each region, the largest first, and a point for the centre."""
    features: list[dict[str, Any]] = []
    for region, polygons in areas(footprint, plane):
        numbers = {name: getattr(region, name) for name in ("share", "area", "low", "high", "radius")}
        places = [[ring.tolist() for ring in rings] for rings in polygons]
        geometry = {"type": "MultiPolygon", "coordinates": places} if places else None
        features.append({"type": "Feature", "geometry": geometry, "properties": finite_or_none(numbers)})
    latitude, longitude = map(float, plane.geodetic(*footprint.centre))
    centre = {"type": "Point", "coordinates": [longitude, latitude]}
    features.append({"type": "Feature", "geometry": centre, "properties": {"answer": footprint.answer}})
    with new_text_file(target) as file:
        file.write(json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False) + "\n")
