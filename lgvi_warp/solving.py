"""The walk from an ensemble to a result."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp import machine, member_fields, plausibility
from lgvi_warp.blocks import Work, blocks
from lgvi_warp.ensemble import AT_ONCE, Ensemble
from lgvi_warp.errors import Faults, Interrupted, MembersFailed, SceneError, shown
from lgvi_warp.executors import Executor, executor_of
from lgvi_warp.executors.threads import Threads
from lgvi_warp.keepers import Outcomes, Samples
from lgvi_warp.kept import KeptRun
from lgvi_warp.method import Method
from lgvi_warp.observation import Observation, Observing, observe
from lgvi_warp.outcomes import failure_text
from lgvi_warp.plan import Plan
from lgvi_warp.recipe import of_store
from lgvi_warp.result import Drawn, Result
from lgvi_warp.running import Merged, Progress, Stored, run_blocks
from lgvi_warp.saveat import FIELDS, SaveAt, time_grid
from lgvi_warp.scene import Scene
from lgvi_warp.statistics.estimate import Estimates
from lgvi_warp.status import Status
from lgvi_warp.store import Folder, Store
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
    checks: str | None = None,
    on_failure: str | None = None,
    progress: Callable[[float], None] | None = None,
    statistics: Sequence[Any] | None = None,
    keep: str | Sequence[int] | None = None,
    until: Any = None,
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
    checks: "safe" (default) gives each member a status and freezes it when it fails, and warns of what its numbers and its
    start say against the step; "all" also warns of what arises on the way; "none" leaves all that code out.
    on_failure: "freeze" (default) keeps a member that fails at its last good state; "raise" raises MembersFailed after the
    run; "substep" makes a step that has no solution again in 2, 4, ... 1024 parts, for that member alone: order and the
    symmetry of each step are kept, symplecticity is not.
    progress: called with the fraction of the work that is done, from the threads that do it.
    statistics: gathered over the members at every sample time while the run goes: lw.Mean("position"), ...; they are
    in result.statistics. keep: "all" samples of members (default); "none", so that memory grows with neither members nor
    steps; "failed" (not those that an event stopped), or indices of members: those are run again after the run, to the same
    bits, and are result.kept.
    until: lw.Until(...), to stop before the last member, once a statistic's interval is narrow enough; False: never, whatever
    the scene says (statistics=() likewise gathers none).
    store: a folder "runs/x/run.zarr", or a Store with more settings: samples go there block by block and not into memory,
    and a run that was stopped goes on with lw.resume. executor: "threads", "processes" or "dask", or an object that runs
    blocks; scheduler: the address of Dask's. only: with a store, the blocks to run, range(0, 100), for a run in parts
    (the last may ask for more than there are): the result then is of their members.

    Raises SceneError naming every fault of the arguments, MembersFailed as asked. Prints nothing. The same inputs give the
    same bits for any number of threads, on one type of machine. A run in memory that Ctrl-C interrupts raises Interrupted, a
    KeyboardInterrupt whose `result` has the members that were finished.
    """
    if not isinstance(fleet, Ensemble | Scene):
        raise SceneError(
            [f"fleet = {shown(fleet)}: is neither an Ensemble nor a Scene; give lw.Scene(...) or lw.Ensemble(...)"]
        )
    ensemble = fleet if isinstance(fleet, Ensemble) else Ensemble.from_scene(fleet)
    faults = Faults()
    observed, runner = Observation(), None
    with faults.including():
        observed = observe(ensemble.members, ensemble.scene.run, statistics, keep, until, ensemble.scene.events)
    with faults.including():
        runner = executor_of(executor, threads, scheduler)
    if only is not None and store is None:
        faults.add("only", only, "is for a run into a store", "give store=..., or leave it out")
    if only is not None and observed.until is not None:
        faults.add("only", only, "runs in parts, where until looks at the whole", "leave out one of them")
    faults.raise_if_any()
    assert runner is not None
    plan = make_plan(
        ensemble, method, h, t1, save, dtype, width=width, checks=checks, on_failure=on_failure, fields=observed.fields
    )
    asked, count = (save or SaveAt()).fields, threads or machine.thread_count()
    if store is None:
        result = run_plan(plan, count, progress, observed, asked, runner, partial=True)
        return finished(result, plan, observed, asked, count)
    only = blocks_there(only, plan)
    into = store if isinstance(store, Store) else Store(store)
    result = run_stored(plan, into, runner, progress, only, observed, asked)
    return result if only is not None else finished(result, plan, observed, asked, count)


def finished(
    result: Result, plan: Plan, observed: Observation, fields: Sequence[str], threads: int | None = None
) -> Result:
    """The result with the samples of members that are wanted after all, which a store has. Raises MembersFailed."""
    if result.store is None:
        indices, kept = again(plan, observed, result.status, fields, threads or machine.thread_count())
        result = replace(result, kept=kept, kept_members=indices)
    failed = failure_text(result) if plan.on_failure == "raise" else ""
    if failed:
        raise MembersFailed(failed, result)
    return result


def blocks_there(only: range | None, plan: Plan) -> range | None:
    """The blocks of a run in parts that it has: the last part may ask for more. Raises SceneError where it has none."""
    count = len(blocks(plan.ensemble.members))
    if only is None:
        return None
    there = range(only.start, min(only.stop, count))
    if only.step != 1 or only.start < 0 or not there:
        raise SceneError(
            [f"blocks {only.start}:{only.stop}: are not within the {count} of this run; give 0:{count} or less"]
        )
    return there


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


def run_plan(
    plan: Plan,
    threads: int,
    progress: Callable[[float], None] | None = None,
    observed: Observation | None = None,
    fields: Sequence[str] | None = None,
    executor: Executor | None = None,
    partial: bool = False,
) -> Result:
    """Run every block of the plan, or as many as its statistics need, and gather the result in memory.

    observed: what is kept, by default the samples of all members; fields: which of them, by default all of the plan.
    executor: by default so many threads. partial: an interrupt raises Interrupted with the members that were finished.
    """
    observed = observed or Observation()
    compile_seconds = plan.compile()
    total = plan.ensemble.members
    outcomes, samples = Outcomes(plan), Samples(plan, fields) if observed.samples else None
    observing = Observing(observed, plan.grid.times, total, plan.ensemble.replicates)
    keepers = (outcomes, *((samples,) if samples else ()), *observing.keepers)
    made = Progress(total * plan.grid.steps, progress)
    start = time.perf_counter()
    merged = Merged()

    def ended(n: int, whole: bool = True) -> Result:
        return _in_memory(
            plan, n, observed, outcomes, samples, observing if whole else None, fields,
            compile_seconds, time.perf_counter() - start,
        )  # fmt: skip

    try:
        n = run_blocks(Work(plan, keepers), blocks(total), executor or Threads(threads), made.at, enough=observing.enough,
                       merged=merged)  # fmt: skip
    except KeyboardInterrupt as stop:
        if not (partial and merged.done):
            raise
        result = ended(merged.done, merged.begun == merged.done)
        text = f"interrupted: the first {merged.done:,} of {total:,} members were finished"
        raise Interrupted(text, replace(result, messages=(*result.messages, text))) from stop
    if progress and n < total:
        progress(1.0)
    return ended(n)


def _in_memory(
    plan: Plan,
    n: int,
    observed: Observation,
    outcomes: Outcomes,
    samples: Samples | None,
    observing: Observing | None,
    fields: Sequence[str] | None,
    compile_seconds: float,
    run_seconds: float,
) -> Result:
    """The result of the first n members; observing: their statistics, None where some are of others as well."""
    told = provenance(plan, observed, fields)
    parameters = Drawn(plan.ensemble, n)
    of_members = {name: values[:n] for name, values in member_fields.of(plan, outcomes.all).items()}
    estimates, said = Estimates(), tuple[str, ...]()
    if observing is not None:
        estimates, said = observing.read(told["ensemble"], of_members["status"])
    # What lies beyond the last member was never written.
    kept = samples.fields if samples and samples.fields else {}
    histories = {name: values[:, :n] for name, values in kept.items()}
    return Result(
        time=plan.grid.times,
        samples=histories,
        **Result.per_member(of_members),
        parameters=dict(parameters) if samples is not None else parameters,
        messages=messages(plan) + said + plausibility.on_the_way(plan.ensemble.scene, histories).messages(n),
        provenance=told
        | {name: float(of_members[name].mean()) for name in ("steps_made", "steps_tried") if name in of_members}
        | ({"members": n} if n < plan.ensemble.members else {}),
        terms=tuple(plan.ensemble.scene.terms),
        statistics=estimates,
        compile_seconds=compile_seconds,
        run_seconds=run_seconds,
    )


def again(
    plan: Plan, observed: Observation, status: np.ndarray, fields: Sequence[str], threads: int
) -> tuple[np.ndarray, Result | None]:
    """Indices of the members whose samples are wanted after all, and their result: the same members, to the same bits."""
    indices = observed.again(status)
    if not len(indices):
        return indices, None
    chosen = plan.with_neighbours(indices)
    result = run_plan(plan.part([int(i) for i in chosen], fields), threads)
    return indices, result if len(chosen) == len(indices) else result.part(np.searchsorted(chosen, indices))


def run_stored(
    plan: Plan,
    store: Store,
    executor: Executor,
    progress: Callable[[float], None] | None = None,
    only: range | None = None,
    observed: Observation | None = None,
    fields: Sequence[str] | None = None,
) -> Result:
    """Run the blocks of the plan, or `only` some, into a store, and give a result that reads from it.

    observed, fields: as for run_plan; where samples of all members are not kept, the store has none.
    """
    observed = observed or Observation()
    compile_seconds = plan.compile()
    start = time.perf_counter()
    observing = Observing(observed, plan.grid.times, plan.ensemble.members, plan.ensemble.replicates)
    into = settled(store, plan, observed, fields)
    asked = plan.fields if fields is None else fields
    kept = tuple(name for name in asked if store.fields is None or name in store.fields)
    told = of_store(provenance(plan, observed, kept), plan.ensemble)
    folder = Stored(
        plan, into, told, messages(plan), observing.keepers, only, observing.enough, KeptRun(observed, kept)
    ).run(executor, progress)
    runs = blocks(plan.ensemble.members)
    members = None if only is None else slice(runs[only[0]].first, runs[only[-1]].stop)
    there = went_on(folder)
    result = result_of(folder, members, messages(plan) + there, plan.ensemble.scene.terms, observing)
    if there:
        return result  # what was measured is not the whole run
    return replace(result, compile_seconds=compile_seconds, run_seconds=time.perf_counter() - start)


def went_on(folder: Folder) -> tuple[str, ...]:
    """What the user should know of a run of which some blocks were there already."""
    found, ran, ran_kept = folder.found, folder.ran, folder.ran_kept
    if not found:
        return ()
    if not ran and not ran_kept:
        return (f"nothing was missing: {found} of {found} blocks were there and whole",)
    kept = f", and {ran_kept} of kept members" if ran_kept else ""
    return (f"went on: {found} of {found + ran} blocks were there and whole, {ran} ran{kept}",)


def settled(store: Store, plan: Plan, observed: Observation, fields: Sequence[str] | None) -> Store:
    """The store with the fields of the samples that it will hold: none where those of all members are not kept."""
    asked = set(plan.fields if fields is None else fields) if observed.samples else set()
    own = asked if store.fields is None else asked & set(store.fields)
    return replace(store, fields=tuple(name for name in FIELDS if name in own))


def messages(plan: Plan) -> tuple[str, ...]:
    """What the user should know before the run."""
    return plan.grid.messages + tuple(plan.ensemble.scene.vehicle.warnings) + odd_before(plan)


def odd_before(plan: Plan) -> tuple[str, ...]:
    """What is odd of the members' numbers, and of where they start: of a large fleet, of where the first ones do."""
    ensemble = plan.ensemble
    varies = ensemble.starts_vary or bool(ensemble.varied() and plausibility.own_flows(ensemble.scene))
    starts = plausibility.of_start(ensemble.scene, ensemble.select(0, min(AT_ONCE, ensemble.members) if varies else 1))
    return plan.model.odd.messages(ensemble.members) + starts.messages(ensemble.members, AT_ONCE)


def provenance(plan: Plan, observed: Observation | None = None, fields: Sequence[str] | None = None) -> dict[str, Any]:
    """Everything that the result follows from: scene, ensemble, settings, versions, machine.

    observed: what is kept of it, told where that is not all; fields: of the samples that are.
    """
    content = {
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
        "kernel": plan.kernel_hash,
        "versions": machine.versions(),
        "machine": machine.describe(),
    }
    if observed is not None and observed != Observation():
        content["observed"] = observed.to_dict() | (
            {} if observed.samples else {"fields": list(plan.fields if fields is None else fields)}
        )
    return content
