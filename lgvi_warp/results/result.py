# SPDX-License-Identifier: Apache-2.0
"""The result of a run: samples, status of each member, statistics, and provenance."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import npy_files, summaries
from lgvi_warp.common.arguments import members_of
from lgvi_warp.common.deferred import Deferred
from lgvi_warp.common.errors import MissingExtra
from lgvi_warp.common.phases import Phases
from lgvi_warp.common.reading import corrupt_file_as_scene_error
from lgvi_warp.common.status import Status, StatusArray, WarningArray
from lgvi_warp.common.summaries import Summarized
from lgvi_warp.control.controller import terms_of
from lgvi_warp.control.signals import IN_FILES, SIGNALS, field_of
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS, dims_of
from lgvi_warp.physics.terms.base import Term, own
from lgvi_warp.physics.terms.events import from_list
from lgvi_warp.physics.terms.floor import altitude_over
from lgvi_warp.results import final as final_files
from lgvi_warp.results import member_fields, result_file
from lgvi_warp.results.drawn import GivenParameters
from lgvi_warp.sampling.final import Final
from lgvi_warp.statistics.estimates.estimate import Estimates
from lgvi_warp.statistics.values.quantity import KNOWN

if TYPE_CHECKING:
    import pandas
    import xarray


TIME = {"units": "s", "long_name": "time since the start"}
END_TIME = {"units": "s", "long_name": "time of the event or of the failure of a member, or the end of the run"}


# Most members in the picture of a notebook.
PICTURED = 20


class _Signal:
    """A signal of the controller, or the energy used, as an attribute of a result."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, result: Any, owner: type | None = None) -> Any:
        return self if result is None else result._kept(self._name)


@dataclass(frozen=True, eq=False, repr=False)
class Result(Summarized):
    """Samples of n members at k times, the status of each member, statistics, messages and provenance of a run.

    Sample 0 is the initial state. Samples have the run's dtype, float64 or float32. With float32_compensated, position
    is float64, so that no digit of the compensated sum is lost, and all other samples are float32.

    Attributes:
        time: Times of the samples [s], shape (k,).
        samples: Arrays of the saved fields, by name; each is also an attribute. Motion: position (k, n, 3) [m, inertial],
            attitude (k, n, 3, 3) body to inertial, velocity (k, n, 3) [m/s, body], angular_velocity (k, n, 3) [rad/s, body].
            Signals of a controller need SaveAt(fields=...), and are the values after the tick at each time. These are
            command (k, n, channels); actuator (k, n, channels), after delay, fault, limit and lag; demand, unmet and
            exerted (k, n, 6) [N, N m]; "measured_" with position, attitude, velocity, water_velocity, angular_velocity, depth
            or heading; "reference_" with position, attitude, velocity (inertial), angular_velocity, depth, heading or speed.
            Signals of a filter (see lw.control.ErrorStateFilter) are estimate_sigma (k, n, 15), estimate_bias (k, n, 6),
            nees, nis, nis_count (k, n), innovation and innovation_sigma (k, n, 12). energy_used (k, n) [J] needs a term
            `lw.terms.EnergyUse`; navigation_error (k, n, 3) [m, inertial] needs an estimate of the position.
        status: Status of each member, shape (n,). A member that an event stopped stays at its state from then on.
        failure_time: Time of each member's last good state, or of the event that stopped it [s], shape (n,); NaN
            without failure or event.
        failure_value: The value that crossed its limit, shape (n,): |J^-1 a| or the relative residual of equation (24)
            (docs/theory/rotation.md); for psi_x, half the angle of one of its rotations. It is 0 for a non-finite state
            and for an event, and NaN without failure or event.
        warnings: Warnings of each member, as bits of lw.Warnings, shape (n,). Warnings about the motion need
            checks="all", which checks the motion every 128 steps and at the end.
        warning_time: Time at which each member's most serious warning was first seen [s], shape (n,); 0 for a warning
            about its start, NaN without a warning.
        warning_value: The value that caused the warning at that time, shape (n,); NaN without a warning.
        substeps: Number of steps that were divided (on_failure="substep"), shape (n,).
        event: Number of the event that stopped each member, from 1; 0 for none, shape (n,). None if `status` alone
            identifies the event.
        parameters: Parameters of the members by name, each with a leading dimension of 1 or n.
        starts: Numbers of the start that varied, by name, (n, ...): "start.position", "start.euler_deg", ...
        weights: Statistical weights of the members, (n,), with mean 1 (see lw.designs.Table); None for equal weights.
        messages: Notes and warnings on the reliability of the result.
        provenance: Scene, ensemble with its seed, settings, versions and machine.
        terms: The scene's terms.
        statistics: Estimates of the statistics gathered during the run, by name.
        kept: Result with the samples of the members in kept_members, if `keep` selected some members; otherwise None.
        kept_members: Indices of the m members whose samples are in `kept`, shape (m,).
        store: Folder from which samples and parameters are read whenever they are used; None for a result in memory.
        jacobian: Derivatives of the samples with respect to the numbers in `tangents`, by field. Each has the shape of
            the samples plus a last axis over these numbers; NaN after a member ended. Empty without `tangents`.
        tangents: Names of the numbers of these derivatives, as given in `solve(tangents=...)`.
        end: Value of `final`, or a function without arguments that reads it; None if no final states were kept.
        compile_seconds: Time to load the kernel [s].
        compile_phases: Parts of compile_seconds [s]: `source` to write C++, `clang` to compile it (0 if cached),
            `load` to load it.
        run_seconds: Time of the run without compile_seconds [s].
        members: Number of members, n.
        end_time: Time up to which each member ran [s], shape (n,).
        final: Final states, from which a run can be continued.
        depth: Depth [m], shape (k, n).
        altitude: Height above the floor [m], shape (k, n).
        speed: Length of the velocity [m/s], shape (k, n).
        euler: Roll, pitch and yaw [rad], shape (k, n, 3).
        quaternion_wxyz: Unit quaternions of the attitudes, shape (k, n, 4).
        energy: Kinetic and potential energy [J], shape (k, n).
        dataset: The samples as an xarray Dataset.

    Methods:
        frame: Table of the members: inputs, outcome and final state.
        part: Select members.
        save: Write the result to a file.
        load: Read a file that `save` wrote.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> result.status.counts()
        {'ok': 8}
        >>> result.depth.shape
        (3, 8)
        >>> again = lw.Result.load(result.save("run.npz"))
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
    provenance: dict[str, Any] = Deferred()  # type: ignore[assignment]
    terms: tuple[Term, ...] = ()
    statistics: Estimates = field(default_factory=Estimates)
    kept: Result | None = None
    kept_members: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    store: Path | None = None
    event: np.ndarray | None = None
    starts: Mapping[str, np.ndarray] = field(default_factory=dict)
    weights: np.ndarray | None = None
    jacobian: Mapping[str, np.ndarray] = field(default_factory=dict)
    tangents: tuple[str, ...] = ()
    end: Final | Callable[[], Final] | None = field(default=None, compare=False)
    compile_seconds: float = field(default=0.0, compare=False)
    compile_phases: Phases = field(default=Phases(), compare=False)
    run_seconds: float = field(default=0.0, compare=False)

    def __post_init__(self) -> None:
        if type(self.parameters) is dict:
            object.__setattr__(self, "parameters", GivenParameters(self.parameters))

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        """Outcomes, settings, fields with their units, statistics and messages."""
        how = self.provenance
        units = (f"{name} [{unit}]" if (unit := field_of(name).unit) != "1" else name for name in self.samples)
        method = (
            f"{how['method']['name']}, {how['dtype']}, step {how['step']:g} s, {how['steps']:,} steps" if how else ""
        )
        rows = [
            ("outcomes", summaries.counted(self.status.counts())),
            ("warnings", summaries.counted(self.warnings.counts())),
            ("method", method),
            ("samples", summaries.listed(units)),
            ("kept", f"samples of {self.kept.members:,} members" if self.kept is not None else ""),
            ("statistics", summaries.listed(self.statistics)),
            ("store", str(self.store or "")),
            *(("message", text) for text in self.messages),
        ]
        title = (
            f"Result of {self.members:,} members at {len(self.time):,} times, {self.time[0]:g} to {self.time[-1]:g} s"
        )
        return title, [row for row in rows if row[1]]

    def summary_picture(self) -> str:
        """Curves of the depth of a few members; none for a run in a store, which may be slow to read."""
        drawn = self if self.samples and self.store is None else self.kept
        if drawn is None or "position" not in drawn.samples:
            return ""
        chosen = np.unique(np.linspace(0, drawn.members - 1, min(drawn.members, PICTURED)).astype(int))
        few = "" if len(chosen) == self.members else f" of {len(chosen)} of {self.members:,} members"
        label = f"depth [m], down, over {drawn.time[0]:g} to {drawn.time[-1]:g} s{few}; dashed: did not end ok"
        return summaries.curves(
            drawn.time, drawn.depth[:, chosen], np.asarray(drawn.status)[chosen] != Status.OK, label
        )

    def _kept(self, name: str) -> np.ndarray:
        if not self.samples:
            remedy = "give keep='all', or indices of members, which are result.kept then"
            raise AttributeError(f"{name} was not kept: {remedy}")
        if name not in self.samples:
            raise AttributeError(f"{name} was not kept: add {name!r} to SaveAt(fields=...)")
        return self.samples[name]

    @property
    def position(self) -> np.ndarray:
        """Positions in inertial axes (north, east, down) [m], shape (k, n, 3)."""
        return self._kept("position")

    @property
    def attitude(self) -> np.ndarray:
        """Rotations from body to inertial axes, shape (k, n, 3, 3)."""
        return self._kept("attitude")

    @property
    def velocity(self) -> np.ndarray:
        """Velocities in body axes [m/s], shape (k, n, 3)."""
        return self._kept("velocity")

    @property
    def angular_velocity(self) -> np.ndarray:
        """Angular velocities in body axes [rad/s], shape (k, n, 3)."""
        return self._kept("angular_velocity")

    energy_used, navigation_error = _Signal(), _Signal()
    command, actuator, demand, unmet, exerted = _Signal(), _Signal(), _Signal(), _Signal(), _Signal()
    measured_position, measured_attitude, measured_velocity = _Signal(), _Signal(), _Signal()
    measured_water_velocity, measured_angular_velocity = _Signal(), _Signal()
    measured_depth, measured_heading = _Signal(), _Signal()
    reference_position, reference_attitude, reference_velocity = _Signal(), _Signal(), _Signal()
    reference_angular_velocity, reference_depth = _Signal(), _Signal()
    reference_heading, reference_speed, reference_angular_acceleration = _Signal(), _Signal(), _Signal()
    if TYPE_CHECKING:  # signals of extensions that come with the package, as the doors name these
        estimate_sigma, estimate_bias, nees, nis = _Signal(), _Signal(), _Signal(), _Signal()
        nis_count, innovation, innovation_sigma = _Signal(), _Signal(), _Signal()
    else:

        def __getattr__(self, name):
            # A signal of an extension; else the error of a property that has no value, or the usual one.
            if name.startswith("_") or hasattr(type(self), name) or name not in SIGNALS:
                return object.__getattribute__(self, name)
            return self._kept(name)

    @functools.cached_property
    def quaternion_wxyz(self) -> np.ndarray:
        """Unit quaternions of the attitudes, scalar first and not negative, shape (k, n, 4)."""
        return notation.quaternion_from_matrix(self.attitude).astype(self.attitude.dtype)

    def _quantity(self, name: str) -> np.ndarray:
        """Compute a quantity of statistics from the samples, float64."""
        quantity = KNOWN[name]
        samples: Any = {field: self._kept(field) for field in quantity.fields}
        return np.asarray(quantity.function(samples, None), dtype=np.float64)  # type: ignore[arg-type]

    @property
    def depth(self) -> np.ndarray:
        """Depth of the body's origin below the surface [m], float64, shape (k, n)."""
        return self._quantity("depth")

    @property
    def altitude(self) -> np.ndarray:
        """Height of the body's origin above the highest floor of the scene [m], float64, shape (k, n)."""
        events = from_list(self.provenance["scene"].get("events", ()))
        return altitude_over(events, self._kept("position"), self.parameters)

    @property
    def speed(self) -> np.ndarray:
        """Length of the velocity [m/s], float64, shape (k, n)."""
        return self._quantity("speed")

    @property
    def euler(self) -> np.ndarray:
        """Roll, pitch and yaw, R = Rz(yaw) Ry(pitch) Rx(roll) [rad], float64, shape (k, n, 3)."""
        return self._quantity("euler")

    @functools.cached_property
    def energy(self) -> np.ndarray:
        """Kinetic and potential energy [J], float64, shape (k, n)."""
        return invariants.energy(self)

    @property
    def final(self) -> Final:
        """Final states of the members, from which a run can be continued: lw.solve(..., start=result.final).

        Raises:
            AttributeError: If the final states were not kept.
        """
        if self.end is None:
            raise AttributeError("the end of the run was not kept. Give SaveAt(final=True)")
        return self.end() if callable(self.end) else self.end

    @property
    def end_time(self) -> np.ndarray:
        """Time up to which each member ran [s], shape (n,): the time of its event, of its failure, or of the end of the run.

        In survival analysis, end_time and `status` are the event times and event types.
        """
        return np.where(np.isnan(self.failure_time), self.time[-1], self.failure_time)

    def own(self, term: Term) -> dict[str, np.ndarray]:
        """Select the parameters of a term.

        Args:
            term: A term of the scene.

        Returns:
            Arrays by field of the term, each with a leading dimension of 1 or n.
        """
        return own(term, self.parameters)

    def part(self, places: Sequence[int] | np.ndarray | slice) -> Result:
        """Select members, in the given order; an index may occur several times.

        Args:
            places: Indices of the members in this result, counted from 0, shape (m,); a slice; or a mask (n,).

        Returns:
            A result of these members alone. Its `statistics` are still the statistics of the whole run.

        Raises:
            SceneError: If the result does not have these members (this error is also an IndexError).
        """
        places = members_of("places", places, self.members)
        parameters = {name: values[places] if len(values) > 1 else values for name, values in self.parameters.items()}
        samples = {name: values[:, places] for name, values in self.samples.items()}
        starts = {name: values[places] for name, values in self.starts.items()}
        slopes = {name: values[:, places] for name, values in self.jacobian.items()}
        of_members = {name: values[places] for name, values in self._of_members().items()}
        # That of a store is read when it is asked for.
        end = (
            functools.partial(_part_of, self.end, places) if callable(self.end) else self.end and self.end.part(places)
        )
        own: dict[str, Any] = {
            "samples": samples,
            "jacobian": slopes,
            "parameters": parameters,
            "starts": starts,
            "end": end,
        }
        return replace(self, **own, **of_members)

    def _of_members(self) -> dict[str, np.ndarray]:
        """Records of each member, (n,) by name."""
        names = [item.name for item in member_fields.EVERY]
        names += [name for name in ("event", "weights") if getattr(self, name) is not None]
        return {name: getattr(self, name) for name in names}

    @property
    def members(self) -> int:
        """Number of members in the result, n."""
        return len(self.status)

    @functools.cached_property
    def dataset(self) -> xarray.Dataset:
        """The samples as an xarray Dataset with dimensions time, realization, component (needs the extra `store`).

        For a run in a store, values are read when they are used, and the energy is omitted.

        Raises:
            ImportError: If xarray is not installed.
        """
        try:
            import xarray as xr
        except ImportError as error:
            raise MissingExtra("datasets", "xarray", "store") from error
        if self.store is not None:
            stored: Any = self.samples
            return stored.dataset(self.store)
        names = [*self.samples] + ["energy"] * (self.samples.keys() >= set(FIELDS))
        data = {}
        for name in names:
            values = getattr(self, name)
            data[name] = (("time", "realization", *dims_of(name, values.shape[2:])), values, field_of(name).attributes)
        about = {item.name: item.attributes for item in member_fields.FIELDS} | {"weights": {"units": "1"}}
        for name, values in self._of_members().items():
            data[name] = (("realization",), np.asarray(values), about[name])
        data["end_time"] = (("realization",), self.end_time, END_TIME)
        coordinates = {"time": ("time", self.time, TIME)}
        attributes = {"Conventions": "CF-1.11", "provenance": json.dumps(self.provenance)}
        return xr.Dataset(data, coordinates, attributes)

    def frame(self) -> pandas.DataFrame:
        """Build a table with one row per member (needs pandas, which the extra `store` installs).

        Columns:

        * inputs that differ between members, by name and component: "vehicle.buoyancy", "start.position[2]";
        * `outcome`, the status by name, and `end_time` [s];
        * the final state, for the fields that were kept: `position[0]` to `position[2]` [m, inertial axes], `euler[0]` to
          `euler[2]` [rad], `velocity[0]` to `velocity[2]` [m/s] and `angular_velocity[0]` to `angular_velocity[2]`
          [rad/s], body axes.

        `frame.attrs["units"]` has the units. From a store, only the samples of the last time are read.

        Returns:
            The table. Its index is the member in this result, counted from 0.

        Raises:
            ImportError: If pandas is not installed.

        Examples:
            >>> import lgvi_warp as lw
            >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
            >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
            >>> frame = lw.solve(fleet, h=0.1, t1=2.0).frame()
            >>> frame[["vehicle.buoyancy", "outcome", "position[2]"]].shape
            (8, 3)
        """
        from lgvi_warp.results.frame import frame_of

        return frame_of(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the result to an .npz file. The file is either complete and durable, or not written at all.

        If no samples were kept, parameters are omitted too, since the ensemble in the provenance determines them.

        Args:
            path: The file; an existing file is replaced.

        Returns:
            The path of the file.

        Raises:
            OSError: If the file cannot be written.
        """
        arrays = {"time": self.time, **self.samples}
        arrays |= {name: np.asarray(values) for name, values in self._of_members().items()}
        if self.samples:
            arrays |= {f"parameters/{name}": value for name, value in self.parameters.items()}
            arrays |= {f"starts/{name}": value for name, value in self.starts.items()}
        texts = {"messages": json.dumps(self.messages), "provenance": json.dumps(self.provenance)}
        if self.samples and self.end is not None:
            of_end, texts["final"] = final_files.to_file(self.final)
            arrays |= of_end
        if self.tangents:
            arrays |= {f"jacobian/{name}": slopes for name, slopes in self.jacobian.items()}
            texts["tangents"] = json.dumps(self.tangents)
        if self.statistics:
            estimates, texts["statistics"] = self.statistics.to_arrays()
            arrays |= {f"statistics/{name}": value for name, value in estimates.items()}
        if self.kept is not None:
            arrays |= {f"kept/{name}": value for name, value in self.kept.samples.items()}
            arrays |= {"kept/members": self.kept_members}
            arrays |= {f"kept/parameters/{name}": value for name, value in self.kept.parameters.items()}
        return npy_files.write_npz(path, arrays | texts)

    @classmethod
    def per_member(cls, arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
        """Select, among arrays, the arguments of a Result that have one number for each member.

        Args:
            arrays: Arrays of shape (n,), by name, including status and warnings.

        Returns:
            Arguments of Result, by name.
        """
        names = [*(item.name for item in member_fields.EVERY), "event", "weights"]
        values: dict[str, Any] = {name: arrays[name] for name in names if name in arrays}
        status, warnings = values["status"].view(StatusArray), values["warnings"].view(WarningArray)
        return values | {"status": status, "warnings": warnings}

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Result:
        """Read a file that `save` wrote. A file from an untrusted source is safe: nothing in it is executed.

        Reading takes no more memory than the size of the file.

        Args:
            path: The .npz file.

        Returns:
            The result, in memory.

        Raises:
            OSError: If the file cannot be read.
            SceneError: If the file is damaged, or is not a result (SceneError is a ValueError).
        """
        with corrupt_file_as_scene_error(
            path, "no result of lgvi-warp", "run the scene again, or ask for the file anew"
        ):
            content = npy_files.of_npz(path)
            return cls._from(content, result_file.checked(content))

    @classmethod
    def _from(cls, content: Mapping[str, np.ndarray], texts: Mapping[str, Any]) -> Result:
        """Build a result from checked arrays and texts."""
        estimates = Estimates()
        if "statistics" in content:
            estimates = Estimates.from_arrays(_below("statistics/", content), str(content["statistics"]))
        provenance = texts["provenance"]
        result = cls(
            time=content["time"],
            samples={name: content[name] for name in content if name in IN_FILES},
            **cls.per_member(content),
            parameters=_below("parameters/", content),
            starts=_below("starts/", content),
            messages=tuple(texts["messages"]),
            provenance=provenance,
            terms=terms_of(provenance["scene"]),
            statistics=estimates,
            jacobian=_below("jacobian/", content),
            tangents=texts["tangents"],
        )
        result = replace(result, end=final_files.from_file(content, result.samples, result.parameters))
        kept = _below("kept/", content)
        if not kept:
            return result
        members = kept["members"]
        few = replace(result.part(members), parameters=_below("parameters/", kept), statistics=Estimates(), end=None)
        few = replace(few, samples={name: kept[name] for name in kept if name in IN_FILES})
        return replace(result, kept=few, kept_members=members)


def _part_of(end: Callable[[], Final], places: np.ndarray) -> Final:
    """Select some members of the final states that a function reads."""
    return end().part(places)


def _below(prefix: str, content: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Select the arrays whose names begin with a prefix, and remove the prefix."""
    return {name.removeprefix(prefix): value for name, value in content.items() if name.startswith(prefix)}
