# SPDX-License-Identifier: Apache-2.0
"""Runs of settings on points of the cube: the numbers of their members, what they cost, and levels of paired settings."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import Prepared, prepare
from lgvi_warp.common.random import generator
from lgvi_warp.sampling.designs.sequences import sobol_points
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.studies.comparison import drawn_every
from lgvi_warp.studies.estimating.estimators import REPLICATES, MeanEstimate, plain, regressed, replicated, together
from lgvi_warp.studies.estimating.question import Question
from lgvi_warp.studies.estimating.target import Solved, Sought, Weighted

# Members of one call.
AT_ONCE = 65_536


@dataclass(frozen=True)
class Setting:
    """How members are run: method, step [s], precision, and which scene, 0 the user's, others the cheaper ones in order."""

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
        """What settings that differ in their steps alone have in common."""
        return self.method, self.dtype, self.scene

    def options(self) -> dict[str, Any]:
        """Arguments of `lw.solve`."""
        return {"method": self.method, "h": self.h, "dtype": self.dtype}


class Runs:
    """Runs of one question in any setting, each prepared once.

    fleets: the user's ensemble, then the cheaper scenes' with the same variation.
    seconds: processor time of all calls so far, without preparing and compiling [s].
    """

    def __init__(
        self, fleets: Sequence[Ensemble], question: Question, t1: float, *, seed: int, threads: int | None = None,
        clock: Callable[[], float] = time.process_time,
    ):  # fmt: skip
        self.question, self.seed, self.seconds = question, seed, 0.0
        self._fleets, self._t1, self._threads, self._clock = fleets, t1, threads, clock
        self._prepared: dict[tuple[Setting, float | None], Prepared] = {}
        self._calls: list[Call] = []
        self.dimensions = fleets[0].space.dimensions

    def prepared(self, setting: Setting, grid: float | None) -> Prepared:
        """The run of a setting, with noise on a grid [s], None for draws once a step; SceneError where it is refused."""
        key = setting, grid
        if key not in self._prepared:
            fleet = self._fleets[setting.scene]
            fleet = Ensemble(fleet.scene, 1, self.seed, fleet.vary)
            fleet = fleet if grid is None else drawn_every(fleet, grid)
            asked = self.question.settings(fleet.scene)
            self._prepared[key] = prepare(
                fleet, levels=self.dimensions > 0, t1=self._t1, threads=self._threads, **setting.options(), **asked
            )
            # What a first call makes once is no cost of later ones.
            self._call(self._prepared[key], setting, np.full((1, self.dimensions), 0.5), np.zeros(1, np.int64))
        return self._prepared[key]

    def __call__(self, setting: Setting, grid: float | None, points: np.ndarray, indices: np.ndarray) -> np.ndarray:
        """The numbers of members (n,) at points (n, d), with the noise of these indices; NaN for those that failed."""
        run, n = self.prepared(setting, grid), len(points)
        groups = []
        for first in range(0, n, AT_ONCE):
            some = slice(first, first + AT_ONCE)
            begun = self._clock()
            groups.append(self.question.numbers(self._call(run, setting, points[some], indices[some])))
            taken = max(self._clock() - begun, 1e-9)
            self.seconds += taken
            self._calls.append(Call(setting, setting.h if grid is None else grid, len(groups[-1]), taken))
        return np.concatenate(groups)

    def _call(self, run: Prepared, setting: Setting, points: np.ndarray, indices: np.ndarray) -> Any:
        if self.dimensions:
            return run(points, seed=self.seed, indices=indices)
        start = self._fleets[setting.scene].select(0, 1)
        states = (start.position, start.attitude, start.velocity, start.angular_velocity)
        many = (np.repeat(state, len(points), axis=0) for state in states)
        return run.states(*many, indices=indices, seed=self.seed)

    def cost(self, setting: Setting, grid: float | None = None) -> float:
        """Processor time of a member in a large call [s], from all calls so far of its kind."""
        like = [call for call in self._calls if call.setting.kind == setting.kind]
        return member_cost(like, setting.h, setting.h if grid is None else grid)


@dataclass(frozen=True)
class Call:
    """A call: its setting, the time between two draws of noise [s], its members and its processor time [s]."""

    setting: Setting
    draw: float
    members: int
    seconds: float


def member_cost(calls: Sequence[Call], h: float, draw: float) -> float:
    """The processor time of a member [s] by least squares over calls: per call, member, step and draw, none below 0.

    Relative residuals count. What a call takes by itself is no cost of a member.
    """
    from scipy.optimize import nnls

    rows = np.array([[1.0, c.members, c.members / c.setting.h, c.members / c.draw] for c in calls])
    seconds = np.array([c.seconds for c in calls])
    size = np.abs(rows).max(axis=0)
    numbers = nnls(rows / size / seconds[:, None], np.ones(len(calls)))[0] / size
    cost = float(numbers[1:] @ (1.0, 1.0 / h, 1.0 / draw))
    # Where all is taken for the calls' own, the cheapest call bounds it.
    return max(cost, 1e-2 * float(np.min(seconds / rows[:, 1])))


def design(seed: int, name: str, dimensions: int, first: int, count: int, replicates: int = REPLICATES) -> np.ndarray:
    """Members of replicates of Sobol points (count, d), from a member on: member i is point i // R of replicate i mod R.

    replicates: 0 for independent points, of which a count of each name is drawn once.
    """
    if not replicates:
        return np.asarray(generator(seed, f"{name} {first}").random((count, dimensions)))
    members = np.arange(first, first + count)
    levels = np.empty((count, dimensions))
    for r in range(replicates):
        mine = members % replicates == r
        levels[mine] = sobol_points(seed, f"{name} {r}", dimensions, members[mine] // replicates)
    return levels


@dataclass
class Level:
    """Members of a setting and, on the same points and noise, of a coarser one times a slope.

    weight: of the mean of fine less slope times coarse in the sum of all levels.
    grid: of the noise of both [s]; None for draws once a step.
    kind: "sobol", "plain" or "regression".
    members: number of members, fixed beforehand.
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
    y: list[np.ndarray] = field(default_factory=list)
    below: list[np.ndarray] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)

    def grow(self, runs: Runs, count: int) -> None:
        """Run so many more members."""
        done = sum(map(len, self.y))
        replicates = REPLICATES if self.kind == "sobol" else 0
        points = design(runs.seed, self.name, runs.dimensions, done, count, replicates)
        indices = self.first_index + np.arange(done, done + count)
        self.y.append(runs(self.fine, self.grid, points, indices))
        if self.coarse is not None:
            self.below.append(runs(self.coarse, self.grid, points, indices))
        self.points.append(points if self.kind == "regression" else points[:, :0])

    def weighted(self) -> list[Weighted]:
        """The level's part in the sum of levels."""
        samples = [(self.weight, np.concatenate(self.y))]
        return [*samples, (-self.weight * self.slope, np.concatenate(self.below))] if self.below else samples

    def part(self, target: Sought, at: Solved) -> MeanEstimate:
        """The estimate of the level, times its weight."""
        z, least = target.contributions(np.concatenate(self.y), at), target.least(at)
        if self.below:
            z = z - self.slope * target.contributions(np.concatenate(self.below), at)
        if self.kind == "sobol":
            return replicated(z, least).times(self.weight)
        if self.kind == "regression":
            return regressed(z, normals(np.concatenate(self.points))).times(self.weight)
        return plain(z, least).times(self.weight)


def normals(points: np.ndarray) -> np.ndarray:
    """Standard normals of levels, column by column."""
    from scipy.special import ndtri

    return np.asarray(ndtri(np.clip(points, 2.0**-53, 1.0 - 2.0**-53)))


def estimated(levels: Sequence[Level], target: Sought) -> tuple[Solved, MeanEstimate]:
    """The target from all levels, and the estimate of its error."""
    samples = [sample for level in levels for sample in level.weighted()]
    at = target.solved(samples)
    parts = together([level.part(target, at) for level in levels])
    value = parts.value if target.kind in ("mean", "probability") else at.value
    return at, replace(parts, value=value)
