# SPDX-License-Identifier: Apache-2.0
"""Runs in memory: all blocks of a plan, gathered into a Result."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.errors import Interrupted, MembersFailed
from lgvi_warp.engine.block import Block, parts
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.engine.keepers.memory import Outcomes, Samples
from lgvi_warp.engine.keepers.observation import Observation, Observing
from lgvi_warp.engine.loop import Merged, RunProgress, run_blocks
from lgvi_warp.engine.plan import NotSurveyed, Plan
from lgvi_warp.engine.work import Work
from lgvi_warp.results import member_fields
from lgvi_warp.results.outcomes import begun_beyond, failure_text
from lgvi_warp.results.provenance import at_end, messages, provenance
from lgvi_warp.results.result import Drawn, Result
from lgvi_warp.scene import plausibility
from lgvi_warp.statistics.estimates.estimate import Estimates


def completed(plan: Plan, threads: int, observed: Observation, fields: Sequence[str], **settings: Any) -> Result:
    """Run a plan, and the members again whose samples alone are kept.

    plan: Plan of the run. Where a member beyond those that were looked at needs another kernel, the run begins anew with a
        kernel for all members, so that they have the bits of one kernel.
    """
    try:
        result = run_plan(plan, threads, observed=observed, fields=fields, **settings)
    except NotSurveyed:
        plan = plan.replanned(survey_all=True)
        result = run_plan(plan, threads, observed=observed, fields=fields, **settings)
    return finished(result, plan, observed, fields, threads)


def finished(
    result: Result, plan: Plan, observed: Observation, fields: Sequence[str], threads: int | None = None
) -> Result:
    """Complete a result with the samples of members that are run again, which a store has already."""
    if result.store is None:
        indices, kept = again(plan, observed, result.status, fields, threads)
        if kept is not None:
            result = replace(result, kept=kept, kept_members=indices)
    failed = failure_text(result) if plan.on_failure == "raise" else ""
    if failed:
        raise MembersFailed(failed, result)
    return result


def run_plan(
    plan: Plan,
    threads: int,
    progress: Callable[[float], None] | None = None,
    observed: Observation | None = None,
    fields: Sequence[str] | None = None,
    executor: Executor | None = None,
    partial: bool = False,
    known: Callable[[Plan], tuple[dict[str, Any], tuple[str, ...]]] | None = None,
    warned: bool = True,
    on_block: Callable[[Result], None] | None = None,
) -> Result:
    """Run the blocks of a plan, all or as many as its statistics need, and gather the result in memory.

    known: Function from the plan to provenance and messages, where many runs share them; by default they are made for this
        run.
    """
    observed = observed or Observation()
    compile_seconds = plan.compile()
    total = plan.ensemble.members
    outcomes, samples = Outcomes(plan), Samples(plan, fields) if observed.samples else None
    observing = Observing(observed, plan.grid.times, total, plan.ensemble.replicates)
    keepers = (outcomes, *((samples,) if samples else ()), *observing.keepers)
    overall = RunProgress(total * plan.grid.steps, progress)
    start = time.perf_counter()
    merged = Merged()

    def ended(n: int, whole: bool = True) -> Result:
        seconds = compile_seconds, time.perf_counter() - start
        return _in_memory(plan, n, observed, outcomes, samples, observing if whole else None, fields, known, seconds)

    def after(block: Block) -> None:
        assert on_block is not None
        on_block(_of_block(plan, block, outcomes, samples, known))

    runner = executor or Threads(threads)
    joined = bool(observing.keepers) or not isinstance(runner, Threads)
    runs, work = parts(total, plan.grid.steps, threads, joined), Work(plan, keepers, warned=warned)
    try:
        n = run_blocks(
            work,
            runs,
            runner,
            overall.at,
            enough=observing.enough,
            merged=merged,
            after=after if on_block is not None else None,
        )
    except KeyboardInterrupt as stop:
        if not (partial and merged.done):
            raise
        result = ended(merged.done, merged.begun == merged.done)
        text = f"interrupted: the first {merged.done:,} of {total:,} members were finished"
        raise Interrupted(text, replace(result, messages=(*result.messages, text))) from stop
    if progress and n < total:
        progress(1.0)
    return ended(n)


def again(
    plan: Plan, observed: Observation, status: np.ndarray, fields: Sequence[str], threads: int | None = None
) -> tuple[np.ndarray, Result | None]:
    """Run the members again whose samples are wanted after the run; they have the same bits as in the run.

    status: Status of each member, shape (n,).
    Returns: Indices of these members, shape (m,), and their result, or None if there are none.
    """
    indices = observed.again(status)
    if not len(indices):
        return indices, None
    chosen = plan.with_neighbours(indices)
    result = run_plan(plan.subplan([int(i) for i in chosen], fields), threads or machine.thread_count())
    return indices, result if len(chosen) == len(indices) else result.part(np.searchsorted(chosen, indices))


def _of_block(
    plan: Plan,
    block: Block,
    outcomes: Outcomes,
    samples: Samples | None,
    known: Callable[[Plan], tuple[dict[str, Any], tuple[str, ...]]] | None,
) -> Result:
    """The result of a block's members: their samples and outcomes, without statistics and messages.

    Its arrays are its own: whoever gets it may write into them, and the run goes on with what it has.
    """
    content, _ = (provenance(plan, None), ()) if known is None else known(plan)
    at = slice(block.first, block.stop)
    of_members = {name: values.copy() for name, values in member_fields.of(plan, outcomes.all.at(at)).items()}
    kept = samples.fields if samples and samples.fields else {}
    return Result(
        time=plan.grid.times.copy(),
        samples={name: values[:, at].copy() for name, values in kept.items()},
        **Result.per_member(of_members),
        parameters=Drawn(plan.ensemble, block.stop, block.first),
        messages=(),
        provenance=content | {"members": plan.ensemble.members},
        terms=tuple(plan.ensemble.scene.terms),
    )


def _in_memory(
    plan: Plan,
    n: int,
    observed: Observation,
    outcomes: Outcomes,
    samples: Samples | None,
    observing: Observing | None,
    fields: Sequence[str] | None,
    known: Callable[[Plan], tuple[dict[str, Any], tuple[str, ...]]] | None,
    seconds: tuple[float, float],
) -> Result:
    """The result of the first n members, after so many seconds of compiling and of running.

    observing: their statistics, None if these include other members.
    """
    content, texts = (provenance(plan, observed, fields), messages(plan)) if known is None else known(plan)
    of_members = {name: values[:n] for name, values in member_fields.of(plan, outcomes.all).items()}
    estimates, remarks = Estimates(), tuple[str, ...]()
    if observing is not None:
        estimates, remarks = observing.read(content["ensemble"], of_members["status"])
    # The arrays have room for all members; beyond the last one that ran nothing was written.
    kept = samples.fields if samples and samples.fields else {}
    histories = {name: values[:, :n] for name, values in kept.items()}
    on_the_way = plausibility.on_the_way(plan.ensemble.scene, histories).messages(n) if known is None else ()
    return Result(
        time=plan.grid.times,
        samples=histories,
        **Result.per_member(of_members),
        parameters=Drawn(plan.ensemble, n),
        messages=texts + remarks + on_the_way + begun_beyond(of_members["status"], of_members["failure_time"]),
        provenance=at_end(content, of_members, n, plan.ensemble.members),
        terms=tuple(plan.ensemble.scene.terms),
        statistics=estimates,
        compile_seconds=seconds[0],
        compile_phases=plan.phases,
        run_seconds=seconds[1],
    )
