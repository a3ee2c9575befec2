# SPDX-License-Identifier: Apache-2.0
"""`solve`: from an ensemble and its settings to a result, in memory or in a store."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

from lgvi_warp.common.arguments import function_of
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.result import Result
from lgvi_warp.runs.measured_error import telling_error
from lgvi_warp.runs.measured_width import with_best_width
from lgvi_warp.runs.request import Request, ensemble_of
from lgvi_warp.runs.tangents import check, run_with_tangents
from lgvi_warp.sampling.final import Final
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.store.settings import Store
from lgvi_warp.store.solve import run_stored


@shows_progress
def solve(
    fleet: Ensemble | Scene,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    *,
    threads: int | None = None,
    width: int | None = None,
    checks: str | None = None,
    on_failure: str | None = None,
    device: str | None = None,
    progress: Callable[[float], None] | bool | None = None,
    statistics: Sequence[Any] | None = None,
    keep: str | Sequence[int] | None = None,
    until: Any = None,
    store: Store | str | os.PathLike[str] | None = None,
    executor: Executor | str = "threads",
    scheduler: str | None = None,
    blocks: range | None = None,
    on_block: Callable[[Result], None] | None = None,
    start: Final | None = None,
    tangents: str | Sequence[str] | None = None,
) -> Result:
    """Advance every member of the fleet from t = 0, or from `start`, to t1 and return the requested samples and statistics.

    An omitted argument is taken from the scene's [run] section; if it is not set there, the default below applies.
    Nothing is printed unless `progress` is True. On one type of machine the same inputs give the same bits for any
    number of threads.

    Args:
        fleet: An Ensemble, or a Scene, whose [ensemble] is then run (one vehicle if the scene has none).
        method: A name or a Method. By default chosen from the scene's forces; "psi_s" for a scene without damping.
        h: Step [s].
        t1: End of the run [s], counted from t = 0.
        save: Fields and times to save. By default one sample per interval `save_every` of the scene's [run], or, if this
            is not set, the start and the end only.
        dtype: "float64" (default), "float32", or "float32_compensated", which stores each number of the state as the
            sum of two float32 (for many short steps, or positions far from the origin).
        threads: Number of threads; by default one per core. A short run has one thread by default (fewer than 2,000
            members, and fewer than a million steps summed over the members).
        width: Number of vehicles in a packet; by default chosen for the CPU.
        checks: "safe" (default) gives each member a status, freezes failed members, and warns if parameters or start do
            not suit the step. "all" also warns of problems during the run. "none" compiles the kernel without checks.
        on_failure: "freeze" (default) keeps a failed member at its last good state. "raise" raises MembersFailed after
            the run. "substep" repeats a step whose equation has no solution, for that member alone, as 2, 4, ... 1024
            shorter steps. Order and symmetry of the method are kept, but not symplecticity.
        device: "cpu", the default, runs on the CPU cores. Any other device, such as "cuda", is refused.
        progress: True shows a bar on a terminal and in a notebook, and lines elsewhere, on stderr. A function is called
            with the finished fraction of the work, in [0, 1], from the working threads. By default nothing is shown.
        statistics: Statistics gathered over the members at every sample time during the run, such as
            lw.statistics.Mean("position"). The estimates are in result.statistics. An empty sequence gathers no
            statistics, even if the scene names some.
        keep: Members whose samples are kept. "all" (default) keeps every member. With "none", memory does not grow with
            members or steps. "failed" or indices of members: these members run again after the run, with the same bits,
            and their samples are in result.kept. A member that an event stopped has not failed.
        until: lw.Until(...) ends the run before all members have run, once the interval of a statistic is narrow enough.
            False runs all members, even if the scene has such a rule.
        store: A folder "runs/x/run.zarr", or a Store with more settings. Samples are written there block by block and
            are not held in memory. lw.resume completes the run if it is interrupted.
        executor: "threads" (default), "processes" or "dask", or an object that runs blocks.
        scheduler: Address of Dask's scheduler.
        blocks: With a store, the blocks to run, such as range(0, 100), for a run in parts. The range may go beyond the
            last block. The result has the members of these blocks.
        on_block: Function to monitor a run. It is called with a copy of each block's Result as soon as the block is
            finished, in the order of the blocks and in the calling thread. By default there is none.
        start: `result.final` of another run of these members, to continue it. With the same settings and numbers, the
            two runs give the same bits as one long run. Samples, statistics and messages cover the new run only. By
            default the members start at t = 0.
        tangents: Name or names of numbers, such as "vehicle.mass" or "start.velocity[0]". The derivatives of all
            samples with respect to these numbers are in result.jacobian. The kernel integrates two derivatives at a
            time with the motion. Each derivative takes the time of one to two runs without derivatives. Default: none.

    Returns:
        A Result, with every member unless `until` or `blocks` selects fewer.

    Raises:
        SceneError: If arguments are at fault; the message names every fault.
        MembersFailed: If members failed and on_failure is "raise".
        Interrupted: If Ctrl-C interrupts a run in memory. It is a KeyboardInterrupt whose `result` has the finished
            members.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0), statistics=[lw.statistics.Mean("depth")])
        >>> result.position.shape
        (3, 8, 3)
        >>> print(f"{result.statistics['mean depth'].value[-1, 0]:.2f} m")
        -0.02 m
    """
    faults = Faults()
    members = ensemble_of(fleet)
    with faults.including():
        members = members if start is None else members.going_on(start)
    request = Request.of(
        faults, members, statistics=statistics, keep=keep, until=until, executor=executor, threads=threads,
        scheduler=scheduler, method=method, h=h, t1=t1, save=save, dtype=dtype, width=width, checks=checks,
        on_failure=on_failure, device=device,
    )  # fmt: skip
    with faults.including():
        function_of("on_block", on_block)
    if blocks is not None and store is None:
        faults.add("blocks", blocks, "is for a run into a store", "give store=..., or leave it out")
    if blocks is not None and request.observed.until is not None:
        faults.add("blocks", blocks, "runs in parts, where until looks at the whole", "leave out one of them")
    faults.raise_if_any()
    names = () if tangents is None else check(request, tangents, store, start, on_block)
    plan = request.plan(survey_all=store is not None)
    # Parts of a run, and other processes and machines, must agree on a width.
    if blocks is None and isinstance(request.executor, Threads) and tangents is None:
        plan = with_best_width(plan, request.count(plan))
    try:
        if names:
            return run_with_tangents(request, plan, names, callback(progress))
        plan = telling_error(plan)
        if store is None:
            report, final = callback(progress), request.keeps_final
            return request.run(plan, progress=report, partial=True, on_block=on_block, final=final)
        return run_stored(request, plan, store, callback(progress), blocks, on_block)
    finally:
        # Packets and their plan refer to each other: their arrays would stay until Python looks for such circles.
        plan.free_packets.clear()
