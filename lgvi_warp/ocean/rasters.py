# SPDX-License-Identifier: Apache-2.0
"""Rasters of elevations, GeoTIFF in any projection: bilinear between the middles of their pixels."""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.common.errors import MissingExtra, SceneError, refusal
from lgvi_warp.common.reading import opened
from lgvi_warp.ocean.places import LocalPlane
from lgvi_warp.ocean.regrid import Regular, edge_of

# How TIFF and BigTIFF begin, by the order of their bytes.
MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
# Places between two pixels may lie so far beyond the last, in pixels, by round-off.
ROUND_OFF = 1e-6
# Rows and columns that differ by less than this part from east and north count as along them.
TURNED = 0.1


def is_raster(path: str) -> bool:
    """Whether a file begins as a TIFF."""
    with opened(path, "GeoTIFF file") as file:
        return file.read(4) in MAGIC


class Raster:
    """The first band of a GeoTIFF in the plane of a scene; only the part that is asked for is read."""

    def __init__(self, path: str, plane: LocalPlane, positive: str):
        self.path, self.plane, self.sign = path, plane, 1.0 if positive == "down" else -1.0
        library = _rasterio()
        try:
            with library.open(path, driver="GTiff") as file:
                self.crs, self.affine, self.shape = file.crs, file.transform, (file.height, file.width)
        except library.errors.RasterioError as error:
            raise _damaged(path, error) from error
        if self.crs is None:
            raise refusal(
                "file", path, "says no coordinate reference system", "write it, by gdal_edit.py -a_srs EPSG:4326"
            )
        if self.affine.determinant == 0.0 or min(self.shape) < 2:
            raise refusal("file", path, f"has no grid of pixels, {self.shape}", "give a GeoTIFF with a geotransform")

    def pixels(self, north: np.ndarray, east: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the row and of the column of places [m], with parts, from the middle of the first pixel on."""
        latitude, longitude = self.plane.geodetic(north, east)
        x, y = self._transformer.transform(longitude, latitude)
        if self.crs.is_geographic:
            # The same meridian within the raster, which may count from 0 to 360.
            middle, _ = _applied(self.affine, 0.5 * self.shape[1], 0.5 * self.shape[0])
            x = (np.asarray(x) - middle + 180.0) % 360.0 - 180.0 + middle
        column, row = _applied(~self.affine, x, y)
        return np.asarray(row - 0.5), np.asarray(column - 0.5)

    def contains(self, north: np.ndarray, east: np.ndarray) -> np.ndarray:
        """Which places [m] have four pixels around them."""
        inside = np.ones(np.shape(north), bool)
        for at, count in zip(self.pixels(north, east), self.shape, strict=True):
            inside &= (at >= -ROUND_OFF) & (at <= count - 1 + ROUND_OFF)
        return inside

    def bounds(self) -> np.ndarray:
        """Least and largest north and east, (2, 2) [m]."""
        north, east = self._places(*edge_of(np.array([[0.0, self.shape[0] - 1.0], [0.0, self.shape[1] - 1.0]])))
        return np.array([[north.min(), north.max()], [east.min(), east.max()]])

    def spacing(self) -> np.ndarray:
        """Distances of pixels in the middle along north and east (2,) [m]; of a raster that is turned the lesser for both."""
        row, column = 0.5 * (self.shape[0] - 1), 0.5 * (self.shape[1] - 1)
        north, east = self._places(np.array([row, row + 1.0, row]), np.array([column, column, column + 1.0]))
        steps = np.abs([north[1:] - north[0], east[1:] - east[0]])
        aligned = steps[1, 0] < TURNED * steps[0, 0] and steps[0, 1] < TURNED * steps[1, 1]
        lengths = np.hypot(*steps)
        return lengths if aligned else np.full(2, lengths.min())

    def depths(self, target: Regular) -> np.ndarray:
        """Depths (x, y) [m] at the nodes of a regular grid, NaN where one of the pixels around has no value."""
        row, column = self.pixels(*np.meshgrid(target.nodes(0), target.nodes(1), indexing="ij"))
        row, column = (np.clip(at, 0.0, n - 1.0) for at, n in zip((row, column), self.shape, strict=True))
        i, j = (np.minimum(at.astype(int), n - 2) for at, n in zip((row, column), self.shape, strict=True))
        window = (i.min(), i.max() + 2), (j.min(), j.max() + 2)
        values = self._values(window)
        i, j, x, y = i - window[0][0], j - window[1][0], row - i, column - j
        # A pixel without weight need not have a value.
        total = np.zeros(row.shape)
        for a, b, weight in ((0, 0, (1 - x) * (1 - y)), (0, 1, (1 - x) * y), (1, 0, x * (1 - y)), (1, 1, x * y)):
            total += np.where(weight > 0.0, weight * values[i + a, j + b], 0.0)
        return self.sign * total

    def _values(self, window: Any) -> np.ndarray:
        library = _rasterio()
        try:
            with library.open(self.path, driver="GTiff") as file:
                read = file.read(1, window=window, masked=True)
                scale, offset = file.scales[0], file.offsets[0]
        except library.errors.RasterioError as error:
            raise _damaged(self.path, error) from error
        return np.asarray(np.ma.filled(read.astype(np.float64), np.nan)) * scale + offset

    def _places(self, row: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """North and east [m] of numbers of rows and columns with parts."""
        x, y = _applied(self.affine, column + 0.5, row + 0.5)
        longitude, latitude = self._transformer.transform(x, y, direction="INVERSE")
        return self.plane.local(latitude, longitude)

    @property
    def _transformer(self) -> Any:
        from pyproj import CRS, Transformer

        return Transformer.from_crs(CRS.from_epsg(4326), CRS.from_wkt(self.crs.to_wkt()), always_xy=True)


def _applied(affine: Any, column: Any, row: Any) -> tuple[Any, Any]:
    """x and y of columns and rows, or the other way round for the inverse."""
    return affine.a * column + affine.b * row + affine.c, affine.d * column + affine.e * row + affine.f


def _rasterio() -> Any:
    try:
        import rasterio
        import rasterio.errors
    except ImportError as error:
        raise MissingExtra("rasters of the sea floor", "rasterio", "ocean") from error
    return rasterio


def _damaged(path: str, error: Exception) -> SceneError:
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return SceneError(
        [f"file = {path}: is damaged, or no GeoTIFF: {reason}; give the path of a GeoTIFF or NetCDF file"]
    )
