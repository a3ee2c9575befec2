# SPDX-License-Identifier: Apache-2.0
"""Ensembles: variations between members, and the members' numbers, block by block."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import summaries
from lgvi_warp.common.arguments import members_of, of_kind
from lgvi_warp.common.documented import Documented
from lgvi_warp.common.errors import Faults, NoSuchMembers, brief, refusal
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.common.summaries import Summarized
from lgvi_warp.physics.terms import base
from lgvi_warp.sampling.designs.base import Sampling
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene import variations
from lgvi_warp.scene.draws import SceneNumbers, counted, draws_of
from lgvi_warp.scene.given_members import given_members
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.scene.physical_checks import PhysicalChecks
from lgvi_warp.scene.settings import EnsembleSettings, section
from lgvi_warp.scene.variations import Target, Variation

if TYPE_CHECKING:
    from lgvi_warp.physics.given_draws import GivenDraws
    from lgvi_warp.sampling.final import Final


class Ensemble(Summarized, Documented):
    """A scene and the numbers that vary between its members.

    A member's numbers depend only on the seed, its index and the varied names, not on the block, subset or order in which
    they are drawn.

    These names can vary:

    * every number that `scene.parameters()` lists: "vehicle.mass", "drag.quadratic" (a term's name or type, and its
      field), ...
    * the numbers that the user gave for the scene's start: "start.position", "start.angular_velocity", ..., and always
      "start.attitude";
    * one entry of such a vector or matrix: "start.position[2]";
    * several numbers that one distribution draws jointly: "vehicle.mass, vehicle.buoyancy".

    A distribution for a vector applies to each entry. A distribution for a symmetric matrix applies to the entries on and
    above the diagonal, or only on the diagonal if the matrix is diagonal.

    Args:
        scene: The scene whose numbers vary.
        members: Number of members, >= 1. The default is the number in a grid or a table, or else one group of the sampling.
        seed: Seed of all random draws, a whole number >= 0; by default 0.
        vary: {name: distribution}, with distributions of lgvi_warp or frozen ones of scipy.stats. By default nothing varies.
        sampling: "random" (default), "sobol", "halton", "saltelli", lw.designs.LatinHypercube(...), lw.designs.Grid(...),
            lw.designs.Table(...) and others, or a table as in a scene file.

    Attributes:
        indices: Indices of these members in the ensemble from which they were selected, (members,).
        final: Final states of the run that these members continue; None for members that start at t = 0.
        replicates: Number of independent replicates of the sampling.

    Methods:
        parameters: Parameters of some members by name.
        numbers: All numbers of some members, including the start.
        starts: Varied numbers of the start of some members.
        levels: Probability levels in (0, 1), which distributions convert to numbers.
        weights: Statistical weights of some members.
        select: Parameters and initial states of some members.
        varied: Names of the parameters that vary.
        member: One member as a separate ensemble.
        subset: Some members as a separate ensemble.
        with_seed: New members, drawn from the same distributions with another seed.
        going_on: These members, continued from the end of a run.
        from_scene: The ensemble that a scene file describes.
        from_states: An ensemble with given states and parameters.
        to_dict: The section [ensemble] of a scene file.

    Raises:
        SceneError: If an argument is invalid; the message lists every fault, the number of unphysical members, and the first
            such member.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> vary = {
        ...     "vehicle.buoyancy": lw.distributions.Normal(std=1.0),
        ...     "start.velocity": lw.distributions.Normal(std=[0.1, 0.0, 0.0]),
        ... }
        >>> fleet = lw.Ensemble(scene, members=1000, seed=1, vary=vary)
        >>> fleet.parameters(0, 1000)["vehicle.buoyancy"].shape
        (1000,)
    """

    # Where these members ended in the run that they go on from; None where they start.
    final: Final | None
    # The time at which they start, or go on [s].
    start_time: float

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
            faults.add("scene", scene, "is not a Scene", "give lw.Scene(...) or lw.Scene.load(path)")
        if vary is not None and not (isinstance(vary, Mapping) and all(_is_name(name) for name in vary)):
            faults.add(
                "vary",
                vary,
                "does not map names to distributions",
                'give {"vehicle.mass": lw.distributions.Normal(...)}',
            )
        faults.raise_if_any()
        self._setup(scene, EnsembleSettings(members, seed, dict(vary or {}), sampling), {})

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        """Rows of the summary: sampling, variations, and the scene's rows."""
        varied = [(f"varies {name}", brief(distribution.to_dict())) for name, distribution in self.vary.items()]
        rows = [("sampling", f"{self.sampling.kind}, seed {self.seed}"), *varied]
        scene_rows = self.scene.summary_rows()[1] if isinstance(self.scene, Summarized) else ()
        return f"Ensemble of {self.members:,} members", [*rows, *(row for row in scene_rows if row[0] != "ensemble")]

    @classmethod
    def of(cls, scene: SceneLike, settings: EnsembleSettings) -> Ensemble:
        """Build the ensemble that settings describe.

        Args:
            scene: The scene whose numbers vary.
            settings: Members, seed, distributions and sampling. If they name indices, only these members are used.

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
        return ensemble.subset(members_of("ensemble.indices", settings.indices, ensemble.members))

    @classmethod
    def from_scene(cls, scene: SceneLike) -> Ensemble:
        """Build the ensemble that the scene file describes.

        Args:
            scene: The scene, with its ensemble_settings.

        Returns:
            The ensemble. It has one member if the scene has no ensemble_settings.

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

        States that are not finite are accepted; the run marks these members as failed.

        Args:
            scene: The scene of the members.
            position: Positions (n, 3) [m], inertial axes (north, east, down).
            attitude: Rotation matrices (n, 3, 3), body to inertial.
            velocity: Velocities (n, 3) [m/s], body axes.
            angular_velocity: Angular velocities (n, 3) [rad/s], body axes.
            parameters: {name: array (n, *shape)}, with names as in `vary`, also of entries ("current.velocity[0]"). The shape
                of "vehicle.inertia" is (n, 3) or (n, 3, 3). The argument may also be a data frame, a structured array or
                an xarray Dataset with these names. None, the default, if no parameter varies.

        Returns:
            The ensemble of n members.

        Raises:
            SceneError: If an array does not hold real numbers, has a wrong shape, or has unphysical values.
        """
        states = position, attitude, velocity, angular_velocity
        n, explicit = given_members(scene.parameters(), *states, parameters)
        ensemble = cls.__new__(cls)
        ensemble._setup(scene, EnsembleSettings(n), explicit)
        return ensemble

    def _setup(
        self, scene: SceneLike, settings: EnsembleSettings, explicit: dict[str, np.ndarray], checked: bool = False
    ) -> None:
        if any("]." in name for name in settings.vary):
            from lgvi_warp.scene.names import all_by_key

            settings = replace(settings, vary=all_by_key("ensemble.vary.", scene, settings.vary))
        self.scene, self.seed = scene, int(settings.seed)
        settings = replace(settings, vary=drawn_by_terms(scene, settings, explicit) | dict(settings.vary))
        self.vary: dict[str, Any] = dict(settings.vary)
        self._draws = draws_of(scene, settings, explicit)
        # What keys the members' noise; None: their positions in the whole ensemble.
        self._indices: np.ndarray | None = None
        self.final, self.start_time = None, 0.0
        # Standard normals of the members' noise, in place of those that counters give; None for these.
        self.given: GivenDraws | None = None
        # The same members with numbers shifted, of a run that is to tell the derivatives by these (see scene/copies.py).
        self.copies: Any = None
        self._check_physical(checked)

    @property
    def members(self) -> int:
        """Number of members."""
        return self._draws.members

    @property
    def sampling(self) -> Sampling:
        """Sampling design by which the members' numbers are drawn."""
        return self._draws.sampling

    @property
    def variations(self) -> Sequence[Variation]:
        """The varied names with their distribution, one entry for each distribution."""
        return self._draws.variations

    @property
    def space(self) -> Space:
        """The unit cube that the sampling fills, one dimension for each varied number."""
        return self._draws.space

    @property
    def indices(self) -> np.ndarray:
        """Indices (members,) of these members in the whole ensemble; they determine the members' noise."""
        if self._indices is not None:
            return self._indices
        return np.arange(self.members) if self._draws.places is None else self._draws.places

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
        return np.arange(first, stop) if self._indices is self._draws.places is None else self.indices[first:stop]

    def _checks(self) -> PhysicalChecks:
        varied = self.varied_names & self._draws.scene.parameters.keys() - self._draws.known_sound
        return PhysicalChecks(self.scene, varied, self._draws.drawn_names, self.members)

    def _check_physical(self, before: bool = False) -> None:
        """Refuse unphysical members among the first SURVEYED ones; a run checks the others block by block."""
        checks, draws = self._checks(), self._draws
        all_of_them = draws.explicit or draws.columns or not checks.varied
        self.checked = self.members if all_of_them else min(self.members, SURVEYED)
        if not before:
            checks.of_members(self.parameters, self.checked)

    def check_block(self, first: int, stop: int, parameters: Mapping[str, np.ndarray]) -> None:
        """Check that members are physical, unless they were checked before.

        Args:
            first: Position of the first member.
            stop: Position after the last member.
            parameters: Parameters of these members by name.

        Raises:
            SceneError: If a member is unphysical; the message names the first such member.
        """
        if stop > self.checked:
            self._checks().of_block(first, stop, parameters)

    @staticmethod
    def own(term: Any, parameters: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the numbers of one term, selected from those of all terms.

        Args:
            term: A term or an event.
            parameters: Values of all parameters by name, such as "drag.quadratic".

        Returns:
            The term's values by field, such as "quadratic".
        """
        return base.own(term, parameters)

    def _values(self, first: int, stop: int, start: bool = True) -> dict[str, np.ndarray]:
        return self._draws.values(first, stop, start)

    def parameters(self, first: int, stop: int) -> dict[str, np.ndarray]:
        """Return the parameters of some members.

        Args:
            first: Position of the first member.
            stop: Position after the last member.

        Returns:
            Values by name, (stop - first, ...), or (1, ...) for values that all members share.
        """
        return self._values(first, stop, start=False)

    def levels(self, first: int, stop: int) -> Mapping[str, np.ndarray]:
        """Return the probability levels in (0, 1) that distributions convert to some members' numbers.

        Args:
            first: Position of the first member.
            stop: Position after the last member.

        Returns:
            {key of a variation: levels (stop - first, columns of this key in `space`)}, in the order of `space`.
        """
        return self._draws.levels_of(first, stop)

    def numbers(self, first: int, stop: int) -> dict[str, np.ndarray]:
        """Return all numbers of some members, including the start.

        Args:
            first: Position of the first member.
            stop: Position after the last member.

        Returns:
            Values by name, (stop - first, ...), or (1, ...) for values that all members share.
        """
        return self._values(first, stop)

    def select(self, first: int, stop: int) -> Members:
        """Return parameters and initial states of some members.

        Args:
            first: Position of the first member.
            stop: Position after the last member.

        Returns:
            Numbers of n = stop - first members: parameters by name; position (n, 3) [m], attitude (n, 3, 3),
            velocity (n, 3) [m/s, body axes] and angular velocity (n, 3) [rad/s, body axes].

        Raises:
            SceneError: If these members do not exist (also an IndexError).
        """
        if not (is_whole(first, 0, self.members - 1) and is_whole(stop, int(first) + 1, self.members)):
            raise NoSuchMembers(
                [f"members {brief(first)} to {brief(stop)} are not among {self.members:,}. Give others"]
            )
        given = None if self.given is None else self.given.of_members(slice(first, stop))
        values, indices = self._values(first, stop), self.indices_of(first, stop)
        members = self._draws.members_of(values, indices, self.seed, self.weights(first, stop), given)
        if self.copies is not None:
            return replace(members, shifted=self.copies.of(int(first), int(stop)))
        if self.final is None:
            return members
        everyone = (first, stop) == (0, self.members)
        final = self.final if everyone else self.final.part(np.arange(first, stop))
        states: dict[str, Any] = {name: np.asarray(rows, dtype=np.float64) for name, rows in final.states.items()}
        return replace(members, final=final, **states)

    def from_zero(self) -> Ensemble:
        """Return these members with their start at t = 0.

        Returns:
            The ensemble; it does not continue another run.
        """
        ensemble = copy.copy(self)
        ensemble.final, ensemble.start_time = None, 0.0
        return ensemble

    def going_on(self, final: Final) -> Ensemble:
        """Return these members, which continue from the end of their previous run.

        Args:
            final: Final states of that run, with the same number of members.

        Returns:
            The ensemble, which starts at the time and in the states of `final`.

        Raises:
            SceneError: If `final` is not a `Final`, or has another number of members.
        """
        from lgvi_warp.sampling.final import Final

        if not isinstance(final, Final):
            raise refusal("start", final, "is no end of a run", "give result.final of the run before")
        if final.members != self.members:
            problem = f"is the end of {final.members:,} members, and there are {self.members:,}"
            raise refusal("start", "...", problem, "give the members of the run before, or final.part(places) of some")
        ensemble = copy.copy(self)
        ensemble.final, ensemble.start_time = final, final.time
        return ensemble

    def weights(self, first: int, stop: int) -> np.ndarray | None:
        """Return the statistical weights of some members.

        Args:
            first: Position of the first member.
            stop: Position after the last member.

        Returns:
            Weights (stop - first,), with mean 1 over the whole table of the sampling; None for equal weights.
        """
        return self._draws.weights_of(first, stop)

    def varied(self) -> list[str]:
        """Return the names of the parameters that vary from member to member.

        Returns:
            Names in the order of `scene.parameters()`, without numbers of the start.
        """
        varied = self.varied_names
        return [name for name in self._draws.scene.parameters if name in varied]

    def varied_starts(self) -> list[str]:
        """Return the names of the numbers of the start that vary between members, such as "start.position"."""
        return list(self._draws.varied_starts)

    def starts(self, first: int, stop: int) -> dict[str, np.ndarray]:
        """Return the varied numbers of the start of some members.

        Args:
            first: Position of the first member.
            stop: Position after the last member.

        Returns:
            Values by name, (stop - first, ...), with all entries of a number even if only one entry varies.
        """
        values = self._values(first, stop) if self._draws.varied_starts else {}
        return {name: values[name] for name in self._draws.varied_starts}

    @property
    def varied_names(self) -> set[str]:
        """Names of the numbers that differ between members: drawn, given in a table's columns, or given as arrays."""
        varied = self._draws.varied_names
        return varied if self.copies is None else varied | self.copies.surveyed.varied_names

    @property
    def starts_vary(self) -> bool:
        """Whether the initial state differs from member to member."""
        return not self.varied_names <= self._draws.scene.parameters.keys()

    def subset(self, indices: Sequence[int] | np.ndarray | slice) -> Ensemble:
        """Return some members as a separate ensemble, with the same numbers.

        Args:
            indices: Positions of the members (k,), counted from 0, in any order; a slice; or a mask (members,).

        Returns:
            The ensemble of k members.

        Raises:
            SceneError: If `indices` names no members, or members that do not exist (also an IndexError).
        """
        chosen = members_of("members", indices, self.members)
        places = chosen if self._draws.places is None else self._draws.places[chosen]
        ensemble = self._drawing(places=places)
        ensemble._indices = None if self._indices is None else self._indices[chosen]
        ensemble.final = None if self.final is None else self.final.part(chosen)
        ensemble.given = None if self.given is None else self.given.of_members(chosen)
        # Some of these may lie beyond the members that were checked.
        ensemble.checked = len(chosen) if self.checked == self.members else 0
        return ensemble

    def __copy__(self) -> Ensemble:
        ensemble = object.__new__(type(self))  # in a fraction of the time that `copy` takes by itself
        vars(ensemble).update(vars(self))
        return ensemble

    def _drawing(self, **changes: Any) -> Ensemble:
        """Return a copy with changed draws."""
        ensemble = copy.copy(self)
        ensemble._draws = replace(self._draws, **changes)
        return ensemble

    def with_given(self, given: GivenDraws | None) -> Ensemble:
        """Return the same members with other noise.

        Args:
            given: Standard normal numbers of each member, or one row for all; None if the kernel draws them.

        Returns:
            The ensemble.
        """
        ensemble = copy.copy(self)
        ensemble.given = given
        return ensemble

    def given_as_arrays(self, arrays: Mapping[str, np.ndarray], repeats: int) -> Ensemble:
        """Return each member several times in a row, with unchecked numbers.

        Args:
            arrays: {name: (members times repeats, ...)} of every number that differs between members.
            repeats: Number of copies of each member, which have the same noise.

        Returns:
            The ensemble.
        """
        total = self.members * repeats
        changes = {"explicit": arrays, "columns": (), "variations": (), "places": None, "weights": None}
        ensemble = self._drawing(total=total, **changes)
        ensemble._indices, ensemble.checked = np.repeat(self.indices, repeats), total
        if self.given is not None:
            ensemble.given = self.given.of_members(np.repeat(np.arange(self.members), repeats))
        return ensemble

    def with_columns(self, columns: Mapping[str, np.ndarray]) -> Ensemble:
        """Return an ensemble with other values in the columns of its table.

        Args:
            columns: {label: values (n, ...)} of the table's columns, such as "start.position[2]".

        Returns:
            The ensemble of n members.

        Raises:
            SceneError: If a member is unphysical.
        """
        pairs = [(target, columns[target.label]) for target, _ in self._draws.columns]
        if not pairs:
            raise refusal("columns", sorted(map(str, columns)), "are of no table", "make the ensemble of a table")
        ensemble = copy.copy(self)
        ensemble._draws, ensemble._indices = self._draws.with_columns(pairs), None
        ensemble.final, ensemble.start_time = None, 0.0
        ensemble._check_physical()
        self._draws.note_sound(ensemble._draws)
        return ensemble

    def in_scene(self, scene: SceneLike, by_member: Sequence[str] = ()) -> Ensemble:
        """Return the same members in another scene, which may have other terms, events or parts of the controller.

        Args:
            scene: The other scene. A varied number must have the same name in this scene, or not exist there.
            by_member: Names of further numbers that count as varied, since the caller sets them; none by default.

        Returns:
            The ensemble; its members have the scene's values of the numbers in `by_member`.
        """
        numbers = SceneNumbers(scene.parameters(), self._draws.scene.start)
        shared = ((name, numbers.parameters[name]) for name in by_member)
        total = self._draws.total
        columns = [(Target(name), np.broadcast_to(value, (total, *np.shape(value)))) for name, value in shared]
        ensemble = self._drawing(scene=numbers, columns=[*self._draws.columns, *columns])
        ensemble.scene = scene
        return ensemble

    def with_seed(self, seed: int, members: int | None = None) -> Ensemble:
        """Return members drawn from the same distributions with another seed.

        Args:
            seed: Whole number >= 0.
            members: Number m of members, the first m of the sampling; by default the members are those of this ensemble.

        Returns:
            The ensemble.

        Raises:
            SceneError: If the sampling does not allow this number of members, or a member is unphysical.
        """
        settings = EnsembleSettings(members, seed, self.vary, self.sampling)
        draws, new_seed = self._draws, int(settings.seed)
        space = variations.space(new_seed, draws.variations)
        if members is None:
            ensemble = self._drawing(space=space)
        else:
            if draws.explicit and members != draws.total:
                fault = f"are drawn, where the states of {draws.total} are given"
                raise refusal("members", members, fault, "leave members out")
            total = counted(draws.sampling, space, settings.members)
            ensemble = self._drawing(space=space, total=total, places=None).from_zero()
            ensemble._indices = None
        ensemble.seed = new_seed
        ensemble._check_physical()
        return ensemble

    def member(self, index: int) -> Ensemble:
        """Return one member as a separate ensemble, with bitwise the same numbers.

        Args:
            index: Position of the member.

        Returns:
            The ensemble of one member.

        Raises:
            SceneError: If the member does not exist (also an IndexError).
        """
        return self.subset(np.array([index if is_whole(index, 0) else -1]))

    @property
    def replicates(self) -> int:
        """Number r of independent replicates of the sampling: member i belongs to replicate i mod r.

        r is 1 for a subset and for members with given states, since these are not a design.
        """
        is_design = self._draws.places is None and not self._draws.explicit
        return self.sampling.replicates_of_members() if is_design else 1

    def explicit(self) -> dict[str, np.ndarray]:
        """Return the numbers that were given as arrays and that settings therefore do not describe.

        Returns:
            Arrays by name, (members of the whole ensemble, ...): given states and parameters, values that the sampling
            holds, "indices" if they were set, and, for members that continue a run, the arrays of `Final.to_arrays`. Empty
            if there are none of these.
        """
        indices = {} if self._indices is None else {"indices": np.asarray(self._indices, dtype=np.int64)}
        sampled = {name: values[: self._draws.total] for name, values in self.sampling.arrays().items()}
        final = {} if self.final is None else self.final.to_arrays()
        return dict(self._draws.explicit) | sampled | indices | final

    def to_dict(self) -> dict[str, Any]:
        """Return the section [ensemble] of a scene file.

        Returns:
            members, seed, vary, sampling and indices as in a scene file. The entry "explicit" has the names of the numbers
            that were given as arrays.
        """
        explicit = self._draws.explicit
        content = section(self._draws.total, self.seed, self.vary, self.sampling, self._draws.places)
        return content | ({"explicit": sorted(explicit)} if explicit else {})


def drawn_by_terms(scene: SceneLike, settings: EnsembleSettings, fixed: Collection[str]) -> dict[str, Any]:
    """Distributions of numbers that terms draw for each member, except numbers that are given or varied otherwise."""
    drawn = [f"{term.key}.{name}" for term in scene.terms for name in term.drawn]
    if not drawn:
        return {}
    from lgvi_warp.sampling.distributions.joint import Levels

    sampled = [*settings.sampling.distributions(), *settings.sampling.own_values()]
    others = {target.name for key in [*settings.vary, *sampled] for target in variations.targets(key)}
    return {name: Levels() for name in drawn if name not in others and name not in fixed}


# Members that are drawn and checked before a run; the others are checked as the run comes to them.
SURVEYED = 32_768


def _is_name(name: Any) -> bool:
    """Return whether `name` is a text, or a tuple of texts for one joint distribution."""
    return isinstance(name, str) or (isinstance(name, tuple) and all(isinstance(entry, str) for entry in name))
