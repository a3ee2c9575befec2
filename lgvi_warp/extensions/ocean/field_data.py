# SPDX-License-Identifier: Apache-2.0
"""Request for a current from a data set, and its result."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.declared import array, declared, read, word
from lgvi_warp.common.errors import Faults
from lgvi_warp.extensions.ocean.holes import FILLS

# Part of the velocities' rms from which on a change by the regular grid is told.
MUCH = 0.05


@dataclass(frozen=True, eq=False)
class FieldRequest:
    """Request for data from a data set; numbers that are None follow from the data set.

    Args:
        origin: Latitude and longitude [deg] of the origin of the inertial axes, (2,); required.
        start: Date and time of t = 0: a datetime or a text in ISO 8601, in UTC unless it names a time zone; by default the
            first time of the data.
        region: Least and largest north, east and depth to read, (3, 2) [m]; by default all the data.
        speed: Largest speed over ground [m/s], to compute the region instead of giving `region`: the region that a vehicle
            starting at `around` can reach in `duration`.
        duration: Length of the time from the start to read [s]; by default to the end of the data.
        variables: Names of the eastward, northward and, if there is one, upward velocity; by default the variables with the
            usual standard_name or the usual name in models.
        spacing: Distances between the nodes of the regular grid [m], (3,); by default at least as fine as the data.
        fill: Treatment of missing values: "nearest", the default, "zero", or "refuse".
        checksum: Checksum of the numbers read, so that a changed file is refused.
        attributes: Missing or wrong attributes of the file: a table of "variable.attribute", or "attribute" of the file
            itself, with their values, for instance {"uo.units": "m s-1"}.
    """

    origin: Any = array(None, shape=(2,), unit="deg")
    start: Any = None
    region: Any = array(None, shape=(3, 2), unit="m")
    speed: float | None = declared(Faults.positive, None, unit="m/s")
    duration: float | None = declared(Faults.positive, None, unit="s")
    variables: Any = None
    spacing: Any = array(None, shape=(3,), unit="m")
    fill: str = word("nearest", known=FILLS)
    checksum: int | None = None
    attributes: Any = None


@dataclass(frozen=True, eq=False)
class FieldData:
    """Source of a field, and the changes of the data by the regular grid.

    Attributes:
        file: Path of the file; None for a Dataset.
        request: The request, completed with the numbers that follow from the data.
        nodes: Numbers of nodes (s, t, x, y, z).
        missing: Number of values, among those read, that were missing on land and below the sea floor.
        values: Number of values read.
        error: Largest change of a velocity at the data's own nodes and times, due to the regular grid [m/s].
        last: The last time that was read [s].
        more: Whether the data has later times.
        speed: Root mean square of the velocities [m/s].
        gap: Begin and end [s] of the longest time without a field, if it is more than twice the usual interval; else None.
        outages: Number of fields left out because they had no value in the region.
    """

    file: str | None
    request: FieldRequest
    nodes: tuple[int, ...]
    missing: int
    values: int
    error: float
    last: float
    more: bool
    speed: float
    gap: tuple[float, float] | None
    outages: int = 0

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on missing values and on the change due to the regular grid."""
        sentences = []
        if self.missing:
            part = 100.0 * self.missing / self.values
            how = {"zero": "taken for 0", "nearest": "filled with the nearest value"}[self.request.fill]
            amount = f"{self.missing:,} of {self.values:,} values ({part:.2g} %)"
            sentences.append(f"{amount}, on land or below the sea floor, are missing: {how}")
        if self.outages:
            sentences.append(f"{self.outages:,} of the fields have no value there: the current goes straight over them")
        if self.gap is not None:
            begin, end = (f"{t / 3600.0:.4g}" for t in self.gap)
            sentences.append(
                f"the data have no field from {begin} to {end} h: the current goes straight from one to the other"
            )
        if self.error > MUCH * self.speed:
            of_rms = f"{100.0 * self.error / self.speed:.2g} % of the rms" if self.speed else "of no current"
            sentences.append(
                f"the regular grid changes a velocity by up to {self.error:.3g} m/s, {of_rms}. Give a finer spacing"
            )
        return tuple(sentences)

    def table(self) -> dict[str, Any]:
        """Keys of a scene file with which the same numbers are read again."""
        request = {item.name: getattr(self.request, item.name) for item in dataclasses.fields(self.request)}
        plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in request.items()}
        return {"file": self.file} | {name: value for name, value in plain.items() if value is not None}


@dataclass(frozen=True, eq=False)
class FieldNumbers:
    """Velocities (s, t, x, y, z, 3) [m/s] in inertial axes on a regular grid, and the grid's axes."""

    velocities: np.ndarray
    origin: np.ndarray
    spacing: np.ndarray
    times: np.ndarray | None
    data: FieldData


def checked(faults: Faults, request: FieldRequest) -> dict[str, Any]:
    """The valid values of a request; adds faults for the others."""
    values = read(request, faults)
    del values["fill"]
    if request.origin is None:
        faults.add("origin", "", "is missing", "give [latitude, longitude] of the origin of the axes [deg]")
    elif (origin := values["origin"]) is not None and abs(origin[0]) > 89.0:
        faults.add("origin", origin, "has a latitude beyond 89 degrees", "give [latitude, longitude] in degrees")
    if (region := values["region"]) is not None and np.any(region[:, 1] < region[:, 0]):
        faults.add(
            "region", region, "ends before it begins", "give [[from, to], [from, to], [from, to]]: north, east, depth"
        )
    if (spacing := values["spacing"]) is not None and np.any(spacing <= 0.0):
        faults.add("spacing", spacing, "is not positive", "give numbers above 0 [m]")
    if request.speed is not None and request.region is not None:
        faults.add("speed", request.speed, "says the region, and so does region", "leave one of them out")
    if request.speed is not None and request.duration is None:
        faults.add("speed", request.speed, "says no region without a duration", "give duration [s], or [run] duration")
    check_attributes(faults, request.attributes)
    names = request.variables
    if names is not None and not (
        isinstance(names, list | tuple) and len(names) in (2, 3) and all(isinstance(n, str) for n in names)
    ):
        faults.add("variables", names, "are no two or three names", "give ['uo', 'vo'], or a third one for upward")
    return values


def check_attributes(faults: Faults, attributes: Any) -> None:
    """Add a fault for a value that is not a table of attributes."""
    if attributes is not None and not (
        isinstance(attributes, dict)
        and all(isinstance(k, str) and isinstance(v, str | int | float) for k, v in attributes.items())
    ):
        faults.add(
            "attributes", attributes, "are no texts or numbers by name", "give {'uo.units': 'm s-1'} for instance"
        )
