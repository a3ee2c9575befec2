# SPDX-License-Identifier: Apache-2.0
"""The tracks of a run's exported members: their samples, read part by part, and their place and time on the Earth."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import members_of
from lgvi_warp.common.errors import SceneError, ragged, refusal
from lgvi_warp.common.places import LocalPlane
from lgvi_warp.common.sentences import capital
from lgvi_warp.common.status import Status
from lgvi_warp.control.signals import ordered
from lgvi_warp.physics import notation
from lgvi_warp.physics import vehicle as vehicles
from lgvi_warp.physics.fields import Field
from lgvi_warp.physics.terms.base import word_of
from lgvi_warp.results.result import Result
from lgvi_warp.scene.start import Environment
from lgvi_warp.statistics.values.quantity import KNOWN

# What is told the fraction that is done.
Report = Callable[[float], None]
# Numbers of the start, by name.
START_UNITS = {"start.position": "m", "start.rotation_vector": "rad", "start.euler_deg": "deg", "start.velocity": "m/s",
               "start.velocity_inertial": "m/s", "start.angular_velocity": "rad/s"}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Tracks:
    """Exported members of a run, with their samples or only their final states.

    result: The members whose samples were kept: the run itself, or its kept members.
    places: Positions of the exported members in `result`, (m,). members: their indices in the ensemble, (m,).
    environment: Origin of the axes and date of t = 0. piece_bytes: Most bytes of numbers that are read at once. Formats
    that write member by member read all samples of a member at once, even if they are more.
    """

    result: Result
    places: np.ndarray
    members: np.ndarray
    environment: Environment
    piece_bytes: int = 64_000_000

    @property
    def count(self) -> int:
        """Number of members."""
        return len(self.places)

    @property
    def time(self) -> np.ndarray:
        """Times of the samples (k,) [s]."""
        return self.result.time

    @property
    def plane(self) -> LocalPlane | None:
        """The plane of the axes on the Earth; None if the origin is unknown."""
        return self.environment.plane

    @property
    def provenance(self) -> dict[str, Any]:
        """Provenance of the run."""
        return self.result.provenance

    @property
    def source(self) -> str:
        """The program and the method that produced the run."""
        version, method = (recorded(self.provenance, *keys) for keys in (("versions", "lgvi-warp"), ("method", "name")))
        return f"lgvi-warp {version}, method {method}"

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields with samples."""
        return ordered(self.result.samples)

    def needing(self, names: Sequence[str], purpose: str) -> None:
        """Refuse a run that did not keep the samples that a format needs."""
        if missing := [name for name in names if name not in self.result.samples]:
            remedy = "run it with keep='all', or SaveAt(fields=...) that names them"
            raise SceneError([f"{', '.join(missing)} were not kept: {purpose} is made of them. {capital(remedy)}"])

    def needing_origin(self, purpose: str) -> LocalPlane:
        """The plane of the axes on the Earth; refuse a run whose origin is unknown."""
        return plane_of(self.environment, purpose)

    def sample(self, name: str, rows: slice = slice(None), when: slice = slice(None)) -> np.ndarray:
        """Samples (k, m, ...) of some of the members at some of the times."""
        places = as_slice(self.places[rows])
        if self.result.store is not None:
            stored: Any = self.result.samples
            return np.asarray(stored.rows(name, when, places))
        return np.asarray(self.result.samples[name][when][:, places])

    def of_members(self, name: str, rows: slice = slice(None)) -> np.ndarray:
        """Records of some of the members, such as "status"."""
        return np.asarray(getattr(self.result, name))[self.places[rows]]

    def statuses(self) -> list[str]:
        """Outcome of each member as a word."""
        return [Status(int(code)).name.lower() for code in self.of_members("status")]

    def numbers(self, rows: slice = slice(None)) -> dict[str, np.ndarray]:
        """Varied numbers of some of the members by name, (m, ...): parameters, and numbers of the start."""
        varied = {name: _of(self.result.parameters, name, self.places[rows]) for name in self.varied}
        starts = {name: _of(self.result.starts, name, self.places[rows]) for name in self.result.starts}
        return dict(sorted((varied | starts).items()))

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that differ between members."""
        parameters: Any = self.result.parameters
        if self.result.store is not None:
            return tuple(name for name in parameters.names)
        return tuple(name for name, values in parameters.items() if len(values) > 1)

    def pieces(self, numbers: int, together: int = 1) -> Iterator[slice]:
        """Slices of the members for reading in parts; each member has this many numbers at each time.

        together: Number of members in one chunk of the file; a chunk should be written only once.
        """
        most = max(1, self.piece_bytes // (8 * max(1, len(self.time) * numbers)))
        most = most // together * together or most
        for first in range(0, self.count, most):
            yield slice(first, min(first + most, self.count))

    def spans(self, numbers: int) -> Iterator[slice]:
        """Slices of the times for reading in parts; each member has this many numbers at each time."""
        most = max(1, self.piece_bytes // (8 * max(1, self.count * numbers)))
        for first in range(0, len(self.time), most):
            yield slice(first, min(first + most, len(self.time)))

    def moments(self, times: Any) -> np.ndarray:
        """Dates and times in UTC, to the microsecond, at times [s]; they count from 1970 if the start is unknown."""
        start = self.environment.start_time
        begin = np.datetime64(0, "us") if start is None else start
        return np.asarray(begin + np.round(np.asarray(times, float) * 1e6).astype("timedelta64[us]"))

    def path(self, member: int) -> tuple[np.ndarray, np.ndarray]:
        """The samples (p,) of a member until it ended, and their times (p,) [s].

        If a member ended between two samples, its final state is in the later samples. The first of these is returned
        as its last one, with the time of its end.
        """
        time = self.time
        end = float(self.of_members("end_time", slice(member, member + 1))[0])
        index = np.flatnonzero(time <= end)
        times = time[index]
        if len(index) < len(time) and (not len(times) or times[-1] < end):
            index, times = np.append(index, len(index)), np.append(times, end)
        return index, times


def plane_of(environment: Environment, purpose: str) -> LocalPlane:
    """Find the plane of axes on the Earth; refuse axes whose origin is unknown."""
    plane = environment.plane
    if plane is None:
        remedy = "give origin=[latitude, longitude] (--origin=LAT,LON), or the scene [environment] origin"
        raise refusal("origin", None, f"is not known: {purpose} has places on the Earth", remedy)
    return plane


def tracks_of(result: Result, members: Any, environment: Environment) -> Tracks:
    """Choose members of a run by a slice or indices; None: all members with samples, or all of a run without samples."""
    source = result.kept if not result.samples and result.kept is not None else result
    present = np.arange(result.members) if source is result else result.kept_members
    identities = _identities(result, source)
    if members is None:
        return Tracks(source, np.arange(source.members), identities, environment)
    wanted = np.array(list(dict.fromkeys(members_of("members", members, result.members).tolist())))
    order = np.argsort(present, kind="stable")
    at = np.minimum(np.searchsorted(present, wanted, sorter=order), len(present) - 1)
    places = order[at]
    if len(lost := wanted[present[places] != wanted]):
        problem = f"is none of the {len(present):,} members that were kept"
        raise refusal("members", int(lost[0]), problem, "leave members out, or run again with keep='all'")
    return Tracks(source, places, identities[places], environment)


def _identities(result: Result, source: Result) -> np.ndarray:
    """Indices of the members in the run's ensemble."""
    if source.store is not None:
        samples: Any = source.samples
        return np.asarray(dataclasses.replace(samples, names=("realization",), axis=0)["realization"])
    indices = recorded(result.provenance, "ensemble", "indices") or ()
    whole = np.zeros(0) if ragged(indices) else np.asarray(indices)
    known = whole.shape == (result.members,) and whole.dtype.kind in "iu"
    whole = whole if known else np.arange(result.members)
    return whole if source is result else whole[result.kept_members]


def recorded(provenance: Any, *keys: str) -> Any:
    """Value at some keys of a run's provenance, which may come from an untrusted file; None if missing."""
    for key in keys:
        provenance = provenance.get(key) if isinstance(provenance, Mapping) else None
    return provenance


def as_slice(places: np.ndarray) -> Any:
    """Convert consecutive positions to a slice, which is read faster; return others unchanged."""
    if len(places) and places[-1] - places[0] == len(places) - 1 and np.all(np.diff(places) == 1):
        return slice(int(places[0]), int(places[-1]) + 1)
    return places


def _of(values: Mapping[str, Any], name: str, places: np.ndarray) -> np.ndarray:
    """An array (m, ...) of some members; from a store, only these members are read."""
    part = getattr(values, "part", None)
    return np.asarray(part(places)[name] if part is not None else values[name][places])


def units_of(tracks: Tracks) -> dict[str, str]:
    """Units of the varied numbers, by name; a number of a part of the controller may have no unit here."""
    units: dict[str, str] = {f"vehicle.{name}": unit for name, unit in vehicles.UNITS.items()}
    units |= {"environment.gravity": "m/s2", "environment.water_density": "kg/m3"}
    for term in tracks.result.terms:
        for item in dataclasses.fields(term):
            units[f"{term.key}.{word_of(item)}"] = item.metadata.get("unit") or "1"
    if tracks.result.store is not None:
        group: Any = tracks.result.samples.group  # type: ignore[attr-defined]
        units |= {name: str(array.attrs["units"]) for name, array in group.arrays() if "units" in array.attrs}
    return units | START_UNITS


# What follows from samples, and what of: names, and a function of one piece of them.
Function = Callable[[Tracks, Mapping[str, np.ndarray]], np.ndarray]


@dataclass(frozen=True)
class DerivedNumber:
    """A number that is computed from samples: its field, its function, and whether it needs an origin."""

    field: Field
    of: tuple[str, ...]
    function: Function
    on_the_earth: bool = False


def _place(axis: int) -> Function:
    def function(tracks: Tracks, samples: Mapping[str, np.ndarray]) -> np.ndarray:
        plane, x = tracks.plane, np.asarray(samples["position"], dtype=np.float64)
        assert plane is not None
        return plane.geodetic(x[..., 0], x[..., 1])[axis]

    return function


def _angle(axis: int) -> Function:
    def function(tracks: Tracks, samples: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.asarray(np.rad2deg(KNOWN["euler"].function(dict(samples), None))[..., axis])  # type: ignore[arg-type]

    return function


def _heading(tracks: Tracks, samples: Mapping[str, np.ndarray]) -> np.ndarray:
    """Direction of the body's x axis, from true north towards east, 0 to 360 [deg]."""
    plane, x = tracks.plane, np.asarray(samples["position"], dtype=np.float64)
    assert plane is not None
    latitude, longitude = plane.geodetic(x[..., 0], x[..., 1])
    turned = np.deg2rad(_angle(2)(tracks, samples)) - plane.convergence(latitude, longitude)
    # PROJ tells infinite angles of what is no place.
    return np.rad2deg(np.where(np.isfinite(turned), turned, np.nan)) % 360.0


def _quaternion(axis: int) -> Function:
    def function(tracks: Tracks, samples: Mapping[str, np.ndarray]) -> np.ndarray:
        return notation.quaternion_from_matrix(samples["attitude"])[..., axis]

    return function


def _speed(tracks: Tracks, samples: Mapping[str, np.ndarray]) -> np.ndarray:
    return np.asarray(KNOWN["speed"].function(dict(samples), None), dtype=np.float64)  # type: ignore[arg-type]


_POSITION, _ATTITUDE = ("position",), ("attitude",)
DERIVED = {
    derived.field.name: derived
    for derived in (
        DerivedNumber(Field("latitude", (), "degrees_north", "latitude, WGS 84"), _POSITION, _place(0), True),
        DerivedNumber(Field("longitude", (), "degrees_east", "longitude, WGS 84"), _POSITION, _place(1), True),
        DerivedNumber(Field("heading_deg", (), "degree", "direction of the body's x axis from true north to the east"),
                (*_POSITION, *_ATTITUDE), _heading, True),
        DerivedNumber(Field("roll_deg", (), "degree", "roll, starboard down"), _ATTITUDE, _angle(0)),
        DerivedNumber(Field("pitch_deg", (), "degree", "pitch, bow up"), _ATTITUDE, _angle(1)),
        DerivedNumber(Field("yaw_deg", (), "degree", "yaw, bow to starboard, from north of the axes"), _ATTITUDE, _angle(2)),
        *(DerivedNumber(Field(f"quaternion_{letter}", (), "1", f"{letter} of the quaternion, body to inertial axes"),
                  _ATTITUDE, _quaternion(i)) for i, letter in enumerate("wxyz")),
        DerivedNumber(Field("speed", (), "m/s", "length of the velocity"), ("velocity",), _speed),
    )
}  # fmt: skip


def derived_of(tracks: Tracks, names: Sequence[str]) -> tuple[DerivedNumber, ...]:
    """Derived numbers with these names that can be computed from kept samples."""
    chosen = (DERIVED[name] for name in names)
    return tuple(
        item
        for item in chosen
        if set(item.of) <= set(tracks.fields) and not (item.on_the_earth and tracks.plane is None)
    )
