# SPDX-License-Identifier: Apache-2.0
"""Ensembles: what varies from member to member, and the members' numbers, block by block."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from lgvi_warp.common import machine, summaries
from lgvi_warp.common.arguments import of_kind
from lgvi_warp.common.errors import Faults, closest, cut, ragged, refusal, shown
from lgvi_warp.common.labelled import columns_by_name, is_labelled, match
from lgvi_warp.common.real_numbers import column_names, is_whole
from lgvi_warp.common.summaries import Summarized
from lgvi_warp.physics import notation
from lgvi_warp.physics import vehicle as vehicles
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.sampling.designs.base import Sampling
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene import variations
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.scene.settings import MOST_MEMBERS, EnsembleSettings, section
from lgvi_warp.scene.start import ATTITUDES, NAMES, resolve_attitude
from lgvi_warp.scene.variations import MATRICES, Target, Variation


class Ensemble(Summarized):
    """A scene and what varies in it from member to member.

    A member's numbers depend on the seed, its index and the varied names alone, not on the block, subset or order in
    which they are drawn.

    Names of what varies:

    * every number of the scene, as `scene.parameters()` lists them: "vehicle.mass", "drag.quadratic" (a term's name or
      type, and its field), ...
    * what the scene's start gives: "start.position", "start.angular_velocity", ..., and always "start.attitude";
    * one entry of these: "start.position[2]";
    * several that one distribution draws together: "vehicle.mass, vehicle.buoyancy".

    A distribution of a vector applies to each entry; of a symmetric matrix, to the entries on and above the diagonal
    (only those on it, where the matrix is diagonal).

    Args:
        scene: The scene that the members vary.
        members: Number of members, >= 1; None for as many as the sampling has, or 1 (default).
        seed: Whole number >= 0; by default 0.
        vary: Distributions by name, of lgvi_warp or frozen ones of scipy.stats; None if nothing varies (default).
        sampling: "random" (default), "sobol", "halton", "saltelli", lw.LatinHypercube(...), lw.Grid(...),
            lw.Table(...) and others, or a table as in a scene file.

    Raises:
        SceneError: If anything is wrong; the message lists every fault. Unphysical members are counted, and the first
            of them is shown.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> vary = {"vehicle.buoyancy": lw.Normal(std=1.0), "start.velocity": lw.Normal(std=[0.1, 0.0, 0.0])}
        >>> fleet = lw.Ensemble(scene, members=1000, seed=1, vary=vary)
        >>> fleet.parameters(0, 1000)["vehicle.buoyancy"].shape
        (1000,)
    """

    def __init__(
        self,
        scene: SceneLike,
        members: int | None = None,
        seed: int = 0,
        vary: Mapping[Any, Any] | None = None,
        sampling: Any = "random",
    ):
        faults = Faults()
        if not isinstance(scene, SceneLike):
            faults.add("scene", scene, "is no Scene", "give lw.Scene(...) or lw.Scene.load(path)")
        if vary is not None and not (isinstance(vary, Mapping) and all(_is_name(name) for name in vary)):
            faults.add("vary", vary, "does not map names to distributions", 'give {"vehicle.mass": lw.Normal(...)}')
        faults.raise_if_any()
        self._setup(scene, EnsembleSettings(members, seed, dict(vary or {}), sampling), {})

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        """Sampling, what varies and the scene's own rows."""
        varied = [(f"varies {name}", shown(distribution.to_dict())) for name, distribution in self.vary.items()]
        rows = [("sampling", f"{self.sampling.kind}, seed {self.seed}"), *varied]
        scene_rows = self.scene.summary_rows()[1] if isinstance(self.scene, Summarized) else ()
        return f"Ensemble of {self.members:,} members", [*rows, *(row for row in scene_rows if row[0] != "ensemble")]

    @classmethod
    def of(cls, scene: SceneLike, settings: EnsembleSettings) -> Ensemble:
        """Build the ensemble that settings describe.

        Args:
            scene: The scene that the members vary.
            settings: Members, seed, distributions and sampling. Where they name indices, only those members are taken.

        Returns:
            The ensemble.

        Raises:
            SceneError: If the settings do not fit the scene, or a member is unphysical.
        """
        ensemble = cls.__new__(cls)
        # The ensemble of a scene file was checked when the file was read.
        from_file = scene.ensemble_settings is settings
        ensemble._setup(scene, settings, {}, checked=from_file and scene.ensemble_is_checked)
        if from_file:
            scene.note_checked_ensemble()
        if settings.indices is None:
            return ensemble
        most = int(np.max(settings.indices))
        if most >= ensemble.members:
            fault = f"is no member of {ensemble.members}"
            raise refusal("ensemble.indices", most, fault, f"give 0 to {ensemble.members - 1}")
        return ensemble.subset(settings.indices)

    @classmethod
    def from_scene(cls, scene: SceneLike) -> Ensemble:
        """Build the ensemble that the scene file describes.

        Args:
            scene: The scene, with its ensemble_settings.

        Returns:
            The ensemble; of one member if the scene has no ensemble_settings.

        Raises:
            SceneError: If the settings do not fit the scene, or a member is unphysical.
        """
        of_kind("scene", scene, "ensemble_settings parameters", "a Scene", "give lw.Scene(...)")
        return cls.of(scene, scene.ensemble_settings or EnsembleSettings())

    @classmethod
    def from_states(
        cls,
        scene: SceneLike,
        position: Any,
        attitude: Any,
        velocity: Any,
        angular_velocity: Any,
        parameters: Any = None,
    ) -> Ensemble:
        """Build an ensemble of members with given states and parameters.

        States that are not finite are accepted: the run marks such members as failed.

        Args:
            scene: The scene that the members vary.
            position: Positions (n, 3) [m], inertial axes (north, east, down).
            attitude: Rotation matrices (n, 3, 3), body to inertial.
            velocity: Velocities (n, 3) [m/s], body axes.
            angular_velocity: Angular velocities (n, 3) [rad/s], body axes.
            parameters: Arrays of length n by name, with names as in `vary`, also of single entries
                ("current.velocity[0]"); "vehicle.inertia" as (n, 3) or (n, 3, 3). Or a data frame, a structured array
                or an xarray Dataset with such names. None if no parameter varies (default).

        Returns:
            The ensemble of n members.

        Raises:
            SceneError: If an array holds no real numbers, has a wrong shape or unphysical values.
        """
        faults = Faults()
        states = dict(zip(FIELDS, (position, attitude, velocity, angular_velocity), strict=True))
        explicit = {f"start.{key}": _state(faults, key, value) for key, value in states.items()}
        faults.raise_if_any()
        n = len(explicit["start.position"]) if explicit["start.position"].ndim else 0
        if n == 0:
            faults.add("position", position, "holds no member", "give arrays of length 1 or more")
        for key, value in explicit.items():
            shape = (n, 3, 3) if key == "start.attitude" else (n, 3)
            if value.shape != shape:
                faults.add(key, value, f"has shape {value.shape}", f"give an array of shape {shape}")
        faults.raise_if_any()
        R = explicit["start.attitude"]
        bad = np.isfinite(R).all(axis=(1, 2)) & ~notation.rotations(R)
        if bad.any():
            problem = f"is not a rotation to 1e-9 ({bad.sum()} of {n} members)"
            faults.add(f"attitude of member {bad.argmax()}", R[bad.argmax()], problem, "give R^T R = I, det R = 1")
        explicit |= _given_parameters(faults, scene.parameters(), parameters, n)
        faults.raise_if_any()
        ensemble = cls.__new__(cls)
        ensemble._setup(scene, EnsembleSettings(n), explicit)
        return ensemble

    def _setup(
        self, scene: SceneLike, settings: EnsembleSettings, explicit: dict[str, np.ndarray], checked: bool = False
    ) -> None:
        self.scene, self.seed = scene, int(settings.seed)
        self.vary: dict[str, Any] = dict(settings.vary)
        self.sampling: Sampling = settings.sampling
        self._explicit = explicit
        self._start = {f"start.{key}": value for key, value in scene.start.given().items()}
        if explicit:
            self._start = {key: value for key, value in explicit.items() if key.startswith("start.")}
        self._base = scene.parameters()
        self._shared_attitude: np.ndarray | None = None
        # Positions of these members in the whole ensemble, and the indices that key their noise; None: all, in order.
        self._places: np.ndarray | None = None
        self._indices: np.ndarray | None = None
        self._few: dict[str, np.ndarray] | None = None
        self.variations = self._described()
        self.space: Space = variations.space(self.seed, self.variations)
        self._whole = self._counted(settings)
        self.members = self._whole
        self._check_physical(checked)

    def _described(self) -> list[Variation]:
        """Return what varies, one entry for each distribution; refuse what does not fit the scene."""
        faults = Faults("ensemble.vary.")
        columns = self.sampling.own_values()
        self._turn_by_matrix(faults, columns)
        known = {**self._base, **({} if self._explicit else self._start)}
        distributions = {**self.sampling.distributions(), **self.vary}
        for key in self.sampling.distributions().keys() & self.vary.keys():
            fault = f"varies what the {self.sampling.kind} gives values"
            faults.add(f'"{key}"', self.vary[key], fault, "drop one of them")
        described = [variations.variation(faults, *item, known) for item in sorted(distributions.items())]
        named = [(variation.key, variation.targets) for variation in described if variation]
        self._columns: list[tuple[Target, np.ndarray]] = []
        tables = Faults("ensemble.sampling.table.")
        for key, column in columns.items():
            (target, *more), also = variations.targets(key), f'; or leave it out: ignore = ["{cut(key)}"]'
            if more:
                tables.add(f'"{key}"', "...", "names several numbers", "give each a column of its own")
            elif variations.known_target(tables, key, "...", target, known, also):
                named.append((key, (target,)))
                shape = (len(column), *target.of(known[target.name]).shape)
                name = target.name if target.index is None else key
                self._columns.append((target, _explicit_parameter(tables, name, column, shape)))
                attitudes = target.name == variations.ATTITUDE and column.shape == shape
                if attitudes and not notation.rotations(column).all():
                    fault = "holds a matrix that is no rotation to 1e-9"
                    tables.add(f'"{key}"', "...", fault, "give R^T R = I, det R = 1")
        variations.clashes(faults, named)
        with faults.including():
            tables.raise_if_any()
        faults.raise_if_any()
        return [variation for variation in described if variation]

    def _turn_by_matrix(self, faults: Faults, columns: Mapping[str, Any]) -> None:
        """Write the scene's attitude as a matrix, whatever form it has, if the attitude itself varies."""
        keys = [*self.vary, *self.sampling.distributions(), *columns]
        names = {target.name for key in keys for target in variations.targets(key)}
        if variations.ATTITUDE not in names or self._explicit:
            return
        ways = {f"start.{way}" for way in ATTITUDES} - {variations.ATTITUDE}
        for way in sorted(ways & names):
            faults.add(f'"{way}"', "...", f'varies beside "{variations.ATTITUDE}"', "keep one of them")
        faults.raise_if_any()
        attitude = {way: self._start.pop(f"start.{way}") for way in ATTITUDES if f"start.{way}" in self._start}
        R = resolve_attitude({way: np.asarray(value)[None] for way, value in attitude.items()})
        self._start[variations.ATTITUDE] = R[0]

    def _counted(self, settings: EnsembleSettings) -> int:
        """Return the number of members; raise SceneError for a number that the sampling cannot have."""
        faults = Faults("ensemble.")
        designed, group = self.sampling.own_members(self.space), self.sampling.group_size(self.space)
        members = int(settings.members or designed or group)
        if members > MOST_MEMBERS:
            problem = f"are more members than the {MOST_MEMBERS} that there can be"
            faults.add(f"sampling.{self.sampling.kind}", members, problem, "give fewer values, of fewer names")
        else:
            self.sampling.check(faults, self.space, members)
        faults.raise_if_any()
        return members

    @property
    def indices(self) -> np.ndarray:
        """Indices (members,) of these members in the whole ensemble, by which their noise is keyed."""
        if self._indices is not None:
            return self._indices
        return np.arange(self.members) if self._places is None else self._places

    @indices.setter
    def indices(self, indices: np.ndarray) -> None:
        self._indices = indices

    def indices_of(self, first: int, stop: int) -> np.ndarray:
        """Return the indices of some of these members in the whole ensemble.

        Args:
            first: Position of the first member.
            stop: Position after the last member.

        Returns:
            Indices (stop - first,).
        """
        return np.arange(first, stop) if self._indices is self._places is None else self.indices[first:stop]

    def _check_physical(self, before: bool = False) -> None:
        """Refuse unphysical members, looking at so few at a time that memory stays small, unless that was done before.

        Members that are drawn are looked at up to SURVEYED; a run looks at the others as it comes to them.
        """
        varied = self.varied_names & self._base.keys()
        self.checked = self.members if self._explicit or self._columns or not varied else min(self.members, SURVEYED)
        if before:
            return

        def look(first: int, stop: int) -> dict[str, _Unphysical]:
            with np.errstate(over="ignore", invalid="ignore"):
                return self._look_at(varied, first, stop, self.parameters(first, stop))

        findings: dict[str, _Unphysical] = {}
        for block_findings in over_members(look, self.checked if varied else 0):
            for key, finding in block_findings.items():
                if key not in findings:
                    findings[key] = finding
                elif not finding.shared:
                    findings[key].count += finding.count
        self._refuse(findings, self.checked)

    def check_block(self, first: int, stop: int, parameters: Mapping[str, np.ndarray]) -> None:
        """Check that members are physical, as far as that was not checked before.

        Args:
            first: Position of the first member.
            stop: Position after the last member.
            parameters: Their parameters by name.

        Raises:
            SceneError: If a member is unphysical; the message names the first of them.
        """
        if stop > self.checked:
            self._refuse(self._look_at(self.varied_names & self._base.keys(), first, stop, parameters), stop - first)

    def _refuse(self, findings: Mapping[str, _Unphysical], looked_at: int) -> None:
        """Raise SceneError if anything was found; looked_at: number of members."""
        if not findings:
            return
        drawn = {target.name for variation in self.variations for target in variation.targets}
        faults = Faults()
        for key, finding in findings.items():
            is_drawn = not drawn.isdisjoint(key.split(" + "))
            remedy = (
                "use a smaller spread, TruncatedNormal or LogNormal" if is_drawn else "give finite, physical values"
            )
            of = (
                f"{looked_at} members"
                if looked_at == self.members
                else f"the {looked_at:,} members that were looked at"
            )
            problem = (
                f"is unphysical ({finding.count} of {finding.of} members)"
                if finding.shared
                else f"is unphysical ({finding.count} of {of})"
            )
            entry, value = _odd_entry(finding.value)
            faults.add(f"{key}{entry} of member {finding.first}", value, problem, remedy)
        faults.raise_if_any()

    def _look_at(self, varied: set[str], first: int, stop: int, p: Mapping[str, np.ndarray]) -> dict[str, _Unphysical]:
        keys = {name.rpartition(".")[0] for name in varied}
        with np.errstate(over="ignore", invalid="ignore"):
            checks = _vehicle_checks(p, varied, self.scene.vehicle.inertia_tolerance)
            for term in self.scene.parts:
                if term.key in keys:
                    checks |= {f"{term.key}.{name}": bad for name, bad in term.unphysical(self.own(term, p)).items()}
        unphysical = {}
        for key, bad in checks.items():
            bad = np.atleast_1d(bad)
            if np.any(bad):
                names = key.split(" + ")
                i = int(np.argmax(bad))
                value = sum(p[name][i % len(p[name])] for name in names if p[name].ndim == p[names[-1]].ndim)
                shared = len(bad) == 1 and stop - first > 1
                unphysical[key] = _Unphysical(first + i, value, shared, len(bad), int(bad.sum()))
        return unphysical

    @staticmethod
    def own(term: Any, parameters: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the numbers of one term out of those of all.

        Args:
            term: A term or an event.
            parameters: Values of all parameters by name, such as "drag.quadratic".

        Returns:
            The term's values by field, such as "quadratic".
        """
        return {name: parameters[f"{term.key}.{name}"] for name in term.parameters()}

    def _values(self, first: int, stop: int, start: bool = True) -> dict[str, np.ndarray]:
        """Return the numbers of the members first to stop - 1 by name, with those of the start or without.

        Values that all members share have a leading dimension of 1. Those of few members are drawn once and kept: a run
        reads them several times.
        """
        if self.members > KEPT:
            return self._drawn(first, stop, start)
        if self._few is None:
            few = self._drawn(0, self.members, True)
            for name in self.varied_names & few.keys():
                few[name].flags.writeable = False
            self._few = few
        every = self._few.items() if start else ((name, self._few[name]) for name in self._base)
        if (first, stop) == (0, self.members):
            return dict(every)
        return {name: values[first:stop] if len(values) > 1 else values for name, values in every}

    @functools.cached_property
    def _of_scene(self) -> dict[str, np.ndarray]:
        """The scene's own numbers by name, with those of the start unless these are given, as arrays (1, ...)."""
        values = self._base | ({} if self._explicit else self._start)
        return {name: np.asarray(value)[None] for name, value in values.items()}

    def _drawn(self, first: int, stop: int, start: bool) -> dict[str, np.ndarray]:
        """Draw what `_values` returns."""
        values = self._of_scene.copy() if start else {name: self._of_scene[name] for name in self._base}
        if self._explicit:
            rows = slice(first, stop) if self._places is None else self._places[first:stop]
            values |= {name: column[rows] for name, column in self._explicit.items() if start or name in self._base}
        wanted = [v for v in self.variations if start or any(target.name in self._base for target in v.targets)]
        if not (wanted or self._columns):
            return values
        members = np.arange(first, stop) if self._places is None else self._places[first:stop]
        space = self.space.of([variation.key for variation in wanted]) if self.sampling.kind == "random" else self.space
        levels = self.sampling.draw(space, members) if wanted else {}
        drawn = [(target, column[members]) for target, column in self._columns]
        for variation in wanted:
            drawn += variation.values(levels[variation.key])
        for target, column in drawn:
            if target.name in values:
                variations.put(values, target, column)
        return values

    def parameters(self, first: int, stop: int) -> dict[str, np.ndarray]:
        """Return the parameters of some members.

        Args:
            first: Position of the first member.
            stop: Position after the last member.

        Returns:
            Values by name, (stop - first, ...) or, where all members share them, (1, ...).
        """
        return self._values(first, stop, start=False)

    def select(self, first: int, stop: int) -> Members:
        """Return parameters and initial states of some members.

        Args:
            first: Position of the first member.
            stop: Position after the last member.

        Returns:
            The members' numbers, n = stop - first: parameters by name; position (n, 3) [m], attitude (n, 3, 3),
            velocity (n, 3) [m/s, body axes] and angular velocity (n, 3) [rad/s, body axes].

        Raises:
            IndexError: If there are no such members.
        """
        if not (is_whole(first, 0, self.members - 1) and is_whole(stop, int(first) + 1, self.members)):
            raise IndexError(f"members {first} to {stop} of {self.members}")
        m = stop - first
        values = self._values(first, stop)
        start = {key.removeprefix("start."): values.pop(key) for key in self._start}
        # In one memory layout, on which the order of the sums of a matrix product depends.
        R = _of_each(np.ascontiguousarray(self._attitude(start)), m)
        if "velocity_inertial" in start:
            # Written out: the order of the sum, and so its bits, must not depend on the number of members.
            v = start["velocity_inertial"]
            nu = R[:, 0] * v[:, :1] + R[:, 1] * v[:, 1:2] + R[:, 2] * v[:, 2:]
        else:
            nu = start["velocity"]
        position, nu, Om = (_of_each(x, m) for x in (start["position"], nu, start["angular_velocity"]))
        return Members(values, position, R, nu, Om, self.indices_of(first, stop), self.seed)

    def _attitude(self, start: Mapping[str, np.ndarray]) -> np.ndarray:
        """Rotation matrices (1 or m, 3, 3) of some members; one that members share is computed once."""
        if self._shared_attitude is None:
            R = resolve_attitude(start)
            if not self.varied_names.isdisjoint(f"start.{way}" for way in ATTITUDES):
                return R
            self._shared_attitude = R
        return self._shared_attitude

    def varied(self) -> list[str]:
        """Return the names of the parameters that vary from member to member.

        Returns:
            Names in the order of `scene.parameters()`; those of the start are not among them.
        """
        varied = self.varied_names
        return [name for name in self._base if name in varied]

    @functools.cached_property
    def varied_names(self) -> set[str]:
        """Names of what members have of their own: drawn, from columns or explicit."""
        targets = [target for variation in self.variations for target in variation.targets]
        return {target.name for target in (*targets, *(target for target, _ in self._columns))} | self._explicit.keys()

    @property
    def starts_vary(self) -> bool:
        """Whether the initial state differs from member to member."""
        return not self.varied_names <= self._base.keys()

    def subset(self, indices: Sequence[int] | np.ndarray) -> Ensemble:
        """Return some members as an ensemble of their own, with the same numbers.

        Args:
            indices: Positions of the members (k,), in the order wanted.

        Returns:
            The ensemble of k members.

        Raises:
            IndexError: If this is no list of whole numbers, or there are no such members.
        """
        chosen = np.asarray(None if ragged(indices) else indices)
        if chosen.ndim != 1 or not len(chosen) or chosen.dtype.kind not in "iu" or np.ma.is_masked(indices):
            raise IndexError(f"members {shown(indices)}: give a list of one or more whole numbers")
        if chosen.min() < 0 or chosen.max() >= self.members:
            raise IndexError(f"members {chosen.min()} to {chosen.max()} of {self.members}")
        chosen = chosen.astype(np.int64)
        ensemble = self._copy()
        ensemble._places = chosen if self._places is None else self._places[chosen]
        ensemble._indices = None if self._indices is None else self._indices[chosen]
        ensemble.members = len(chosen)
        # Some of these may lie beyond the members that were checked.
        ensemble.checked = len(chosen) if self.checked == self.members else 0
        return ensemble

    def __getstate__(self) -> dict[str, Any]:
        # Another process draws the numbers itself: they are not sent.
        return {name: None if name == "_few" else value for name, value in vars(self).items() if name != "_of_scene"}

    def _copy(self) -> Ensemble:
        """Return an ensemble with what this one has, but for the numbers that were drawn."""
        ensemble = object.__new__(type(self))
        ensemble.__dict__.update(self.__dict__)
        ensemble._few = None
        return ensemble

    def with_columns(self, columns: Mapping[str, np.ndarray]) -> Ensemble:
        """Return an ensemble of other members, of which a table's columns have other values.

        Args:
            columns: Values (n, ...) by label of what the table of this ensemble sets, such as "start.position[2]".

        Returns:
            The ensemble of n members.

        Raises:
            SceneError: If a member is unphysical.
        """
        ensemble = self._copy()
        ensemble._columns = [(target, columns[target.label]) for target, _ in self._columns]
        ensemble._places = ensemble._indices = None
        ensemble._whole = ensemble.members = len(ensemble._columns[0][1])
        ensemble._check_physical()
        return ensemble

    def in_scene(self, scene: SceneLike, by_member: Sequence[str] = ()) -> Ensemble:
        """Return the same members, in a scene with other terms, events or parts of the controller.

        Args:
            scene: The scene; what varies of it has the names that it had, or is no more.
            by_member: Names of more numbers that count as varied, since the caller sets them; none by default.

        Returns:
            The ensemble, whose members have the scene's values of these.
        """
        ensemble = self._copy()
        ensemble.scene, ensemble._base = scene, scene.parameters()
        shared = ((name, ensemble._base[name]) for name in by_member)
        columns = [(Target(name), np.broadcast_to(value, (self._whole, *np.shape(value)))) for name, value in shared]
        ensemble._columns = [*self._columns, *columns]
        for name in ("varied_names", "_of_scene"):
            ensemble.__dict__.pop(name, None)
        return ensemble

    def with_seed(self, seed: int, members: int | None = None) -> Ensemble:
        """Return these members, drawn from the same distributions by another seed.

        Args:
            seed: Whole number >= 0.
            members: Number of members, in place of these the first ones of the sampling; None for these (default).

        Returns:
            The ensemble.

        Raises:
            SceneError: If the sampling cannot have so many members, or a member is unphysical.
        """
        settings = EnsembleSettings(members, seed, self.vary, self.sampling)
        ensemble = self._copy()
        ensemble.seed = int(settings.seed)
        ensemble.space = variations.space(ensemble.seed, self.variations)
        if members is not None:
            if self._explicit and members != self._whole:
                fault = f"are drawn, where the states of {self._whole} are given"
                raise refusal("members", members, fault, "leave members out")
            ensemble._places = ensemble._indices = None
            ensemble._whole = ensemble.members = ensemble._counted(settings)
        ensemble._check_physical()
        return ensemble

    def member(self, index: int) -> Ensemble:
        """Return one member as an ensemble of its own, with bitwise the same numbers.

        Args:
            index: Position of the member.

        Returns:
            The ensemble of one member.

        Raises:
            IndexError: If there is no such member.
        """
        return self.subset([index])

    @property
    def replicates(self) -> int:
        """Number r of independent replicates of the sampling: member i belongs to replicate i mod r.

        It is 1 for a subset and for members with given states, which are no design.
        """
        return self.sampling.replicates_of_members() if self._places is None and not self._explicit else 1

    def explicit(self) -> dict[str, np.ndarray]:
        """Return the numbers that were given as arrays, which settings do not describe.

        Returns:
            Arrays by name, (members of the whole, ...): given states and parameters, the values that the sampling
            holds, and "indices" if they were set. Empty if there are none of these.
        """
        indices = {} if self._indices is None else {"indices": np.asarray(self._indices, dtype=np.int64)}
        sampled = {name: values[: self._whole] for name, values in self.sampling.arrays().items()}
        return dict(self._explicit) | sampled | indices

    def to_dict(self) -> dict[str, Any]:
        """Return the section [ensemble] of a scene file.

        Returns:
            members, seed, vary, sampling and indices as in a scene file, and under "explicit" the names of the numbers
            that were given as arrays.
        """
        content = section(self._whole, self.seed, self.vary, self.sampling, self._places)
        return content | ({"explicit": sorted(self._explicit)} if self._explicit else {})


# Most members whose numbers an ensemble keeps once they are drawn.
KEPT = 1024
# Members that are checked together before a run: some tens of megabytes per thread.
AT_ONCE = 16_384
# Members that are drawn and checked before a run; the others are checked as the run comes to them.
SURVEYED = 32_768
Found = TypeVar("Found")


def over_members(look: Callable[[int, int], Found], members: int) -> list[Found]:
    """Apply a function to all members, some at a time so that memory stays small, on all cores."""
    firsts = range(0, members, AT_ONCE)
    if len(firsts) < 2:
        return [look(0, members)] if members else []
    with ThreadPoolExecutor(min(machine.thread_count(), max(1, len(firsts)))) as pool:
        return list(pool.map(lambda first: look(first, min(first + AT_ONCE, members)), firsts))


def _of_each(values: np.ndarray, members: int) -> np.ndarray:
    """Return values (1 or n, ...) as those of n members, which nobody writes into."""
    if len(values) == members and not values.flags.writeable:
        return values
    return np.broadcast_to(values, (members, *values.shape[1:]))


@dataclass
class _Unphysical:
    """Unphysical values of one quantity: the first such member, its value, and how many; shared: one value for all."""

    first: int
    value: Any
    shared: bool
    of: int
    count: int


def _odd_entry(value: Any) -> tuple[str, Any]:
    """Return the place of the first entry that is not finite, as in "[1,2]", and the entry; or "" and the value itself."""
    numbers = np.asarray(value)
    if not numbers.ndim or np.isfinite(numbers).all():
        return "", value
    place = tuple(np.argwhere(~np.isfinite(numbers))[0].tolist())
    return f"[{','.join(map(str, place))}]", numbers[place]


def _is_name(name: Any) -> bool:
    """Return whether this is a text, or a tuple of texts that one distribution draws together."""
    return isinstance(name, str) or (isinstance(name, tuple) and all(isinstance(entry, str) for entry in name))


def _vehicle_checks(p: Mapping[str, np.ndarray], varied: set[str], tolerance: float) -> dict[str, np.ndarray]:
    """Return masks (n,) by name: which members' varied numbers of vehicle and environment are unphysical."""

    def heavy() -> np.ndarray:
        return np.isfinite(p["vehicle.mass"]) & (p["vehicle.mass"] >= vehicles.LEAST)

    def light_with_water() -> np.ndarray:
        total = p["vehicle.mass"][:, None, None] * np.eye(3) + p["vehicle.added_mass"]
        return heavy() & ~_positive_definite(total)

    def impossible_body() -> np.ndarray:
        good = _positive_definite(p[rigid])
        possible = np.where(good[:, None, None], p[rigid], np.eye(6))
        return np.asarray(~good | vehicles.impossible(possible, tolerance))

    def negative(key: str) -> np.ndarray:
        return np.asarray(~(np.isfinite(p[key]) & (p[key] >= 0.0)))

    def not_finite(key: str) -> np.ndarray:
        return np.asarray(~np.isfinite(p[key]).all(axis=1))

    rigid, added = "vehicle.rigid_body_mass_matrix", "vehicle.added_mass_matrix"
    checks: dict[str, Callable[[], np.ndarray]] = {}
    if "vehicle.mass" in p:
        checks["vehicle.mass"] = lambda: ~heavy()
        checks["vehicle.inertia"] = lambda: ~_positive_definite(p["vehicle.inertia"])
        checks["vehicle.mass + vehicle.added_mass"] = light_with_water
    else:
        checks[rigid] = impossible_body
        checks[f"{rigid} + {added}"] = lambda: ~_positive_definite(p[rigid] + p[added])
    for keys, check in ((("center_of_buoyancy", "center_of_gravity"), not_finite), (("buoyancy", "weight"), negative)):
        checks |= {key: functools.partial(check, key) for key in map("vehicle.{}".format, keys) if key in p}
    if "environment.gravity" in p:
        checks["environment.gravity"] = functools.partial(negative, "environment.gravity")
    density = p["environment.water_density"]
    checks["environment.water_density"] = lambda: ~(np.isfinite(density) & (density > 0))
    return {key: check() for key, check in checks.items() if any(name in varied for name in key.split(" + "))}


def _state(faults: Faults, key: str, value: Any) -> np.ndarray:
    """Return a copy of a state in float64, which may hold NaN; later changes of the argument do not reach the ensemble.

    A data frame's columns may be called position[0], position[1], position[2], in any order.
    """
    names = column_names(value)
    if key != "attitude" and names is not None and all(isinstance(name, str) for name in names):
        columns = columns_by_name(faults, key, value)
        entries = [f"{key}[{i}]" for i in range(3)]
        if not columns or not match(faults, key, list(columns), entries):
            return np.empty(0)
        value = _numbers(faults, key, [columns[entry] for entry in entries])
        return np.ascontiguousarray(value.T)
    return _numbers(faults, key, value)


def _numbers(faults: Faults, key: str, value: Any) -> np.ndarray:
    """Numbers of an array; none after a fault."""
    array = faults.real(key, value, "give an array of numbers")
    return np.empty(0) if array is None else array


def _given_parameters(faults: Faults, base: Mapping[str, np.ndarray], given: Any, n: int) -> dict[str, np.ndarray]:
    """Return arrays (n, *shape) by name, from parameters given whole or by their entries."""
    if given is None or (isinstance(given, Mapping) and not given):
        return {}
    if not is_labelled(given):
        remedy = 'give {"vehicle.mass": array, ...} or a DataFrame with such names'
        faults.add("parameters", given, "has no names", remedy)
        return {}
    parameters: dict[str, np.ndarray] = {}
    named = []
    for key, column in columns_by_name(faults, "parameters", given).items():
        (target, *more) = variations.targets(key)
        if more or target.name not in base:
            faults.keys("", {key: column}, base)
        elif variations.known_target(faults, key, "...", target, base):
            named.append((key, (target,)))
            name = key if target.index is not None else target.name
            values = _explicit_parameter(faults, name, column, (n, *target.of(base[target.name]).shape))
            if target.index is None:
                parameters[target.name] = values
            elif values.shape == (n,):
                parameters.setdefault(target.name, np.repeat(base[target.name][None], n, axis=0))
                variations.put(parameters, target, values)
    variations.clashes(faults, named)
    return parameters


def check_names(vary: Mapping[str, Any], parameters: Sequence[str]) -> None:
    """Check that a scene has the names that vary."""
    faults = Faults("ensemble.vary.")
    known = [*parameters, *(f"start.{name}" for name in NAMES)]
    for key, distribution in vary.items():
        for target in variations.targets(key):
            if target.name not in known:
                remedy = functools.partial(closest, target.name, known)
                faults.add(f'"{key}"', distribution, "does not name what a scene has", remedy)
    faults.raise_if_any()


def _explicit_parameter(faults: Faults, key: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    array = faults.real(key, value, "give an array of numbers")
    if array is None:
        return np.empty(0)
    if key in MATRICES and array.shape == shape[:2]:
        return np.where(np.eye(shape[1], dtype=bool), array[:, :, None], 0.0)
    if array.shape != shape:
        also = f" or {shape[:2]}" if key in MATRICES else ""
        faults.add(key, value, f"has shape {array.shape}", f"give an array of shape {shape}{also}")
    elif key in MATRICES and _skew(array):
        faults.add(key, "...", "holds a matrix that is not symmetric", "give symmetric matrices")
    return array


def _skew(matrices: np.ndarray) -> bool:
    """Return whether one of the matrices (n, d, d) is not symmetric; those that are not finite are judged elsewhere."""
    with np.errstate(invalid="ignore"):
        return bool(np.any(np.abs(matrices - np.swapaxes(matrices, 1, 2)) > 1e-9 * np.abs(matrices).max()))


def _positive_definite(matrices: np.ndarray) -> np.ndarray:
    """Return which symmetric matrices (n, d, d) are positive definite, by elimination; False where not finite."""
    d, diagonals = matrices.shape[-1], np.einsum("nii->ni", matrices)
    if np.count_nonzero(matrices) == np.count_nonzero(diagonals):  # diagonal matrices
        return np.asarray(((diagonals >= vehicles.LEAST) & np.isfinite(diagonals)).all(axis=1))
    remainder = matrices.copy()
    good = np.isfinite(matrices).all(axis=(1, 2))
    for k in range(d):
        pivot = remainder[:, k, k]
        good &= pivot >= vehicles.LEAST
        row = remainder[:, k, k + 1 :] / np.where(good, pivot, 1.0)[:, None]
        remainder[:, k + 1 :, k + 1 :] -= remainder[:, k + 1 :, k, None] * row[:, None, :]
    return np.asarray(good)
