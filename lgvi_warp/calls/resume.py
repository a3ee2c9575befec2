# SPDX-License-Identifier: Apache-2.0
"""`resume`: complete an interrupted run in a store."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

from lgvi_warp.common.arguments import listed
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.engine.executors import executor_of
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.keepers.protocol import Keeper
from lgvi_warp.results.result import Result
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.store.folder import Folder
from lgvi_warp.store.open import folder_of
from lgvi_warp.store.solve import request_of, resume_stored


@shows_progress
def resume(
    path: str | os.PathLike[str],
    fleet: Ensemble | Scene | None = None,
    *,
    executor: str | Executor = "threads",
    threads: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[float], None] | bool | None = None,
    force: bool = False,
    keepers: Sequence[Keeper] = (),
    statistics: Sequence[Any] | None = None,
) -> Result:
    """Complete an interrupted run in a store. The store then has the same bytes as after a run without interruption.

    Every finished block is read and compared with its checksums. Missing, incomplete or changed blocks run again.

    Args:
        path: A store, or a folder with one store.
        fleet: The run's Ensemble, or Scene. Needed if a scene file cannot describe it, as with user-defined distributions.
        executor: "threads" (default), "processes" or "dask", or an object that runs blocks.
        threads: Number of threads; by default as in `lw.solve`.
        scheduler: Address of Dask's scheduler.
        progress: As in `lw.solve`.
        force: Whether to resume on another machine or with other software versions, which may change the bits.
        keepers: The keepers (objects that store a run's data, internal) that were passed to the run.
        statistics: The statistics of the run. Needed if a statistic uses a function, which a store cannot save.

    Returns:
        The result of the complete run, which reads its samples from the store.

    Raises:
        SceneError: If the path holds no run, or the arguments describe another run.
        OSError: If the disk cannot be written.
        MembersFailed: If members failed and the run's on_failure is "raise".

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, store="run.zarr")
        >>> lw.resume("run.zarr").members
        8
    """
    folder = Folder(folder_of(path))
    request = request_of(folder, fleet, statistics, executor_of(executor, threads, scheduler))
    return resume_stored(folder, request, callback(progress), force, listed("keepers", keepers, "keepers"))
