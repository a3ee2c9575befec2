# SPDX-License-Identifier: Apache-2.0
"""Compilation of kernels before a run, several at a time, each in its own process."""

from __future__ import annotations

import multiprocessing
import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed

from lgvi_warp.common.phases import Phases
from lgvi_warp.engine.executors.base import deaf
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.state_lanes import MANY, kernel_for
from lgvi_warp.runs.request import Request
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene


def plans_of(scene: Scene, methods: Sequence[str], dtypes: Sequence[str]) -> list[Plan]:
    """Plan the runs of a scene by some methods and precisions."""
    ensemble = Ensemble.from_scene(scene)
    plans: dict[tuple[str, str], Plan] = {}
    for method in methods or (None,):
        for dtype in dtypes or (None,):
            plan = Request(ensemble, method, dtype=dtype).plan()
            plans[plan.method.name, plan.dtype] = plan
    return list(plans.values())


def warm(plans: Sequence[Plan], workers: int) -> Iterator[tuple[Plan, Phases]]:
    """Compile the kernels of some plans into Warp's cache."""
    workers = min(workers, len(plans))
    if workers < 2:
        for plan in plans:
            yield plan, _phases(pickle.dumps(plan))
        return
    with deaf():
        pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"))
        waiting = {pool.submit(_phases, pickle.dumps(plan)): plan for plan in plans}
    try:
        for future in as_completed(waiting):
            yield waiting[future], future.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _phases(data: bytes) -> Phases:
    """Compile the kernels of a pickled plan in this process: its step kernel, and the kernel that packs members' states."""
    plan: Plan = pickle.loads(data)
    plan.compile()
    kernel_for(plan.spec, MANY)
    return plan.phases
