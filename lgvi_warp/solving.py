"""The walk from an ensemble to a result."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp import machine
from lgvi_warp.blocks import Block, Keeper, blocks, in_order, run_block
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.errors import Faults, MembersFailed, SceneError, shown
from lgvi_warp.executors import threads as thread_executor
from lgvi_warp.keepers import Outcomes, Samples
from lgvi_warp.method import Method
from lgvi_warp.observation import Observation, notes, observe
from lgvi_warp.plan import Plan
from lgvi_warp.result import Drawn, Result
from lgvi_warp.saveat import SaveAt, time_grid
from lgvi_warp.scene import Scene
from lgvi_warp.statistics.estimate import Estimates
from lgvi_warp.statistics.keeper import Gathered
from lgvi_warp.status import Status, StatusArray, WarningArray, failure_text


def solve(
    fleet: Ensemble | Scene,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    *,
    threads: int | None = None,
    width: int | None = None,
    checks: str | None = None,
    on_failure: str | None = None,
    progress: Callable[[float], None] | None = None,
    statistics: Sequence[Any] | None = None,
    keep: str | Sequence[int] | None = None,
    until: Any = None,
) -> Result:
    """Advance every member of the fleet from t = 0 to t1 and keep the samples asked for.

    fleet: an Ensemble, or a Scene for its own ensemble (one vehicle if it has none).
    method: a name or a Method. h, t1: step and end [s]. dtype: "float64", "float32", or "float32_compensated", which
    keeps each number of the state as a sum of two (many short steps, far from the origin). What is left out is taken from
    the scene's [run] section (method "psi_s" and float64 where it says nothing).
    save: what to keep (default: every [run] save_every of the scene, else the start and the end).
    threads: default all cores. width: vehicles per packet, default from the CPU.
    checks: "safe" (default) gives each member a status and freezes it when it fails, and warns of what its numbers and its
    start say against the step; "all" also warns of what arises on the way; "none" leaves all that code out.
    on_failure: "freeze" (default) keeps a member that fails at its last good state; "raise" raises MembersFailed after the
    run; "substep" makes a step that has no solution again in 2, 4, ... 1024 parts, for that member alone: order and the
    symmetry of each step are kept, symplecticity is not.
    progress: called with the fraction of the work that is done, from the threads that do it.
    statistics: gathered over the members at every sample time while the run goes: lw.Mean("position"), ...; they are
    in result.statistics. keep: "all" samples of members (default); "none", so that memory grows with neither members nor
    steps; "failed", or indices of members: those are run again after the run, to the same bits, and are result.kept.
    until: lw.Until(...), to stop before the last member, once a statistic's interval is narrow enough.

    Raises SceneError naming every fault of the arguments, MembersFailed as asked. Prints nothing. The same inputs give the
    same bits for any number of threads, on one type of machine.
    """
    if not isinstance(fleet, Ensemble | Scene):
        raise SceneError(
            [f"fleet = {shown(fleet)}: is neither an Ensemble nor a Scene; give lw.Scene(...) or lw.Ensemble(...)"]
        )
    ensemble = fleet if isinstance(fleet, Ensemble) else Ensemble.from_scene(fleet)
    faults = Faults()
    observed = Observation()
    with faults.including():
        observed = observe(ensemble.members, ensemble.scene.run, statistics, keep, until)
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, int) or threads < 1):
        faults.add("threads", threads, "is not a whole number above 0", "give 1 or more, or leave it out for all cores")
    faults.raise_if_any()
    plan = make_plan(
        ensemble, method, h, t1, save, dtype, width=width, checks=checks, on_failure=on_failure, fields=observed.fields
    )
    result = run_plan(plan, threads or machine.thread_count(), progress, observed, (save or SaveAt()).fields)
    failed = failure_text(result) if plan.on_failure == "raise" else ""
    if failed:
        raise MembersFailed(failed, result)
    return result


def make_plan(
    ensemble: Ensemble,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    *,
    width: int | None = None,
    checks: str | None = None,
    on_failure: str | None = None,
    fields: Callable[[Sequence[str]], tuple[str, ...]] = tuple,
) -> Plan:
    """Settle a run's settings, from the arguments and then from the scene's [run]. Raises SceneError.

    fields: from the fields that `save` asks for, those that the kernel writes.
    """
    settings = ensemble.scene.run
    h = settings.step if h is None else h
    t1 = settings.duration if t1 is None else t1
    faults = Faults()
    if h is None:
        faults.add("h", h, "is missing", "give the step in seconds: solve(..., h=0.01) or [run] step")
    else:
        h = faults.positive("h", h)
    if t1 is None:
        faults.add("t1", t1, "is missing", "give the end in seconds: solve(..., t1=150.0) or [run] duration")
    else:
        t1 = faults.positive("t1", t1)
    if save is not None and not isinstance(save, SaveAt):
        faults.add("save", save, "is no SaveAt", "give lw.SaveAt(every=1.0) or lw.SaveAt(at=[...])")
    faults.raise_if_any()
    every = settings.save_every
    # A spacing that the scene gave for its own duration says nothing about a shorter run.
    dropped = save is None and every is not None and every > float(t1)  # type: ignore[arg-type]
    if save is None:
        save = SaveAt(every=None if dropped else every)
    grid = time_grid(float(h), float(t1), save)  # type: ignore[arg-type]
    if dropped:
        text = f"run.save_every = {every} s is longer than the run, {t1} s: only the start and the end are kept"
        grid = replace(grid, messages=(*grid.messages, text))
    chosen = method if isinstance(method, Method) else settings.method_of(method)
    dtype, checks = dtype or settings.dtype, checks or settings.checks
    if chosen.iterations == "auto":
        chosen = replace(chosen, iterations=enough_iterations(ensemble, chosen, grid.h, dtype))
        n = chosen.iterations
        number = f"{n} a solve, enough for" if n is not None else f"to the tolerance: {MOST_FIXED} are too few for"
        text = f"Newton steps {number} every member's start at twice the step"
        grid = replace(grid, messages=(*grid.messages, text))
    return Plan(ensemble, chosen, grid, fields(save.fields), dtype, width, checks, on_failure or settings.on_failure)


# Beyond so many Newton steps a fixed number gains nothing over iterating to the tolerance.
MOST_FIXED = 4


def enough_iterations(ensemble: Ensemble, method: Method, h: float, dtype: str) -> int | None:
    """The least Newton steps that leave every member's residual below the tolerance at twice the step; None above 4.

    The residual of a fixed number grows with h |Omega|: twice the step leaves room for members that spin up.
    """
    for n in range(MOST_FIXED + 1):
        fixed = replace(method, iterations=n)
        trial = run_plan(make_plan(ensemble, fixed, 2.0 * h, 2.0 * h, SaveAt(), dtype), machine.thread_count())
        if not np.any(trial.status == Status.NOT_CONVERGED):
            return n
    return None


class _Progress:
    """Fraction of the vehicle-steps made so far, counted from several threads."""

    def __init__(self, total: int, report: Callable[[float], None] | None):
        self._total, self._done, self._report, self._lock = total, 0, report, threading.Lock()

    def add(self, vehicle_steps: int) -> None:
        if self._report is None:
            return
        with self._lock:
            self._done += vehicle_steps
            self._report(self._done / self._total)


def run_plan(
    plan: Plan,
    threads: int,
    progress: Callable[[float], None] | None = None,
    observed: Observation | None = None,
    fields: Sequence[str] | None = None,
) -> Result:
    """Run every block of the plan, or as many as its statistics need, and gather the result.

    observed: what is kept, by default the samples of all members; fields: which of them, by default all of the plan.
    """
    observed = observed or Observation()
    fields = plan.fields if fields is None else fields
    statistics, watch = observed.watch(plan.grid.times)
    compile_seconds = plan.compile()
    n = plan.ensemble.members
    outcomes, samples = Outcomes(plan), Samples(plan, fields) if observed.samples else None
    gathered = Gathered(plan, statistics) if statistics else None
    keepers: tuple[Keeper, ...] = tuple(one for one in (outcomes, samples, gathered) if one is not None)
    counter = _Progress(n * plan.grid.steps, progress)
    stop = threading.Event()

    def work(block: Block) -> tuple[Any, ...] | None:
        return run_block(plan, block, keepers, stop.is_set, counter.add)

    start = time.perf_counter()
    runs = blocks(n)
    with contextlib.closing(thread_executor.run(runs, work, threads, stop)) as done:
        for block, parts in in_order(runs, done):
            for keeper, part in zip(keepers, parts, strict=True):
                keeper.merge(block, part)
            if watch and gathered and watch.due(block.stop) and watch.reached(gathered.estimates(watch.statistic)):
                n = block.stop
                break
    if progress and n < plan.ensemble.members:
        progress(1.0)
    run_seconds = time.perf_counter() - start
    parameters = Drawn(plan.ensemble, n)
    estimates = gathered.result() if gathered else Estimates()
    messages = plan.grid.messages + plan.ensemble.scene.vehicle.warnings + notes(estimates, plan.ensemble, n)
    if watch:
        messages += (watch.report(n, gathered.estimates(watch.statistic) if gathered else ()),)
    indices, kept = again(plan, observed, outcomes.status[:n], fields, threads)
    return Result(
        time=plan.grid.times,
        samples={} if samples is None else {name: values[:, :n] for name, values in samples.fields.items()},
        **of_members(outcomes, n, plan.grid.h),
        parameters=dict(parameters) if samples is not None else parameters,
        messages=messages,
        provenance=provenance(plan)
        | dict(zip(("steps_made", "steps_tried"), outcomes.chosen[:n].mean(axis=0).tolist(), strict=False))
        | ({"members": n} if n < plan.ensemble.members else {})
        | ({} if observed == Observation() else {"observed": observed.to_dict()}),
        terms=tuple(plan.ensemble.scene.terms),
        statistics=estimates,
        kept=kept,
        kept_members=indices,
        compile_seconds=compile_seconds,
        run_seconds=run_seconds,
    )


def of_members(outcomes: Outcomes, n: int, h: float) -> dict[str, Any]:
    """What became of the first n members, as a Result has it (result.OF_MEMBERS)."""
    status, size, warnings = outcomes.status[:n], outcomes.failed_size[:n], outcomes.warnings[:n]
    failed, stopped = status != 0, status >= Status.SURFACE
    # An event's size is the part of its step that was made before it.
    steps_made = outcomes.failed_step[:n] + np.where(stopped, size, 0.0)
    return {
        "status": status.view(StatusArray),
        "failure_time": np.where(failed, steps_made * h, np.nan),
        "failure_value": np.where(failed, np.where(stopped, 0.0, size), np.nan),
        "warnings": warnings.view(WarningArray),
        "warning_time": np.where(warnings != 0, outcomes.warning_step[:n] * h, np.nan),
        "warning_value": outcomes.warning_value[:n],
        "substeps": outcomes.substeps[:n],
    }


def again(
    plan: Plan, observed: Observation, status: np.ndarray, fields: Sequence[str], threads: int
) -> tuple[np.ndarray, Result | None]:
    """Indices of the members whose samples are wanted after all, and their result: the same members, to the same bits."""
    indices = observed.again(status)
    if not len(indices):
        return indices, None
    chosen = indices
    if plan.method.adaptive:
        # A packet chooses its steps: its members stay together.
        width = plan.spec.width
        chosen = np.unique(indices // width)[:, None] * width + np.arange(width)
        chosen = chosen[chosen < plan.ensemble.members]
    result = run_plan(plan.part([int(i) for i in chosen], fields), threads)
    return indices, result if len(chosen) == len(indices) else result.part(np.searchsorted(chosen, indices))


def provenance(plan: Plan) -> dict[str, Any]:
    """Everything that the result follows from: scene, ensemble, settings, versions, machine."""
    return {
        "scene": plan.ensemble.scene.to_dict(),
        "ensemble": plan.ensemble.to_dict(),
        "method": {
            "name": plan.method.name,
            "solver": plan.method.solver,
            "iterations": plan.method.iterations,
            "tolerance": plan.method.residual_tolerance(plan.dtype),
        }
        | ({"alpha": plan.method.alpha, "beta": plan.method.beta} if plan.spec.averages else {})
        | ({"rtol": plan.method.rtol, "atol": plan.method.atol} if plan.method.adaptive else {}),
        "step": plan.grid.h,
        "steps": plan.grid.steps,
        "dtype": plan.dtype,
        "width": plan.spec.width,
        "checks": plan.checks,
        "on_failure": plan.on_failure,
        "terms": [term.type for term, _ in plan.model.laws],
        "versions": machine.versions(),
        "machine": machine.describe(),
    }
