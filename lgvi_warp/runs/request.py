# SPDX-License-Identifier: Apache-2.0
"""A requested run: its members, its settings, the data that it keeps and its executor, settled once for every call."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.status import Status
from lgvi_warp.common.times import of_step
from lgvi_warp.control.signals import check_signals
from lgvi_warp.engine.executors import executor_of
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.executors.threads import threads_for
from lgvi_warp.engine.keepers.observation import Observation, observe
from lgvi_warp.engine.plan import NotSurveyed, Plan, choose_plan
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt, TimeGrid, time_grid
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.results.result import Result
from lgvi_warp.runs.default_method import planned
from lgvi_warp.runs.run import refuse_failed, run_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.settings import check_device

# With more Newton steps than this, a fixed number gains nothing over iterating to the tolerance.
MOST_FIXED = 4
# From so many members on, a result holds what another run needs to go on only where SaveAt says so.
MOST_FINALS = 100_000
# Numbers of steps are signed words of 32 bits in the kernel.
MOST_STEPS = 2**31 - 2
# What a run keeps that says nothing of it.
ALL_SAMPLES = Observation()


@dataclass(frozen=True)
class Request:
    """A requested run. Settings that are None come from the scene's [run]; `lw.solve` explains them.

    h: step [s].
    t1: end of the run [s].
    observed: statistics, members whose samples are kept, and the rule that ends the run.
    threads: number of threads; None: chosen by the amount of work.
    executor: None for threads.
    settled: steps and sample times of a resumed run; None if h, t1 and save determine them.
    """

    fleet: Ensemble
    method: str | Method | None = None
    h: float | None = None
    t1: float | None = None
    save: SaveAt | None = None
    dtype: str | None = None
    _: KW_ONLY
    width: int | None = None
    checks: str | None = None
    on_failure: str | None = None
    device: str | None = None
    observed: Observation = ALL_SAMPLES
    threads: int | None = None
    executor: Executor | None = None
    settled: TimeGrid | None = None

    @classmethod
    def of(
        cls,
        faults: Faults,
        fleet: Ensemble,
        *,
        statistics: Any = None,
        keep: Any = None,
        until: Any = None,
        executor: Any = "threads",
        threads: int | None = None,
        scheduler: str | None = None,
        **settings: Any,
    ) -> Request:
        """Make the request from arguments of `solve`; problems with those named here are added to the faults."""
        observed, runner = ALL_SAMPLES, None
        with faults.including():
            observed = observe(fleet, statistics, keep, until)
        with faults.including():
            runner = executor_of(executor, threads, scheduler)
        return cls(fleet, **settings, observed=observed, threads=threads, executor=runner)

    @property
    def saved(self) -> tuple[str, ...]:
        """Names of the samples that are kept."""
        if self.save is not None:
            return self.save.fields
        named = self.fleet.scene.run.save_fields
        return FIELDS if named is None else tuple(named)

    @property
    def keeps_final(self) -> bool:
        """Whether the result is to have `final`, from which another run can continue."""
        if self.save is not None and self.save.final is not None:
            return self.save.final
        return self.observed.samples and self.fleet.members < MOST_FINALS

    def count(self, plan: Plan) -> int:
        """The number of threads of a plan's run."""
        return self.threads or threads_for(plan)

    def grid(self) -> TimeGrid:
        """Choose the steps and the sample times."""
        if self.settled is not None:
            return self.settled
        run, faults, t0 = self.fleet.scene.run, Faults(), self.fleet.start_time
        before = None if self.fleet.final is None else self.fleet.final.step
        step = before if run.step is None else run.step
        h = _seconds(faults, "h", self.h, step, "give the step in seconds: solve(..., h=0.01) or [run] step")
        end = "give the end in seconds: solve(..., t1=150.0) or [run] duration"
        t1 = _seconds(faults, "t1", self.t1, run.duration, end)
        if self.save is not None and not isinstance(self.save, SaveAt):
            faults.add("save", self.save, "is not a SaveAt", "give lw.SaveAt(every=1.0) or lw.SaveAt(at=[...])")
        faults.raise_if_any()
        key = "run.save_fields" if self.save is None else "save.fields"
        check_signals(faults, key, self.saved, self.fleet.scene)
        faults.raise_if_any()
        if self.save is not None:
            return time_grid(h, t1, self.save, t0)
        if run.save_every is None or run.save_every <= t1 - t0:
            return time_grid(h, t1, SaveAt(every=run.save_every), t0)
        # The scene's save_every is meant for its own duration; a shorter run ignores it.
        problem = f"run.save_every = {run.save_every} s is longer than the run, {t1 - t0} s"
        return time_grid(h, t1, SaveAt(), t0).telling(f"{problem}: only the start and the end are kept")

    def plan(self, survey_all: bool = True) -> Plan:
        """Plan the run: its steps, its method and its kernel.

        survey_all: as in `choose_plan`.
        """
        if self.device is not None:
            check_device(self.device)
        grid, run = self.grid(), self.fleet.scene.run
        dtype = run.dtype if self.dtype is None else self.dtype
        checks = run.checks if self.checks is None else self.checks
        on_failure = run.on_failure if self.on_failure is None else self.on_failure
        observed, fields = self.observed, self.observed.fields(self.saved)
        others = (fields, dtype, self.width, checks, on_failure, survey_all, observed.ticks, observed.read_at_ticks())
        if self.method is None and run.method is None and not run.method_options:
            return planned(self.fleet, grid, others)
        method = self.method if isinstance(self.method, Method) else run.method_of(self.method)
        if method.iterations == "auto":
            method = replace(method, iterations=enough_iterations(self.fleet, method, grid.h, dtype))
            n = method.iterations
            number = f"{n} a solve, enough for" if n is not None else f"to the tolerance: {MOST_FIXED} are too few for"
            grid = grid.telling(f"Newton steps {number} every member's start at twice the step")
        return choose_plan(self.fleet, method, grid, *others)

    def run(self, plan: Plan, **settings: Any) -> Result:
        """Run in memory, then run the members again whose samples are to be kept.

        plan: the plan of this request, from a survey of some members. If another member needs another kernel, the run
            starts again with a kernel for all members, so that all bits come from one kernel.
        settings: as in `run_plan`.
        """
        settings = {"observed": self.observed, "fields": self.saved, "executor": self.executor, **settings}
        try:
            result = run_plan(plan, self.count(plan), **settings)
        except NotSurveyed:
            plan = plan.replanned(survey_all=True)
            result = run_plan(plan, self.count(plan), **settings)
        indices, kept = self.again(plan, result.status)
        if kept is not None:
            result = replace(result, kept=kept, kept_members=indices)
        return refuse_failed(result, plan)

    def again(self, plan: Plan, status: np.ndarray) -> tuple[np.ndarray, Result | None]:
        """Run the members again whose samples are kept after the run; the bits are the same as in the run.

        status: status of each member (n,).
        Returns: Their indices, (m,), and their result, None if there are none.
        """
        indices = self.observed.again(status)
        if not len(indices):
            return indices, None
        chosen = plan.with_neighbours(indices)
        part = plan.subplan([int(i) for i in chosen], self.saved)
        result = run_plan(part, self.count(part))
        return indices, result if len(chosen) == len(indices) else result.part(np.searchsorted(chosen, indices))


def scene_of(fleet: Any, key: str = "fleet") -> Any:
    """The scene of an Ensemble, or the Scene itself; key: name of the argument. Raises SceneError."""
    if not isinstance(fleet, Ensemble | Scene):
        raise refusal(key, fleet, "is neither an Ensemble nor a Scene", "give lw.Scene(...) or lw.Ensemble(...)")
    return fleet.scene if isinstance(fleet, Ensemble) else fleet


def ensemble_of(fleet: Any) -> Ensemble:
    """The Ensemble itself, or the ensemble of a Scene with its [ensemble]."""
    scene = scene_of(fleet)
    return fleet if isinstance(fleet, Ensemble) else Ensemble.from_scene(scene)


def longest(scene: SceneLike, h: Any) -> float:
    """End of the longest possible run of a scene with steps h [s]; 1 s for an invalid h, which the run itself reports."""
    if not (isinstance(h, float | int) and np.isfinite(h) and h > 0.0):
        return 1.0
    draws = [term.draws(h) for term in scene.terms if isinstance(term, NoisyTerm)]
    every = 1 if scene.controller is None else scene.controller.every(h)
    return float(of_step(h) * (MOST_STEPS // max(draws, default=1) // every * every))


def enough_iterations(fleet: Ensemble, method: Method, h: float, dtype: str) -> int | None:
    """Find the least number of Newton steps that leaves every member's residual below the tolerance at twice the step.

    The residual after a fixed number of iterations grows with h |Omega|; twice the step allows members to spin up.

    h: Step of the run [s].
    Returns: The number of Newton steps, or None if more than MOST_FIXED would be needed.
    """
    fleet = fleet if fleet.given is None else fleet.with_given(None)  # a trial has steps of its own, and so draws
    for n in range(MOST_FIXED + 1):
        trial = Request(fleet, replace(method, iterations=n), 2.0 * h, 2.0 * h, SaveAt(), dtype)
        plan = trial.plan()
        if not np.any(run_plan(plan, trial.count(plan)).status == Status.NOT_CONVERGED):
            return n
    return None


def _seconds(faults: Faults, key: str, argument: Any, of_scene: float | None, remedy: str) -> float:
    """A time of the run [s]: the argument, else the scene's."""
    seconds = of_scene if argument is None else argument
    if seconds is None:
        faults.add(key, seconds, "is missing", remedy)
        return 0.0
    return float(faults.positive(key, seconds) or 0.0)
