# SPDX-License-Identifier: Apache-2.0
"""The axes of a variable of a data set: which dimension is latitude, longitude, depth, time or scenario, and its numbers."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import brief, refusal
from lgvi_warp.extensions.ocean.units import factor

# By standard_name, by units or the attribute axis, by name, the first that fits. CF 1.11, chapters 4 and 5.
LATITUDE = ("latitude",), ("degrees_north", "degree_north", "degree_n", "degrees_n", "degreen", "degreesn")
LONGITUDE = ("longitude",), ("degrees_east", "degree_east", "degree_e", "degrees_e", "degreee", "degreese")
LATITUDES = ("lat", "latitude", "nav_lat", "lat_rho", "lat_u", "lat_v", "y_lat", "gphit")
LONGITUDES = ("lon", "longitude", "nav_lon", "lon_rho", "lon_u", "lon_v", "x_lon", "glamt")
S_COORDINATES = ("ocean_s_coordinate", "ocean_s_coordinate_g1", "ocean_s_coordinate_g2")
DOWNWARD = ("depth", "sea_floor_depth_below_sea_surface")
UPWARD = ("height", "altitude", "height_above_mean_sea_level", "height_above_geoid")
DEPTHS = ("depth", "depthu", "depthv", "deptht", "depthw", "lev", "level", "z", "s_rho", "height")
TIMES = ("time", "ocean_time", "time_counter", "mt")
# Nodes of a grid whose places are read whole.
MOST_PLACES = 1 << 26
SCENARIOS = ("realization", "member", "ensemble", "number", "scenario")


@dataclass(frozen=True, eq=False)
class Axes:
    """Dimensions of a variable by part: "scenario", "time", "depth", "y", "x"; and coordinates as the file orders them.

    latitude, longitude [deg]: (y,) and (x,), or (y, x). depth [m], positive downward (k,); None without, and for levels that
    follow the ground (`s_levels`, the name of their coordinate). time: datetime64[ns] (t,), or None.
    """

    dims: Mapping[str, Hashable]
    latitude: np.ndarray
    longitude: np.ndarray
    depth: np.ndarray | None
    time: np.ndarray | None
    s_levels: str | None = None


def axes_of(ds: Any, name: str) -> Axes:
    """The axes of a variable of an xarray Dataset."""
    variable = ds[name]
    coordinates = {str(c): ds[c] for c in ds.variables if c != name and set(ds[c].dims) <= set(variable.dims)}
    # CF 1.11, section 5; xarray keeps what it has read of the attribute.
    named = str(variable.attrs.get("coordinates", variable.encoding.get("coordinates", ""))).split()
    latitude = _place(name, coordinates, named, *LATITUDE, LATITUDES, "latitude")
    longitude = _place(name, coordinates, named, *LONGITUDE, LONGITUDES, "longitude")
    y, x = _horizontal(name, latitude, longitude)
    dims: dict[str, Hashable] = {"y": y, "x": x}
    others = [dim for dim in variable.dims if dim not in (y, x)]
    for part, fits in (("time", _is_time), ("depth", _is_depth), ("scenario", _is_scenario)):
        fitting = [dim for dim in others if dim not in dims.values() and fits(str(dim), coordinates.get(str(dim)))]
        if len(fitting) > 1:
            raise refusal(f"{name}.dims", fitting, f"are all axes of {part}", f"take one, by ds.isel({fitting[1]}=0)")
        if fitting:
            dims[part] = fitting[0]
    level = coordinates.get(str(dims.get("depth")))
    follows = level is not None and _word(level, "standard_name") in S_COORDINATES
    depth = None if "depth" not in dims or follows else _depths(name, str(dims["depth"]), level)
    time = _times(name, str(dims["time"]), coordinates.get(str(dims["time"]))) if "time" in dims else None
    places = _degrees(name, latitude, 90.0), _degrees(name, longitude, 720.0)
    if latitude.ndim == 2:
        places = places[0], places[1] if longitude.dims == latitude.dims else places[1].T
    return Axes(dims, *places, depth, time, str(dims["depth"]) if follows else None)


def _word(coordinate: Any, attribute: str) -> str:
    """An attribute in lower case; "" where it is missing."""
    return str(coordinate.attrs.get(attribute, "")).strip().lower()


def _place(
    name: str, coordinates: Mapping[str, Any], named: list[str], standard: Any, units: Any, names: Any, meaning: str
) -> Any:
    """The coordinate that is the latitude or the longitude of a variable: of those that it names itself, else of all."""
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
                          "name one in the variable's attribute coordinates")  # fmt: skip
        if first is not None:
            return first
    raise refusal(f"{name}.coordinates", brief(sorted(coordinates)), f"have no {meaning}",
                  f"write the attribute standard_name = {meaning!r} of a coordinate along its dimensions")  # fmt: skip


def _horizontal(name: str, latitude: Any, longitude: Any) -> tuple[Hashable, Hashable]:
    """The dimensions along y and x."""
    if latitude.ndim == longitude.ndim == 1 and latitude.dims != longitude.dims:
        return latitude.dims[0], longitude.dims[0]
    if latitude.ndim == longitude.ndim == 2 and set(latitude.dims) == set(longitude.dims):
        return latitude.dims[0], latitude.dims[1]
    raise refusal(f"{name}.coordinates", f"{latitude.dims} and {longitude.dims}", "are latitudes and longitudes of no grid",
                  "interpolate the data onto a grid")  # fmt: skip


def _is_time(dim: str, c: Any) -> bool:
    if c is not None and (c.dtype.kind == "M" or _word(c, "standard_name") == "time" or _word(c, "axis") == "t"):
        return True
    return dim.lower() in TIMES


def _is_depth(dim: str, c: Any) -> bool:
    if c is not None and (
        _word(c, "standard_name") in (*DOWNWARD, *UPWARD, *S_COORDINATES)
        or _word(c, "axis") == "z"
        or _word(c, "positive") in ("up", "down")
    ):
        return True
    return dim.lower() in DEPTHS


def _is_scenario(dim: str, c: Any) -> bool:
    return (c is not None and _word(c, "standard_name") == "realization") or dim.lower() in SCENARIOS


def _degrees(name: str, coordinate: Any, most: float) -> np.ndarray:
    """The numbers of a latitude or a longitude [deg]."""
    where = f"{name}.{coordinate.name}"
    if coordinate.size > MOST_PLACES:
        raise refusal(
            where, coordinate.shape, f"has more than {MOST_PLACES:,} places", "cut the region out, by ds.isel"
        )
    values = np.asarray(coordinate.values, dtype=np.float64)
    if _word(coordinate, "units").startswith("rad"):
        values = np.rad2deg(values)
    if not np.isfinite(values).all():
        count = int(np.count_nonzero(~np.isfinite(values)))
        raise refusal(
            where, values, f"has {count:,} holes", "give a place to every node of the grid, those on land too"
        )
    if np.abs(values).max() > most:
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
    positive = _word(coordinate, "positive")
    upward = positive == "up" or (positive != "down" and _word(coordinate, "standard_name") in UPWARD)
    depths = -values if upward else values
    if depths.size and depths.min() < 0.0 and depths.max() <= 0.0:
        other = "down" if upward else "up"
        raise refusal(where, values, f"lies above the surface, with positive = {positive or 'down'!r}",
                      f"the axis is upside down: write the attribute positive = {other!r}")  # fmt: skip
    return depths


def _times(name: str, dim: str, coordinate: Any) -> np.ndarray:
    """Moments of the fields."""
    where = f"{name}.{dim}"
    if coordinate is None or coordinate.dtype.kind != "M":
        shown = "" if coordinate is None else np.asarray(coordinate.values)[:3]
        raise refusal(where, shown, "is not a time of the standard calendar", "write the attribute units = "
                      "'seconds since 2024-01-01', or convert it by ds.convert_calendar('standard')")  # fmt: skip
    values = np.asarray(coordinate.values, dtype="datetime64[ns]")
    if np.isnat(values).any() or np.any(np.diff(values) <= np.timedelta64(0, "ns")):
        raise refusal(where, values.astype(str), "does not rise", "sort it by ds.sortby, and drop repetitions")
    return values
