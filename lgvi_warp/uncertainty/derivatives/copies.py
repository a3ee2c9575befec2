# SPDX-License-Identifier: Apache-2.0
"""Copies of members with changed numbers and the members' noise, and the results of their runs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.calls.runner import PATHS_AT_ONCE, Runner, samples_for, statistics_for, values_of
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.status import failed
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.results.quantities import OfResult
from lgvi_warp.results.result import Result
from lgvi_warp.sampling.designs.table import Table
from lgvi_warp.scene import variations
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.variations import Target

# Least size of a number of the start, and of an entry beside the others of its array.
LEAST_SIZE = 1e-3
# How far the starts are apart whose distance at the end tells growth [m/s, rad, rad/s].
NUDGE = 1e-8
ABOVE, BELOW = 0, 1


@dataclass(frozen=True, eq=False)
class MovedCopies:
    """Copies of the members of a fleet, with some numbers changed.

    scene: scene of the copies, whose events and quanta may differ. targets: the k numbers that are changed. left_out: names
    of numbers taken from the scene instead of the members. unmovable: index of a number -> reason why it cannot be changed.
    """

    fleet: Ensemble
    scene: Any
    targets: tuple[Target, ...]
    left_out: Collection[str] = ()
    unmovable: dict[int, str] = field(default_factory=dict)

    @functools.cached_property
    def numbers(self) -> dict[str, np.ndarray]:
        """Arrays (n, ...) by name, of the members' own numbers and of the changed ones."""
        fleet, n = self.fleet, self.fleet.members
        parameters = fleet.parameters(0, n)
        known = {f"start.{name}": value[None] for name, value in fleet.scene.start.given().items()}
        known |= parameters | fleet.starts(0, n)
        names = dict.fromkeys([*fleet.varied(), *fleet.varied_starts(), *(target.name for target in self.targets)])
        kept = [name for name in names if name not in self.left_out]
        return {name: np.broadcast_to(known[name], (n, *known[name].shape[1:])) for name in kept}

    @functools.cached_property
    def at(self) -> np.ndarray:
        """The members' values of the numbers that are changed (n, k)."""
        return self._beside([self._entry(target, self.numbers[target.name]) for target in self.targets])

    def _beside(self, columns: Sequence[np.ndarray]) -> np.ndarray:
        return np.stack(columns, axis=1) if columns else np.zeros((self.fleet.members, 0))

    @staticmethod
    def _entry(target: Target, values: np.ndarray) -> np.ndarray:
        every: tuple[Any, ...] = (slice(None), *(target.index or ()))
        return np.asarray(values[every], dtype=np.float64)

    @functools.cached_property
    def sizes(self) -> np.ndarray:
        """Scale of relative increments (n, k): the number, or the largest of its array; 1 if all are 0."""
        columns = []
        for j, target in enumerate(self.targets):
            values = self.numbers[target.name]
            largest = np.abs(values.reshape(len(values), -1)).max(axis=1)
            least = np.where(target.name.startswith("start."), LEAST_SIZE, 0.0) + LEAST_SIZE * largest
            size = np.where(self.at[:, j] == 0.0, largest, np.maximum(np.abs(self.at[:, j]), least))
            columns.append(np.where(size > 0.0, size, 1.0))
        return self._beside(columns)

    def moved(self, each: np.ndarray, by: np.ndarray) -> dict[str, np.ndarray]:
        """Numbers (N, ...) by name of copies of the members `each` (N,), changed by `by` (N, k)."""
        numbers = {name: np.array(values[each], dtype=np.float64) for name, values in self.numbers.items()}
        for j, target in enumerate(self.targets):
            variations.put(numbers, target, self.at[each, j] + by[:, j], into=True)
        return numbers

    def ensemble(self, each: np.ndarray, numbers: Mapping[str, np.ndarray]) -> Ensemble:
        """Copies of members with these numbers. Raises SceneError if a number is unphysical."""
        of_scene = {name: values for name, values in numbers.items() if self._in_scene(name)}
        copies = Ensemble(
            self.scene, len(each), self.fleet.seed, None, Table(values=of_scene) if of_scene else "random"
        )
        copies.indices = self.fleet.indices[each]
        return copies

    def _in_scene(self, name: str) -> bool:
        return name.startswith("start.") or name in self._known

    @functools.cached_property
    def _known(self) -> frozenset[str]:
        return frozenset(self.scene.parameters())

    def physical(self, each: np.ndarray, increments: np.ndarray) -> np.ndarray:
        """Mask (k, 2, levels), above and below, of increments that leave all members `each` (n,) physical.

        If a number has no such increment, `unmovable` gets the reason.
        """
        k, levels = increments.shape[1:]
        good = np.ones((k, 2, levels), bool)
        for j in range(k):
            fault: SceneError | None = None
            for side, level in np.ndindex(2, levels):
                by = np.zeros((len(each), k))
                by[:, j] = increments[:, j, level] * (1.0 if side == ABOVE else -1.0)
                try:
                    self.ensemble(each, self.moved(each, by))
                except SceneError as error:
                    good[j, side, level], fault = False, error
            if fault is not None and not good[j].any():
                self.unmovable[j] = f"cannot be moved to either side: {fault}"
        return good

    def nudged(self) -> tuple[Ensemble, Ensemble]:
        """The members with their own starts, and with slightly changed starts."""
        n = self.fleet.members
        every = np.arange(n)
        start = self.ensemble(every, self.numbers).select(0, n)
        rng = np.random.default_rng(0)
        turn, shift, spin = (NUDGE * rng.normal(size=(n, 3)) / np.sqrt(3.0) for _ in range(3))
        R = start.attitude @ notation.matrix_from_rotation_vector(turn)
        beside = R, start.velocity + shift, start.angular_velocity + spin
        own = {name: values for name, values in self.numbers.items() if name in self._known} or None
        here = start.attitude, start.velocity, start.angular_velocity
        both = [Ensemble.from_states(self.scene, start.position, R, v, w, own) for R, v, w in (here, beside)]
        for each in both:
            each.indices, each.seed = self.fleet.indices, self.fleet.seed
        return both[0], both[1]


@dataclass(frozen=True)
class CopyEnds:
    """Ends of copies: values (N, m), NaN for failed copies, status (N,) and end time (N,) [s]."""

    values: np.ndarray
    status: np.ndarray
    time: np.ndarray


class CopyRuns:
    """Runs of copies, whose settings and kernel are prepared once.

    interests: the quantities. settings: arguments of `Runner`.

    Attributes:
        labels, units: labels and units of the values (m,).
        owner: (m,), index of the interest to which each value belongs.
        provenance: provenance of a run.
        members: number of copies that were run.
    """

    def __init__(self, copies: MovedCopies, interests: Sequence[OfResult], settings: Mapping[str, Any]):
        self.copies, self.interests = copies, tuple(interests)
        every = np.arange(copies.fleet.members)
        first = copies.ensemble(every, copies.numbers)
        save = _with_states(samples_for(copies.scene, self.interests, settings.get("save")))
        gathered = statistics_for(copies.scene, self.interests)
        # A copy that is far away may fail: that ends no study.
        lasting = {"on_failure": "freeze"} if copies.scene.run.on_failure == "raise" else {}
        self.runner = Runner(first, gathered, **{**settings, **lasting, "save": save})
        self.plan = self.runner.plan(first)
        self.labels: tuple[str, ...] = ()
        self.units: tuple[str, ...] = ()
        self.owner: tuple[int, ...] = ()
        self.provenance: dict[str, Any] = {}
        self.members = 0

    @property
    def dtype(self) -> str:
        """Precision of the run."""
        return self.plan.dtype

    def __call__(
        self, each: np.ndarray, by: np.ndarray, report: Callable[[float], None] | None = None
    ) -> tuple[CopyEnds, np.ndarray]:
        """Ends of copies of the members `each` (N,), changed by `by` (N, k), and the changes after rounding (N, k)."""
        parts, added = [], self.copies.at[each] + by - self.copies.at[each]
        for first in range(0, len(each), PATHS_AT_ONCE):
            rows = slice(first, first + PATHS_AT_ONCE)
            group = self.copies.ensemble(each[rows], self.copies.moved(each[rows], by[rows]))
            result = self.runner.run(group, warned=False)
            parts.append(self._ends(result, group))
            if report:
                report(min(1.0, (first + PATHS_AT_ONCE) / len(each)))
        self.members += len(each)
        return CopyEnds(*(np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0]))), added

    def _ends(self, result: Result, group: Ensemble) -> CopyEnds:
        numbers = values_of(result, group, self.interests)
        if not self.labels:
            counts = [values.shape[1] for values in numbers]
            pairs = list(zip(self.interests, counts, strict=True))
            self.labels = tuple(label for each, count in pairs for label in each.labels(count))
            self.units = tuple(each.unit for each, count in pairs for _ in range(count))
            self.owner = tuple(i for i, count in enumerate(counts) for _ in range(count))
            self.provenance = result.provenance
        status = np.asarray(result.status)
        values = np.where(failed(status)[:, None], np.nan, np.concatenate(numbers, axis=1, dtype=np.float64))
        return CopyEnds(values, status, np.asarray(result.end_time))

    def nudged(self, final: bool) -> tuple[np.ndarray, Result]:
        """Growth factor of the distance between two starts up to the end (n,), and the run from the first starts.

        final: True if this run keeps its final state.
        """
        ends, results = [], []
        for group in self.copies.nudged():
            result = self.runner.run(group, warned=False, final=final)
            kept = [result.samples[name][-1].reshape(group.members, -1) for name in FIELDS if name in result.samples]
            ends.append(np.concatenate(kept, axis=1, dtype=np.float64))
            results.append(result)
        self.members += 2 * self.copies.fleet.members
        return np.linalg.norm(ends[1] - ends[0], axis=1) / NUDGE, results[0]


def _with_states(save: SaveAt | None) -> SaveAt | None:
    """Add states to the saved fields if they are only signals: the growth is computed from states."""
    if not isinstance(save, SaveAt) or set(save.fields) & set(FIELDS):  # what is none is refused with the run
        return save
    return replace(save, fields=(*FIELDS, *save.fields))


@dataclass(frozen=True)
class Neighbours:
    """Values of members (n, m), and of copies with one number changed (n, m, k, levels); NaN if a copy does not count.

    increments: (n, k, levels), each a fourth of the last. status, time: status and end time of the members (n,).
    """

    at: np.ndarray
    above: np.ndarray
    below: np.ndarray
    increments: np.ndarray
    status: np.ndarray
    time: np.ndarray

    def part(self, members: np.ndarray) -> Neighbours:
        """The neighbours of some members."""
        return Neighbours(*(values[members] for values in vars(self).values()))


def neighbours(
    runs: CopyRuns, members: np.ndarray, relative: np.ndarray, report: Callable[[float], None] | None = None
) -> Neighbours:
    """Run members and their copies in one call; relative: increments (k, levels), as fractions of numbers' sizes."""
    copies = runs.copies
    n, (k, levels) = len(members), relative.shape
    count = 1 + 2 * k * levels
    increments = copies.sizes[members][:, :, None] * relative
    each = np.repeat(members, count)
    good = np.ones((k, 2, levels), bool)
    try:
        ends, added = runs(each, _moves(increments, good), report)
    except SceneError:
        good = copies.physical(members, increments)
        ends, added = runs(each, _moves(increments, good), report)
    m = ends.values.shape[1]
    values = ends.values.reshape(n, count, m)
    status, time = ends.status.reshape(n, count), ends.time.reshape(n, count)
    # A copy that ended in another way is no neighbour of the member.
    values = np.where((status == status[:, :1])[:, :, None], values, np.nan)
    counts = np.moveaxis(good, 1, 2)
    beside = np.moveaxis(values[:, 1:].reshape(n, k, levels, 2, m), -1, 1)
    beside = np.where(counts[None, None], beside, np.nan)
    own = np.einsum("njlsj->njls", added.reshape(n, count, k)[:, 1:].reshape(n, k, levels, 2, k))
    sides = counts.sum(axis=-1)
    span = np.where(sides > 0, np.abs(own).sum(axis=-1) / np.maximum(sides, 1), increments)
    return Neighbours(values[:, 0], beside[..., ABOVE], beside[..., BELOW], span, status[:, 0], time[:, 0])


def _moves(increments: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Changes of copies (n (1 + 2 k levels), k): the member itself, then copies above and below for each increment.

    increments: (n, k, levels). good: (k, 2, levels), False for increments that are replaced by 0.
    """
    n, k, levels = increments.shape
    moved = np.zeros((n, k, levels, 2, k))
    for j in range(k):
        moved[:, j, :, ABOVE, j] = np.where(good[j, ABOVE], increments[:, j], 0.0)
        moved[:, j, :, BELOW, j] = np.where(good[j, BELOW], -increments[:, j], 0.0)
    members = np.zeros((n, 1, k))
    return np.concatenate([members, moved.reshape(n, 2 * k * levels, k)], axis=1).reshape(n * (1 + 2 * k * levels), k)
