# SPDX-License-Identifier: Apache-2.0
"""The sea floor, flat or on a grid: an event that stops members, and its depth."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.status import Status
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number, own
from lgvi_warp.physics.terms.events import Box, Event
from lgvi_warp.physics.terms.in_files import InFile, numbers_in

# Depths between which the box of a grid lies [m]: beyond any sea.
ABOVE, BELOW = -1e5, 1e5
# Ways of contact; how far above where a member is the event is kept of one on which it may rest [m].
STOP, REST = "stop", "rest"
FAR_BELOW = 1e6


@dataclass(frozen=True, eq=False, kw_only=True)
class Floor(InFile, Event):
    """Stop a member when the body's origin sinks to the sea floor, which is flat or on a regular grid.

    Between the nodes of a grid the depth is bilinear in north and east. Outside the grid, the depth of the nearest edge is
    used. `edges` returns an event that stops members at the edges.

    Args:
        depth: Depth of the floor [m]; or an array of depths of shape (nodes along north, nodes along east) [m].
        origin: Position of the grid's first node, (2,) [m]: north and east; zeros by default.
        spacing: Distance between nodes along north and east, (2,) [m]; required with a grid.
        clearance: Height above the floor at which members stop [m]; 0 if omitted. To vary it by member, give it, even as 0.0.
        contact: "stop", the default, stops members at the floor; "rest" lets them land on it (`lw.terms.BottomContact`).

    Methods:
        from_file: Floor from a chart, in a raster or a data set.
        depth_at: Depth of the floor at given points.
        edges: The event that stops members that leave the grid.

    Raises:
        SceneError: If a grid has no spacing, a flat floor has a spacing, or a number is invalid (see `Term`).

    Examples:
        A floor whose depth increases by 5 m per 100 m to the north.

        >>> import lgvi_warp as lw
        >>> lw.Scene.named("remus_100", events=[lw.events.Floor(depth=40.0)]).parameters()["floor.depth"]
        array(40.)
        >>> slope = lw.events.Floor(depth=[[20.0, 20.0], [25.0, 25.0]], spacing=[100.0, 100.0])
        >>> slope.depth_at(60.0, 0.0)
        array(23.)
    """

    type: ClassVar[str] = "floor"
    depth_field: ClassVar[str] = "depth"
    status: ClassVar[Status] = Status.FLOOR
    of_file_besides: ClassVar[tuple[str, ...]] = ("file", "clearance", "contact", "name")
    of_file_by: ClassVar[str] = "from_file"

    depth: Any = number(("x", "y"), "m")
    origin: Any = number((2,), "m", None, optional=True)
    spacing: Any = number((2,), "m", None, above=0.0, optional=True)
    # Absent where it is not given, so that a scene without it has no such parameter.
    clearance: Any = number((), "m", None, optional=True)
    contact: str = word(STOP, known=(STOP, REST))

    @classmethod
    def from_file(
        cls,
        file: Any,
        origin: Any,
        *,
        region: Any = None,
        spacing: Any = None,
        variable: str | None = None,
        positive: str = "",
        fill: str = "refuse",
        attributes: Mapping[str, Any] | None = None,
        clearance: Any = None,
        contact: str = STOP,
        name: str = "",
    ) -> Self:
        """Read a floor on a grid from a file: NetCDF in the CF conventions, such as the files of GEBCO, or a GeoTIFF.

        Args:
            file: Path of the file, or an xarray Dataset.
            origin: Latitude and longitude [deg] of the origin of the inertial axes, (2,).
            region: Least and largest north and east to read, (2, 2) [m]; by default the whole file.
            spacing: Distances between the nodes of the regular grid along north and east, (2,) [m]; by default the grid is
                as fine as the file.
            variable: Name of the variable; by default the variable that is a floor depth or an elevation.
            positive: "up" if the numbers are elevations, "down" if they are depths. By default it is the direction that
                the variable states, and "up" for a GeoTIFF.
            fill: Treatment of missing depths: "refuse", the default; "nearest"; or "zero", for land at depth 0.
            attributes: Values for missing or wrong attributes of a NetCDF file, such as {"z.grid_mapping": "EPSG:3996"}.
            clearance: Height above the floor at which members stop [m]; 0 if omitted.
            contact: "stop", the default, or "rest", as in the class.
            name: As in `Event`.

        Returns:
            The floor. It holds the depths, so the file is not read again.

        Raises:
            SceneError: If the file cannot be read, has no floor, or does not cover the region; the message names the remedy.
            MissingExtra: If xarray, rasterio or pyproj is not installed.

        Examples:
            >>> import lgvi_warp as lw
            >>> import numpy as np
            >>> import xarray as xr
            >>> lat, lon = np.linspace(54.0, 54.1, 25), np.linspace(7.8, 8.0, 49)
            >>> up = xr.DataArray(np.broadcast_to(-20.0 - 100.0 * (lat[:, None] - 54.0), (25, 49)), dims=("lat", "lon"),
            ...                   attrs={"standard_name": "height_above_mean_sea_level", "units": "m"})
            >>> ds = xr.Dataset({"elevation": up}, {"lat": lat, "lon": lon})
            >>> floor = lw.events.Floor.from_file(ds, (54.05, 7.9), region=[[-2000, 2000], [-1000, 1000]])
            >>> float(floor.depth_at(0.0, 0.0).round(2))
            25.0
        """
        wanted = {"origin": origin, "region": region, "spacing": spacing, "variable": variable, "positive": positive,
                  "fill": fill, "attributes": attributes}  # fmt: skip
        numbers = numbers_in(file, cls, wanted)
        at = {"depth": numbers.depth, "origin": numbers.origin, "spacing": numbers.spacing}
        return cls(**at, clearance=clearance, contact=contact, name=name)

    @property
    def remarks(self) -> tuple[str, ...]:
        depth = np.asarray(self.depth)
        dry = float(np.mean(depth < 0.0))
        told = depth.ndim == 2 and dry > 0.5
        return (f"{100.0 * dry:.0f} % of the floor lies above the sea: its sign may be wrong",) if told else ()

    def __post_init__(self) -> None:
        if self.on_grid and self.origin is None:
            object.__setattr__(self, "origin", np.zeros(2))
        super().__post_init__()

    @functools.cached_property
    def on_grid(self) -> bool:
        """Whether the floor is on a grid."""
        return np.ndim(np.asarray(self.depth, dtype=object)) > 0

    def shape_of(self, item: Field[Any]) -> tuple[Any, ...]:
        # One number is a flat floor.
        return () if item.name == "depth" and not self.on_grid else super().shape_of(item)

    def check(self, faults: Faults) -> None:
        if self.on_grid and self.spacing is None:
            faults.add("spacing", None, "is missing for a grid of depths", "give the distances of its nodes, (2,) [m]")
        for name in ("origin", "spacing"):
            value = getattr(self, name)
            if value is not None and not self.on_grid:
                faults.add(name, value, "is given for a floor of one depth", "leave it out, or give a grid of depths")

    def beside(self, terms: Sequence[Term]) -> Any:
        # Nothing would hold a vehicle on a floor that neither stops it nor pushes.
        if self.contact == REST and not any(getattr(term, "floor", None) in ("", self.key) for term in terms):
            problem = "has no term by which the vehicle rests on the floor"
            remedy = 'give [[terms]] type = "bottom_contact" and its points, or contact = "stop"'
            raise refusal(f"{self.key}.contact", self.contact, problem, remedy)
        return self

    def device_in(self, aligned: bool) -> str:
        return "floor:grid" if self.on_grid else "floor"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        clearance = numbers.get("clearance", np.zeros(1)) - FAR_BELOW * (self.contact == REST)
        if not self.on_grid:
            return Packed({"depth": numbers["depth"] - clearance})
        return self.packed_grid(numbers, {"clearance": clearance})

    def packed_grid(self, numbers: Numbers, others: Mapping[str, Any]) -> Packed:
        """Pack the floor for device code that looks up its depth; a flat floor is a grid of one node.

        Args:
            numbers: The floor's numbers by field, each of shape (n, ...).
            others: Further fields of the device struct.

        Returns:
            The fields that `lgvi_kernels.cells` reads, the fields `others`, and the rows of depths.
        """
        depth, origin, inverse = self._grid(numbers)
        counts = depth.shape[1:]
        values = dict(others)
        for i, axis in enumerate(("north", "east")):
            values |= {f"origin_{axis}": origin[:, i], f"inverse_{axis}": inverse[:, i]}
            values[f"last_{axis}"] = np.array([counts[i] - 1.0])
        # Rows from one node to the next; 0 where there is one node.
        values |= {"across_north": counts[1] * (counts[0] > 1), "across_east": int(counts[1] > 1)}
        return Packed(values, depth.reshape(len(depth), -1))

    def _grid(self, numbers: Numbers) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Depths (n, x, y) [m], position of the first node (n, 2) [m], 1 / spacing (n, 2) [1/m]."""
        if self.on_grid:
            return numbers["depth"], numbers["origin"], 1.0 / numbers["spacing"]
        return numbers["depth"][:, None, None], np.zeros((1, 2)), np.ones((1, 2))

    def depth_at(
        self, north: np.ndarray | float, east: np.ndarray | float, numbers: Numbers | None = None
    ) -> np.ndarray:
        """The depth of the floor at given points.

        Args:
            north: North coordinates of the points [m], of any shape.
            east: East coordinates of the points [m], of the same shape.
            numbers: The floor's numbers by field for n members, each of shape (1 or n, ...); the last dimension of the points
                is then n. By default the floor's own numbers are used.

        Returns:
            Depths [m], of the shape of the points.

        Examples:
            >>> import lgvi_warp as lw
            >>> lw.events.Floor(depth=[[10.0, 20.0]], spacing=[50.0, 50.0]).depth_at([0.0, 9.0], [25.0, 500.0])
            array([15., 20.])
        """
        if numbers is None:
            numbers = {name: np.asarray(value)[None] for name, value in self.parameters().items()}
        return self._looked_up(north, east, numbers)[0]

    def height(self, position: np.ndarray, velocity: np.ndarray, numbers: Numbers) -> tuple[np.ndarray, np.ndarray]:
        """Height above the level at which members stop, and its rate.

        Args:
            position: Positions (..., n, 3) [m], inertial axes.
            velocity: Velocities over ground (..., n, 3) [m/s], inertial axes.
            numbers: The floor's numbers by field, each of shape (1 or n, ...).

        Returns:
            Heights (..., n) [m] and their rates (..., n) [m/s].
        """
        x, y, z = np.moveaxis(position, -1, 0)
        depth, by_north, by_east = self._looked_up(x, y, numbers)
        rate = by_north * velocity[..., 0] + by_east * velocity[..., 1] - velocity[..., 2]
        return depth - numbers.get("clearance", np.zeros(1)) - z, rate

    def _looked_up(self, north: Any, east: Any, numbers: Numbers) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Depths at points, and their slopes to the north and to the east; the slopes are 0 outside the grid."""
        depth, origin, inverse = self._grid(numbers)
        places = np.broadcast_arrays(np.asarray(north, float), np.asarray(east, float))
        shape, corner, part, steep = places[0].shape, [], [], []
        for i, place in enumerate(places):
            last = depth.shape[1 + i] - 1
            free = np.nan_to_num((place - origin[:, i]) * inverse[:, i])
            u = np.clip(free, 0.0, last)
            corner.append(np.clip(u.astype(int), 0, max(last - 1, 0)))
            part.append(u - corner[i])
            steep.append(inverse[:, i] * ((free > 0.0) & (free < last)))
        (i, j), (x, y) = corner, part
        i1, j1 = np.minimum(i + 1, depth.shape[1] - 1), np.minimum(j + 1, depth.shape[2] - 1)
        member = np.arange(len(depth)) if len(depth) > 1 else 0
        e0 = depth[member, i, j1] - depth[member, i, j]
        e1 = depth[member, i1, j1] - depth[member, i1, j]
        here, ahead = depth[member, i, j] + y * e0, depth[member, i1, j] + y * e1
        known = np.where(np.isfinite(places[0]) & np.isfinite(places[1]), 1.0, np.nan)
        values = (here + x * (ahead - here), steep[0] * (ahead - here), steep[1] * (e0 + x * (e1 - e0)))
        found = [known * value if shape else (known * value).reshape(()) for value in values]
        return found[0], found[1], found[2]

    def edges(self, name: str = "edge of the chart") -> Box:
        """The event that stops members that leave the grid.

        Args:
            name: Name of the event; "edge of the chart" by default.

        Returns:
            A box with the corners of the grid, from far above the sea to far below it.

        Raises:
            SceneError: If the floor is flat, since it then has no edges.

        Examples:
            >>> import lgvi_warp as lw
            >>> slope = lw.events.Floor(depth=[[20.0, 20.0], [25.0, 25.0]], spacing=[100.0, 100.0])
            >>> lw.Scene.named("remus_100", events=[slope, slope.edges()]).events[1].upper[:2]
            array([100., 100.])
        """
        if not self.on_grid:
            faults = Faults(f"{self.key}.")
            faults.add(
                "depth", self.depth, "is that of a flat floor, which has no edges", "give a grid, or lw.events.Box"
            )
            faults.raise_if_any()
        far = self.origin + self.spacing * (np.array(self.depth.shape) - 1.0)
        return Box(name=name, lower=[*self.origin, ABOVE], upper=[*far, BELOW])


def altitude_over(events: Sequence[Any], position: np.ndarray, parameters: Numbers) -> np.ndarray:
    """Height (k, n) [m] of positions (k, n, 3) above the highest floor among the events of a scene.

    parameters: All numbers of the scene by name, each (1 or n, ...). Raises SceneError if there is no floor.
    """
    floors = [event for event in events if isinstance(event, Floor)]
    if not floors:
        remedy = 'give the scene one, such as [[events]] type = "floor", depth = 40.0, or ask for "depth"'
        raise refusal("of", "altitude", "needs a floor", remedy)
    x, y, z = np.moveaxis(position.astype(np.float64, copy=False), -1, 0)
    heights = [floor.depth_at(x, y, own(floor, parameters)) - z for floor in floors]
    return np.asarray(np.minimum.reduce(heights))
