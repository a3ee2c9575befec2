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
    """Request for depths from a file; numbers that are None follow from the file.

    Args:
        origin: Latitude and longitude [deg] of the origin of the inertial axes, (2,).
        region: Least and largest north and east to read, (2, 2) [m]; by default the whole file.
        spacing: Distances between the nodes of the regular grid [m], (2,); by default as fine as the file.
        variable: Name of the NetCDF variable; by default the variable that is a floor depth or an elevation by its
            standard_name or by a usual name.
        positive: "up" if the numbers are elevations, "down" if they are depths. With "", the default, the variable states
            the direction, and a raster is "up".
        fill: Treatment of missing values: "refuse", the default; "nearest"; or "zero", for land at the surface.
        attributes: Missing or wrong attributes of a NetCDF file: a table of "variable.attribute" with their values, for
            instance {"z.grid_mapping": "EPSG:3996"}.
    """

    origin: Any = array(shape=(2,), unit="deg")
    region: Any = array(None, shape=(2, 2), unit="m")
    spacing: Any = array(None, shape=(2,), unit="m")
    variable: str | None = None
    positive: str = word("", known=POSITIVE)
    fill: str = word("refuse", known=FILLS)
    attributes: Any = None
