# SPDX-License-Identifier: Apache-2.0
"""Runs of a plan into a store, as `solve` makes them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from lgvi_warp.control.signals import ordered
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.keepers.observation import Observation, Observing
from lgvi_warp.engine.plan import Plan
from lgvi_warp.results.provenance import messages, provenance
from lgvi_warp.results.result import Result
from lgvi_warp.store.folder import Folder
from lgvi_warp.store.kept import KeptRun
from lgvi_warp.store.open import result_of
from lgvi_warp.store.recipe import of_store
from lgvi_warp.store.run import StoredRun
from lgvi_warp.store.settings import Store


def run_stored(
    plan: Plan,
    store: Store,
    executor: Executor,
    progress: Callable[[float], None] | None = None,
    only: range | None = None,
    observed: Observation | None = None,
    fields: Sequence[str] | None = None,
    on_block: Callable[[Result], None] | None = None,
) -> Result:
    """Run the blocks of a plan into a store."""
    observed = observed or Observation()
    compile_seconds = plan.compile()
    start = time.perf_counter()
    observing = Observing(observed, plan.grid.times, plan.ensemble.members, plan.ensemble.replicates)
    into = settled(store, plan, observed, fields)
    saved_fields = plan.fields if fields is None else fields
    kept = tuple(name for name in saved_fields if store.fields is None or name in store.fields)
    content = of_store(provenance(plan, observed, kept), plan.ensemble)

    def after(block: Block) -> None:
        assert on_block is not None
        on_block(result_of(Folder(into.folder), slice(block.first, block.stop), terms=plan.ensemble.scene.terms))

    folder = StoredRun(
        plan,
        into,
        content,
        messages(plan),
        observing.keepers,
        only,
        observing.enough,
        KeptRun(observed, kept),
        on_block and after,
    ).run(executor, progress)
    runs = blocks(plan.ensemble.members)
    members = None if only is None else slice(runs[only[0]].first, runs[only[-1]].stop)
    remarks = folder.noted + went_on(folder)
    result = result_of(folder, members, messages(plan) + remarks, plan.ensemble.scene.terms, observing)
    if remarks:
        return result  # what was measured is not the whole run
    seconds = time.perf_counter() - start
    return replace(result, compile_seconds=compile_seconds, compile_phases=plan.phases, run_seconds=seconds)


def went_on(folder: Folder) -> tuple[str, ...]:
    """Tell how many blocks of a run were in the store already."""
    present, ran, ran_kept = folder.found, folder.ran, folder.ran_kept
    if not present:
        return ()
    if not ran and not ran_kept:
        return (f"nothing was missing: {present} of {present} blocks were there and whole",)
    kept = f", and {ran_kept} of kept members" if ran_kept else ""
    return (f"went on: {present} of {present + ran} blocks were there and whole, {ran} ran{kept}",)


def settled(store: Store, plan: Plan, observed: Observation, fields: Sequence[str] | None) -> Store:
    """Settle which samples a store holds: none if those of all members are not kept.

    fields: Names of the fields whose samples are kept; None: all of the plan.
    """
    wanted = set(plan.fields if fields is None else fields) if observed.samples else set()
    stored = wanted if store.fields is None else wanted & set(store.fields)
    return replace(store, fields=ordered(stored))
