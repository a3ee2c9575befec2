# SPDX-License-Identifier: Apache-2.0
"""Runs of settings on points of the unit cube, their costs, and levels of paired settings."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import Prepared, prepare
from lgvi_warp.common import machine
from lgvi_warp.common.random import generator
from lgvi_warp.criteria.memory import Remembered
from lgvi_warp.measuring.comparison import drawn_every
from lgvi_warp.methods.method import Method
from lgvi_warp.sampling.designs.sequences import SOBOL_BITS, sobol_points
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.uncertainty.estimating.estimators import REPLICATES, MeanEstimate, plain, regressed, replicated, together
from lgvi_warp.uncertainty.estimating.question import Question
from lgvi_warp.uncertainty.estimating.target import Solved, Sought, Weighted
from lgvi_warp.uncertainty.estimating.unseen import strata_of

# Members of one call for each thread, whose numbers stay in its cache, and threads that count.
AT_ONCE, MOST_THREADS = 8192, 8
# Counted time of a call by itself, and of an evaluation of the forces of a member, a draw of its noise [s]: about what a core
# takes. Choices follow these, so that one seed gives one answer.
CALL, EVALUATION, DRAW = 1e-3, 1e-8, 1e-8
# What a step in single precision counts, and one of a cheaper scene.
SINGLE, CHEAPER = 0.55, 0.5


@dataclass(frozen=True)
class Setting:
    """Setting of members' runs.

    Method, step [s], precision, and index of the scene: 0 is the user's, the cheaper ones follow.
    """

    method: Any
    h: float
    dtype: str = "float64"
    scene: int = 0

    def __str__(self) -> str:
        name = self.method if isinstance(self.method, str) else self.method.name
        precision = "" if self.dtype == "float64" else f" {self.dtype}"
        return f"{name} {self.h:.6g}{precision}" + (f" of cheaper scene {self.scene}" if self.scene else "")

    @property
    def kind(self) -> tuple[Any, ...]:
        """Common key of settings that differ only in their steps."""
        return self.method, self.dtype, self.scene

    def options(self) -> dict[str, Any]:
        """Arguments of `lw.solve`."""
        return {"method": self.method, "h": self.h, "dtype": self.dtype}

    def to_dict(self) -> dict[str, Any]:
        """Convert the setting to plain values, for JSON."""
        return asdict(self)  # a Method is a dict then

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Setting:
        """Build it from `to_dict`."""
        method = content["method"]
        return cls(**{**content, "method": method if isinstance(method, str) else Method(**method)})


class Runs:
    """Runs of one question in any setting, each prepared once.

    fleets: the user's ensemble, then those of the cheaper scenes with the same distributions.
    strata: strata of the user's ensemble, the common one first.
    counted: predicted time of all calls so far by counted steps, the same whenever `lw.estimate` is called [s].
    seconds: processor time of all runs so far, including preparation, except for the first run of each kernel, whose
        preparation loads or compiles it [s].
    execution: threads, executor and scheduler, as in `lw.prepare`.
    remembered: store of calls; None stores nothing.
    """

    def __init__(
        self, fleets: Sequence[Ensemble], question: Question, t1: float, *, seed: int,
        execution: Mapping[str, Any] | None = None, clock: Callable[[], float] = time.process_time,
        remembered: Remembered | None = None,
    ):  # fmt: skip
        self.question, self.seed, self.seconds, self.counted = question, seed, 0.0, 0.0
        self.strata = strata_of(fleets[0])
        self._fleets, self._t1, self._execution, self._clock = fleets, t1, execution or {}, clock
        self._prepared: dict[tuple[Setting, float | None], Prepared] = {}
        self._calls: list[Call] = []
        self._loaded, self._costs = set[Any](), dict[Any, float]()
        self._remembered = remembered or Remembered()
        threads = self._execution.get("threads") or machine.thread_count()
        # Calls that are kept are the same on any number of threads.
        self._at_once = AT_ONCE * (MOST_THREADS if self._remembered.keeps else min(threads, MOST_THREADS))
        self.dimensions = fleets[0].space.dimensions

    def prepared(self, setting: Setting, grid: float | None) -> Prepared:
        """The run of a setting with noise on a grid [s], None for draws once per step; SceneError if it is refused."""
        key = setting, grid
        if key not in self._prepared:
            begun, fleet = self._clock(), self._fleets[setting.scene]
            fleet = Ensemble(fleet.scene, 1, self.seed, fleet.vary)
            fleet = fleet if grid is None else drawn_every(fleet, grid)
            asked = self.question.settings(fleet.scene)
            run = self._prepared[key] = prepare(
                fleet, levels=self.dimensions > 0, t1=self._t1, **self._execution, **setting.options(), **asked
            )
            kernel = run.noise.plan.spec
            # What loads a kernel, or compiles it, is no cost of later calls.
            if kernel in self._loaded:
                self.seconds += max(self._clock() - begun, 0.0)
            self._loaded.add(kernel)
        return self._prepared[key]

    def __call__(
        self, setting: Setting, grid: float | None, points: np.ndarray, indices: np.ndarray, stratum: int = 0
    ) -> np.ndarray:
        """Numbers of members (n,) at points (n, d) of a stratum, with noise of these indices; NaN if they failed."""
        run, n = self.prepared(setting, grid), len(points)
        groups, points = [], self.strata[stratum].placed(points)
        self.counted += CALL + n * self.cost(setting, grid)
        for first in range(0, n, self._at_once):
            some = slice(first, first + self._at_once)
            ran = functools.partial(self._ran, run, setting)
            numbers, taken = self._remembered(f"{setting!r} {grid!r}", ran, points[some], indices[some])
            groups.append(numbers)
            self.seconds += float(taken)
            self._calls.append(Call(setting, setting.h if grid is None else grid, len(numbers), float(taken)))
        return np.concatenate(groups)

    def _ran(
        self, run: Prepared, setting: Setting, points: np.ndarray, indices: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The numbers of members (n,), and the processor time that they took [s]."""
        begun = self._clock()
        numbers = self.question.numbers(self._call(run, setting, points, indices))
        return numbers, np.array(max(self._clock() - begun, 1e-9))

    def _call(self, run: Prepared, setting: Setting, points: np.ndarray, indices: np.ndarray) -> Any:
        if self.dimensions:
            return run(points, seed=self.seed, indices=indices)
        start = self._fleets[setting.scene].select(0, 1)
        states = (start.position, start.attitude, start.velocity, start.angular_velocity)
        many = (np.repeat(state, len(points), axis=0) for state in states)
        return run.states(*many, indices=indices, seed=self.seed)

    @property
    def members(self) -> int:
        """Number of members run so far."""
        return sum(call.members for call in self._calls)

    def cost(self, setting: Setting, grid: float | None = None) -> float:
        """Predicted time of a member [s], by counts of force evaluations and of noise draws on a grid."""
        method = Method(setting.method) if isinstance(setting.method, str) else setting.method
        each = method.gauss * 8 or (len(method.tableau.b) if method.tableau else len(method.stages))
        one = EVALUATION * each * (SINGLE if setting.dtype != "float64" else 1.0) * (CHEAPER if setting.scene else 1.0)
        return self._t1 * (one / setting.h + (0.0 if grid is None else DRAW / grid))

    def measured_cost(self, setting: Setting, grid: float | None = None) -> float:
        """Processor time of a member in a large call [s], from all calls so far of its kind."""
        key = setting, grid, len(self._calls)
        if key not in self._costs:
            like = [call for call in self._calls if call.setting.kind == setting.kind]
            others = [call for call in self._calls if call.setting.kind != setting.kind]
            self._costs[key] = member_cost(like, setting.h, setting.h if grid is None else grid, others)
        return self._costs[key]


@dataclass(frozen=True)
class Call:
    """A call: its setting, the time between two draws of noise [s], its members and its processor time [s]."""

    setting: Setting
    draw: float
    members: int
    seconds: float


def member_cost(calls: Sequence[Call], h: float, draw: float, others: Sequence[Call] = ()) -> float:
    """The processor time of a member [s], by `fitted`; the fixed cost of a call is not included."""
    cost = float(fitted(calls, others)[1:4] @ (1.0, 1.0 / h, 1.0 / draw))
    # Where all is taken for the calls' own, the cheapest call bounds it.
    return max(cost, 1e-2 * min(call.seconds / call.members for call in calls))


def fitted(calls: Sequence[Call], others: Sequence[Call] = ()) -> np.ndarray:
    """Processor time per call, member, step and draw [s], by non-negative least squares over calls.

    others: calls of other kinds, with the same fixed cost of a call.
    """
    from scipy.optimize import nnls

    def rows(some: Sequence[Call]) -> np.ndarray:
        return np.array([[c.members, c.members / c.setting.h, c.members / c.draw] for c in some]).reshape(-1, 3)

    mine, theirs = rows(calls), rows(others)
    apart = np.block([[mine, np.zeros_like(mine)], [np.zeros_like(theirs), theirs]])
    columns = np.column_stack([np.ones(len(apart)), apart])
    seconds = np.array([c.seconds for c in (*calls, *others)])
    size = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    return np.asarray(nnls(columns / size / seconds[:, None], np.ones(len(seconds)))[0] / size)


def design(seed: int, name: str, dimensions: int, first: int, count: int, replicates: int = REPLICATES) -> np.ndarray:
    """Points (count, d) of Sobol replicates from member `first`: member i is point i // R of replicate i mod R.

    A replicate is one scrambled sequence with its own digital shift.

    replicates: number R of replicates; 0 for independent points, drawn for each name and first member.
    """
    if not replicates:
        return np.asarray(generator(seed, f"{name} {first}").random((count, dimensions)))
    members, parts = np.arange(first, first + count), 2.0**SOBOL_BITS
    words = (sobol_points(seed, name, dimensions, members // replicates) * parts).astype(np.uint64)
    shifts = generator(seed, f"{name} shifts").integers(2**SOBOL_BITS, size=(replicates, dimensions), dtype=np.uint64)
    return np.asarray(((words ^ shifts[members % replicates]) + 0.5) / parts)


@dataclass
class Level:
    """Members of a setting, paired with a coarser setting times a slope on the same points and noise.

    weight: weight of the mean of fine minus slope times coarse in the sum of all levels.
    grid: time between noise draws of both settings [s]; None for draws once per step.
    kind: "sobol", "plain" or "regression".
    members: number of members, fixed beforehand.
    reach: possible distance of the numbers of unseen members; at least the spread of the members.
    stratum: index of the stratum of all members.
    """

    fine: Setting
    coarse: Setting | None
    slope: float
    weight: float
    grid: float | None
    kind: str
    members: int
    first_index: int = 0
    name: str = ""
    reach: float = 0.0
    stratum: int = 0
    y: list[np.ndarray] = field(default_factory=list)
    below: list[np.ndarray] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Convert the level without its results to plain values, for JSON."""
        own = {each.name: getattr(self, each.name) for each in fields(self)[:-3]}
        return own | {"fine": self.fine.to_dict(), "coarse": self.coarse and self.coarse.to_dict()}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Level:
        """Build it from `to_dict`."""
        fine, coarse = Setting.from_dict(content["fine"]), content["coarse"] and Setting.from_dict(content["coarse"])
        return cls(**{**content, "fine": fine, "coarse": coarse})

    def grow(self, runs: Runs, count: int) -> None:
        """Run `count` more members."""
        done = sum(map(len, self.y))
        replicates = REPLICATES if self.kind == "sobol" else 0
        points = design(runs.seed, self.name, runs.dimensions, done, count, replicates)
        indices = self.first_index + np.arange(done, done + count)
        self.y.append(runs(self.fine, self.grid, points, indices, self.stratum))
        if self.coarse is not None:
            self.below.append(runs(self.coarse, self.grid, points, indices, self.stratum))
        self.points.append(points if self.kind == "regression" else points[:, :0])

    def failed(self) -> Setting | None:
        """The setting at which members of the last round failed; None if none failed."""
        for setting, numbers in ((self.fine, self.y), (self.coarse, self.below)):
            if setting is not None and np.isnan(numbers[-1]).any():
                return setting
        return None

    def more(self, share: float) -> int:
        """Number of members to add, a share of the present number; for balanced replicates once or three times it."""
        points = sum(map(len, self.y)) // REPLICATES
        if self.kind == "sobol" and points & (points - 1) == 0:
            return REPLICATES * points * (1 if share <= 1.0 else 3)
        return REPLICATES * math.ceil(share * points)

    def weighted(self) -> list[Weighted]:
        """The level's weighted samples in the sum of levels."""
        samples = [(self.weight, np.concatenate(self.y))]
        return [*samples, (-self.weight * self.slope, np.concatenate(self.below))] if self.below else samples

    def part(self, target: Sought, at: Solved) -> MeanEstimate:
        """The estimate of the level, times its weight. docs/theory/estimators.md, (E20), (E25)."""
        z, least = target.contributions(np.concatenate(self.y), at), target.least(at)
        if self.below:
            z = z - self.slope * target.contributions(np.concatenate(self.below), at)
        # No answer is surer than the effect of members that so many others do not show.
        least = max(least, self.reach, float(np.std(z)))
        if self.kind == "sobol":
            return replicated(z, least).times(self.weight)
        if self.kind == "regression":
            return regressed(z, normals(np.concatenate(self.points)), least).times(self.weight)
        return plain(z, least).times(self.weight)


def normals(points: np.ndarray) -> np.ndarray:
    """Standard normals from points of the unit cube, column by column."""
    from scipy.special import ndtri

    return np.asarray(ndtri(np.clip(points, 2.0**-53, 1.0 - 2.0**-53)))


def cube(normals: np.ndarray) -> np.ndarray:
    """Points of the unit cube from standard normals."""
    from scipy.special import ndtr

    return np.asarray(ndtr(normals))


def samples_of(levels: Sequence[Level]) -> list[Weighted]:
    """The weighted samples of all levels."""
    return [sample for level in levels for sample in level.weighted()]


def estimated(levels: Sequence[Level], target: Sought) -> tuple[Solved, MeanEstimate]:
    """The target from all levels, and its estimate with error. docs/theory/estimators.md, (E20)."""
    samples = samples_of(levels)
    at = target.solved(samples)
    parts = together([level.part(target, at) for level in levels])
    # What regression takes away of a quantile's error is in the mean of the contributions.
    adjusted = target.kind in ("mean", "probability") or any(level.kind == "regression" for level in levels)
    value = parts.value if adjusted else at.value
    return at, replace(parts, value=value)
