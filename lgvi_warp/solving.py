"""The walk from an ensemble to a result."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp import machine, member_fields
from lgvi_warp.blocks import Work, blocks
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.errors import Faults, SceneError, shown
from lgvi_warp.executors import Executor, executor_of
from lgvi_warp.executors.threads import Threads
from lgvi_warp.keepers import Outcomes, Samples
from lgvi_warp.method import Method
from lgvi_warp.plan import Plan
from lgvi_warp.result import Result
from lgvi_warp.running import Progress, Stored, run_blocks
from lgvi_warp.saveat import SaveAt, time_grid
from lgvi_warp.scene import Scene
from lgvi_warp.status import Status
from lgvi_warp.store import Store
from lgvi_warp.stored import result_of


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
    checks: str = "safe",
    progress: Callable[[float], None] | None = None,
    store: Store | str | os.PathLike[str] | None = None,
    executor: Executor | str = "threads",
    scheduler: str | None = None,
    only: range | None = None,
) -> Result:
    """Advance every member of the fleet from t = 0 to t1 and keep the samples asked for.

    fleet: an Ensemble, or a Scene for its own ensemble (one vehicle if it has none).
    method: a name or a Method. h, t1: step and end [s]. dtype: "float64", "float32", or "float32_compensated", which
    keeps each number of the state as a sum of two (many short steps, far from the origin). What is left out is taken from
    the scene's [run] section (method "psi_s" and float64 where it says nothing).
    save: what to keep (default: every [run] save_every of the scene, else the start and the end).
    threads: default all cores. width: vehicles per packet, default from the CPU.
    checks: "safe" gives each member a status and freezes it when it fails; "none" leaves that code out.
    progress: called with the fraction of the work that is done, from the threads that do it.
    store: a folder "runs/x/run.zarr", or a Store with more settings: samples go there block by block and not into memory,
    and a run that was stopped goes on with lw.resume. executor: "threads", "processes" or "dask", or an object that runs
    blocks; scheduler: the address of Dask's. only: with a store, the blocks to run, range(0, 100), for a run in parts:
    the result then is of their members.

    Raises SceneError naming every fault of the arguments. Prints nothing. The same inputs give the same bits for any
    number of threads, on one type of machine.
    """
    if not isinstance(fleet, Ensemble | Scene):
        raise SceneError(
            [f"fleet = {shown(fleet)}: is neither an Ensemble nor a Scene; give lw.Scene(...) or lw.Ensemble(...)"]
        )
    ensemble = fleet if isinstance(fleet, Ensemble) else Ensemble.from_scene(fleet)
    plan = make_plan(ensemble, method, h, t1, save, dtype, width=width, checks=checks)
    runner = executor_of(executor, threads, scheduler)
    if store is None:
        if only is not None:
            raise SceneError([f"only = {only}: is for a run into a store; give store=..., or leave it out"])
        return run_plan(plan, threads or machine.thread_count(), progress, runner)
    check_blocks(only, plan)
    return run_stored(plan, store if isinstance(store, Store) else Store(store), runner, progress, only)


def check_blocks(only: range | None, plan: Plan) -> None:
    """The blocks of a run in parts must be there. Raises SceneError."""
    count = len(blocks(plan.ensemble.members))
    if only is not None and not (only.step == 1 and len(only) and only[0] >= 0 and only[-1] < count):
        raise SceneError(
            [f"blocks {only.start}:{only.stop}: are not within the {count} of this run; give 0:{count} or less"]
        )


def make_plan(
    ensemble: Ensemble,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    *,
    width: int | None = None,
    checks: str = "safe",
) -> Plan:
    """Settle a run's settings, from the arguments and then from the scene's [run]. Raises SceneError."""
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
    chosen = method if isinstance(method, Method) else Method(method or settings.method)
    dtype = dtype or settings.dtype
    if chosen.iterations == "auto":
        chosen = replace(chosen, iterations=enough_iterations(ensemble, chosen, grid.h, dtype))
        n = chosen.iterations
        number = f"{n} a solve, enough for" if n is not None else f"to the tolerance: {MOST_FIXED} are too few for"
        text = f"Newton steps {number} every member's start at twice the step"
        grid = replace(grid, messages=(*grid.messages, text))
    return Plan(ensemble, chosen, grid, save.fields, dtype, width, checks)


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


def run_plan(
    plan: Plan, threads: int, progress: Callable[[float], None] | None = None, executor: Executor | None = None
) -> Result:
    """Run every block of the plan and gather the result in memory; executor: default so many threads."""
    compile_seconds = plan.compile()
    n = plan.ensemble.members
    outcomes, samples = Outcomes(plan), Samples(plan)
    made = Progress(n * plan.grid.steps, progress)
    start = time.perf_counter()
    run_blocks(Work(plan, (outcomes, samples)), blocks(n), executor or Threads(threads), made.at)
    run_seconds = time.perf_counter() - start
    assert samples.fields is not None
    return Result(
        time=plan.grid.times,
        samples=samples.fields,
        **Result.per_member(member_fields.of(plan, outcomes)),
        parameters=plan.ensemble.parameters(0, n),
        messages=messages(plan),
        provenance=provenance(plan)
        | dict(zip(("steps_made", "steps_tried"), outcomes.chosen.mean(axis=0).tolist(), strict=False)),
        terms=tuple(plan.ensemble.scene.terms),
        compile_seconds=compile_seconds,
        run_seconds=run_seconds,
    )


def run_stored(
    plan: Plan, store: Store, executor: Executor, progress: Callable[[float], None] | None, only: range | None = None
) -> Result:
    """Run every block of the plan, or `only` some, into a store, and give a result that reads from it."""
    compile_seconds = plan.compile()
    start = time.perf_counter()
    folder = Stored(plan, store, provenance(plan), messages(plan), (), only).run(executor, progress)
    runs = blocks(plan.ensemble.members)
    members = None if only is None else slice(runs[only[0]].first, runs[only[-1]].stop)
    result = result_of(folder, members, messages(plan), plan.ensemble.scene.terms)
    return replace(result, compile_seconds=compile_seconds, run_seconds=time.perf_counter() - start)


def messages(plan: Plan) -> tuple[str, ...]:
    """What the user should know before the run."""
    return plan.grid.messages + tuple(plan.ensemble.scene.vehicle.warnings)


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
        "terms": [term.type for term, _ in plan.model.laws],
        "kernel": plan.kernel_hash,
        "versions": machine.versions(),
        "machine": machine.describe(),
    }
