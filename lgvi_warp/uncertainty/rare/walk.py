# SPDX-License-Identifier: Apache-2.0
"""A scene as a walk from checkpoint to checkpoint: each interval continues the members' states with its own noise."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import Prepared, prepare
from lgvi_warp.common.errors import refusal
from lgvi_warp.common.status import failed
from lgvi_warp.common.times import of_step
from lgvi_warp.control.signals import ordered
from lgvi_warp.criteria.memory import Remembered
from lgvi_warp.criteria.success import Success
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.results.quantities import quantities
from lgvi_warp.runs.request import Request
from lgvi_warp.sampling import final as ends
from lgvi_warp.uncertainty.rare.event import SURE, RareCondition, between
from lgvi_warp.uncertainty.rare.flock import Flock
from lgvi_warp.uncertainty.rare.following import followed, looks_of
from lgvi_warp.uncertainty.rare.limit import Varying, refuse_lost
from lgvi_warp.uncertainty.rare.stretches import Stretches


@dataclass(frozen=True, eq=False)
class AtStart:
    """Standard normals (n, d) of members before the start."""

    u: np.ndarray

    def part(self, rows: np.ndarray) -> AtStart:
        """Some of the members."""
        return AtStart(self.u[rows])


class VehicleWalk(Varying):
    """A scene as a Walk.

    fleet: the scene and its distributions. condition: the event. settings: arguments of `prepare`. refuse: True if a
    failed member is an error, False if it is the event. seed: seed of the noise. looks: maximum number of time
    intervals. remembered: store of the runs from level to level.

    Attributes:
        lasting: as in `Walk`.
        steps: (looks,), number of steps of each interval.
        h: step [s].
        seconds: time of the runs of intervals [s].
        steps_run: number of steps that were run, over all members.
    """

    sources: tuple[Any, ...] = ()

    def __init__(
        self, fleet: Any, condition: RareCondition, settings: Mapping[str, Any], refuse: bool, seed: int, looks: int,
        remembered: Remembered | None = None,
    ):  # fmt: skip
        super().__init__(fleet)
        self.condition, self._refuse, self._seed = condition, refuse, seed
        self._followed = followed(condition)
        self.lasting = np.array([each.lasting for each in self._followed])
        self._of = None if condition.of is None else quantities(condition.of)[0]
        scene = self.fleet.scene
        save = looks_of(condition, scene, settings)
        grid = Request(self.fleet, h=settings.get("h"), t1=settings.get("t1"), save=save).grid()
        self.h = grid.h
        self.steps = pieces(grid.steps, self._unit(save), looks)
        fields = ordered([*FIELDS, *save.fields, *(self._of.fields if self._of else ())])
        more = {} if self._of else {"statistics": condition.arguments(scene, grid.h)["statistics"]}
        self._settings = {**settings, **more, "h": grid.h, "save": replace(save, fields=fields, final=True)}
        self._runs: dict[int, Prepared] = {}
        run = self._run(int(self.steps[0]))
        self.names = run.names if self.fleet.vary else ()
        if not sum(each.numbers for each in run.draws):
            problem = "has no noise, so that copies of a member would go the same way"
            raise refusal("by", "splitting", problem, 'give by="chains", the default, or a scene with noise')
        self.stretches = Stretches(remembered) if remembered is not None and remembered.keeps else None
        self._fresh, self.steps_run, self.seconds = 0, 0, 0.0

    def _unit(self, save: Any) -> int:
        """Number of steps of which intervals are multiples, so that they begin at samples and ticks of a controller."""
        scene = self.fleet.scene
        every = [] if save.every is None else [save.every]
        if scene.controller is not None:
            every.append(scene.controller.period)
        return math.lcm(*(max(1, round(float(each) / self.h)) for each in every)) if every else 1

    def _run(self, steps: int) -> Prepared:
        """The prepared run of this number of steps."""
        if steps not in self._runs:
            length = float(steps * of_step(self.h))
            settings, save = dict(self._settings), self._settings["save"]
            if save.every is not None and save.every > length:
                settings["save"] = replace(save, every=None)
            settings |= {"t1": length, "levels": bool(self.fleet.vary)}
            self._runs[steps] = prepare(self.fleet, **settings)
        return self._runs[steps]

    @property
    def looks(self) -> int:
        """Number of the last checkpoint."""
        return len(self.steps)

    @property
    def times(self) -> np.ndarray:
        """Times of the checkpoints (looks + 1,) [s]."""
        return np.concatenate([[0], np.cumsum(self.steps)]) * self.h

    @property
    def d(self) -> int:
        """Number of the normals at the start."""
        return len(self.names)

    @property
    def members(self) -> int:
        """Number of members that were run, in whole runs."""
        return math.ceil(self.steps_run / self.steps.sum())

    def begin(self, u: np.ndarray) -> Flock:
        """Members at the start, of standard normals (n, d)."""
        n, c = len(u), len(self._followed)
        no = np.zeros(n, bool)
        return Flock(0, AtStart(u), np.full((c, n), np.nan), np.full((c, n), -SURE), np.zeros((n, 0)), no, no, no)

    def keys(self, count: int) -> np.ndarray:
        """Keys (n,) of noise that no member has used."""
        self._fresh += count
        return np.arange(self._fresh - count, self._fresh)

    def advance(self, flock: Flock, keys: np.ndarray) -> Flock:
        """Advance the members to the next checkpoint, with the noise of these keys."""
        began = time.perf_counter()
        steps = int(self.steps[flock.look])
        run = self._run(steps)
        noise: dict[str, Any] = {"indices": keys, "seed": self._seed}
        if not isinstance(flock.place, AtStart):
            result = run.states(flock.place, **noise)
        elif self.names:
            result = run(self.levels(flock.place.u), **noise)
        else:
            result = run.states(**self.states(len(keys)), **noise)
        self.steps_run += steps * len(keys)
        there = self._flock(flock, result)
        self.seconds += time.perf_counter() - began
        return there

    def _flock(self, before: Flock, result: Any) -> Flock:
        """The members after an interval."""
        status = np.asarray(result.status)
        if self._of is not None:
            pieces = [self._of.values(result)]
            if pieces[0].shape[1] != 1:
                raise refusal(
                    "limit", self.condition.label, f"is {pieces[0].shape[1]} numbers", "name one of its entries"
                )
            numbers, lost = [pieces[0][:, 0]], failed(status) | np.isnan(pieces[0][:, 0])
        else:
            numbers = [np.asarray(result.statistics[f"each {name}"].value[0, 0]) for name in self.condition.limits]
            lost = failed(status)
        if self._refuse:
            refuse_lost(lost)
        values = [number if each.combine is None or before.look == 0 else each.combine(had, number)
                  for each, had, number in zip(self._followed, before.values, numbers, strict=True)]  # fmt: skip
        distances = np.stack([between(value, each.above, each.below)
                              for value, each in zip(values, self._followed, strict=True)])  # fmt: skip
        over, look = status != 0, before.look + 1
        happened = lost | (distances > 0.0).any(axis=0) & (over | (look == self.looks))
        happened |= (distances[self.lasting] > 0.0).any(axis=0)
        if self.condition.statuses:
            ended = Success(self.condition.statuses).passed(status, {}) & (over | (look == self.looks))
            distances, happened = np.where(ended, SURE, distances), happened | ended
        end = {name: np.asarray(result.samples[name][-1], np.float64) for name in FIELDS}
        features = np.column_stack([rows.reshape(len(rows), -1) for rows in end.values()])
        return Flock(look, result.final, np.stack(values), distances, features, happened, over | lost, lost)

    def joined(self, flocks: Sequence[Flock]) -> Flock:
        """Join flocks at one checkpoint."""
        if len(flocks) == 1:
            return flocks[0]
        places = [flock.place for flock in flocks]
        place = (
            AtStart(np.concatenate([each.u for each in places]))
            if isinstance(places[0], AtStart)
            else ends.joined(places)
        )
        return flocks[0].beside(flocks[1:], place)


def pieces(steps: int, unit: int, looks: int) -> np.ndarray:
    """Steps of each interval: at most `looks` intervals of whole units; the last takes the remainder."""
    size = unit * max(1, -(-steps // (unit * looks)))
    whole, rest = divmod(steps, size)
    return np.array([size] * whole + ([rest] if rest else []), dtype=np.int64)
