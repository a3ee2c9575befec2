# SPDX-License-Identifier: Apache-2.0
"""Request for the depth of the sea floor from a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lgvi_warp.common.declared import array, word
from lgvi_warp.extensions.ocean.holes import FILLS

POSITIVE = ("", "up", "down")


@dataclass(frozen=True, eq=False)
class FloorRequest:
    """Request for depths from a file; numbers that are None follow from it.

    Args:
        origin: Latitude and longitude [deg] of the origin of the inertial axes, (2,).
        region: Least and largest north and east that are read, (2, 2) [m]; by default all that is in the file.
        spacing: Distances of the nodes that are made [m], (2,); by default as fine as the file's own.
        variable: Name of the variable of NetCDF; by default the one that is a depth of the floor or an elevation by its
            standard_name, or by the name that data sets give it.
        positive: "up" where numbers are elevations, "down" where they are depths; by default "" what the variable says, and
            "up" of a raster.
        fill: What stands where values are missing: "refuse", the default, nothing; "nearest"; or "zero", land at the surface.
        attributes: Attributes that a NetCDF file lacks or has wrong: a table of "variable.attribute" and their values, for
            instance {"z.grid_mapping": "EPSG:3996"}.
    """

    origin: Any = array(shape=(2,), unit="deg")
    region: Any = array(None, shape=(2, 2), unit="m")
    spacing: Any = array(None, shape=(2,), unit="m")
    variable: str | None = None
    positive: str = word("", known=POSITIVE)
    fill: str = word("refuse", known=FILLS)
    attributes: Any = None
