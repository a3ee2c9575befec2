# SPDX-License-Identifier: Apache-2.0
"""Sources of the members' numbers, and their values, drawn block by block."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, cut
from lgvi_warp.physics import notation
from lgvi_warp.sampling.designs.base import Sampling
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene import variations
from lgvi_warp.scene.given_members import explicit_parameter
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.scene.settings import MOST_MEMBERS, EnsembleSettings
from lgvi_warp.scene.start import ATTITUDES, resolve_attitude
from lgvi_warp.scene.variations import Target, Variation

if TYPE_CHECKING:
    from lgvi_warp.physics.given_draws import GivenDraws

# Most members whose numbers an ensemble keeps once they are drawn.
KEPT = 1024
Columns = Sequence[tuple[Target, np.ndarray]]


@dataclass(frozen=True, eq=False)
class SceneNumbers:
    """The numbers of a scene by name: its parameters, and the start unless starts are given for each member."""

    parameters: Mapping[str, np.ndarray]
    start: Mapping[str, Any]

    @functools.cached_property
    def arrays(self) -> dict[str, np.ndarray]:
        """All numbers as arrays (1, ...)."""
        return {name: np.asarray(value)[None] for name, value in {**self.parameters, **self.start}.items()}

    @functools.cached_property
    def attitude(self) -> np.ndarray:
        """Rotation matrix (1, 3, 3) of the start."""
        return resolve_attitude({way: self.arrays[f"start.{way}"] for way in ATTITUDES if f"start.{way}" in self.start})


@dataclass(frozen=True, eq=False)
class Draws:
    """The numbers of members, from four sources: scene, arrays, columns of a table, draws. Later sources override earlier.

    A member's numbers depend only on its position in the whole ensemble.

    explicit: Arrays (total, ...) by name; names of the start begin with "start.". columns: Values (total, ...) of a table.
    weights: Statistical weights (total,); None for equal weights.
    total: Number of members of the whole ensemble. places: Positions (members,) of these members in it; None for all.
    """

    scene: SceneNumbers
    explicit: Mapping[str, np.ndarray]
    columns: Columns
    variations: Sequence[Variation]
    sampling: Sampling
    space: Space
    total: int
    places: np.ndarray | None = None
    weights: np.ndarray | None = None
    # Numbers of the few members of the last table that was found sound, and those that there were before this one.
    _latest: ClassVar[Mapping[str, np.ndarray]] = MappingProxyType({})
    _before: ClassVar[Mapping[str, np.ndarray] | None] = None

    def __getstate__(self) -> dict[str, Any]:
        # Another process draws the numbers itself: they are not sent.
        return {item.name: getattr(self, item.name) for item in fields(self)}

    @property
    def members(self) -> int:
        """Number of these members."""
        return self.total if self.places is None else len(self.places)

    @functools.cached_property
    def drawn_names(self) -> set[str]:
        """Names of the numbers that distributions draw."""
        return {target.name for variation in self.variations for target in variation.targets}

    @functools.cached_property
    def varied_names(self) -> set[str]:
        """Names of the numbers that differ between members: drawn, from columns, or explicit."""
        return self.drawn_names | {target.name for target, _ in self.columns} | self.explicit.keys()

    def values(self, first: int, stop: int, start: bool = True) -> dict[str, np.ndarray]:
        """The numbers of members first to stop - 1 by name, with or without the start; shared numbers are (1, ...).

        Numbers of few members are kept, since a run reads them several times.
        """
        if self.members > KEPT:
            return self._drawn(first, stop, start)
        every = self._few if start else self._few_parameters
        if (first, stop) == (0, self.members):
            return every.copy()
        return {name: values[first:stop] if len(values) > 1 else values for name, values in every.items()}

    @functools.cached_property
    def _few(self) -> dict[str, np.ndarray]:
        few, before = self._drawn(0, self.members, True), self._before
        for name in self.varied_names & few.keys():
            if before is not None:
                few[name] = _same_or_copy(few[name], before.get(name))
            few[name].flags.writeable = False
        return few

    @functools.cached_property
    def _few_parameters(self) -> dict[str, np.ndarray]:
        return {name: self._few[name] for name in self.scene.parameters}

    @functools.cached_property
    def _start_names(self) -> tuple[str, ...]:
        """Names of the members' numbers of the start."""
        return tuple(name for name in {**self.scene.start, **self.explicit} if name.startswith("start."))

    @functools.cached_property
    def varied_starts(self) -> tuple[str, ...]:
        """Names of the numbers of the start that differ between members."""
        return tuple(name for name in self._start_names if name in self.varied_names)

    def with_columns(self, columns: Columns) -> Draws:
        """Draws with other values in the table's columns; the targets are the same."""
        draws = object.__new__(Draws)  # in a third of the time of `replace`
        vars(draws).update(self._of_tables, columns=columns, total=len(columns[0][1]), _before=self._latest)
        return draws

    @functools.cached_property
    def _of_tables(self) -> dict[str, Any]:
        """Attributes that draws of one table share for any values of its columns."""
        names = ("drawn_names", "varied_names", "_start_names", "varied_starts")
        known = self.__getstate__() | {name: getattr(self, name) for name in names}
        return known | {"places": None, "weights": None}

    def note_sound(self, draws: Draws) -> None:
        """Record that the members of another table are physical."""
        vars(self)["_latest"] = draws._few if draws.members <= KEPT else {}

    @property
    def known_sound(self) -> set[str]:
        """Names of the numbers whose values were already checked as physical."""
        before = self._before if self._before and self.members <= KEPT else {}
        return {name for name, values in before.items() if self._few[name] is values}

    def _drawn(self, first: int, stop: int, start: bool) -> dict[str, np.ndarray]:
        """Compute the result of `values`."""
        base, of_scene = self.scene.parameters, self.scene.arrays
        values = of_scene.copy() if start else {name: of_scene[name] for name in base}
        if self.explicit:
            rows = slice(first, stop) if self.places is None else self.places[first:stop]
            values |= {name: column[rows] for name, column in self.explicit.items() if start or name in base}
        wanted = [v for v in self.variations if start or any(target.name in base for target in v.targets)]
        if not (wanted or self.columns):
            return values
        members = np.arange(first, stop) if self.places is None else self.places[first:stop]
        space = self.space.of([variation.key for variation in wanted]) if self.sampling.kind == "random" else self.space
        levels = self.sampling.draw(space, members) if wanted else {}
        rows = slice(first, stop) if self.places is None else members
        drawn = [(target, column[rows]) for target, column in self.columns]
        for variation in wanted:
            drawn += variation.values(levels[variation.key])
        own: set[str] = set()
        for target, column in drawn:
            if target.name in values:
                variations.put(values, target, column, target.name in own)
                own.add(target.name)
        return values

    def weights_of(self, first: int, stop: int) -> np.ndarray | None:
        """Statistical weights of members first to stop - 1, (stop - first,); None for equal weights."""
        if self.weights is None:
            return None
        return self.weights[slice(first, stop) if self.places is None else self.places[first:stop]]

    def levels_of(self, first: int, stop: int) -> Mapping[str, np.ndarray]:
        """{key: levels in (0, 1) (stop - first, size)} from which distributions draw members first to stop - 1."""
        members = np.arange(first, stop) if self.places is None else self.places[first:stop]
        return self.sampling.draw(self.space, members) if self.variations else {}

    def members_of(
        self,
        values: dict[str, np.ndarray],
        indices: np.ndarray,
        seed: int,
        weight: np.ndarray | None = None,
        given: GivenDraws | None = None,
    ) -> Members:
        """Members from their numbers by name; numbers of the start are removed from `values`. given: Noise, None: drawn."""
        m = len(indices)
        own = {name: values[name] for name in self.varied_starts}
        start = {key.removeprefix("start."): values.pop(key) for key in self._start_names}
        # In one memory layout, on which the order of the sums of a matrix product depends.
        R = np.ascontiguousarray(self._attitude(start))
        if "velocity_inertial" in start:
            # Written out: the order of the sum, and so its bits, must not depend on the number of members.
            v = start["velocity_inertial"]
            nu = R[:, 0] * v[:, :1] + R[:, 1] * v[:, 1:2] + R[:, 2] * v[:, 2:]
        else:
            nu = start["velocity"]
        R, position, nu, Om = (_of_each(x, m) for x in (R, start["position"], nu, start["angular_velocity"]))
        return Members(values, position, R, nu, Om, indices, seed, own, weight, given=given)

    def _attitude(self, start: Mapping[str, np.ndarray]) -> np.ndarray:
        """Rotation matrices (1 or m, 3, 3) of some members; a shared attitude is computed once."""
        shared = self.varied_names.isdisjoint(f"start.{way}" for way in ATTITUDES)
        return self.scene.attitude if shared else resolve_attitude(start)


def _same_or_copy(values: np.ndarray, before: np.ndarray | None) -> np.ndarray:
    """The array `before` if it has the same bits, so that results cached by array are found again; else a copy."""
    same = before is not None and (before.shape, before.dtype) == (values.shape, values.dtype)
    return before if same and before.tobytes() == values.tobytes() else values.copy()  # type: ignore[union-attr,return-value]


def _of_each(values: np.ndarray, members: int) -> np.ndarray:
    """Return values (1 or n, ...) as a read-only array for n members."""
    if len(values) == members:
        values = values.view()
        values.flags.writeable = False
        return values
    return np.broadcast_to(values, (members, *values.shape[1:]))


def draws_of(scene: SceneLike, settings: EnsembleSettings, explicit: Mapping[str, np.ndarray]) -> Draws:
    """The draws for the settings, or for members with given states; refuse settings that do not fit the scene."""
    faults = Faults("ensemble.vary.")
    base, sampling = scene.parameters(), settings.sampling
    columns, designed = sampling.own_values(), sampling.distributions()
    if any(name.startswith("start.geodetic") for name in columns):
        from lgvi_warp.scene.given_places import positions_in_place_of_places

        columns = positions_in_place_of_places(columns, scene)
    start = {} if explicit else {f"start.{key}": value for key, value in scene.start.given().items()}
    if not explicit:
        start = _turned_by_matrix(faults, start, [*settings.vary, *designed, *columns])
    known = {**base, **start}
    for key in designed.keys() & settings.vary.keys():
        fault = f"varies what the {sampling.kind} gives values"
        faults.add(f'"{key}"', settings.vary[key], fault, "drop one of them")
    distributions = {**designed, **settings.vary}
    described = [variations.variation(faults, *item, known) for item in sorted(distributions.items())]
    drawing = [variation for variation in described if variation]
    tables = Faults("ensemble.sampling.table.")
    in_table = {key: _column(tables, key, column, known) for key, column in columns.items()}
    named = [(variation.key, variation.targets) for variation in drawing]
    variations.clashes(faults, [*named, *((key, (pair[0],)) for key, pair in in_table.items() if pair)])
    with faults.including():
        tables.raise_if_any()
    faults.raise_if_any()
    seed = int(settings.seed)
    space = variations.space(seed, drawing)
    total = counted(sampling, space, settings.members)
    numbers = SceneNumbers(base, start)
    given = [pair for pair in in_table.values() if pair]
    return Draws(numbers, explicit, given, drawing, sampling, space, total, weights=sampling.own_weights())


def _turned_by_matrix(faults: Faults, start: dict[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """The start, with its attitude as a matrix if the attitude itself varies."""
    names = {target.name for key in keys for target in variations.targets(key)}
    if variations.ATTITUDE not in names:
        return start
    ways = [f"start.{way}" for way in ATTITUDES]
    for way in sorted((set(ways) - {variations.ATTITUDE}) & names):
        faults.add(f'"{way}"', "...", f'varies beside "{variations.ATTITUDE}"', "keep one of them")
    faults.raise_if_any()
    R = resolve_attitude({way.removeprefix("start."): np.asarray(start[way])[None] for way in ways if way in start})
    return {name: value for name, value in start.items() if name not in ways} | {variations.ATTITUDE: R[0]}


def _column(tables: Faults, key: str, column: Any, known: Mapping[str, np.ndarray]) -> tuple[Target, np.ndarray] | None:
    """The target and the values of a table's column; None after a fault in the name."""
    (target, *more), also = variations.targets(key), f'; or leave it out: ignore = ["{cut(key)}"]'
    if more:
        tables.add(f'"{key}"', "...", "names several numbers", "give each a column of its own")
    if more or not variations.known_target(tables, key, "...", target, known, also):
        return None
    shape = (len(column), *target.of(known[target.name]).shape)
    name = target.name if target.index is None else key
    values = explicit_parameter(tables, name, column, shape)
    attitudes = target.name == variations.ATTITUDE and values.shape == shape
    if attitudes and not notation.rotations(values).all():
        tables.add(f'"{key}"', "...", "holds a matrix that is not a rotation to 1e-9", "give R^T R = I, det R = 1")
    return target, values


def counted(sampling: Sampling, space: Space, members: int | None) -> int:
    """The number of members: as given, or that of the sampling for None. Raises SceneError if it does not fit the sampling."""
    faults = Faults("ensemble.")
    designed, group = sampling.own_members(space), sampling.group_size(space)
    total = int(members or designed or group)
    if total > MOST_MEMBERS:
        problem = f"are more members than the {MOST_MEMBERS} that there can be"
        faults.add(f"sampling.{sampling.kind}", total, problem, "give fewer values, of fewer names")
    else:
        sampling.check(faults, space, total)
    faults.raise_if_any()
    return total
