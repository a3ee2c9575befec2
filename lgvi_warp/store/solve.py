# SPDX-License-Identifier: Apache-2.0
"""Runs of a plan into a store, as `solve` and `resume` make them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace

from lgvi_warp.common.errors import SceneError
from lgvi_warp.control.signals import ordered
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.engine.keepers.observation import Observing
from lgvi_warp.engine.plan import Plan
from lgvi_warp.results.provenance import messages, provenance
from lgvi_warp.results.result import Result
from lgvi_warp.runs.request import Request
from lgvi_warp.store.folder import Folder
from lgvi_warp.store.kept import KeptRun
from lgvi_warp.store.open import result_of
from lgvi_warp.store.recipe import of_store
from lgvi_warp.store.run import StoredRun
from lgvi_warp.store.settings import Store


def run_stored(
    request: Request,
    plan: Plan,
    store: Store | str | os.PathLike[str],
    progress: Callable[[float], None] | None = None,
    only: range | None = None,
    on_block: Callable[[Result], None] | None = None,
) -> Result:
    """Run the blocks of a request's plan into a store."""
    only = blocks_there(only, plan)
    into, kept = with_saved_fields(store, request)
    observed, terms = request.observed, plan.ensemble.scene.terms
    compile_seconds = plan.compile()
    start = time.perf_counter()
    observing = Observing(observed, plan.grid.times, plan.ensemble.members, plan.ensemble.replicates)
    content = of_store(provenance(plan, observed, kept), plan.ensemble)

    def after(block: Block) -> None:
        assert on_block is not None
        on_block(result_of(Folder(into.folder), slice(block.first, block.stop), terms=terms))

    last = KeptRun(observed, kept)
    run = StoredRun(
        plan, into, content, messages(plan), observing.keepers, only, observing.enough, last, on_block and after
    )
    assert request.executor is not None
    folder = run.run(request.executor, progress)
    runs = blocks(plan.ensemble.members)
    members = None if only is None else slice(runs[only[0]].first, runs[only[-1]].stop)
    remarks = folder.noted + resume_message(folder)
    result = result_of(folder, members, messages(plan) + remarks, terms, observing)
    if remarks:
        return result  # what was measured is not the whole run
    seconds = time.perf_counter() - start
    return replace(result, compile_seconds=compile_seconds, compile_phases=plan.phases, run_seconds=seconds)


def blocks_there(only: range | None, plan: Plan) -> range | None:
    """Limit the blocks asked for to those that the run has.

    only: Indices of blocks, in steps of 1; the end may lie beyond the last block. None: all blocks.
    Returns: The indices that exist, or None for all blocks.
    """
    count = len(blocks(plan.ensemble.members))
    if only is None:
        return None
    present = range(only.start, min(only.stop, count))
    if only.step != 1 or only.start < 0 or not present:
        problem = f"are not within the {count} of this run"
        raise SceneError([f"blocks {only.start}:{only.stop}: {problem}; give 0:{count} or less"])
    return present


def resume_message(folder: Folder) -> tuple[str, ...]:
    """Tell how many blocks of a run were in the store already."""
    present, ran, ran_kept = folder.found, folder.ran, folder.ran_kept
    if not present:
        return ()
    if not ran and not ran_kept:
        return (f"nothing was missing: {present} of {present} blocks were there and whole",)
    kept = f", and {ran_kept} of kept members" if ran_kept else ""
    return (f"went on: {present} of {present + ran} blocks were there and whole, {ran} ran{kept}",)


def with_saved_fields(store: Store | str | os.PathLike[str], request: Request) -> tuple[Store, tuple[str, ...]]:
    """Settle which samples a store holds: none if those of all members are not kept.

    Returns: The store, and the names of the samples of the members that are kept.
    """
    store = store if isinstance(store, Store) else Store(store)
    kept = tuple(name for name in request.saved if store.fields is None or name in store.fields)
    return replace(store, fields=ordered(kept) if request.observed.samples else ()), kept
