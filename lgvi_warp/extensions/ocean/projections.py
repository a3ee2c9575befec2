# SPDX-License-Identifier: Apache-2.0
"""Coordinate reference systems of files, given as text or numbers: conversion to latitude and longitude."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import MissingExtra, refusal

# Words of a system in WKT that stand before the name of a file.
NAMES_A_FILE = ("PARAMETERFILE", "GRIDS=", "EXTENSION[")
# Parameters of a text of PROJ that name no file and no chain of steps.
PROJ_WORDS = frozenset((
    "proj", "lat_0", "lat_1", "lat_2", "lat_ts", "lon_0", "lon_1", "lon_2", "lonc", "alpha", "gamma", "k", "k_0", "x_0", "y_0",
    "a", "b", "rf", "f", "R", "ellps", "datum", "towgs84", "pm", "units", "to_meter", "zone", "south", "no_defs", "no_off",
    "no_uoff", "o_proj", "o_lat_p", "o_lon_p", "wktext", "type", "over",
))  # fmt: skip
# Attributes of a grid mapping that hold a text, in the order in which they are believed: WKT or PROJ, then a number of EPSG.
TEXTS = ("crs_wkt", "spatial_ref", "esri_pe_string", "proj4", "proj4_string", "proj4_params", "proj4text", "proj_string",
         "proj4string", "epsg", "epsg_code", "EPSG_code", "EPSG")  # fmt: skip
ELLIPSOID = ("semi_major_axis", "earth_radius")
ELLIPSOID_NAMES = ("reference_ellipsoid_name", "horizontal_datum_name", "geographic_crs_name", "ellipsoid", "datum")
COMMON = re.compile(r"wgs[ _]?(19)?84|world geodetic system 1984|grs[ _]?(19)?80", re.IGNORECASE)
# Distance over which directions of a projection are taken [m].
STEP = 10.0


@dataclass(frozen=True, eq=False)
class Projection:
    """Plane of x and y in a reference system. unit: Unit of its axes [m, or deg]. geographic: Whether this is degrees."""

    transformer: Any
    geographic: bool
    unit: float = 1.0

    def geodetic(self, x: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        """Latitudes and longitudes [deg] of x and y [m, or deg]; NaN for points outside the projection."""
        longitude, latitude = self.transformer.transform(
            np.asarray(x, float) / self.unit, np.asarray(y, float) / self.unit, direction="INVERSE"
        )
        known = np.isfinite(latitude) & np.isfinite(longitude)
        return np.where(known, latitude, np.nan), np.where(known, longitude, np.nan)

    def plane(self, latitude: Any, longitude: Any) -> tuple[np.ndarray, np.ndarray]:
        """x and y [m, or deg] of latitudes and longitudes [deg]."""
        x, y = self.transformer.transform(np.asarray(longitude, float), np.asarray(latitude, float))
        return np.asarray(x) * self.unit, np.asarray(y) * self.unit

    def neighbors(self, latitude: Any, longitude: Any, along: str) -> tuple[Any, Any]:
        """Points [deg] slightly behind and ahead of others along "x" or "y": latitudes and longitudes of both."""
        x, y = self.plane(latitude, longitude)
        step = STEP / 111e3 if self.geographic else STEP
        dx, dy = (step, 0.0) if along == "x" else (0.0, step)
        return self.geodetic(x - dx, y - dy), self.geodetic(x + dx, y + dy)


def transformer_of(system: Any) -> tuple[Any, bool, float]:
    """Transformer from longitude and latitude [deg] to a pyproj CRS, whether its axes are degrees, and their unit.

    Raises ValueError with the reason if there is no transformer.
    """
    from pyproj import CRS, Transformer

    text = system.to_wkt()
    # A shift by a grid names the file that holds it.
    if any(word in text.upper().replace("GRIDS=@NULL", "") for word in NAMES_A_FILE):
        raise ValueError("names a file of its own")
    system = CRS.from_wkt(text)
    system = system.sub_crs_list[0] if system.is_compound else system
    if not (system.is_geographic or system.is_projected):
        raise ValueError(f"is a {system.type_name.lower()}")
    system = system.to_2d()
    unit = 1.0 if system.is_geographic else float(system.axis_info[0].unit_conversion_factor)
    return Transformer.from_crs(CRS.from_epsg(4326), system, always_xy=True), system.is_geographic, unit


def projection(where: str, attributes: Mapping[str, Any]) -> Projection:
    """Plane of a grid mapping of the CF conventions, given by a text or by its parameters (CF 1.11, appendix F)."""
    try:
        from pyproj.exceptions import ProjError
    except ImportError as error:
        raise MissingExtra("projected grids", "pyproj", "ocean") from error
    try:
        return Projection(*transformer_of(_system(attributes)))
    except (ProjError, ValueError, TypeError, KeyError) as error:
        problem = (
            error.args[0] if type(error) is ValueError else f"is not understood, {' '.join(str(error).split())[:100]}"
        )
    raise refusal(where, attributes.get("grid_mapping_name", ""), f"has a coordinate reference system that {problem}",
                  f"give attributes = {{'{where}.epsg': 32631}}, with the number of its system")  # fmt: skip


def _system(attributes: Mapping[str, Any]) -> Any:
    """The pyproj CRS of a grid mapping."""
    from pyproj import CRS

    texts = [str(np.asarray(attributes[name]).flat[0]) for name in TEXTS if name in attributes]
    # In the order of the attributes of a file WKT, a text of PROJ and a number may stand under any of these names.
    for written in texts:
        # A sign of degrees in a file that says that it is in ASCII.
        text = " ".join(written.encode("utf-8", "surrogateescape").decode("utf-8", "replace").split())
        if "[" in text:
            return CRS.from_wkt(text)
        if text.startswith("+"):
            if unknown := sorted(set(re.findall(r"\+?([^\s=+]+)(?:=\S*)?", text)) - PROJ_WORDS):
                raise ValueError(f"has {unknown[0]}, which a grid has no need of")
            return CRS.from_proj4(text)
        if number := re.fullmatch(r"(?:EPSG:+)?(\d{4,6})(?:\.0)?", text, re.IGNORECASE):
            return CRS.from_epsg(int(number[1]))
    # Names of datums and the like would be looked up: numbers alone say where a node is.
    plain = {}
    for name in set(attributes) - set(TEXTS):
        with contextlib.suppress(ValueError, TypeError):
            plain[name] = np.squeeze(np.asarray(attributes[name], float)).tolist()
    named = " ".join(str(attributes[name]) for name in ELLIPSOID_NAMES if name in attributes)
    if not any(name in plain for name in ELLIPSOID):
        if not COMMON.search(named):
            raise ValueError("says no ellipsoid, such as semi_major_axis and inverse_flattening")
        plain |= {"semi_major_axis": 6378137.0, "inverse_flattening": 298.257223563}
    return CRS.from_cf(plain | {"grid_mapping_name": str(attributes.get("grid_mapping_name", ""))})
