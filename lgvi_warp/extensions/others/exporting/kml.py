# SPDX-License-Identifier: Apache-2.0
"""Tracks of members as a KML file, with times if the run has a date, else as lines; or regions of a footprint."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from lgvi_warp.common.files import new_text_file
from lgvi_warp.common.places import LocalPlane
from lgvi_warp.extensions.others.exporting.areas import areas
from lgvi_warp.extensions.others.exporting.lines import MapLine, lines
from lgvi_warp.store.exporting.tracks import Report, Tracks

if TYPE_CHECKING:
    from lgvi_warp.uncertainty.footprint.answer import Footprint

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">
<Document><name>Ensemble of underwater vehicles</name>
"""
# Style of a region: alpha, blue, green, red.
STYLE = {"LineStyle": "ffb27200", "PolyStyle": "40b27200"}
TAIL = "</Document>\n</kml>\n"

# Programs read such a file whole.
MOST_MEMBERS = 1000


def write(tracks: Tracks, target: Path, report: Report) -> None:
    """Write a document with a placemark for each member, one after the other."""
    with new_text_file(target) as file:
        file.write(HEAD)
        for done, line in enumerate(lines(tracks, "a map")):
            file.write(ET.tostring(_placemark(tracks, line), encoding="unicode") + "\n")
            report((done + 1) / tracks.count)
        file.write(TAIL)


def _placemark(tracks: Tracks, line: MapLine) -> ET.Element:
    """The placemark of a member: its name, its outcome, and its track or line."""
    placemark = ET.Element("Placemark")
    _text(placemark, "name", f"member {line.member}")
    data = ET.SubElement(placemark, "ExtendedData")
    for name, value in (("status", line.status), ("end_time", repr(line.end_time))):
        _text(ET.SubElement(data, "Data", name=name), "value", value)
    if len(line.points) == 0:
        return placemark
    if len(line.points) == 1:
        _coordinates(ET.SubElement(placemark, "Point"), line.points)
    elif tracks.environment.start is not None:
        _track(tracks, ET.SubElement(placemark, "gx:Track"), line)
    else:
        several = placemark if len(line.parts) == 1 else ET.SubElement(placemark, "MultiGeometry")
        for part in line.parts:
            _coordinates(ET.SubElement(several, "LineString"), part)
    return placemark


def _track(tracks: Tracks, track: ET.Element, line: MapLine) -> None:
    """Add times, then positions; a viewer joins two positions the short way, also across the antimeridian."""
    _text(track, "altitudeMode", "absolute")
    for moment in np.datetime_as_string(tracks.moments(line.points[:, 3])):
        _text(track, "when", f"{moment}Z")
    for point in line.points:
        _text(track, "gx:coord", " ".join(map(repr, point[:3].tolist())))


def _coordinates(geometry: ET.Element, points: np.ndarray) -> None:
    """Add longitude, latitude and height of points."""
    _text(geometry, "altitudeMode", "absolute")
    _places(geometry, points[:, :3])


def _places(geometry: ET.Element, points: np.ndarray) -> None:
    """Add longitude, latitude and, if given, height of points."""
    _text(geometry, "coordinates", " ".join(",".join(map(repr, point)) for point in points.tolist()))


def _text(parent: ET.Element, name: str, text: str) -> None:
    """Add an element with a text."""
    ET.SubElement(parent, name).text = text


def write_regions(footprint: Footprint, plane: LocalPlane, target: Path, report: Report) -> None:
    """Write a placemark for each region, the largest first, and one for the centre."""
    with new_text_file(target) as file:
        file.write(HEAD)
        for region, polygons in areas(footprint, plane):
            placemark = ET.Element("Placemark")
            _text(placemark, "name", region.percent)
            _text(placemark, "description", region.area_text)
            style = ET.SubElement(placemark, "Style")
            for name, color in STYLE.items():
                _text(ET.SubElement(style, name), "color", color)
            several = ET.Element("MultiGeometry")
            placemark.extend([several] if polygons else [])
            for rings in polygons:
                polygon = ET.SubElement(several, "Polygon")
                for i, ring in enumerate(rings):
                    boundary = ET.SubElement(polygon, "innerBoundaryIs" if i else "outerBoundaryIs")
                    _places(ET.SubElement(boundary, "LinearRing"), ring)
            file.write(ET.tostring(placemark, encoding="unicode") + "\n")
        placemark = ET.Element("Placemark")
        _text(placemark, "name", "centre")
        _text(placemark, "description", footprint.answer)
        latitude, longitude = plane.geodetic(*footprint.centre)
        _places(ET.SubElement(placemark, "Point"), np.array([[longitude, latitude]]))
        file.write(ET.tostring(placemark, encoding="unicode") + "\n" + TAIL)
