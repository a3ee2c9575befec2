"""To be said in one sentence."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.keepers.observation import Observation, Observing
from lgvi_warp.engine.plan import Plan
from lgvi_warp.methods.saveat import FIELDS
from lgvi_warp.runs.provenance import messages, provenance
from lgvi_warp.runs.result import Result
from lgvi_warp.runs.store.folder import Folder
from lgvi_warp.runs.store.kept import KeptRun
from lgvi_warp.runs.store.open import result_of
from lgvi_warp.runs.store.recipe import of_store
from lgvi_warp.runs.store.run import Stored
from lgvi_warp.runs.store.settings import Store


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
