"""What a run leaves: samples, status, and everything they follow from."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common import npy_files
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.status import StatusArray, WarningArray
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics import notation
from lgvi_warp.physics.terms import Term, from_list
from lgvi_warp.runs import member_fields, result_file
from lgvi_warp.statistics.estimate import Estimates

if TYPE_CHECKING:
    import xarray

    from lgvi_warp.scene.ensemble import Ensemble

UNITS = {
    "position": "m",
    "attitude": "1",
    "quaternion_wxyz": "1",
    "velocity": "m s-1",
    "angular_velocity": "rad s-1",
    "energy": "J",
}
MEANINGS = {
    "position": "position in inertial axes, north east down",
    "attitude": "rotation from body to inertial axes",
    "quaternion_wxyz": "unit quaternion of the attitude, scalar first",
    "velocity": "velocity in body axes",
    "angular_velocity": "angular velocity in body axes",
    "energy": "kinetic and potential energy",
}

END_TIME = {"units": "s", "long_name": "time of the event or of the failure of a member, or the end of the run"}


@dataclass(frozen=True, eq=False)
class Result:
    """Samples of n members at k times; the initial state is sample 0. Arrays are float64 or float32, as asked.

    With float32_compensated all are float32 but the position, float64, which nothing of its two numbers is lost in.

    time: (k,) [s]. samples: the fields that were kept, by name (also attributes: position (k, n, 3) [m, inertial],
    attitude (k, n, 3, 3) body to inertial, velocity (k, n, 3) [m/s, body], angular_velocity (k, n, 3) [rad/s, body]).
    status: (n,), see Status. A member that an event stopped stands at it from then on. failure_time: (n,) [s], the time of
    the last good state, for an event its own time; NaN where there was neither; end_time: the same, and the end of the
    run. failure_value: (n,), the |J^-1 a| or relative residual that crossed its limit (psi_x: half the angle of its turns),
    0 for a non-finite state and for an event.
    warnings: (n,), bits of Warnings; warning_time (n,) [s] and warning_value (n,): when a member's most serious warning was
    first seen (0 for one that its start gives), and the value then; NaN without. Motion is looked at once in 128 steps and at
    the end, with checks="all" only. substeps: (n,), steps that were divided (on_failure="substep").
    statistics: what was gathered while the run went, by name. kept: samples of the members kept_members (m,), where not
    all were kept. messages: what the user should know; provenance: scene, settings, versions, seed, machine.
    store: the folder that samples and parameters are read from, each time that they are asked for; None in memory.
    """

    time: np.ndarray
    samples: Mapping[str, np.ndarray]
    status: StatusArray
    failure_time: np.ndarray
    failure_value: np.ndarray
    warnings: WarningArray
    warning_time: np.ndarray
    warning_value: np.ndarray
    substeps: np.ndarray
    parameters: Mapping[str, np.ndarray]
    messages: tuple[str, ...]
    provenance: dict[str, Any]
    terms: tuple[Term, ...] = ()
    statistics: Estimates = field(default_factory=Estimates)
    kept: Result | None = None
    kept_members: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    store: Path | None = None
    compile_seconds: float = field(default=0.0, compare=False)
    run_seconds: float = field(default=0.0, compare=False)

    def _kept(self, name: str) -> np.ndarray:
        if not self.samples:
            raise AttributeError(
                f"{name} was not kept: give keep='all', or indices of members, which are result.kept then"
            )
        if name not in self.samples:
            raise AttributeError(f"{name} was not kept: add {name!r} to SaveAt(fields=...)")
        return self.samples[name]

    @property
    def position(self) -> np.ndarray:
        """(k, n, 3) [m], inertial axes (north, east, down)."""
        return self._kept("position")

    @property
    def attitude(self) -> np.ndarray:
        """(k, n, 3, 3), body to inertial axes."""
        return self._kept("attitude")

    @property
    def velocity(self) -> np.ndarray:
        """(k, n, 3) [m/s], body axes."""
        return self._kept("velocity")

    @property
    def angular_velocity(self) -> np.ndarray:
        """(k, n, 3) [rad/s], body axes."""
        return self._kept("angular_velocity")

    @functools.cached_property
    def quaternion_wxyz(self) -> np.ndarray:
        """(k, n, 4), unit quaternions of the attitude, scalar first and not negative."""
        return notation.quaternion_from_matrix(self.attitude).astype(self.attitude.dtype)

    @functools.cached_property
    def energy(self) -> np.ndarray:
        """(k, n) [J], kinetic and potential energy, float64."""
        return invariants.energy(self)

    @property
    def end_time(self) -> np.ndarray:
        """(n,) [s], until when each member went on: its event, its failure, or the end of the run.

        With `status` these are the times and the kinds of what survival analysis is of.
        """
        return np.where(np.isnan(self.failure_time), self.time[-1], self.failure_time)

    def own(self, term: Term) -> dict[str, np.ndarray]:
        """A term's numbers, by field, with a leading dimension of 1 or n."""
        return {name: self.parameters[f"{term.key}.{name}"] for name in term.parameters()}

    def part(self, places: np.ndarray) -> Result:
        """The same of the members in these places, in this order."""
        own = {name: values[places] if len(values) > 1 else values for name, values in self.parameters.items()}
        samples = {name: values[:, places] for name, values in self.samples.items()}
        of_members = {one.name: getattr(self, one.name)[places] for one in self._member_fields()}
        return replace(self, samples=samples, parameters=own, **of_members)

    def _member_fields(self) -> list[member_fields.MemberField]:
        """Those that are attributes of a result."""
        own = {one.name for one in fields(self)}
        return [one for one in member_fields.FIELDS if one.name in own]

    @property
    def members(self) -> int:
        """n."""
        return len(self.status)

    @functools.cached_property
    def dataset(self) -> xarray.Dataset:
        """The samples as an xarray Dataset with dimensions time, realization, component (extra: store).

        Of a run in a store, a view of it: values are read when they are used, and energy is left out.
        """
        try:
            import xarray as xr
        except ImportError as error:
            raise ImportError("result.dataset needs xarray: pip install 'lgvi-warp[store]'") from error
        if self.store is not None:
            stored: Any = self.samples
            return stored.dataset(self.store)
        dims = {1: ("component",), 2: ("row", "column")}
        names = [*self.samples] + ["energy"] * (len(self.samples) == 4)
        data = {}
        for name in names:
            values = getattr(self, name)
            attributes = {"units": UNITS[name], "long_name": MEANINGS[name]}
            data[name] = (("time", "realization", *dims.get(values.ndim - 2, ())), values, attributes)
        for one in self._member_fields():
            data[one.name] = (("realization",), np.asarray(getattr(self, one.name)), one.attributes)
        data["end_time"] = (("realization",), self.end_time, END_TIME)
        coordinates = {"time": ("time", self.time, {"units": "s", "long_name": "time since the start"})}
        attributes = {"Conventions": "CF-1.11", "provenance": json.dumps(self.provenance)}
        return xr.Dataset(data, coordinates, attributes)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write everything to an .npz file, durable and whole or not at all. Returns its path. Raises OSError.

        Where no samples were kept, parameters are left out too: they follow from the provenance's ensemble.
        """
        arrays = {"time": self.time, **self.samples}
        arrays |= {one.name: np.asarray(getattr(self, one.name)) for one in self._member_fields()}
        if self.samples:
            arrays |= {f"parameters/{name}": value for name, value in self.parameters.items()}
        texts = {"messages": json.dumps(self.messages), "provenance": json.dumps(self.provenance)}
        if self.statistics:
            found, texts["statistics"] = self.statistics.to_arrays()
            arrays |= {f"statistics/{name}": value for name, value in found.items()}
        if self.kept is not None:
            arrays |= {f"kept/{name}": value for name, value in self.kept.samples.items()}
            arrays |= {"kept/members": self.kept_members}
            arrays |= {f"kept/parameters/{name}": value for name, value in self.kept.parameters.items()}
        with durable.placed(path) as beside, beside.open("xb") as file:
            np.savez(file, **arrays, **texts)  # type: ignore[arg-type]
        return Path(path)

    @classmethod
    def per_member(cls, arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
        """Arguments of a result that are arrays over members, out of arrays by name."""
        own = {one.name for one in fields(cls)}
        found: dict[str, Any] = {f.name: arrays[f.name] for f in member_fields.FIELDS if f.name in own & arrays.keys()}
        return found | {"status": found["status"].view(StatusArray), "warnings": found["warnings"].view(WarningArray)}

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Result:
        """Read what `save` wrote, maybe somewhere else: nothing in it is executed, and it takes no more memory than the file.

        Raises OSError, or SceneError (a ValueError) if it is not such a file, or a damaged one.
        """
        try:
            with result_file.understood(path):
                content = npy_files.of_npz(path)
                texts = result_file.checked(content)
                return cls._from(content, texts)
        except MemoryError:
            raise SceneError([f"{path}: does not fit into memory; read it on a larger machine"]) from None

    @classmethod
    def _from(cls, content: Mapping[str, np.ndarray], texts: Mapping[str, Any]) -> Result:
        """From arrays and texts that were checked."""
        estimates = Estimates()
        if "statistics" in content:
            estimates = Estimates.from_arrays(_below("statistics/", content), str(content["statistics"]))
        provenance = texts["provenance"]
        result = cls(
            time=content["time"],
            samples={name: content[name] for name in content if name in UNITS},
            **cls.per_member(content),
            parameters=_below("parameters/", content),
            messages=tuple(texts["messages"]),
            provenance=provenance,
            terms=from_list(provenance["scene"].get("terms", ())),
            statistics=estimates,
        )
        kept = _below("kept/", content)
        if not kept:
            return result
        members = kept["members"]
        few = replace(result.part(members), parameters=_below("parameters/", kept), statistics=Estimates())
        few = replace(few, samples={name: kept[name] for name in kept if name in UNITS})
        return replace(result, kept=few, kept_members=members)


def _below(prefix: str, content: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What is named so, without the prefix."""
    return {name.removeprefix(prefix): value for name, value in content.items() if name.startswith(prefix)}


class Drawn(Mapping[str, np.ndarray]):
    """Parameters of an ensemble's first members, drawn when they are asked for: they take no memory before."""

    def __init__(self, ensemble: Ensemble, members: int):
        self._ensemble, self._members = ensemble, members

    @functools.cached_property
    def _drawn(self) -> dict[str, np.ndarray]:
        return self._ensemble.parameters(0, self._members)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._drawn[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._drawn)

    def __len__(self) -> int:
        return len(self._drawn)
