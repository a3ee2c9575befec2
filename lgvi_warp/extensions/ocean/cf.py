# SPDX-License-Identifier: Apache-2.0
"""Variables of data sets in the CF conventions: search for them, and read parts of them in SI units."""

from __future__ import annotations

import dataclasses
import datetime
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError, brief, closest, refusal
from lgvi_warp.extensions.ocean import staggered
from lgvi_warp.extensions.ocean.axes import NO_NUMBER, PROJECTED, Axes, axes_of, elapsed
from lgvi_warp.extensions.ocean.projections import Projection
from lgvi_warp.extensions.ocean.s_levels import SLevels, s_levels
from lgvi_warp.extensions.ocean.units import factor, positive

# The dimensions of a variable in the order in which its values come.
ORDER = ("scenario", "time", "depth", "y", "x")

# An interval of longitude so many times the median is no cell: the data have an edge on both sides of it.
MOST_OF_STEP = 3.0


@dataclass(frozen=True)
class OceanQuantity:
    """Names of an ocean variable: its standard_name in the CF conventions, or the names used by models."""

    meaning: str
    standard_names: tuple[str, ...]
    names: tuple[str, ...]
    unit: str = "m/s"
    # -1 for what grows upward, where depth does not.
    sign: float = 1.0


EASTWARD = OceanQuantity("the eastward velocity", ("eastward_sea_water_velocity", "surface_eastward_sea_water_velocity"),
                    ("water_u", "uo", "u_eastward"))  # fmt: skip
NORTHWARD = OceanQuantity("the northward velocity", ("northward_sea_water_velocity", "surface_northward_sea_water_velocity"),
                     ("water_v", "vo", "v_northward"))  # fmt: skip
UPWARD = OceanQuantity("the upward velocity", ("upward_sea_water_velocity",), ("water_w", "wo"))
ALONG_X = OceanQuantity("the velocity along the grid's x", ("sea_water_x_velocity", "x_sea_water_velocity",
                   "sea_water_x_velocity_at_u_location", "surface_sea_water_x_velocity"), ("u", "vozocrtx"))  # fmt: skip
ALONG_Y = OceanQuantity("the velocity along the grid's y", ("sea_water_y_velocity", "y_sea_water_velocity",
                   "sea_water_y_velocity_at_v_location", "surface_sea_water_y_velocity"), ("v", "vomecrty"))  # fmt: skip
# Names and dimensions of a turned grid that say along what a velocity is, where no standard_name does.
SAY_ALONG, SAY_DIMENSIONS = ("u_eastward", "v_northward", "vozocrtx", "vomecrty"), ("eta_", "xi_")
FLOOR_DEPTH = OceanQuantity(
    "the depth of the sea floor",
    ("sea_floor_depth_below_sea_surface", "sea_floor_depth_below_geoid", "sea_floor_depth_below_mean_sea_level",
     "sea_floor_depth", "sea_floor_depth_below_sea_level", "model_sea_floor_depth_below_geoid"),
    ("depth", "deptho", "bathymetry", "bathy", "h"),
    "m",
)  # fmt: skip
ELEVATION = OceanQuantity(
    "the elevation of the ground",
    ("height_above_mean_sea_level", "height_above_geoid", "surface_altitude", "altitude", "bedrock_altitude",
     "height_above_reference_ellipsoid"),
    ("elevation", "z", "topo"),
    "m",
    -1.0,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Gridded:
    """A variable of a data set on a grid; its values are not read until `values` is called.

    Attributes:
        name: Name of the variable in the data set.
        pieces: Lazy xarray variable, in several pieces side by side along x if the grid crosses the date line.
        scale: Factor from the file's numbers to SI units; it also makes depths positive downward.
        latitude, longitude: Coordinates of the nodes [deg], (y,) and (x,), rising, or (y, x) each; longitudes may pass 180.
        depth: Depths of the levels [m], rising, positive downward, (k,); None for a variable without depth.
        time: Times of the fields, datetime64[ns] (t,), rising; None for a variable without time.
        dims: {role in `ORDER`: name of the dimension}.
        scenarios: Number of scenarios; 1 for a variable without them.
        s_levels: Depths of levels that follow the sea floor; None for other levels.
        projection: Plane of the axes y and x [m]; None for others. One-dimensional axes then replace latitudes and longitudes,
            and velocities are along the axes.
        land: Mask of nodes (y, x) that are on land or have no position; None if the file has no mask.
        angle: Angle [rad] (y, x) from east to the grid's x, counterclockwise; None if the file has none.
    """

    name: str
    pieces: tuple[Any, ...]
    scale: float
    latitude: np.ndarray
    longitude: np.ndarray
    depth: np.ndarray | None
    time: np.ndarray | None
    dims: Mapping[str, Hashable]
    scenarios: int = 1
    s_levels: SLevels | None = None
    projection: Projection | None = None
    land: np.ndarray | None = None
    angle: np.ndarray | None = None

    @property
    def rectilinear(self) -> bool:
        """Whether the axes of the grid are latitude and longitude, or y and x of a projection."""
        return self.latitude.ndim == 1

    @property
    def turned(self) -> bool:
        """Whether the grid's axes differ from latitude and longitude."""
        return not self.rectilinear or self.projection is not None

    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Latitudes and longitudes [deg] of the nodes (y, x); NaN for nodes without a position."""
        if not self.rectilinear:
            return self.latitude, self.longitude
        y, x = np.meshgrid(self.latitude, self.longitude, indexing="ij")
        return (y, x) if self.projection is None else self.projection.geodetic(x, y)

    def extent(self, latitude: np.ndarray, longitude: np.ndarray) -> tuple[float, float, float, float]:
        """Box around points [deg], for `between`."""
        y, x = latitude, longitude
        if self.rectilinear and self.projection is not None:
            x, y = self.projection.plane(latitude, longitude)
        return float(np.min(y)), float(np.max(y)), float(np.min(x)), float(np.max(x))

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes in `ORDER`, 1 along an axis that the variable does not have."""
        sizes = [dict(piece.sizes) for piece in self.pieces]
        return tuple(
            sum(size[self.dims[part]] for size in sizes) if part == "x" else sizes[0].get(self.dims.get(part), 1)
            for part in ORDER
        )

    def values(self, scenario: int = 0, time: int = 0) -> np.ndarray:
        """One field (k, y, x), float64; missing values are NaN, and k is 1 for a variable without depth."""
        at = {"scenario": scenario, "time": time}
        index = {self.dims[part]: at[part] for part in at if part in self.dims}
        parts = [np.asarray(piece.isel(index).values, dtype=np.float64) for piece in self.pieces]
        field = np.concatenate(parts, axis=-1)
        # As few values as possible are gone through twice.
        missing = np.abs(field) >= NO_NUMBER if self.land is None else (np.abs(field) >= NO_NUMBER) | self.land
        field = np.where(missing, np.nan, field) * self.scale
        return field if "depth" in self.dims else field[None]

    def between(self, south: float, north: float, west: float, east: float) -> Gridded:
        """The part of the grid that covers a box and the nodes next to it; the box is in the grid's own axes."""
        rows, columns = _covering(self, south, north, west, east)
        pieces, first = [], 0
        for piece in self.pieces:
            size = piece.sizes[self.dims["x"]]
            low, high = max(columns.start - first, 0), min(columns.stop - first, size)
            if low < high:
                pieces.append(piece.isel({self.dims["y"]: rows, self.dims["x"]: slice(low, high)}))
            first += size
        cut = (rows, columns)
        places = (self.latitude[rows], self.longitude[columns]) if self.rectilinear else (
            self.latitude[cut], self.longitude[cut])  # fmt: skip
        changed: dict[str, Any] = {
            "pieces": tuple(pieces),
            "latitude": places[0],
            "longitude": places[1],
            "s_levels": self.s_levels and self.s_levels.part(rows, columns),
            "land": None if self.land is None else self.land[cut],
            "angle": None if self.angle is None else self.angle[cut],
        }
        return dataclasses.replace(self, **changed)

    def levels(self, deepest: float) -> Gridded:
        """The grid with the levels down to the first one at or below a depth [m]."""
        if self.depth is None:
            return self
        kept = slice(0, min(int(np.searchsorted(self.depth, deepest)) + 1, len(self.depth)))
        pieces = tuple(piece.isel({self.dims["depth"]: kept}) for piece in self.pieces)
        return dataclasses.replace(self, pieces=pieces, depth=self.depth[kept])


def variable_name(ds: Any, quantity: OceanQuantity, named: str | None = None) -> str | None:
    """The name of the variable that holds a quantity; None if there is no such variable."""
    if named is not None:
        if named in ds.encoding.get("damaged", {}):
            raise refusal(
                "variables", named, f"cannot be decoded, {ds.encoding['damaged'][named]}", "mend its attributes"
            )
        if named not in ds.data_vars:
            raise refusal(
                "variables", named, "is not a variable of the data set", closest(named, map(str, ds.data_vars))
            )
        return named
    by_standard = [str(name) for name, v in ds.data_vars.items()
                   if str(v.attrs.get("standard_name", "")).strip().lower() in quantity.standard_names]  # fmt: skip
    by_name = [str(name) for name in ds.data_vars if str(name).lower() in quantity.names]
    both = [name for name in by_standard if name in by_name]
    for names in (both, by_standard, by_name):
        if len(names) == 1 or (names and names is not by_standard):
            return names[0]
        if names:
            raise refusal("variables", names, f"are all {quantity.meaning}", "name the one that is meant")
    return None


def missing(ds: Any, quantities: Iterable[OceanQuantity]) -> SceneError:
    """The error for a data set that has none of these quantities."""
    names = " or ".join(quantity.standard_names[0] for quantity in quantities)
    present = ", ".join(map(str, ds.data_vars)) or "nothing"
    return refusal("variables", present[:60], "have no CF names that are known",
                   f"write the attribute standard_name = {names}, or name the variables by variables=")  # fmt: skip


def gridded(ds: Any, quantity: OceanQuantity, name: str, about: float | None = None) -> Gridded:
    """A lazy variable of a data set with its axes; longitudes rise and are within 180 degrees of `about`.

    Args:
        ds: An xarray Dataset.
        quantity: Quantity that the variable holds.
        name: Name of the variable.
        about: A longitude [deg]; None, the default, for the longitude of the data set's first node.
    """
    ds = staggered.trimmed(ds)
    axes = axes_of(ds, name)
    ds, axes = _risen(ds, name, axes)
    variable = ds[name]
    scale = factor(name, variable.attrs.get("units"), quantity.unit) * quantity.sign
    if quantity is FLOOR_DEPTH and positive(variable.attrs) == "up":
        scale = -scale
    variable = _ordered(variable, axes)
    dims = {part: dim for part, dim in axes.dims.items() if dim in variable.dims}
    if axes.depth is not None:
        variable = variable.isel({dims["depth"]: _rising(f"{name}.{dims['depth']}", axes.depth, "m")})
    depth = None if axes.depth is None else np.sort(axes.depth)
    grid, shape = (dims["y"], dims["x"]), variable.shape[-2:]
    land = staggered.land_at(ds, grid, shape)
    if axes.latitude.ndim == 1 and (land is not None or axes.s_levels is not None):
        # What stands at each node keeps the order of the file.
        latitude, longitude = np.meshgrid(axes.latitude, axes.longitude, indexing="ij")
        if axes.projection is not None:
            latitude, longitude = axes.projection.geodetic(longitude, latitude)
        axes = dataclasses.replace(axes, latitude=latitude, longitude=longitude)
    if axes.latitude.ndim == 2 and (nowhere := np.isnan(axes.latitude)).any():
        land = nowhere if land is None else land | nowhere
    about = float(axes.longitude[np.isfinite(axes.longitude)][0]) if about is None else about
    latitude, longitude, pieces = _places(name, axes, variable, about)
    scenarios = int(variable.sizes[dims["scenario"]]) if "scenario" in dims else 1
    levels = None
    if axes.s_levels is not None:
        levels = s_levels(ds, name, axes.s_levels, grid, shape, dims.get("time"))
    angle = staggered.at_nodes(ds, "angle", grid, shape) if latitude.ndim == 2 else None
    if angle is not None and str(ds["angle"].attrs.get("units", "rad")).lower().startswith("deg"):
        angle = np.deg2rad(angle)
    return Gridded(name, pieces, scale, latitude, longitude, depth, axes.time, dims, scenarios, levels, axes.projection, land,
                   angle)  # fmt: skip


def says_along(ds: Any, name: str, quantity: OceanQuantity) -> bool:
    """Whether a file states the axis of a velocity, by its standard_name or by a name that only one model uses."""
    standard = str(ds[name].attrs.get("standard_name", "")).strip().lower()
    return (
        standard in quantity.standard_names
        or name.lower() in SAY_ALONG
        or any(str(dim).startswith(SAY_DIMENSIONS) for dim in ds[name].dims)
    )


def seconds_since(time: np.ndarray, start: datetime.datetime | np.datetime64 | str | None) -> np.ndarray:
    """Times [s] from `start`, or from the first time for None, in the file's calendar; `start` is in UTC without a zone."""
    if start is None:
        return elapsed(time)
    first: Any = instant("start", start)
    if time.dtype.kind == "m":
        raise refusal("start", start, "is a moment, and the times of the file count from none",
                      "leave it out, or give attributes = {'time.units': 'seconds since 2000-01-01'}")  # fmt: skip
    if time.dtype.kind == "O":
        moment = first.astype("datetime64[us]").item()
        words = ("year", "month", "day", "hour", "minute", "second", "microsecond")
        try:
            first = time[0].replace(**{word: getattr(moment, word) for word in words})
        except ValueError as error:
            problem = f"is no day of the file's calendar, {time[0].calendar}"
            raise refusal("start", start, problem, "give another day") from error
    return elapsed(time, first)


def instant(key: str, value: Any) -> np.datetime64:
    """The date and time in UTC of a datetime or of a text in ISO 8601."""
    try:
        text = value.strip().replace(" ", "T") if isinstance(value, str) else ""
        if text:
            value = datetime.datetime.fromisoformat(text)
            # A datetime has microseconds, times of a file may have less.
            value = value if value.tzinfo is not None else np.datetime64(text)
        if isinstance(value, datetime.datetime) and value.tzinfo is not None:
            value = value.astimezone(datetime.UTC).replace(tzinfo=None)
        moment = np.datetime64(value, "ns")
    except (ValueError, TypeError, OverflowError):
        moment = np.datetime64("NaT")
    if np.isnat(moment):
        raise refusal(key, value, "is not a moment", "give a datetime, or a text such as '2024-05-01T12:00:00'")
    return moment


def _risen(ds: Any, name: str, axes: Axes) -> tuple[Any, Axes]:
    """The data set with rows and columns in rising order of y and x, if a two-dimensional grid also has such axes."""
    falling = [
        axes.dims[part]
        for part, words in PROJECTED.items()
        for c in ds.variables
        if ds[c].dims == (axes.dims[part],) and ds[c].attrs.get("standard_name") in words and ds[c][0] > ds[c][-1]
    ]
    if axes.latitude.ndim == 1 or not falling:
        return ds, axes
    ds = ds.isel({dim: slice(None, None, -1) for dim in falling})
    return ds, axes_of(ds, name)


def _ordered(variable: Any, axes: Axes) -> Any:
    """The variable with its dimensions in `ORDER`; other dimensions of size 1 are dropped."""
    known = [axes.dims[part] for part in ORDER if part in axes.dims]
    others = [dim for dim in variable.dims if dim not in known]
    for dim in others:
        if variable.sizes[dim] != 1:
            raise refusal(f"{variable.name}.dims", dim, "is not an axis that is known",
                          f"take one of it, by ds.isel({dim}=0), or write its attribute axis")  # fmt: skip
    return variable.isel(dict.fromkeys(others, 0)).transpose(*known)


def _rising(where: str, values: np.ndarray, unit: str) -> slice:
    """Slice that puts the values of an axis in rising order. Raises SceneError if they neither rise nor fall."""
    steps = np.diff(values)
    if not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        raise refusal(where, brief(values), "neither rises nor falls", f"sort it [{unit}] and drop repetitions")
    return slice(None) if len(values) < 2 or steps[0] > 0.0 else slice(None, None, -1)


def _places(name: str, axes: Axes, variable: Any, about: float) -> tuple[np.ndarray, np.ndarray, tuple[Any, ...]]:
    """Rising latitudes and longitudes, within 180 degrees of a meridian, and the pieces of the variable in that order."""
    y, x = axes.dims["y"], axes.dims["x"]
    if axes.latitude.ndim == 2:
        return axes.latitude, _about(axes.longitude, about), (variable,)
    order = _rising(f"{name}.{y}", axes.latitude, "deg")
    variable, latitude = variable.isel({y: order}), axes.latitude[order]
    longitude = axes.longitude
    if axes.projection is not None:
        order = _rising(f"{name}.{x}", longitude, "m")
        return latitude, longitude[order], (variable.isel({x: order}),)
    if np.any(np.diff(longitude) > 0.0) and np.any(np.diff(longitude) < 0.0):
        # It jumps by a whole turn.
        longitude = np.unwrap(longitude, period=360.0)
    order = _rising(f"{name}.{x}", longitude, "deg")
    variable, longitude = variable.isel({x: order}), longitude[order]
    # A column that closes the circle is the first one again.
    once = int(np.count_nonzero(longitude < longitude[0] + 360.0 - 1e-6))
    variable, longitude = variable.isel({x: slice(0, once)}), _about(longitude[:once], about)
    seam = int(np.argmin(longitude))
    longitude = np.roll(longitude, -seam)
    first, stop = _block(longitude, about)
    parts = [
        slice(max(seam + first, seam), min(seam + stop, once)),
        slice(max(seam + first - once, 0), seam + stop - once),
    ]
    pieces = tuple(variable.isel({x: part}) for part in parts if part.start < part.stop)
    return latitude, longitude[first:stop], pieces


def _block(longitude: np.ndarray, about: float) -> tuple[int, int]:
    """First and one past the last index of the longitudes without a gap that contain or are next to a meridian."""
    steps = np.diff(longitude)
    gaps = np.flatnonzero(steps > MOST_OF_STEP * np.median(steps)) + 1 if len(steps) else steps.astype(int)
    ends = [0, *gaps.tolist(), len(longitude)]
    blocks = list(zip(ends[:-1], ends[1:], strict=True))
    return min(blocks, key=lambda block: np.abs(longitude[block[0] : block[1]] - about).min())


def _about(longitude: np.ndarray, about: float) -> np.ndarray:
    """The same meridians, as longitudes within 180 degrees of `about`."""
    return np.asarray((longitude - about + 180.0) % 360.0 - 180.0 + about)


def _covering(grid: Gridded, south: float, north: float, west: float, east: float) -> tuple[slice, slice]:
    """Slices of the rows and columns of the nodes in a box and next to it."""
    if grid.rectilinear:
        return _span(grid.latitude, south, north), _span(grid.longitude, west, east)
    inside = (grid.latitude >= south) & (grid.latitude <= north)
    inside &= (grid.longitude >= west) & (grid.longitude <= east)
    if not inside.any():
        middle = np.hypot(grid.latitude - 0.5 * (south + north), grid.longitude - 0.5 * (west + east))
        inside.flat[int(np.nanargmin(middle))] = True
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    sizes = grid.latitude.shape
    # Two more on each side: cells of a turned grid reach into the box between its nodes.
    return tuple(slice(max(k[0] - 2, 0), min(k[-1] + 3, n)) for k, n in zip((rows, columns), sizes, strict=True))  # type: ignore[return-value]


def _span(nodes: np.ndarray, low: float, high: float) -> slice:
    """Slice from the last node at or before `low` to the first at or after `high`, with two nodes if there are two."""
    first = max(int(np.searchsorted(nodes, low, side="right")) - 1, 0)
    stop = min(int(np.searchsorted(nodes, high, side="left")) + 1, len(nodes))
    first = min(first, max(len(nodes) - 2, 0))
    return slice(first, max(stop, min(first + 2, len(nodes))))
