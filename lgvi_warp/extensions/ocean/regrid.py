# SPDX-License-Identifier: Apache-2.0
"""Linear interpolation from the grid of a data set to a regular grid in metres, and back."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.common.places import LocalPlane
from lgvi_warp.extensions.ocean.cf import Gridded
from lgvi_warp.extensions.ocean.curvilinear import CurvedGrid
from lgvi_warp.extensions.ocean.s_levels import at_depths

# Part of a cell by which a place may lie outside, despite round-off.
ROUND_OFF = 1e-6
# How far inside the edge of its data a grid that is not told stays, as a part of its size: edges are curved in the plane.
MARGIN = 1e-6
# Places along each side of a box.
ON_EDGE = 21
# The angle that a file tells and the directions of its own nodes may differ by so much [rad].
MOST_OFF = 0.2


@dataclass(frozen=True, eq=False)
class Regular:
    """A regular grid in north, east and depth [m]: first node, spacing and number of nodes along each."""

    origin: np.ndarray
    spacing: np.ndarray
    counts: tuple[int, int, int]

    def nodes(self, axis: int) -> np.ndarray:
        """Positions of the nodes along an axis."""
        return np.asarray(self.origin[axis] + self.spacing[axis] * np.arange(self.counts[axis]))


@dataclass(frozen=True, eq=False)
class Placed:
    """A grid of a data set on a plane of metres."""

    grid: Gridded
    plane: LocalPlane

    @functools.cached_property
    def placed_nodes(self) -> np.ndarray:
        """Mask of the nodes (y, x) that have a position."""
        return np.isfinite(self.grid.places()[0])

    @functools.cached_property
    def north_east(self) -> tuple[np.ndarray, np.ndarray]:
        """North and east of the nodes (y, x) [m]; nodes without a position are extrapolated from the others."""
        north, east = self.plane.local(*self.grid.places())
        return (
            (north, east)
            if self.placed_nodes.all()
            else (_extended(north, self.placed_nodes), _extended(east, self.placed_nodes))
        )

    @functools.cached_property
    def curved(self) -> CurvedGrid:
        """This grid as a grid of cells with four corners."""
        return CurvedGrid(*self.north_east, self.placed_nodes)

    def fractions(self, north: np.ndarray, east: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Fractional row and column indices of points, also beyond the grid."""
        if not self.grid.rectilinear:
            return self.curved.fractions(north, east)
        latitude, longitude = self.plane.geodetic(north, east)
        if self.grid.projection is not None:
            x, y = self.grid.projection.plane(latitude, longitude)
            return _numbered(y, self.grid.latitude), _numbered(x, self.grid.longitude)
        middle = 0.5 * (self.grid.longitude[0] + self.grid.longitude[-1])
        longitude = (longitude - middle + 180.0) % 360.0 - 180.0 + middle
        return _numbered(latitude, self.grid.latitude), _numbered(longitude, self.grid.longitude)

    def contains(self, north: np.ndarray, east: np.ndarray) -> np.ndarray:
        """Mask of points within the outermost nodes; an axis of one node contains all points."""
        inside = np.ones(np.shape(north), bool)
        for at, count in zip(self.fractions(north, east), self.grid.shape[3:], strict=True):
            if count > 1:
                inside &= (at >= -ROUND_OFF) & (at <= count - 1 + ROUND_OFF)
        return inside

    def inner_box(self) -> np.ndarray:
        """A box within the data, (2, 2) [m]: least and largest north, least and largest east."""
        north, east = self.north_east
        box = np.array([[north.min(), north.max()], [east.min(), east.max()]])
        middle = np.array([[x.mean()] for x in (north, east)])
        if self.grid.rectilinear:
            box = np.array([[north[0].max(), north[-1].min()], [east[:, 0].max(), east[:, -1].min()]])
            middle = box.mean(axis=1, keepdims=True)
        whole, none = 1.0, 0.0
        if not self.contains(*edge_of(box)).all():
            for _ in range(40):
                half = 0.5 * (whole + none)
                within = self.contains(*edge_of(middle + half * (box - middle))).all()
                whole, none = (whole, half) if within else (half, none)
            box = middle + none * (1.0 - MARGIN) * (box - middle)
        return box

    def spacing(self) -> tuple[float, float]:
        """Least distance between neighbours along y and along x [m]; 0 along an axis of one node."""
        north, east = (np.where(self.placed_nodes, x, np.nan) for x in self.north_east)
        steps = (np.hypot(np.diff(north, axis=axis), np.diff(east, axis=axis)) for axis in (0, 1))
        # Nodes that a writer repeats, at a fold or a seam, are no neighbors.
        along_y, along_x = (float(np.min(step, initial=np.inf, where=step > 0.0)) for step in steps)
        return tuple(step if np.isfinite(step) else 0.0 for step in (along_y, along_x))  # type: ignore[return-value]


class Onto:
    """Interpolation of a variable to a regular grid, and back to its own nodes to measure the change."""

    def __init__(self, placed: Placed, target: Regular):
        self.placed, self.target = placed, target
        north, east = np.meshgrid(target.nodes(0), target.nodes(1), indexing="ij")
        self.rows, self.columns = placed.fractions(north, east)
        levels = placed.grid.depth
        self.levels = np.zeros(target.counts[2]) if levels is None else _held(target.nodes(2), levels)

    def __call__(self, field: np.ndarray, depths: np.ndarray | None = None) -> np.ndarray:
        """A field (k, y, x) at the nodes of the regular grid (x, y, z): north, east, depth.

        depths: Rising depths of the field's nodes (k, y, x), if levels follow the sea floor.
        """
        level = _along_first(field, self.levels) if depths is None else at_depths(field, depths, self.target.nodes(2))
        return np.moveaxis(_in_plane(level, self.rows, self.columns), 0, -1)

    def change(self, field: np.ndarray, regular: np.ndarray, depths: np.ndarray | None = None) -> np.ndarray:
        """Differences (n,) between the data and the regular grid, at the data's own nodes within the regular grid."""
        from scipy.ndimage import map_coordinates

        if depths is None:
            levels = self.placed.grid.depth
            depths = (self.target.nodes(2)[:1] if levels is None else levels)[:, None, None]
        places = (*self.placed.north_east, depths)
        at = [(x - o) / d for x, o, d in zip(places, self.target.origin, self.target.spacing, strict=True)]
        at = [np.broadcast_to(x, field.shape) for x in at]
        inside = np.logical_and.reduce(
            [(x > -1e-9) & (x < n - 1 + 1e-9) for x, n in zip(at, self.target.counts, strict=True)]
        )
        own = map_coordinates(regular, [x[inside] for x in at], order=1, mode="nearest")
        return np.asarray(own - field[inside])


def directions(placed: Placed, along: str) -> np.ndarray:
    """Unit vectors (y, x, 3) at the nodes, in the inertial axes, of "east", "north", "up", or "x" or "y" of the grid."""
    grid, (rows, columns) = placed.grid, placed.grid.shape[3:]
    if along == "up":
        return np.broadcast_to(np.array([0.0, 0.0, -1.0]), (rows, columns, 3))
    vectors = np.zeros((rows, columns, 3))
    latitude, longitude = placed.plane.geodetic(*placed.north_east)
    if along in ("x", "y") and grid.projection is not None:
        first, last = (
            np.array(placed.plane.local(*place)) for place in grid.projection.neighbors(latitude, longitude, along)
        )
        vectors[..., :2] = np.moveaxis((last - first) / np.linalg.norm(last - first, axis=0), 0, -1)
        return vectors
    along_grid = along in ("x", "y") and not grid.rectilinear
    if along_grid:
        vectors[..., :2] = placed.curved.directions(1 if along == "x" else 0)
        if grid.angle is None:
            return vectors
    # From the plane's north to true north, towards the east; and to the left from the east to the grid's x.
    turn = placed.plane.convergence(latitude, longitude) - (
        grid.angle if along_grid and grid.angle is not None else 0.0
    )
    unit = (-np.sin(turn), np.cos(turn)) if along in ("east", "x") else (np.cos(turn), np.sin(turn))
    if along_grid:
        off = np.arccos(np.clip(vectors[..., 0] * unit[0] + vectors[..., 1] * unit[1], -1.0, 1.0))[_water(placed)]
        if (most := np.nanmax(off, initial=0.0)) > MOST_OFF:
            remedy = "give attributes = {'angle.units': 'degrees'} if it is in degrees, or leave the variable out"
            shown, problem = f"{np.rad2deg(most):.3g} degrees", f"is between it and the {along} of the grid"
            raise refusal("angle", shown, problem, remedy)
    vectors[..., 0], vectors[..., 1] = unit
    return vectors


def _water(placed: Placed) -> np.ndarray:
    """Mask of the nodes that have a position and are not on land."""
    return placed.placed_nodes if placed.grid.land is None else placed.placed_nodes & ~placed.grid.land


def _extended(values: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Numbers (y, x); unusable ones come from a cubic fit in row and column, plus the nearest node's residual."""
    from scipy.ndimage import distance_transform_edt

    y, x = (np.linspace(-1.0, 1.0, n) for n in values.shape)
    cubic = np.stack([np.outer(y**i, x**j) for i in range(4) for j in range(4 - i)], axis=-1)
    fit = cubic @ np.linalg.lstsq(cubic[usable], values[usable], rcond=None)[0]
    j, i = distance_transform_edt(~usable, return_distances=False, return_indices=True)
    return np.asarray(np.where(usable, values, fit + (values - fit)[j, i]))


def edge_of(box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points along the edge of a box (2, 2) in the plane [m]."""
    north, east = (np.linspace(float(low), float(high), ON_EDGE) for low, high in box[:2])
    sides = np.meshgrid(north, east, indexing="ij")
    rim = np.ones((ON_EDGE, ON_EDGE), bool)
    rim[1:-1, 1:-1] = False
    return sides[0][rim], sides[1][rim]


def _numbered(places: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Fractional node indices of points, extrapolated beyond the ends; 0 for an axis of one node."""
    if len(nodes) == 1:
        return np.zeros(np.shape(places))
    cell = np.clip(np.searchsorted(nodes, places, side="right") - 1, 0, len(nodes) - 2)
    return np.asarray(cell + (places - nodes[cell]) / (nodes[cell + 1] - nodes[cell]))


def _held(places: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    return np.clip(_numbered(places, nodes), 0.0, len(nodes) - 1.0)


def _along_first(field: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values at fractional indices (m,) along the first axis, constant beyond its ends."""
    held = np.clip(at, 0.0, len(field) - 1.0)
    low = np.clip(np.floor(held).astype(int), 0, max(len(field) - 2, 0))
    part = (held - low).reshape(-1, *(1,) * (field.ndim - 1))
    lower = field[low]
    return lower + part * (field[np.minimum(low + 1, len(field) - 1)] - lower)


def _in_plane(field: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Values (k, ...) of a field (k, y, x) at fractional rows and columns (...), bilinear, constant beyond the edges."""
    sizes = field.shape[1:]
    (j, y), (i, x) = (_cell(at, size) for at, size in zip((rows, columns), sizes, strict=True))
    j1, i1 = np.minimum(j + 1, sizes[0] - 1), np.minimum(i + 1, sizes[1] - 1)
    first, second = field[:, j, i], field[:, j1, i]
    first = first + x * (field[:, j, i1] - first)
    second = second + x * (field[:, j1, i1] - second)
    return np.asarray(first + y * (second - first))


def _cell(at: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    held = np.clip(at, 0.0, size - 1.0)
    low = np.clip(np.floor(held).astype(int), 0, max(size - 2, 0))
    return low, held - low
