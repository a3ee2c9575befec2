"""Go on with a run that was stopped; put the parts of one run together; say what a store holds."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

from lgvi_warp.engine.executors import executor_of
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.keepers.observation import Observing, observation_of
from lgvi_warp.engine.keepers.protocol import Keeper
from lgvi_warp.runs.provenance import provenance
from lgvi_warp.runs.result import Result
from lgvi_warp.runs.run import finished
from lgvi_warp.runs.store.folder import ROOT, Folder
from lgvi_warp.runs.store.kept import KeptRun
from lgvi_warp.runs.store.layout_check import understood
from lgvi_warp.runs.store.open import folder_of, result_of
from lgvi_warp.runs.store.recipe import of_store, refuse_another
from lgvi_warp.runs.store.run import Stored
from lgvi_warp.runs.store.solve import went_on
from lgvi_warp.runs.store.state import store_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene


def resume(
    path: str | os.PathLike[str],
    fleet: Ensemble | Scene | None = None,
    *,
    executor: str | Executor = "threads",
    threads: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
    force: bool = False,
    keepers: Sequence[Keeper] = (),
    statistics: Sequence[Any] | None = None,
) -> Result:
    """Go on with a run in a store, or in a folder with one store: it ends with the bytes of a run that was never stopped.

    Every finished block is read and compared with its checksums; what is torn, missing or changed runs again. fleet: the
    ensemble, needed where a scene file cannot tell it (laws of your own). force: on another machine or with other
    versions, where the bits may differ. keepers: those that the run had. statistics: those that it had, needed where they
    are of functions. Raises SceneError, OSError, or MembersFailed as the run was asked to.
    """
    folder = Folder(folder_of(path))
    given = Ensemble.from_scene(fleet) if isinstance(fleet, Scene) else fleet
    plan = folder.plan(given)
    told = folder.provenance.get("observed")
    with understood(folder.path / ROOT):
        observed = observation_of(told, statistics)
    observing = Observing(observed, plan.grid.times, plan.ensemble.members, plan.ensemble.replicates)
    now = of_store(provenance(plan), plan.ensemble) | ({} if told is None else {"observed": told})
    messages = refuse_another(folder.path, folder.provenance, now, force)
    runner = executor_of(executor, threads, scheduler)
    # What the store says stays as it was when it was made, on whatever machine the run goes on.
    run = Stored(
        plan, store_of(folder, force), folder.provenance, folder.messages, (*keepers, *observing.keepers), None,
        observing.enough, KeptRun(observed, tuple((told or {}).get("fields", ()))),
    )  # fmt: skip
    made = run.run(runner, progress)
    told_now = messages + went_on(made)
    result = result_of(made, None, folder.messages + told_now, plan.ensemble.scene.terms, observing)
    return finished(result, plan, observed, (told or {}).get("fields", ()), threads)
