# SPDX-License-Identifier: Apache-2.0
"""Runs of a plan into a store, for `solve` and `resume`."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.sentences import sentences
from lgvi_warp.control.signals import ordered
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.keepers.final import FINAL, Finals
from lgvi_warp.engine.keepers.observation import Observing, observation_of
from lgvi_warp.engine.keepers.protocol import Keeper
from lgvi_warp.engine.plan import Plan
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.provenance import messages, provenance
from lgvi_warp.results.result import Result
from lgvi_warp.runs.request import Request, ensemble_of
from lgvi_warp.runs.run import refuse_failed
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.store.folder import ROOT, Folder
from lgvi_warp.store.kept import KeptRun
from lgvi_warp.store.layout_check import corrupt_store_as_scene_error
from lgvi_warp.store.open import result_of
from lgvi_warp.store.recipe import of_store, refuse_another, stored_ensemble
from lgvi_warp.store.run import StoredRun
from lgvi_warp.store.settings import Store
from lgvi_warp.store.state import store_of


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
    into, kept_fields = with_saved_fields(store, request)
    compile_seconds = plan.compile()
    start = time.perf_counter()

    def after(block: Block) -> None:
        assert on_block is not None
        members = slice(block.first, block.stop)
        on_block(result_of(Folder(into.folder), members, terms=plan.ensemble.scene.terms))

    content = of_store(provenance(plan, request.observed, kept_fields), plan.ensemble)
    finals = (Finals(in_store=True),) if request.keeps_final else ()
    run = StoredRun(plan, into, content, messages(plan), finals, only, after=on_block and after)
    result, remarks = _observed(run, request, kept_fields, progress)
    if not remarks:  # else what was measured is not the whole run
        seconds = time.perf_counter() - start
        result = replace(result, compile_seconds=compile_seconds, compile_phases=plan.phases, run_seconds=seconds)
    return result if only is not None else refuse_failed(result, plan)


def request_of(
    folder: Folder, fleet: Ensemble | Scene | None = None, statistics: Any = None, executor: Executor | None = None
) -> Request:
    """Rebuild the request of a run in a store, with the steps and settings of its first start.

    fleet, statistics: needed if a store cannot save them.
    """
    recipe = folder.recipe
    grid, arrays = folder.steps_and_arrays()
    with corrupt_store_as_scene_error(folder.path / ROOT):
        return Request(
            stored_ensemble(folder.provenance, arrays, folder.path) if fleet is None else ensemble_of(fleet),
            Method(**recipe["method"]),
            save=SaveAt(fields=tuple(recipe["fields"])),
            **{name: recipe[name] for name in ("dtype", "width", "checks", "on_failure")},
            observed=observation_of(folder.provenance.get("observed"), statistics),
            executor=executor,
            settled=grid,
        )


def resume_stored(
    folder: Folder,
    request: Request,
    progress: Callable[[float], None] | None = None,
    force: bool = False,
    keepers: Sequence[Keeper] = (),
) -> Result:
    """Run the missing blocks of the run in a folder. Provenance and messages of its start are kept, even elsewhere."""
    observed_before = folder.provenance.get("observed")
    with corrupt_store_as_scene_error(folder.path / ROOT):
        plan = request.plan()
    now = of_store(provenance(plan, request.observed), plan.ensemble)
    now |= {} if observed_before is None else {"observed": observed_before}
    noted = refuse_another(folder.path, folder.provenance, now, force)
    finals = (Finals(in_store=True),) if FINAL in folder.recipe["keepers"] else ()
    run = StoredRun(plan, store_of(folder, force), folder.provenance, folder.messages, (*finals, *keepers))
    kept_fields = tuple((observed_before or {}).get("fields", ()))
    return refuse_failed(_observed(run, request, kept_fields, progress, noted)[0], plan)


def _observed(
    run: StoredRun,
    request: Request,
    kept_fields: tuple[str, ...],
    progress: Callable[[float], None] | None,
    noted: tuple[str, ...] = (),
) -> tuple[Result, tuple[str, ...]]:
    """Run with the statistics and kept members of a request. Returns the result, and messages on resumed blocks."""
    plan, observed = run.plan, request.observed
    observing = Observing(observed, plan.grid.times, plan.ensemble.members, plan.ensemble.replicates)
    assert request.executor is not None
    run = replace(
        run,
        keepers=(*run.keepers, *observing.keepers),
        enough=observing.enough,
        last=KeptRun(observed, kept_fields),
    )
    folder = run.run(request.executor, progress)
    remarks = noted + folder.noted + resume_message(folder)
    runs, terms = run.blocks, plan.ensemble.scene.terms
    members = None if run.only is None else slice(runs[0].first, runs[-1].stop)
    return result_of(folder, members, run.messages + remarks, terms, observing), remarks


def blocks_there(only: range | None, plan: Plan) -> range | None:
    """Limit a range of requested blocks to the blocks of the run.

    only: Indices of blocks, in steps of 1; the end may lie beyond the last block. None: all blocks.
    Returns: The indices that exist, or None for all blocks.
    """
    count = len(blocks(plan.ensemble.members))
    if only is None:
        return None
    present = range(only.start, min(only.stop, count))
    if only.step != 1 or only.start < 0 or not present:
        problem = f"are not within the {count} of this run"
        raise SceneError([sentences(f"blocks {only.start}:{only.stop}", problem, f"give 0:{count} or less")])
    return present


def resume_message(folder: Folder) -> tuple[str, ...]:
    """Report how many blocks of a run were already in the store."""
    present, ran, ran_kept = folder.found, folder.ran, folder.ran_kept
    if not present:
        return ()
    if not ran and not ran_kept:
        return (f"nothing was missing: {present} of {present} blocks were there and whole",)
    kept = f", and {ran_kept} of kept members" if ran_kept else ""
    return (f"went on: {present} of {present + ran} blocks were there and whole, {ran} ran{kept}",)


def with_saved_fields(store: Store | str | os.PathLike[str], request: Request) -> tuple[Store, tuple[str, ...]]:
    """Decide which samples a store holds: none unless the samples of all members are kept.

    Returns: The store, and the names of the samples of the members that are kept.
    """
    store = store if isinstance(store, Store) else Store(store)
    kept = tuple(name for name in request.saved if store.fields is None or name in store.fields)
    return replace(store, fields=ordered(kept) if request.observed.samples else ()), kept
