"""The walk from an ensemble to a result."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

from lgvi_warp.common import machine
from lgvi_warp.common.errors import Faults, SceneError, shown
from lgvi_warp.engine.executors import executor_of
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.keepers.observation import Observation, observe
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.runs.result import Result
from lgvi_warp.runs.run import finished, run_plan
from lgvi_warp.runs.settle import blocks_there, make_plan
from lgvi_warp.runs.store.settings import Store
from lgvi_warp.runs.store.solve import run_stored
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene


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
