# SPDX-License-Identifier: Apache-2.0
"""A current on a grid in space and time, such as that of an ocean model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults, ragged
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number
from lgvi_warp.physics.terms.events import Outside
from lgvi_warp.physics.terms.in_files import InFile, numbers_in

OUTSIDE = ("hold", "stop")
# Numbers that are those of a data set.
OF_DATA = ("velocities", "origin", "spacing", "times")
# Part of a time that is round-off.
ROUND_OFF = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class CurrentField(InFile, Term):
    """A current on a regular grid in north, east, depth and, if `times` are given, time; linear between the nodes.

    Several fields on one grid, for example of an ensemble forecast, are scenarios. `scenario` selects one of them, and may
    vary by member.

    Args:
        velocities: Velocities of the water [m/s], inertial axes, (x, y, z, 3) for x, y, z nodes along north, east and depth.
            With `times`: (t, x, y, z, 3) for t fields. For s scenarios: (s, t, x, y, z, 3), without `times` (s, x, y, z, 3).
        origin: Position of the first node, (3,) [m]: north, east, depth; zeros by default.
        spacing: Distance between nodes along north, east and depth, (3,) [m].
        times: Time of the first field and time step between fields, (2,) [s]; None, the default, for a constant field.
        scenario: Index of the scenario, a whole number from 0; 0 by default.
        outside: Treatment of members outside the grid. "hold", the default, uses the velocity at the nearest edge. With
            "stop", a member that leaves the grid stops with the status OUTSIDE, and a run that ends after the last time is
            refused.

    Methods:
        from_dataset: Current from the data set of an ocean model.

    Raises:
        SceneError: If the shape of `velocities` does not fit, or a number is invalid (see `Term`).

    Examples:
        An eddy that turns once in 1,000 s about the centre of a square with sides of 200 m.

        >>> import lgvi_warp as lw
        >>> import numpy as np
        >>> x = np.linspace(-100.0, 100.0, 21)
        >>> north, east = np.meshgrid(x, x, indexing="ij")
        >>> turn = 2.0 * np.pi / 1000.0
        >>> eddy = np.stack([-turn * east, turn * north, 0.0 * north], axis=-1)[:, :, None]
        >>> field = lw.terms.CurrentField(velocities=eddy, origin=[-100.0, -100.0, 0.0], spacing=[10.0, 10.0, 10.0])
        >>> field.velocities.shape
        (1, 1, 21, 21, 1, 3)
    """

    type: ClassVar[str] = "current_field"

    velocities: Any = number(("s", "t", "x", "y", "z", 3), "m/s")
    origin: Any = number((3,), "m", (0.0, 0.0, 0.0))
    spacing: Any = number((3,), "m", above=0.0)
    times: Any = number((2,), "s", None, optional=True)
    scenario: Any = number((), "1", 0.0, least=0.0)
    outside: str = word("hold", known=OUTSIDE)
    # Where the numbers come from, of `from_dataset`.
    data: Any = field(default=None, init=False, repr=False)

    of_file_besides: ClassVar[tuple[str, ...]] = ("file", "around", "outside", "scenario", "name")
    of_file_by: ClassVar[str] = "from_dataset"

    @classmethod
    def from_dataset(
        cls,
        source: Any,
        origin: Any,
        *,
        start: Any = None,
        region: Any = None,
        speed: float | None = None,
        duration: float | None = None,
        around: Any = (0.0, 0.0, 0.0),
        variables: Any = None,
        spacing: Any = None,
        fill: str = "nearest",
        checksum: int | None = None,
        attributes: Mapping[str, Any] | None = None,
        outside: str = "stop",
        scenario: float = 0.0,
        name: str = "",
    ) -> Self:
        """Read a current from a data set in the CF conventions, such as those of CMEMS, HYCOM and ROMS.

        Only the requested region and times are read, field by field. Latitudes and longitudes are converted to metres in the
        plane that touches the Earth at `origin`, and velocities to the axes of this plane.

        Args:
            source: Path of a NetCDF file, or an xarray Dataset.
            origin: Latitude and longitude [deg] of the origin of the inertial axes, (2,).
            start: Date and time of t = 0: a datetime or a text in ISO 8601, in UTC unless it names a time zone; by default
                the first time of the data.
            region: Least and largest north, east and depth to read, (3, 2) [m]; by default all the data are read.
            speed: Largest speed over ground [m/s], instead of `region`. The region is then the one that a vehicle starting
                at `around` can reach in `duration`.
            duration: Length of the period to read [s], from `start`; by default it ends with the data.
            around: Start position of members [m], (3,), for use with `speed`; zeros by default.
            variables: Names of the eastward, northward and, if there is one, upward velocity; by default the variables with
                the usual standard_name or the usual name in models.
            spacing: Distances between the nodes of the regular grid [m], (3,); by default the grid is at least as fine as the
                data, with at most 100 levels in depth.
            fill: Treatment of missing values, on land and below the sea floor: "nearest", the default, "zero", or "refuse".
            checksum: Checksum of the numbers of the file; a changed file is refused. By default any file is read.
            attributes: Values for missing or wrong attributes of the file, for instance {"u.units": "m s-1"}; a key without
                a variable is an attribute of the file itself.
            outside: As in the class; "stop" by default.
            scenario: As in the class. Scenarios are the dimension `realization`, `member`, `ensemble` or `number`.
            name: As in `Term`.

        Returns:
            The field. Its `data` has the number of missing values, and the largest change of a velocity by regridding [m/s].

        Raises:
            SceneError: If the data set has no known velocities, has unknown axes, or does not cover the region or the times;
                the message names the remedy.
            MissingExtra: If xarray, a reader of NetCDF or pyproj is not installed.

        Examples:
            A current whose eastward velocity rises by 1 m/s per 0.1 degrees to the north, and its value 5 km north.

            >>> import lgvi_warp as lw
            >>> import numpy as np
            >>> import xarray as xr
            >>> lat, lon = np.linspace(41.0, 42.0, 11), np.linspace(-71.0, -70.0, 11)
            >>> east = np.repeat(10.0 * (lat[:, None] - 41.5), 11, axis=1)
            >>> known = {"units": "m s-1", "standard_name": "eastward_sea_water_velocity"}
            >>> still = {"units": "m s-1", "standard_name": "northward_sea_water_velocity"}
            >>> ds = xr.Dataset({"uo": (("lat", "lon"), east, known), "vo": (("lat", "lon"), 0.0 * east, still)},
            ...                 {"lat": lat, "lon": lon})
            >>> field = lw.terms.CurrentField.from_dataset(ds, (41.5, -70.5), region=[[-1e4, 1e4], [-1e4, 1e4], [0.0, 50.0]])
            >>> field.velocities.shape
            (1, 1, 3, 4, 1, 3)
            >>> float(np.round(field.velocities[0, 0, 2, 0, 0, 1], 2))
            0.9
        """
        wanted = {"origin": origin, "start": start, "region": region, "speed": speed, "duration": duration,
                  "variables": variables, "spacing": spacing, "fill": fill, "checksum": checksum,
                  "attributes": attributes}  # fmt: skip
        numbers = numbers_in(source, cls, wanted, outside=outside, around=around)
        known = {key: getattr(numbers, key) for key in OF_DATA}
        return _with_data(cls(**known, outside=outside, scenario=scenario, name=name), numbers.data)

    def __post_init__(self) -> None:
        if not ragged(self.velocities):
            velocities = np.asarray(self.velocities)
            if velocities.ndim == 4:
                velocities = velocities[None, None]
            elif velocities.ndim == 5:
                velocities = velocities[:, None] if self.times is None else velocities[None]
            if velocities.ndim == 6:
                object.__setattr__(self, "velocities", velocities)
        super().__post_init__()

    def with_fields(self, fields: Mapping[str, Any]) -> Any:
        # Other velocities are not those of the data.
        changed = super().with_fields(fields)
        return _with_data(changed, self.data) if fields.keys().isdisjoint(OF_DATA) else changed

    def to_dict(self) -> dict[str, Any]:
        if self.data is None or self.data.file is None:
            return self.table_without(("data",))
        return self.table_without(("data", *OF_DATA)) | self.data.table()

    @property
    def remarks(self) -> tuple[str, ...]:
        return () if self.data is None else self.data.remarks

    @property
    def own_events(self) -> tuple[Any, ...]:
        if self.outside != "stop":
            return ()
        return (Outside(field=self.key, name="" if self.key == self.type else f"{self.key}_outside"),)

    def check_times(self, faults: Faults, first: float, last: float) -> None:
        if self.times is None:
            return
        begin, end = float(self.times[0]), float(self.times[0] + (self.velocities.shape[1] - 1) * self.times[1])
        if self.data is not None and self.data.more and last > end * (1.0 + ROUND_OFF):
            known = f"is read to {end:.9g} s alone, and the run ends at {last:.9g} s"
            faults.add(f"{self.key}.duration", end, known, f"give duration = {last:.9g} to the field, or a shorter run")
        elif self.outside == "stop" and (first < begin or last > end * (1.0 + ROUND_OFF)):
            problem = f"ends the field at {end:.9g} s" if first >= begin else f"begins the field at {begin:.9g} s"
            remedy = "give outside = 'hold' to hold its last velocities, or a shorter run"
            faults.add(
                f"{self.key}.times",
                self.times,
                f"{problem}, and the run lasts from {first:.9g} to {last:.9g} s",
                remedy,
            )

    @property
    def timed(self) -> bool:  # type: ignore[override]
        return self.times is not None

    def check(self, faults: Faults) -> None:
        if self.times is None and self.velocities.shape[1] > 1:
            faults.add(
                "times", None, f"is missing for {self.velocities.shape[1]} fields", "give [first, between] in seconds"
            )
        if self.times is not None and not self.times[1] > 0.0:
            faults.add("times", self.times, "has no time between two fields", "give [first, between] in seconds")
        if _no_scenario(self.scenario[None], len(self.velocities)).any():
            faults.add("scenario", self.scenario, f"is none of {len(self.velocities)}", "give a whole number from 0")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        bad = super().unphysical(numbers)
        return bad | {"scenario": bad["scenario"] | _no_scenario(numbers["scenario"], len(self.velocities))}

    def present(self, numbers: Numbers) -> bool:
        return bool(np.any(numbers["velocities"]))

    def device_in(self, aligned: bool) -> str:
        return "current_field:time" if self.timed else "current_field"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        velocities = numbers["velocities"]
        counts = np.array(velocities.shape[1:6])
        # Rows from one node to the next along each axis; 0 where there is one node.
        rows = 3 * np.array([np.prod(counts[i + 1 :], dtype=np.int64) for i in range(5)])
        words = dict(
            zip(("scenario", "time", "north", "east", "depth"), np.where(counts > 1, rows, 0).tolist(), strict=True)
        )
        times = numbers.get("times", np.array([[0.0, 1.0]]))
        values = {
            "origin": numbers["origin"],
            "inverse": 1.0 / numbers["spacing"],
            "last": (counts[2:] - 1.0)[None],
            "start": times[:, 0],
            "inverse_time": 1.0 / times[:, 1],
            "last_time": np.array([counts[1] - 1.0]),
            "chosen": numbers["scenario"],
        }
        return Packed(values | words, velocities.reshape(len(velocities), -1))

    def water(self, numbers: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        from scipy.ndimage import map_coordinates

        n = position.shape[1]
        nodes = numbers["velocities"]
        times = numbers.get("times", np.array([[0.0, 1.0]]))
        result = np.empty(position.shape)
        for i in range(n):
            values = nodes[i % len(nodes)][int(numbers["scenario"][i % len(numbers["scenario"])])]
            first, between = times[i % len(times)]
            place = (position[:, i] - numbers["origin"][i % len(numbers["origin"])]) / numbers["spacing"][
                i % len(numbers["spacing"])
            ]
            at = np.column_stack([(time - first) / between, place]).T
            for axis in range(3):
                result[:, i, axis] = map_coordinates(values[..., axis], at, order=1, mode="nearest")
        return result


def _with_data(field: Any, data: Any) -> Any:
    """The field, with the source of its numbers."""
    object.__setattr__(field, "data", data)
    return field


def _no_scenario(scenario: np.ndarray, count: int) -> np.ndarray:
    """Mask of numbers (n,) that are not an index of one of `count` scenarios."""
    return (scenario != np.rint(scenario)) | (scenario > count - 1)
