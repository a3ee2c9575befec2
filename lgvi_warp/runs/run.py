"""To be said in one sentence."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.errors import Interrupted, MembersFailed
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.engine.keepers.memory import Outcomes, Samples
from lgvi_warp.engine.keepers.observation import Observation, Observing
from lgvi_warp.engine.loop import Merged, Progress, run_blocks
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.work import Work
from lgvi_warp.runs import member_fields
from lgvi_warp.runs.outcomes import failure_text
from lgvi_warp.runs.provenance import messages, provenance
from lgvi_warp.runs.result import Drawn, Result
from lgvi_warp.scene import plausibility
from lgvi_warp.statistics.estimate import Estimates


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
