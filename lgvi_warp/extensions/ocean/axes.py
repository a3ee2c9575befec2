# SPDX-License-Identifier: Apache-2.0
"""The axes of a variable of a data set: its dimensions for latitude, longitude, depth, time and scenario, with values."""

from __future__ import annotations

import datetime
import itertools
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import brief, refusal
from lgvi_warp.extensions.ocean.projections import Projection, projection
from lgvi_warp.extensions.ocean.staggered import places_at
from lgvi_warp.extensions.ocean.units import factor, positive

# By standard_name, by units or the attribute axis, by name, the first that fits. CF 1.11, chapters 4 and 5.
LATITUDE = (("latitude", "latitude_at_u_location", "latitude_at_v_location"),
            ("degrees_north", "degree_north", "degree_n", "degrees_n", "degreen", "degreesn"))  # fmt: skip
LONGITUDE = (("longitude", "longitude_at_u_location", "longitude_at_v_location"),
             ("degrees_east", "degree_east", "degree_e", "degrees_e", "degreee", "degreese"))  # fmt: skip
LATITUDES = ("lat", "latitude", "nav_lat", "lat_rho", "lat_u", "lat_v", "y_lat", "gphit", "gphiu", "gphiv")
LONGITUDES = ("lon", "longitude", "nav_lon", "lon_rho", "lon_u", "lon_v", "x_lon", "glamt", "glamu", "glamv")
# Axes of a projected grid, and of one about another pole.
PROJECTED = {"y": ("projection_y_coordinate", "grid_latitude"), "x": ("projection_x_coordinate", "grid_longitude")}
S_COORDINATES = ("ocean_s_coordinate", "ocean_s_coordinate_g1", "ocean_s_coordinate_g2", "ocean_sigma_coordinate")
DOWNWARD = ("depth", "sea_floor_depth_below_sea_surface")
UPWARD = ("height", "altitude", "height_above_mean_sea_level", "height_above_geoid")
DEPTHS = ("depth", "depthu", "depthv", "deptht", "depthw", "gdept", "gdepu", "gdepv", "gdept_0", "gdept_1d", "nav_lev", "lev",
          "level", "z", "height")  # fmt: skip
# Levels that follow the floor, where no attribute says so.
FOLLOWING = ("s_rho",)
TIMES = ("time", "ocean_time", "time_counter", "mt", "scrum_time")
# Nodes of a grid whose places are read whole.
MOST_PLACES = 1 << 26
SCENARIOS = ("realization", "member", "ensemble", "number", "scenario")
# Numbers beyond it are what writers put where they have none: 9.97e36 of NetCDF, 1e37 of ROMS, 1e20 of NEMO.
NO_NUMBER = 0.99e20


@dataclass(frozen=True, eq=False)
class Axes:
    """Dimensions of a variable by role, "scenario", "time", "depth", "y", "x", and its coordinates in the file's order.

    latitude, longitude [deg]: (y,) and (x,), or (y, x), NaN at nodes without a position. One-dimensional axes of a
    `projection` are its y and x [m, or deg]. depth [m]: Positive downward (k,); None without depth, and for levels that follow
    the ground (`s_levels`, the name of their dimension). time (t,): datetime64[ns], dates of another calendar (objects of
    cftime), timedelta64[ns] without a reference date, or None.
    """

    dims: Mapping[str, Hashable]
    latitude: np.ndarray
    longitude: np.ndarray
    depth: np.ndarray | None
    time: np.ndarray | None
    s_levels: str | None = None
    projection: Projection | None = None


def axes_of(ds: Any, name: str) -> Axes:
    """The axes of a variable of an xarray Dataset."""
    variable = ds[name]
    coordinates = {str(c): ds[c] for c in ds.variables if c != name and set(ds[c].dims) <= set(variable.dims)}
    (y, x), latitude, longitude, plane = _grid(ds, name, coordinates)
    dims: dict[str, Hashable] = {"y": y, "x": x}
    others = [dim for dim in variable.dims if dim not in (y, x)]
    for part, fits in (("time", _is_time), ("depth", _is_depth), ("scenario", _is_scenario)):
        fitting = [dim for dim in others if dim not in dims.values() and _along(coordinates, dim, fits)[0]]
        if len(fitting) > 1:
            raise refusal(f"{name}.dims", fitting, f"are all axes of {part}", f"take one, by ds.isel({fitting[1]}=0)")
        if fitting:
            dims[part] = fitting[0]
    level = _along(coordinates, dims.get("depth"), _is_depth)[1]
    word = "" if level is None else _word(level, "standard_name")
    follows = word in S_COORDINATES or (
        str(dims.get("depth")).lower() in FOLLOWING and word not in (*DOWNWARD, *UPWARD)
    )
    depth = None if "depth" not in dims or follows else _depths(name, str(dims["depth"]), level)
    time = None
    if "time" in dims:
        time = _times(name, str(dims["time"]), _along(coordinates, dims["time"], _is_time)[1])
    return Axes(dims, latitude, longitude, depth, time, str(dims["depth"]) if follows else None, plane)


def elapsed(time: np.ndarray, since: Any = None) -> np.ndarray:
    """Times [s] since a date of the same calendar; by default since the first time."""
    differences = time - (time[0] if since is None else since)
    if time.dtype.kind == "O":
        return np.array([one / datetime.timedelta(seconds=1) for one in differences])
    return np.asarray(differences / np.timedelta64(1, "ns") * 1e-9, dtype=np.float64)


def _word(coordinate: Any, attribute: str) -> str:
    """An attribute in lower case; "" if it is missing."""
    return str(coordinate.attrs.get(attribute, "")).strip().lower()


def _attribute(variable: Any, attribute: str) -> str:
    """An attribute that xarray may have moved to the encoding (CF 1.11, section 5)."""
    return str(variable.attrs.get(attribute, variable.encoding.get(attribute, "")))


def _along(coordinates: Mapping[str, Any], dim: Hashable | None, fits: Callable[[str, Any], bool]) -> tuple[bool, Any]:
    """Whether a dimension fits, and its coordinate: the one of its name, or else the first that fits along only it."""
    own = coordinates.get(str(dim))
    if own is not None and own.dims == (dim,):
        return fits(str(dim), own), own
    others = [c for word, c in coordinates.items() if c.dims == (dim,) and fits(word, c)]
    return bool(others) or fits(str(dim), None), others[0] if others else None


def _grid(
    ds: Any, name: str, coordinates: Mapping[str, Any]
) -> tuple[tuple[Hashable, Hashable], np.ndarray, np.ndarray, Projection | None]:
    """Dimensions along y and x, latitudes and longitudes or y and x, and the projection of a variable."""
    variable = ds[name]
    named = _attribute(variable, "coordinates").split()
    axes = [_first(coordinates, named, words) for words in PROJECTED.values()]
    if any(c is None for c in axes):
        pairs = [[c for c in coordinates.values() if c.name == letter and c.dims == (letter,)] for letter in PROJECTED]
        axes = [pair[0] if pair else None for pair in pairs]
    y, x = axes
    mapped = _mapping(variable, y, x) if y is not None and x is not None else ""
    plane = None
    # Two-dimensional x and y of a projection are what the variable is told by, if it names them.
    if mapped and y.ndim == 2 and y.name in named:
        plane = _projection(ds, name, mapped)
    else:
        latitude = _place(name, coordinates, named, *LATITUDE, LATITUDES, "latitude")
        longitude = _place(name, coordinates, named, *LONGITUDE, LONGITUDES, "longitude")
        if latitude is not None and longitude is not None:
            dims = _horizontal(name, latitude, longitude)
            if latitude.ndim == 2 and longitude.dims != latitude.dims:
                longitude = longitude.transpose(*latitude.dims)
            places = _without_places(_degrees(name, latitude, 90.0), _degrees(name, longitude, 720.0))
            if np.isfinite(places[0]).any():
                return dims, *places, None
        if (found := places_at(ds, variable)) is not None:
            return found[0], *_without_places(*found[1:]), None
        if y is not None and x is not None and not mapped and _word(y, "units") == _word(x, "units") == "degrees":
            # As GMT writes latitudes and longitudes.
            return _horizontal(name, y, x), _degrees(name, y, 90.0), _degrees(name, x, 720.0), None
        if y is None or x is None:
            raise refusal(
                f"{name}.coordinates",
                brief(sorted(coordinates)),
                "have no latitude and longitude, nor x and y of a projection",
                f"give attributes = {{'lat.standard_name': 'latitude'}} for a coordinate lat along the dimensions of {name}",
            )
        plane = _projection(ds, name, mapped)
    dims = _horizontal(name, y, x)
    places = _metres(name, y, plane), _metres(name, x, plane)
    if y.ndim == 1:
        return dims, *places, plane
    north, east = _without_places(places[0], places[1] if x.dims == y.dims else places[1].T)
    return dims, *plane.geodetic(east, north), plane


def _mapping(*variables: Any) -> str:
    """The grid mapping that a variable or its axes name, the first in the extended form (CF 1.11, section 5.6)."""
    return next(
        (text.split(":")[0].split()[0] for v in variables if (text := _attribute(v, "grid_mapping")).strip()), ""
    )


def _projection(ds: Any, name: str, mapped: str) -> Projection:
    """The projection of a grid mapping: a variable of the file, or the code of a system such as "EPSG:32631"."""
    if mapped in ds.variables:
        return projection(mapped, ds[mapped].attrs)
    if mapped.upper() == "EPSG":
        return projection(f"{name}.grid_mapping", {"epsg": _attribute(ds[name], "grid_mapping")})
    raise refusal(f"{name}.grid_mapping", mapped, "names no projection of its x and y",
                  f"give attributes = {{'{name}.grid_mapping': 'EPSG:32631'}}, with the number of its system")  # fmt: skip


def _metres(name: str, axis: Any, plane: Projection) -> np.ndarray:
    """Values of an axis of a projection [m], or [deg] for a rotated pole."""
    where, unit = str(axis.name), _word(axis, "units")
    if axis.size > MOST_PLACES:
        raise refusal(
            f"{name}.{where}", axis.shape, f"has more than {MOST_PLACES:,} places", "cut the region out, by ds.isel"
        )
    if plane.geographic and not unit.startswith("degree"):
        raise refusal(
            f"{where}.units", unit, "is no unit of degrees, in which the system of the grid is", "mend one of them"
        )
    values = np.asarray(axis.values, dtype=np.float64) * (1.0 if plane.geographic else factor(where, unit, "m"))
    if axis.ndim == 1 and not np.isfinite(values).all():
        raise refusal(where, values, "has holes", "give a place to every row and column")
    return values


def _without_places(latitude: np.ndarray, longitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates, of two-dimensional ones with NaN at nodes without a position, on land or in dry cells.

    Some models write missing values at these nodes, others zeros: if several nodes are at 0, 0, none has a position.
    """
    if latitude.ndim == 1:
        return latitude, longitude
    origin = (latitude == 0.0) & (longitude == 0.0)
    unknown = ~(np.isfinite(latitude) & np.isfinite(longitude)) | (origin & (np.count_nonzero(origin) > 1))
    return np.where(unknown, np.nan, latitude), np.where(unknown, np.nan, longitude)


def _first(coordinates: Mapping[str, Any], named: list[str], words: tuple[str, ...]) -> Any:
    """The first coordinate with one of these standard names, among those that the variable names, then all; or None."""
    own = [coordinates[word] for word in named if word in coordinates]
    return next((c for c in (*own, *coordinates.values()) if _word(c, "standard_name") in words), None)


def _place(
    name: str, coordinates: Mapping[str, Any], named: list[str], standard: Any, units: Any, names: Any, meaning: str
) -> Any:
    """The latitude or longitude of a variable: among the coordinates that it names itself, then among all; or None."""
    tests: tuple[Callable[[str, Any], bool], ...] = (
        lambda _, c: _word(c, "standard_name") in standard,
        lambda _, c: _word(c, "units") in units,
        lambda word, _: word.lower() in names,
    )
    own = {word: coordinates[word] for word in named if word in coordinates}
    for offered, fits in itertools.product((own, coordinates), tests):
        found: dict[str, Any] = {word: c for word, c in offered.items() if c.ndim in (1, 2) and fits(word, c)}
        first, *others = list(found.values()) or [None]
        if first is not None and any(
            first.dims == c.dims and not np.array_equal(first.values, c.values) for c in others
        ):
            raise refusal(f"{name}.coordinates", brief(sorted(found)), f"are all its {meaning}",
                          "name one in the variable's attribute coordinates, or give attributes = "
                          f"{{'{name}.coordinates': {' '.join(sorted(found)[:1])!r}}}")  # fmt: skip
        if first is not None:
            return first
    return None


def _horizontal(name: str, latitude: Any, longitude: Any) -> tuple[Hashable, Hashable]:
    """The dimensions along y and x."""
    if latitude.ndim == longitude.ndim == 1 and latitude.dims != longitude.dims:
        return latitude.dims[0], longitude.dims[0]
    if latitude.ndim == longitude.ndim == 2 and set(latitude.dims) == set(longitude.dims):
        return latitude.dims[0], latitude.dims[1]
    raise refusal(f"{name}.coordinates", f"{latitude.dims} and {longitude.dims}", "are latitudes and longitudes of no grid",
                  "interpolate the data onto a grid")  # fmt: skip


def _is_time(dim: str, c: Any) -> bool:
    if c is not None and (c.dtype.kind in "mM" or _word(c, "standard_name") == "time" or _word(c, "axis") == "t"):
        return True
    return dim.lower() in TIMES


def _is_depth(dim: str, c: Any) -> bool:
    if c is not None and (
        _word(c, "standard_name") in (*DOWNWARD, *UPWARD, *S_COORDINATES)
        or _word(c, "axis") == "z"
        or positive(c.attrs) in ("up", "down")
    ):
        return True
    return dim.lower() in (*DEPTHS, *FOLLOWING)


def _is_scenario(dim: str, c: Any) -> bool:
    return (c is not None and _word(c, "standard_name") == "realization") or dim.lower() in SCENARIOS


def _degrees(name: str, coordinate: Any, most: float) -> np.ndarray:
    """The values of a latitude or a longitude [deg]."""
    where = f"{name}.{coordinate.name}"
    if coordinate.size > MOST_PLACES:
        raise refusal(
            where, coordinate.shape, f"has more than {MOST_PLACES:,} places", "cut the region out, by ds.isel"
        )
    values = np.asarray(coordinate.values, dtype=np.float64)
    values = np.where(np.abs(values) < NO_NUMBER, values, np.nan)
    if _word(coordinate, "units").startswith("rad"):
        values = np.rad2deg(values)
    if values.ndim == 1 and not np.isfinite(values).all():
        count = int(np.count_nonzero(~np.isfinite(values)))
        raise refusal(where, values, f"has {count:,} holes", "give a place to every node of the grid")
    if np.nanmax(np.abs(values), initial=0.0) > most:
        raise refusal(where, values, f"passes {most:g} degrees", "give latitudes and longitudes [deg]")
    return values


def _depths(name: str, dim: str, coordinate: Any) -> np.ndarray:
    """Depths of the levels [m], positive downward."""
    where = f"{name}.{dim}"
    if coordinate is None:
        raise refusal(
            where, dim, "has no depths", "add a coordinate of this name [m] with the attribute positive = 'down'"
        )
    values = np.asarray(coordinate.values, dtype=np.float64) * factor(where, coordinate.attrs.get("units"), "m")
    if not np.isfinite(values).all():
        raise refusal(where, values, "has holes", "give a depth to every level")
    said = positive(coordinate.attrs)
    upward = said == "up" or (said != "down" and _word(coordinate, "standard_name") in UPWARD)
    depths = -values if upward else values
    if depths.size and depths.min() < 0.0 and depths.max() <= 0.0:
        other = "down" if upward else "up"
        raise refusal(where, values, f"lies above the surface, with positive = {said or 'down'!r}",
                      f"the axis is upside down: write the attribute positive = {other!r}, or give attributes = "
                      f"{{'{coordinate.name}.positive': {other!r}}}")  # fmt: skip
    return depths


def _times(name: str, dim: str, coordinate: Any) -> np.ndarray:
    """Dates of the fields, or durations if the file has no reference date."""
    where = f"{name}.{dim}"
    values = None if coordinate is None else np.asarray(coordinate.values)
    unit = "" if coordinate is None else _word(coordinate, "units")
    if values is not None and values.dtype.kind in "fiu" and unit and "since" not in unit:
        values = np.round(values * factor(str(coordinate.name), unit, "s") * 1e9).astype("timedelta64[ns]")
    moments = values is not None and values.dtype.kind == "O" and all(hasattr(one, "calendar") for one in values)
    if values is None or not (moments or values.dtype.kind in "mM"):
        known = dim if coordinate is None else coordinate.name
        shown, words = "" if values is None else values[:3], "'seconds since 2024-01-01'"
        raise refusal(where, shown, "is not a time of the standard calendar, nor of another one that is known",
                      f"give attributes = {{'{known}.units': {words}, '{known}.calendar': 'standard'}}")  # fmt: skip
    if not moments:
        values = values.astype(f"{'datetime64' if values.dtype.kind == 'M' else 'timedelta64'}[ns]")
    if (not moments and np.isnat(values).any()) or np.any(np.diff(elapsed(values)) <= 0.0):
        raise refusal(where, values.astype(str), "does not rise", "sort it by ds.sortby, and drop repetitions")
    return values
