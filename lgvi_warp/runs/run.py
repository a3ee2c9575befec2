# SPDX-License-Identifier: Apache-2.0
"""Runs in memory: all blocks of a plan, gathered into a Result."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Interrupted, MembersFailed
from lgvi_warp.engine import single_block
from lgvi_warp.engine.block import Block, parts
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.engine.keepers.final import Finals, Rows
from lgvi_warp.engine.keepers.memory import Outcomes, Samples
from lgvi_warp.engine.keepers.observation import Observation, Observing
from lgvi_warp.engine.keepers.speeds import Speeds
from lgvi_warp.engine.loop import Merged, RunProgress, run_blocks
from lgvi_warp.engine.outcome import MemberStatus
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.work import Work
from lgvi_warp.results import member_fields
from lgvi_warp.results.drawn import DrawnParameters, DrawnStarts
from lgvi_warp.results.final import final_of
from lgvi_warp.results.outcomes import failure_text, remarks_on
from lgvi_warp.results.provenance import at_end, messages, provenance_but_scene, when_read
from lgvi_warp.results.result import Result
from lgvi_warp.sampling.final import Final
from lgvi_warp.scene import plausibility
from lgvi_warp.statistics.estimates.estimate import Estimates

# Function from a plan to its provenance, as in `provenance_but_scene`, and messages.
Known = Callable[[Plan], tuple[dict[str, Any], tuple[str, ...]]]


def refuse_failed(result: Result, plan: Plan) -> Result:
    """Return the result, or raise MembersFailed if members failed and on_failure is "raise"."""
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
    known: Known | None = None,
    warned: bool = True,
    on_block: Callable[[Result], None] | None = None,
    final: bool = False,
    slopes: Any = None,
) -> Result:
    """Run the blocks of a plan, all or as many as its statistics need, and gather the result in memory.

    fields: Names of the samples to keep; None: all fields of the plan.
    known: Function from the plan to provenance and messages, if many runs share them; by default they are made for this
        run.
    final: Whether the result has `final`, from which another run can continue.
    slopes: The keeper of the derivatives of a run with tangents.
    """
    total, runner, merged = plan.ensemble.members, executor or Threads(threads), Merged()
    compile_seconds = plan.compile()
    gathered = _Gathered(plan, observed or Observation(), fields, known, final)
    overall = RunProgress(total * plan.grid.steps, progress)
    start = time.perf_counter()

    def ended(n: int, complete: bool = True) -> Result:
        return gathered.result(n, complete, compile_seconds, time.perf_counter() - start)

    def after(block: Block) -> None:
        assert on_block is not None
        on_block(gathered.of_block(block))

    apart, statistics = gathered.observed.apart or not isinstance(runner, Threads), bool(gathered.observing.keepers)
    runs = parts(total, plan.grid.steps, threads, apart, statistics)
    if gathered.speeds is None and not (apart or statistics) and on_block is None and single_block.fits(plan, runs):
        gathered.take_all(*single_block.run_single_block(plan, gathered.names, warned, overall.at, final))
        return ended(total)
    work = Work(plan, gathered.keepers if slopes is None else (*gathered.keepers, slopes), warned=warned)
    try:
        n = run_blocks(
            work, runs, runner, overall.at, enough=gathered.observing.enough, merged=merged,
            after=after if on_block is not None else None,
        )  # fmt: skip
    except KeyboardInterrupt as stop:
        if not (partial and merged.done):
            raise
        result = ended(merged.done, merged.begun == merged.done)
        text = f"interrupted: the first {merged.done:,} of {total:,} members were finished"
        raise Interrupted(text, replace(result, messages=(*result.messages, text))) from stop
    if progress and n < total:
        progress(1.0)
    return ended(n)


class _Gathered:
    """Data that a run in memory gathers; it builds the results from them."""

    def __init__(
        self, plan: Plan, observed: Observation, fields: Sequence[str] | None, known: Known | None, final: bool
    ):
        self.plan, self.observed, self.fields, self.known = plan, observed, fields, known
        self._finals = Finals() if final else None
        # Samples in memory tell of implausible speeds.
        self.speeds = None if observed.samples or known else Speeds()
        self.observing = Observing(observed, plan.grid.times, plan.ensemble.members, plan.ensemble.replicates)
        self._whole: tuple[dict[str, np.ndarray], MemberStatus, Rows] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the samples to keep."""
        if not self.observed.samples:
            return ()
        return self.plan.fields if self.fields is None else tuple(self.fields)

    @functools.cached_property
    def keepers(self) -> tuple[Any, ...]:
        """The keepers of a run by blocks: for outcomes, for samples if these are kept, and for statistics."""
        samples = (Samples(self.plan, self.fields),) if self.observed.samples else ()
        others = (keeper for keeper in (self._finals, self.speeds) if keeper is not None)
        return (Outcomes(self.plan), *samples, *self.observing.keepers, *others)

    def take_all(self, samples: dict[str, np.ndarray], outcome: MemberStatus, rows: Rows) -> None:
        """Store data gathered without keepers: samples and outcome of all members, and the rows of their final states."""
        self._whole = samples, outcome, rows

    @property
    def outcome(self) -> MemberStatus:
        """The outcome of all members."""
        return self._whole[1] if self._whole else self.keepers[0].all

    def histories(self, at: slice) -> dict[str, np.ndarray]:
        """Samples of some members, by field."""
        if self._whole:
            return self._whole[0]
        kept = self.keepers[1].fields if self.observed.samples else None
        return {name: values[:, at] for name, values in (kept or {}).items()}

    def final(self, n: int, states: Mapping[str, np.ndarray], status: np.ndarray) -> Final | None:
        """Final states of the first n members; None if not requested, or if none is complete."""
        if self._finals is None or not n:
            return None
        rows = {name: each[:n] for name, each in (self._whole[2] if self._whole else self._finals.rows(n)).items()}
        return final_of(self.plan, n, {name: values[-1] for name, values in states.items()}, status, rows)

    def of_block(self, block: Block) -> Result:
        """The result of a block's members: their samples and outcomes, without statistics and messages.

        Its arrays are copies: the caller may change them without an effect on the run.
        """
        plan, at = self.plan, slice(block.first, block.stop)
        of_members = {
            name: values.copy() for name, values in member_fields.member_fields(plan, self.outcome.at(at)).items()
        }
        return Result(
            time=plan.grid.times.copy(),
            samples={name: values.copy() for name, values in self.histories(at).items()},
            **Result.per_member(of_members),
            parameters=DrawnParameters(plan.ensemble, block.stop, block.first),
            starts=DrawnStarts(plan.ensemble, block.stop, block.first),
            weights=plan.ensemble.weights(block.first, block.stop),
            messages=(),
            provenance=when_read(provenance_but_scene(plan) | {"members": plan.ensemble.members}),
            terms=tuple(plan.ensemble.scene.terms),
        )

    def result(self, n: int, complete: bool, compile_seconds: float, run_seconds: float) -> Result:
        """The result of the first n members. Without `complete` it has no statistics: these include other members."""
        plan = self.plan
        if self.known is None:
            content, texts = provenance_but_scene(plan, self.observed, self.fields), messages(plan)
        else:
            content, texts = self.known(plan)
        of_members = {name: values[:n] for name, values in member_fields.member_fields(plan, self.outcome).items()}
        estimates, remarks = Estimates(), tuple[str, ...]()
        if complete:
            estimates, remarks = self.observing.read(content["ensemble"], of_members["status"])
        # The arrays have room for all members; beyond the last one that ran nothing was written.
        histories, scene = self.histories(slice(n)), plan.ensemble.scene
        odd = self.speeds.found if self.speeds else plausibility.on_the_way(histories)
        on_the_way = odd.messages(n) if self.known is None else ()
        return Result(
            time=plan.grid.times,
            samples=histories,
            **Result.per_member(of_members),
            parameters=DrawnParameters(plan.ensemble, n),
            starts=DrawnStarts(plan.ensemble, n),
            weights=plan.ensemble.weights(0, n),
            messages=texts + remarks + on_the_way + remarks_on(of_members),
            provenance=when_read(at_end(content, of_members, n, plan.ensemble.members)),
            terms=tuple(scene.terms),
            statistics=estimates,
            end=self.final(n, histories, of_members["status"]),
            compile_seconds=compile_seconds,
            compile_phases=plan.phases,
            run_seconds=run_seconds,
        )
