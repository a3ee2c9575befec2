# SPDX-License-Identifier: Apache-2.0
"""Rasters of elevations, GeoTIFF in any projection, with bilinear interpolation between pixel centres."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.errors import MissingExtra, SceneError, refusal
from lgvi_warp.common.places import LocalPlane
from lgvi_warp.common.sentences import capital
from lgvi_warp.extensions.ocean.projections import transformer_of
from lgvi_warp.extensions.ocean.regrid import Regular, edge_of

# How TIFF and BigTIFF begin, by the order of their bytes.
MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
# Places between two pixels may lie so far beyond the last, in pixels, by round-off.
ROUND_OFF = 1e-6
# Rows and columns that differ by less than this part from east and north count as along them.
TURNED = 0.1

# Neither sidecars (.msk, .ovr, .aux.xml) nor folders are looked at; the file is open, so that its name leads nowhere.
OPTIONS = {"GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR", "GDAL_PAM_ENABLED": "NO"}


def is_raster(file: BinaryIO) -> bool:
    """Whether an open file begins as a TIFF."""
    begin = file.read(4)
    file.seek(0)
    return begin in MAGIC


class Raster:
    """The first band of an open GeoTIFF in the plane of a scene; only the requested part is read."""

    def __init__(self, path: str, plane: LocalPlane, positive: str, file: Any):
        self.path, self.plane, self.positive, self.file = path, plane, positive, file
        self.sign = 1.0 if positive == "down" else -1.0
        self.affine, self.shape = file.transform, (file.height, file.width)
        if file.crs is None:
            raise refusal(
                "file", path, "says no coordinate reference system", "write it, by gdal_edit.py -a_srs EPSG:4326"
            )
        with np.errstate(all="ignore"):
            grid = min(self.shape) > 1 and self.affine.determinant != 0.0
            if not (grid and np.isfinite([*self.affine, self.affine.determinant, *~self.affine]).all()):
                raise refusal(
                    "file", path, f"has no grid of pixels, {self.shape}", "give a GeoTIFF with a geotransform"
                )
        self.transformer, self.geographic = self._transformer(file.crs)
        if not (np.isfinite(self.bounds()).all() and np.all(self.spacing() > 0.0)):
            raise refusal(
                "file", path, "lies at no place of the Earth", "correct its geotransform, by gdal_edit.py -a_ullr"
            )

    def pixels(self, north: np.ndarray, east: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Fractional row and column indices of points [m], counted from the centre of the first pixel."""
        latitude, longitude = self.plane.geodetic(north, east)
        x, y = self.transformer.transform(longitude, latitude)
        if self.geographic:
            # The same meridian within the raster, which may count from 0 to 360.
            middle, _ = _applied(self.affine, 0.5 * self.shape[1], 0.5 * self.shape[0])
            with np.errstate(invalid="ignore"):
                x = (np.asarray(x) - middle + 180.0) % 360.0 - 180.0 + middle
        column, row = _applied(~self.affine, x, y)
        return np.asarray(row - 0.5), np.asarray(column - 0.5)

    def contains(self, north: np.ndarray, east: np.ndarray) -> np.ndarray:
        """Mask of points [m] with four pixels around them."""
        inside = np.ones(np.shape(north), bool)
        for at, count in zip(self.pixels(north, east), self.shape, strict=True):
            inside &= (at >= -ROUND_OFF) & (at <= count - 1 + ROUND_OFF)
        return inside

    def bounds(self) -> np.ndarray:
        """Least and largest north and east, (2, 2) [m]."""
        north, east = self._places(*edge_of(np.array([[0.0, self.shape[0] - 1.0], [0.0, self.shape[1] - 1.0]])))
        known = np.isfinite(north) & np.isfinite(east)
        # A projection may not reach the corners.
        north, east = (np.append(x[known], [] if known.any() else np.nan) for x in (north, east))
        return np.array([[north.min(), north.max()], [east.min(), east.max()]])

    def spacing(self) -> np.ndarray:
        """Pixel distances along north and east at the centre (2,) [m]; for a rotated raster, the lesser for both."""
        row, column = 0.5 * (self.shape[0] - 1), 0.5 * (self.shape[1] - 1)
        north, east = self._places(np.array([row, row + 1.0, row]), np.array([column, column, column + 1.0]))
        steps = np.abs([north[1:] - north[0], east[1:] - east[0]])
        aligned = steps[1, 0] < TURNED * steps[0, 0] and steps[0, 1] < TURNED * steps[1, 1]
        lengths = np.hypot(*steps)
        return lengths if aligned else np.full(2, lengths.min())

    def depths(self, target: Regular) -> np.ndarray:
        """Depths (x, y) [m] at the nodes of a regular grid; NaN if one of the four pixels around has no value."""
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
        rows, columns = (int(high - low) for low, high in window)
        available = machine.memory_bytes()
        if available is not None and 32.0 * rows * columns > available:
            raise refusal(
                "region", f"{rows:,} x {columns:,}", "are more pixels than the memory holds", "give a smaller one"
            )
        with _damage(self.path):
            read = self.file.read(1, window=window, masked=True)
            scale, offset = self.file.scales[0], self.file.offsets[0]
        return np.asarray(np.ma.filled(read.astype(np.float64), np.nan)) * scale + offset

    def _places(self, row: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """North and east [m] of fractional row and column indices."""
        x, y = _applied(self.affine, column + 0.5, row + 0.5)
        longitude, latitude = self.transformer.transform(x, y, direction="INVERSE")
        north, east = self.plane.local(latitude, longitude)
        known = np.isfinite(north) & np.isfinite(east)
        return np.where(known, north, np.nan), np.where(known, east, np.nan)

    def _transformer(self, crs: Any) -> tuple[Any, bool]:
        """Transformer from longitude and latitude [deg] to the raster's x and y, and whether these are degrees, too."""
        from pyproj import CRS
        from pyproj.exceptions import ProjError

        try:
            transformer, geographic, _ = transformer_of(CRS.from_wkt(crs.to_wkt(version="WKT2_2019")))
            return transformer, geographic
        except (ProjError, ValueError) as error:  # rasterio's errors of such systems are ValueErrors
            said = " ".join(str(error).split())[:100]
            problem = (
                said
                if type(error) is ValueError and said.startswith(("names", "is a"))
                else f"is not understood, {said}"
            )
        raise refusal("file", self.path, f"has a coordinate reference system that {problem}",
                      "write one of latitudes and longitudes or a projection, by gdalwarp -t_srs EPSG:4326")  # fmt: skip


def _applied(affine: Any, column: Any, row: Any) -> tuple[Any, Any]:
    """x and y of columns and rows; with the inverse affine map, columns and rows of x and y."""
    return affine.a * column + affine.b * row + affine.c, affine.d * column + affine.e * row + affine.f


@contextlib.contextmanager
def open_raster(path: str, file: BinaryIO, plane: LocalPlane, positive: str) -> Iterator[Raster]:
    """Open the raster of an open file; the file stays open."""
    try:
        import rasterio
    except ImportError as error:
        raise MissingExtra("rasters of the sea floor", "rasterio", "ocean") from error
    with contextlib.ExitStack() as stack:
        stack.enter_context(rasterio.Env(**OPTIONS))
        with _damage(path):
            source = stack.enter_context(rasterio.open(file, driver="GTiff"))
        yield Raster(path, plane, positive, source)


@contextlib.contextmanager
def _damage(path: str) -> Iterator[None]:
    """Convert the library's errors for a damaged file into a SceneError."""
    from rasterio.errors import RasterioError

    try:
        yield
    except (RasterioError, ValueError, MemoryError) as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        remedy = "give the path of a GeoTIFF or NetCDF file"
        raise SceneError([f"file = {path} is damaged, or no GeoTIFF: {reason}. {capital(remedy)}"]) from error
