# SPDX-License-Identifier: Apache-2.0
"""Reader of a current from a data set: it finds the variables and interpolates each field to a regular grid."""

from __future__ import annotations

import dataclasses
import os
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.places import LocalPlane
from lgvi_warp.extensions.ocean import cf
from lgvi_warp.extensions.ocean.data_sets import data_set
from lgvi_warp.extensions.ocean.field_data import FieldData, FieldNumbers, FieldRequest, checked
from lgvi_warp.extensions.ocean.holes import filled
from lgvi_warp.extensions.ocean.regrid import Onto, Placed, Regular, directions, edge_of

# Levels of a regular grid, at most, where none are told: the finest levels of a model, near its surface, are a meter apart.
MOST_LEVELS = 100
# Pairs of velocities, first those that need no turning.
PAIRS = ((("east", cf.EASTWARD), ("north", cf.NORTHWARD)), (("x", cf.ALONG_X), ("y", cf.ALONG_Y)))
# Intervals of time that differ by less than this part are equal.
EQUAL_TIMES = 1e-6
# An interval of time so many times the median is a gap. Parts of the least interval, at most, of which all are multiples.
MOST_OF_TIME, MOST_PARTS = 2.0, 4
# Part of the velocities' rms that a grid may change them by without being made finer; numbers that a finer one may have.
LITTLE, MOST_FINE = 0.02, 2e7


def read_field(source: Any, request: FieldRequest, *, outside: str, around: Any = (0.0, 0.0, 0.0)) -> FieldNumbers:
    """Read the requested velocities from a path or an xarray Dataset.

    outside: Treatment of members beyond the grid, "hold" or "stop".
    around: Start position of members [m], (3,), for a region that follows from a speed.
    """
    faults = Faults()
    values = checked(faults, request)
    place = faults.finite("around", around, (3,), "m")
    faults.raise_if_any()
    assert place is not None
    request = dataclasses.replace(request, **values)
    with data_set(source, request.attributes) as ds:
        plane = LocalPlane(*map(float, request.origin))
        components = _components(ds, request, plane)
        region = _region(components[0].placed, request, place, outside)
        components = [component.within(region) for component in components]
        window, seconds, more = _times(components, request)
        count = _steps_of_time(seconds)
        spacing = request.spacing if request.spacing is not None else _fine_spacing(components[0].placed, region)
        target = _regular(region, spacing)
        _check_memory(components[0].placed.grid.scenarios, count + 1, target)
        if request.spacing is None and components[0].placed.grid.turned:
            target = _refined(components, target, request.fill, window, count)
        reader = _FieldReader(components, target, request.fill)
        velocities, times, error = reader.read(window, seconds)
        seconds = seconds[~reader.outage]
    if request.checksum not in (None, reader.checksum):
        raise refusal("checksum", request.checksum, f"is not that of what is read, {reader.checksum}",
                      "leave it out to take this file")  # fmt: skip
    file = os.fspath(source) if isinstance(source, str | os.PathLike) else None
    settled: dict[str, Any] = {
        "start": _moment(components, request),
        "region": region,
        "speed": None,
        "duration": None if times is None else float(seconds[-1]),
        "variables": [component.placed.grid.name for component in components],
        "spacing": target.spacing,
        "checksum": reader.checksum,
    }
    data = FieldData(file, dataclasses.replace(request, **settled), velocities.shape[:5], reader.missing, reader.count,
                     error, float(seconds[-1]), more, float(np.sqrt(np.mean(np.sum(velocities**2, axis=-1)))),
                     _gap(seconds), int(np.count_nonzero(reader.outage)))  # fmt: skip
    return FieldNumbers(velocities, target.origin, target.spacing, times, data)


@dataclass(frozen=True, eq=False)
class _Component:
    """A velocity of the data set along "east", "north", "up", or "x" or "y" of its grid."""

    along: str
    placed: Placed

    def within(self, region: np.ndarray) -> _Component:
        """The part of the grid that covers a region."""
        middle = np.mean(region[:2], axis=1)
        latitude, longitude = self.placed.plane.geodetic(
            *(np.append(side, at) for side, at in zip(edge_of(region), middle, strict=True))
        )
        about = self.placed.plane.longitude
        longitude = (longitude - about + 180.0) % 360.0 - 180.0 + about
        grid = self.placed.grid.between(*self.placed.grid.extent(latitude, longitude)).levels(float(region[2, 1]))
        return _Component(self.along, Placed(grid, self.placed.plane))


def _components(ds: Any, request: FieldRequest, plane: LocalPlane) -> list[_Component]:
    """The velocity components of a data set, each on its grid."""
    about, names = float(request.origin[1]), request.variables

    def component(along: str, quantity: cf.OceanQuantity, name: str) -> _Component:
        grid = cf.gridded(ds, quantity, name, about)
        if grid.turned and along != "up" and not cf.says_along(ds, name, quantity):
            word = quantity.standard_names[0]
            other = (cf.ALONG_X if along == "east" else cf.EASTWARD).standard_names[0] if along in ("east", "x") else (
                cf.ALONG_Y if along == "north" else cf.NORTHWARD).standard_names[0]  # fmt: skip
            raise refusal(f"{name}.standard_name", ds[name].attrs.get("standard_name", ""),
                          "does not say whether it is along the axes of its turned grid or to the east and north",
                          f"give attributes = {{'{name}.standard_name': {word!r}}}, or {other!r}")  # fmt: skip
        return _Component(along, Placed(grid, plane))

    if names is not None:
        known = [cf.variable_name(ds[[names[0]]], quantity) if names[0] in ds.data_vars else None
                 for quantity in (cf.EASTWARD, cf.ALONG_X)]  # fmt: skip
        pair = PAIRS[1] if known[0] is None and known[1] is not None else PAIRS[0]
        quantities = (*pair, ("up", cf.UPWARD))[: len(names)]
        return [component(along, quantity, str(cf.variable_name(ds, quantity, name)))
                for (along, quantity), name in zip(quantities, names, strict=True)]  # fmt: skip
    for pair in PAIRS:
        found = [(along, quantity, cf.variable_name(ds, quantity)) for along, quantity in pair]
        if all(name is not None for *_, name in found):
            break
    else:
        raise cf.missing(ds, [quantity for _, quantity in PAIRS[0]])
    parts = [component(along, quantity, str(name)) for along, quantity, name in found]
    upward = cf.variable_name(ds, cf.UPWARD)
    # Upward velocities stand between the levels of the others in some models: those follow the floor, and are small.
    if upward is not None and parts[0].placed.grid.s_levels is None:
        parts.append(component("up", cf.UPWARD, upward))
    return parts


def _region(placed: Placed, request: FieldRequest, around: np.ndarray, outside: str) -> np.ndarray:
    """Least and largest north, east and depth of the regular grid, (3, 2) [m]."""
    known = _known_depths(placed)
    if request.region is not None:
        region = np.array(request.region)
        if not placed.contains(*edge_of(region)).all():
            raise _small(placed, "region", region, "give one within the data, or a larger data set")
    elif request.speed is not None:
        reach = float(request.speed) * float(request.duration or 0.0)
        region = np.array([[x - reach, x + reach] for x in around])
        if not placed.contains(*edge_of(region)).all():
            remedy = "take a larger data set, or outside = 'stop'"
            if outside != "stop":
                raise _small(placed, "speed", region, remedy)
            region[:2] = _overlap(placed, region, remedy)
    else:
        region = np.vstack([placed.inner_box(), known])
    region[2] = np.clip(region[2], *known)
    return region


def _known_depths(placed: Placed) -> np.ndarray:
    """Depths of the first and the deepest level [m]."""
    grid = placed.grid
    if grid.s_levels is not None:
        return np.array([0.0, float(np.nanmax(grid.s_levels.floor))])
    return np.zeros(2) if grid.depth is None else grid.depth[[0, -1]]


def _overlap(placed: Placed, region: np.ndarray, remedy: str) -> np.ndarray:
    inner = placed.inner_box()
    both = np.stack([np.maximum(region[:2, 0], inner[:, 0]), np.minimum(region[:2, 1], inner[:, 1])], axis=1)
    if np.any(both[:, 1] <= both[:, 0]):
        raise _small(placed, "origin", region, remedy)
    return both


def _small(placed: Placed, key: str, region: np.ndarray, remedy: str) -> SceneError:
    """The error for data that do not cover the region that the mission may reach."""
    north, east = placed.north_east
    data = f"{_kilometers(north.min(), north.max())} north and {_kilometers(east.min(), east.max())} east"
    wanted = f"{_kilometers(*region[0])} north and {_kilometers(*region[1])} east"
    return refusal(key, wanted, f"is not within the data, {data} of the origin", remedy)


def _kilometers(low: float, high: float) -> str:
    return f"{low / 1e3:.4g} to {high / 1e3:.4g} km"


def _fine_spacing(placed: Placed, region: np.ndarray) -> np.ndarray:
    """Distances between nodes as fine as those of the data [m]."""
    along_y, along_x = placed.spacing()
    horizontal = min(d for d in (along_y, along_x, np.inf) if d > 0.0)
    grid = placed.grid
    if grid.s_levels is not None:
        level = float(region[2, 1] - region[2, 0]) / (MOST_LEVELS - 1)
    else:
        near = np.zeros(0) if grid.depth is None else grid.depth
        level = float(np.diff(near).min()) if len(near) > 1 else 1.0
    least = float(region[2, 1] - region[2, 0]) / (MOST_LEVELS - 1)
    # North and east are turned from the axes of a curved grid: the finer of the two along both.
    plane = (horizontal, horizontal) if grid.turned else (along_y, along_x)
    return np.array([d if d > 0.0 else 1.0 for d in (*plane, max(level, least))])


def _regular(region: np.ndarray, spacing: np.ndarray) -> Regular:
    """The regular grid over a region, with at most the given spacing."""
    extent = region[:, 1] - region[:, 0]
    intervals = np.ceil(extent / spacing - 1e-6).astype(int)
    fine = np.where(intervals > 0, extent / np.maximum(intervals, 1), spacing)
    x, y, z = (int(n) + 1 for n in intervals)
    return Regular(region[:, 0].copy(), fine, (x, y, z))


def _times(components: list[_Component], request: FieldRequest) -> tuple[range, np.ndarray, bool]:
    """Indices of the fields to read, their times [s], and whether the data has later fields."""
    time = components[0].placed.grid.time
    for component in components[1:]:
        other = component.placed.grid.time
        same = time is other is None or (time is not None and other is not None and np.array_equal(time, other))
        if not same:
            name = component.placed.grid.name
            raise refusal("variables", name, "has other times than the first one", "interpolate it in time")
    if time is None:
        return range(1), np.zeros(1), False
    seconds = cf.seconds_since(time, request.start)
    span = " to ".join(str(one).split(".")[0] for one in time[[0, -1]])
    if not seconds[0] <= 0.0 <= seconds[-1]:
        raise refusal("start", str(request.start), f"is outside the data, {span}", "give a moment within")
    first = int(np.searchsorted(seconds, 0.0, side="right")) - 1
    end = seconds[-1] if request.duration is None else float(request.duration)
    stop = min(int(np.searchsorted(seconds, end)) + 1, len(seconds))
    return range(first, stop), seconds[first:stop], stop < len(seconds)


def _moment(components: list[_Component], request: FieldRequest) -> str | None:
    """The date and time of t = 0 as a text; None for the first time if it is not in the standard calendar."""
    time = components[0].placed.grid.time
    if time is None or (request.start is None and time.dtype.kind != "M"):
        return None
    return str(np.datetime_as_string(time[0] if request.start is None else cf.instant("start", request.start)))


def _check_memory(scenarios: int, times: int, target: Regular) -> None:
    size = 24.0 * scenarios * times * float(np.prod(target.counts, dtype=float))
    available = machine.memory_bytes()
    if available is not None and size > 0.5 * available:
        raise refusal("region", " x ".join(map(str, (scenarios, times, *target.counts))),
                      f"are nodes of {size / 1e9:.3g} GB, more than half the memory",
                      "give a smaller region, a shorter duration, or a wider spacing")  # fmt: skip


def _refined(components: list[_Component], target: Regular, fill: str, window: range, count: int) -> Regular:
    """Halve the horizontal spacing until the grid changes the first, middle and last field little.

    No node of a rotated grid is a node of the regular grid, so the change at each node falls in proportion to the spacing.
    """
    most = MOST_FINE / (components[0].placed.grid.scenarios * (count + 1.0))
    while True:
        reader = _FieldReader(components, target, fill)
        read = [reader.field(0, window[i]) for i in sorted({0, len(window) // 2, len(window) - 1})]
        if not (fields := [one for one in read if one is not None]):
            return target
        rms = np.sqrt(max(np.mean(np.sum(velocities**2, axis=-1)) for velocities, _ in fields))
        finer = _regular(np.stack([target.origin, target.origin + target.spacing * (np.array(target.counts) - 1.0)], axis=1),
                         target.spacing * [0.5, 0.5, 1.0])  # fmt: skip
        if max(error for _, error in fields) <= LITTLE * rms or np.prod(finer.counts, dtype=float) > most:
            return target
        target = finer


class _FieldReader:
    """Reader of one field after another.

    missing, count: Numbers of missing and of all values. checksum: Of the numbers read. outage: Mask of times without values.
    """

    def __init__(self, components: list[_Component], target: Regular, fill: str):
        self.components, self.target, self.fill = components, target, fill
        self.onto = [Onto(component.placed, target) for component in components]
        self.along = [directions(component.placed, component.along) for component in components]
        # Components at the same nodes change together; of others the largest changes add up at worst.
        self.group = [
            next(i for i, other in enumerate(components) if _same_nodes(component, other)) for component in components
        ]
        self.missing = self.count = self.checksum = 0
        self.outage = np.zeros(1, bool)
        for component in components:
            grid = component.placed.grid
            self._note(grid.latitude, grid.longitude, np.zeros(0) if grid.depth is None else grid.depth)

    def read(self, window: range, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray | None, float]:
        """Velocities (s, t, x, y, z, 3), their first time and time step [s], and the largest change."""
        self._note(seconds)
        scenarios = self.components[0].placed.grid.scenarios
        velocities = np.empty((scenarios, len(window), *self.target.counts, 3))
        error = 0.0
        self.outage = np.zeros(len(window), bool)
        for scenario in range(scenarios):
            for number, time in enumerate(window):
                if (found := self.field(scenario, time)) is None:
                    self.outage[number] = True
                else:
                    velocities[scenario, number] = found[0]
                    error = max(error, found[1])
        if self.outage.any():
            velocities, seconds = velocities[:, ~self.outage], seconds[~self.outage]
            name = self.components[0].placed.grid.name
            if not len(seconds):
                problem = "has no value there: land, or a field that is missing"
                raise refusal("region", f"{name} at time {window[0]}", problem, "give a region in the water")
            if not seconds[0] <= 0.0 <= seconds[-1]:
                raise refusal("start", name, "has no value there at times before or after it, an outage",
                              f"give a moment {seconds[0]:g} to {seconds[-1]:g} s from it")  # fmt: skip
        if len(seconds) == 1:
            return velocities, None, error
        times, velocities, change = _in_equal_steps(seconds, velocities, _steps_of_time(seconds))
        return velocities, times, error + change

    def field(self, scenario: int, time: int) -> tuple[np.ndarray, float] | None:
        """Velocities (x, y, z, 3) of one field, and the largest change; None if a component has no value at all."""
        total = np.zeros((*self.target.counts, 3))
        changes: dict[int, list[Any]] = {}
        for group, component, onto, along in zip(self.group, self.components, self.onto, self.along, strict=True):
            grid = component.placed.grid
            field = grid.values(scenario, time)
            self._note(field)
            depths = None if grid.s_levels is None else grid.s_levels.depths(time)
            holes = np.isnan(field)
            self.missing, self.count = self.missing + int(np.count_nonzero(holes)), self.count + field.size
            if holes.all():
                return None
            if holes.any() and self.fill == "refuse":
                when = f"{grid.name} at time {time}"
                raise refusal("fill", self.fill, f"{np.count_nonzero(holes):,} of {field.size:,} values of {when} are missing",
                              "give fill = 'nearest' or 'zero', or a region in open water")  # fmt: skip
            spacing = component.placed.spacing()
            if depths is not None:
                # A column that is filled has the levels of the one that it is filled from.
                depths = filled(np.where(holes.all(axis=0), np.nan, depths), spacing, "nearest")
            field = filled(field, spacing, self.fill)
            if depths is not None and depths[0].mean() > depths[-1].mean():
                field, depths = field[::-1], depths[::-1]
            # In the plane's axes before values are taken between the nodes, where north is another.
            for axis in np.flatnonzero(np.any(along, axis=(0, 1))):
                part = field * along[..., axis]
                regular = onto(part, depths)
                change = changes.setdefault(group, [0.0, 0.0, 0.0])
                change[axis] = change[axis] + onto.change(part, regular, depths)
                total[..., axis] += regular
        return total, float(np.sum([_largest(change) for change in changes.values()]))

    def _note(self, *arrays: np.ndarray) -> None:
        for values in arrays:
            self.checksum = zlib.crc32(np.ascontiguousarray(values, dtype="<f8").tobytes(), self.checksum)


def _same_nodes(single: _Component, compared: _Component) -> bool:
    """Whether two components have the same nodes."""
    first, second = single.placed.grid, compared.placed.grid
    pairs = ((first.latitude, second.latitude), (first.longitude, second.longitude), (first.depth, second.depth))
    none = np.zeros(0)
    same = [np.array_equal(none if a is None else a, none if b is None else b, equal_nan=True) for a, b in pairs]
    return all(same) and first.shape == second.shape


def _largest(change: list[Any]) -> float:
    """Largest length of vectors of three components, each an array (n,) or 0."""
    return float(np.sqrt(np.max(sum(np.square(part) for part in change), initial=0.0)))


def _gap(seconds: np.ndarray) -> tuple[float, float] | None:
    """Begin and end [s] of the longest time without a field, if it is more than twice the usual interval."""
    steps = np.diff(seconds)
    if not len(steps) or steps.max() <= MOST_OF_TIME * np.median(steps) * (1.0 + EQUAL_TIMES):
        return None
    at = int(np.argmax(steps))
    return float(seconds[at]), float(seconds[at + 1])


def _steps_of_time(seconds: np.ndarray) -> int:
    """Number of equal time steps that replace the data's times, if possible so that each time of the data is among them.

    Otherwise the steps are about as long as the shortest interval, but at most four for each interval of the data on average.
    """
    steps = np.diff(seconds)
    if not len(steps):
        return 0
    least = steps.min()
    for part in range(1, MOST_PARTS + 1):
        at = (seconds - seconds[0]) * part / least
        count = int(np.round(at[-1]))
        if np.abs(at * (count / at[-1]) - np.round(at)).max() <= EQUAL_TIMES * part:
            return count
    if (gap := _gap(seconds)) is not None:
        raise refusal("duration", f"{gap[0]:g} to {gap[1]:g} s", "is a gap among times without a common interval",
                      "give a shorter duration or a later start, or interpolate the data in time, by ds.interp")  # fmt: skip
    return int(min(np.ceil((seconds[-1] - seconds[0]) / least - 1e-9), 4 * len(steps)))


def _in_equal_steps(seconds: np.ndarray, velocities: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, float]:
    """First time and step [s], velocities at equal steps, and the largest change of velocities at times of the data."""
    step = (seconds[-1] - seconds[0]) / count
    if count == len(seconds) - 1 and np.ptp(np.diff(seconds)) <= EQUAL_TIMES * step:
        return np.array([seconds[0], step]), velocities, 0.0
    equal = _at_times(velocities, np.interp(seconds[0] + step * np.arange(count + 1), seconds, np.arange(len(seconds))))
    back = _at_times(equal, (seconds - seconds[0]) / step)
    return np.array([seconds[0], step]), equal, float(np.linalg.norm(back - velocities, axis=-1).max())


def _at_times(velocities: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Velocities at fractional indices of times."""
    low = np.clip(np.floor(at).astype(int), 0, velocities.shape[1] - 2)
    part = (at - low)[None, :, None, None, None, None]
    return np.asarray((1.0 - part) * velocities[:, low] + part * velocities[:, low + 1])
