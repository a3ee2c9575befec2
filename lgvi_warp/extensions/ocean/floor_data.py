# SPDX-License-Identifier: Apache-2.0
"""Reader of the depth of the sea floor from NetCDF or GeoTIFF, interpolated to a regular grid in metres."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from lgvi_warp.common.declared import read
from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.places import LocalPlane
from lgvi_warp.extensions.ocean import cf
from lgvi_warp.extensions.ocean.data_sets import data_set, regular_file
from lgvi_warp.extensions.ocean.field_data import check_attributes
from lgvi_warp.extensions.ocean.floor_request import FloorRequest
from lgvi_warp.extensions.ocean.holes import filled
from lgvi_warp.extensions.ocean.rasters import is_raster, open_raster
from lgvi_warp.extensions.ocean.regrid import MARGIN, Onto, Placed, Regular, edge_of
from lgvi_warp.extensions.ocean.units import positive

# Nodes that a floor has at most: a scene holds them all.
MOST_NODES = 4_000_000


class DepthSource(Protocol):
    """Depths of a data set in the plane of a scene. positive: "up" if its numbers are elevations, "down" if depths."""

    positive: str

    def contains(self, north: np.ndarray, east: np.ndarray) -> np.ndarray:
        """Mask of points [m] with data around them."""

    def bounds(self) -> np.ndarray:
        """Least and largest north and east of the data, (2, 2) [m]."""

    def spacing(self) -> np.ndarray:
        """Distances between its nodes along north and east, (2,) [m]."""

    def depths(self, target: Regular) -> np.ndarray:
        """Depths (x, y) [m] at the nodes of a regular grid; missing values are NaN."""


@dataclass(frozen=True, eq=False)
class FloorNumbers:
    """Depths (x, y) [m] on a regular grid, position of its first node and spacing (2,) [m]."""

    depth: np.ndarray
    origin: np.ndarray
    spacing: np.ndarray


def read_floor(file: Any, request: FloorRequest) -> FloorNumbers:
    """Read the requested floor from a path or from an xarray Dataset."""
    faults = Faults()
    values = read(request, faults)
    region, spacing = values["region"], values["spacing"]
    if (origin := values["origin"]) is not None and abs(origin[0]) > 89.0:
        faults.add("origin", origin, "has a latitude beyond 89 degrees", "give [latitude, longitude] in degrees")
    if region is not None and np.any(region[:, 1] <= region[:, 0]):
        faults.add("region", region, "ends before it begins", "give [[from, to], [from, to]]: north and east [m]")
    if spacing is not None and np.any(spacing <= 0.0):
        faults.add("spacing", spacing, "is not positive", "give numbers above 0 [m]")
    check_attributes(faults, request.attributes)
    faults.raise_if_any()
    with _source(file, request, LocalPlane(*map(float, values["origin"])), region) as source:
        target = _target(source, region, source.spacing() if spacing is None else spacing)
        depth = source.depths(target)
    holes = int(np.count_nonzero(np.isnan(depth)))
    if holes == depth.size:
        raise refusal("region", "the file", "has no value there", "give a region in the water")
    if holes and request.fill == "refuse":
        remedy = "give fill = 'nearest', or 'zero' for land, or a region in open water"
        raise refusal("fill", request.fill, f"{holes:,} of {depth.size:,} depths are missing", remedy)
    depth = filled(depth[None], (float(target.spacing[0]), float(target.spacing[1])), request.fill)[0]
    if np.all(depth < 0.0):
        problem = f"makes all of the floor dry land, {-depth.max():.4g} to {-depth.min():.4g} m above the sea"
        other, meaning = ("down", "depths") if source.positive == "up" else ("up", "elevations")
        raise refusal("positive", source.positive, problem, f"give positive = {other!r} if the numbers are {meaning}")
    return FloorNumbers(depth, target.origin[:2], target.spacing[:2])


@contextlib.contextmanager
def _source(file: Any, request: FloorRequest, plane: LocalPlane, region: np.ndarray | None) -> Iterator[DepthSource]:
    """Content of the file."""
    with contextlib.ExitStack() as stack:
        if isinstance(file, str | os.PathLike):
            path, held = stack.enter_context(regular_file(file, "file"))
            if is_raster(held):
                if request.variable is not None:
                    raise refusal("variable", request.variable, "is asked of a raster, which has none", "leave it out")
                yield stack.enter_context(open_raster(path, held, plane, request.positive or "up"))
                return
        yield _Gridded(stack.enter_context(data_set(file, request.attributes)), request, plane, region)


class _Gridded:
    """A variable of a data set in the CF conventions."""

    def __init__(self, ds: Any, request: FloorRequest, plane: LocalPlane, region: np.ndarray | None):
        quantity, name = _variable(ds, request.variable)
        grid = cf.gridded(ds, quantity, name, plane.longitude)
        if grid.depth is not None or grid.scenarios > 1:
            raise refusal("variable", name, "has levels or scenarios, which a floor has not", "name another variable")
        self.placed = Placed(_cut(grid, plane, region), plane)
        said = positive(ds[name].attrs)
        # As `cf.gridded` has taken the numbers, to make depths of them.
        usual = "up" if quantity is cf.ELEVATION or said == "up" else "down"
        known = name in {cf.variable_name(ds[[name]], either) for either in (cf.FLOOR_DEPTH, cf.ELEVATION)}
        self.positive = request.positive or (said if said in ("up", "down") else usual if known else "")
        if not self.positive:
            raise refusal("variable", name, "says neither by standard_name nor by positive whether it is a depth",
                          "give positive = 'up' for elevations, 'down' for depths")  # fmt: skip
        self.sign = 1.0 if self.positive == usual else -1.0

    def contains(self, north: np.ndarray, east: np.ndarray) -> np.ndarray:
        return self.placed.contains(north, east)

    def bounds(self) -> np.ndarray:
        north, east = self.placed.north_east
        return np.array([[north.min(), north.max()], [east.min(), east.max()]])

    def spacing(self) -> np.ndarray:
        fine = np.array(self.placed.spacing())
        return np.full(2, fine.min()) if self.placed.grid.turned else fine

    def depths(self, target: Regular) -> np.ndarray:
        return self.sign * Onto(self.placed, target)(self.placed.grid.values())[..., 0]


def _variable(ds: Any, named: str | None) -> tuple[cf.OceanQuantity, str]:
    """Quantity and name of the variable that holds the floor."""
    both = (cf.FLOOR_DEPTH, cf.ELEVATION)
    if named is not None:
        name = str(cf.variable_name(ds, cf.FLOOR_DEPTH, named))
        elevation = name in {cf.variable_name(ds[[name]], cf.ELEVATION)}
        return (cf.ELEVATION if elevation else cf.FLOOR_DEPTH), name
    for quantity in both:
        if (found := cf.variable_name(ds, quantity)) is not None:
            return quantity, found
    raise cf.missing(ds, both)


def _cut(grid: cf.Gridded, plane: LocalPlane, region: np.ndarray | None) -> cf.Gridded:
    """The part of the grid that covers a region."""
    if region is None:
        return grid
    latitude, longitude = plane.geodetic(*edge_of(region))
    longitude = (longitude - plane.longitude + 180.0) % 360.0 - 180.0 + plane.longitude
    return grid.between(*grid.extent(latitude, longitude))


def _target(source: DepthSource, region: np.ndarray | None, spacing: np.ndarray) -> Regular:
    """The regular grid over a region, or over all data, with at most the given spacing."""
    if region is None:
        region = _within(source)
    elif not source.contains(*edge_of(region)).all():
        raise _small(source, region)
    intervals = np.maximum(np.ceil((region[:, 1] - region[:, 0]) / spacing - 1e-6), 1.0)
    if np.prod(intervals + 1.0) > MOST_NODES:
        nodes = " x ".join(f"{n + 1:.0f}" for n in intervals)
        remedy = f"give a smaller region or a wider spacing: at most {MOST_NODES:,} nodes"
        raise refusal("region", nodes, "are too many nodes for a scene", remedy)
    fine = (region[:, 1] - region[:, 0]) / intervals
    x, y = (int(n) + 1 for n in intervals)
    return Regular(np.array([*region[:, 0], 0.0]), np.array([*fine, 1.0]), (x, y, 1))


def _within(source: DepthSource) -> np.ndarray:
    """A box within the data, (2, 2) [m]: least and largest north, least and largest east."""
    box = source.bounds()
    middle = box.mean(axis=1, keepdims=True)
    whole, none = 1.0, 0.0
    if not source.contains(*edge_of(box)).all():
        for _ in range(40):
            half = 0.5 * (whole + none)
            fits = source.contains(*edge_of(middle + half * (box - middle))).all()
            whole, none = (whole, half) if fits else (half, none)
        box = middle + none * (1.0 - MARGIN) * (box - middle)
    return box


def _small(source: DepthSource, region: np.ndarray) -> SceneError:
    """The error for data that do not cover the requested region."""

    def words(box: np.ndarray) -> str:
        north, east = (f"{low / 1e3:.4g} to {high / 1e3:.4g} km" for low, high in box)
        return f"{north} north and {east} east"

    problem = f"is not within the data, {words(source.bounds())} of the origin"
    return refusal("region", words(region), problem, "give one within, or a larger file, or another origin")
