# SPDX-License-Identifier: Apache-2.0
"""Prediction of a run's time, memory and disk space, from a short trial of the same plan on this machine."""

from __future__ import annotations

import math
import shutil
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.calls.sizes import Sizes, sizes, with_ends
from lgvi_warp.common import files as durable
from lgvi_warp.common import machine
from lgvi_warp.common.arguments import explained
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.near import near_names
from lgvi_warp.engine.block import Block, blocks, parts
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.engine.keepers.memory import Samples
from lgvi_warp.engine.keepers.observation import Observation, Observing
from lgvi_warp.engine.keepers.protocol import Keeper
from lgvi_warp.engine.launches import SEGMENT_SAMPLE_BYTES
from lgvi_warp.engine.plan import NotSurveyed, Plan
from lgvi_warp.engine.work import Work
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.results import member_fields
from lgvi_warp.runs.request import Request, ensemble_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.store.block_files import BlockFiles, marker
from lgvi_warp.store.create import create, nearest_folder
from lgvi_warp.store.folder import Folder
from lgvi_warp.store.kept import group_of
from lgvi_warp.store.layout import columns, size
from lgvi_warp.store.recipe import of_store
from lgvi_warp.store.settings import Store
from lgvi_warp.store.solve import with_saved_fields

# Least time of a trial [s]; bytes, and number of small files, written to measure the speed of a disk.
TRIAL_SECONDS = 0.3
PROBE_BYTES, SYNCS = 64_000_000, 4


@explained
@dataclass(frozen=True)
class Prediction:
    """Predicted time, memory and disk space of a run.

    Blocks are written while other blocks advance, so the slower of the two determines the time of the run.
    `str(prediction)` is a summary for a user.

    Attributes:
        members: Number of members.
        steps: Number of steps.
        blocks: Number of blocks.
        threads: Number of threads.
        compile: Time to load the kernel in the trial [s]; near 0 if Warp's cache had the kernel.
        set_up: Time to set up all blocks [s].
        advance: Time of the steps of all members [s].
        write: Time to write the store [s].
        memory: Peak memory of the process [bytes], including its memory before the run.
        disk: Size of the store, or the approximate size of the file of a result in memory [bytes].
        free_memory: Memory of the machine [bytes]; None if unknown.
        free_disk: Free space on the disk [bytes]; None if unknown.
        messages: Messages that the run will give about its settings, for example about a shortened step.
    """

    members: int
    steps: int
    blocks: int
    threads: int
    compile: float
    set_up: float
    advance: float
    write: float
    memory: int
    disk: int
    free_memory: int | None
    free_disk: int | None
    messages: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """Time of the run without compilation [s]: the set-up plus the longer of `advance` and `write`."""
        return self.set_up + max(self.advance, self.write)

    def __str__(self) -> str:
        lines = [
            f"members     {self.members:,} in {self.blocks:,} blocks, {self.steps:,} steps, {self.threads} threads",
            f"time        {_duration(self.seconds)}: set-up {_duration(self.set_up)}, steps {_duration(self.advance)}, disk "
            f"{_duration(self.write)} meanwhile; kernel loaded in {self.compile:.2f} s",
            f"memory      {self.memory / 1e9:.2f} GB" + _share(self.memory, self.free_memory, "the memory"),
            f"disk        {self.disk / 1e9:.3f} GB" + _share(self.disk, self.free_disk, "what is free"),
        ]
        lines += [f"note        {text}" for text in self.messages]
        if self.free_memory and self.memory > 0.8 * self.free_memory:
            lines.append("note        more than the memory holds. Use --store zarr, save less often or fewer fields")
        if self.free_disk is not None and self.disk > self.free_disk:
            remedy = "save less often, fewer fields, or --store-dtype float32"
            lines.append(f"note        more than the disk holds: {remedy}")
        return "\n".join(lines)


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


def _share(wanted: int, available: int | None, of: str) -> str:
    return f" ({wanted / available:.0%} of {of})" if available else ""


@near_names(Request.of, Request.__init__)
def predict(
    fleet: Ensemble | Scene, *, threads: int | None = None, store: Store | str | None = None, **settings: Any
) -> Prediction:
    """Predict time, memory and disk space of lw.solve(fleet, **settings) from a trial run of about one second.

    The prediction includes statistics, and the second run of the members that keep=[...] lists. It excludes the second
    run with keep="failed", since the number of failures is not known. With `until`, all members are assumed to run. If
    the cost of a step changes during the run (events, adaptive steps), the time of the run differs from the prediction.

    Args:
        fleet: An Ensemble, or a Scene, whose [ensemble] is then used.
        threads: Number of threads; by default as in `lw.solve`.
        store: As in `lw.solve`; free space is read from the disk of its folder. None, the default, is a run in memory.
        **settings: Arguments of `lw.solve` that determine the plan and the saved data: method, h, t1, save, dtype,
            width, checks, on_failure, statistics, keep, until.

    Returns:
        The prediction.

    Raises:
        SceneError: If arguments are at fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> prediction = lw.predict(fleet, h=0.1, t1=2.0)
        >>> prediction.members, prediction.steps, prediction.seconds > 0.0
        (8, 20, True)
    """
    faults = Faults()
    request = Request.of(faults, ensemble_of(fleet), threads=threads, **settings)
    faults.raise_if_any()
    observed, plan = request.observed, request.plan(survey_all=False)
    count = request.count(plan)
    into, fields = (None, request.saved) if store is None else with_saved_fields(store, request)
    apart, statistics = into is not None or observed.apart, bool(observed.statistics)
    blocks_of_run = parts(plan.ensemble.members, plan.grid.steps, count, apart, statistics)
    compile_seconds = plan.compile()
    try:
        set_up, step = costs(plan, blocks_of_run, count, observed)
    except NotSurveyed:  # as `solve` goes on
        plan = plan.replanned(survey_all=True)
        compile_seconds += plan.compile()
        set_up, step = costs(plan, blocks_of_run, count, observed)
    place = nearest_folder(into.folder) if into else Path.cwd()
    of_statistics = with_ends(
        sizes(plan, observed.watch(plan.grid.times)[0]), plan, into is not None, request.keeps_final
    )
    runs = [Sized(plan, into, fields if observed.samples else (), of_statistics)]
    runs += size_of_rerun(plan, observed, into, fields)
    write, metadata = writing(runs, place, count) if into else (0.0, 0)
    n, steps = plan.ensemble.members, plan.grid.steps
    more = sum(sized.plan.ensemble.members for sized in runs) / n
    return Prediction(
        members=n,
        steps=steps,
        blocks=len(blocks_of_run),
        threads=count,
        compile=compile_seconds,
        set_up=set_up,
        advance=step * steps * more,
        write=write,
        memory=machine.resident() + memory(runs, count),
        disk=metadata + sum(sized.disk for sized in runs),
        free_memory=machine.memory_bytes(),
        free_disk=shutil.disk_usage(place).free,
        messages=plan.grid.messages,
    )


def costs(plan: Plan, runs: Sequence[Block], threads: int, observed: Observation | None = None) -> tuple[float, float]:
    """Measure the time to set up a run, and the time of one step of all members with its samples.

    Trials run one block per thread. The number of steps is doubled until a trial takes long enough; a second trial of
    half the steps separates the cost of a step from the start-up cost of a block.

    observed: Data that the run keeps; None: samples of all members and no statistics.
    Returns: (set-up, one step) [s], for all blocks on all threads.
    """
    chosen = runs[:threads]
    steps, most = min(64, plan.grid.steps), plan.grid.steps
    while (high := _seconds(plan, steps, chosen, threads, observed)) < TRIAL_SECONDS and steps < most:
        steps = min(most, steps * max(2, min(64, int(TRIAL_SECONDS / max(high, 1e-4)))))
    half = max(1, steps // 2)
    high = min(high, _seconds(plan, steps, chosen, threads, observed))
    low = min(_seconds(plan, half, chosen, threads, observed) for _ in range(2))
    slope = (high - low) / (steps - half) if steps > half and high > low else high / steps
    # With few blocks, some threads are idle in the last round: count whole rounds.
    rounds = math.ceil(len(runs) / threads) if len(runs) < 8 * threads else len(runs) / threads
    return max(0.0, high - slope * steps) * rounds, slope * rounds


def _seconds(plan: Plan, steps: int, chosen: Sequence[Block], threads: int, observed: Observation | None) -> float:
    """Time of a trial of these blocks up to a step [s], with the samples due by then."""
    due = plan.grid.sample_steps[plan.grid.sample_steps < steps]
    due = np.append(due, steps)
    trial = plan.replanned(grid=TimeGrid(plan.grid.h, due, due * plan.grid.h))
    trial.compile()
    keepers: tuple[Keeper, ...] = (Samples.elsewhere(trial.fields),)
    if observed is not None:
        fleet = plan.ensemble
        gathering = Observing(replace(observed, until=None), trial.grid.times, fleet.members, fleet.replicates)
        keepers = (*(keepers if observed.samples else ()), *gathering.keepers)
    work = Work(trial, keepers)
    start = time.perf_counter()
    for _, results in Threads(threads).run(work, chosen, lambda block, vehicle_steps: None):
        if isinstance(results, Exception):
            raise results
    return time.perf_counter() - start


def result_bytes(plan: Plan, fields: Sequence[str] | None = None) -> int:
    """Size of a result in memory [bytes]; the size of its file is about the same.

    fields: Names of the sampled fields in the result; None: all fields of the plan.
    """
    k, n = len(plan.grid.times), plan.ensemble.members
    real = np.dtype(machine.DTYPES[plan.dtype]).itemsize
    rows = {
        name: int(np.prod(plan.layout.table[name].shape)) * real for name in (plan.fields if fields is None else fields)
    }
    if plan.spec.compensated and "position" in rows:
        rows["position"] = 24
    first = plan.ensemble.parameters(0, 1)
    varied = sum(first[name].nbytes for name in plan.ensemble.varied())
    return n * (k * sum(rows.values()) + varied + member_fields.size(plan))


NO_STATISTICS = Sizes()


@dataclass(frozen=True)
class Sized:
    """Computes the size of a run in memory and on disk.

    store: Store of the run; None: the run is kept in memory.
    fields: Names of the fields whose samples are kept; None: all fields of the plan.
    statistics: Sizes of its statistics.
    """

    plan: Plan
    store: Store | None = None
    fields: Sequence[str] | None = None
    statistics: Sizes = NO_STATISTICS

    @property
    def disk(self) -> int:
        """Size of the files without a store's metadata [bytes]; for a run in memory, about the size of its result's file."""
        if self.store is None:
            return result_bytes(self.plan, self.fields) + self.statistics.estimates
        each = self.statistics.file + len(marker(self._sums()))
        return size(self.plan, self.store) + each * len(blocks(self.plan.ensemble.members))

    def _sums(self) -> dict[str, list[int]]:
        """Content of a block's marker: files with sizes and checksums, here with the longest possible numbers."""
        assert self.store is not None
        block, k = blocks(self.plan.ensemble.members)[0], len(self.plan.grid.times)
        keys = {key: column.bytes for column in columns(self.plan, self.store) for key in column.keys(block, k)}
        keys |= {BlockFiles.parts_key(block): self.statistics.file} if self.statistics.file else {}
        return {key: [count, 2**32 - 1] for key, count in keys.items()}

    @property
    def held(self) -> int:
        """Memory held at the end of the run [bytes]: the result, or the data that stay in memory when a store is written."""
        held = self.statistics.joined + self.statistics.estimates
        if self.store is None:
            return held + result_bytes(self.plan, self.fields)
        return held + member_fields.size(self.plan) * self.plan.ensemble.members

    def working(self, threads: int) -> int:
        """Compute the memory of the blocks at work [bytes]."""
        plan = self.plan
        apart, statistics = self.store is not None or plan.launches.gathered is not None, self.statistics.part > 0
        runs = parts(plan.ensemble.members, plan.grid.steps, threads, apart, statistics)
        count = min(len(runs), threads)
        row = sum(plan.layout.sizes.values()) * np.dtype(machine.DTYPES[plan.dtype]).itemsize
        segment = min(SEGMENT_SAMPLE_BYTES, row * runs[0].count * len(plan.grid.times))
        # Those gathered at ticks are held once, as the kernel wrote them.
        ticks = plan.launches.ticks_held(runs[0].count) * plan.launches.tick_bytes(runs[0].count)
        # A segment's samples are held three times: as the kernel wrote them, in order of members, and as rotated or moved
        # copies. Parts are held twice: their rows, and all joined.
        gathered = -(-runs[0].count // blocks(plan.ensemble.members)[0].count)
        each = 3 * segment + ticks + 2 * gathered * self.statistics.part + self.statistics.taking
        if self.store:
            each += self.statistics.file + sum(column.bytes for column in columns(plan, self.store))
        return count * each


def memory(runs: Sequence[Sized], threads: int) -> int:
    """Compute the peak memory [bytes] that several runs, one after the other, add to the process."""
    peaks = [
        sum(earlier.held for earlier in runs[: i + 1]) + max(run.working(threads), run.statistics.reading)
        for i, run in enumerate(runs)
    ]
    return max(peaks)


def size_of_rerun(plan: Plan, observed: Observation, store: Store | None, fields: Sequence[str]) -> list[Sized]:
    """Find the sizes of the second run, in which selected members are run again for their samples.

    store: Store of the run; None: the run is kept in memory.
    """
    if isinstance(observed.keep, str):
        return []
    wanted = observed.again(np.zeros(plan.ensemble.members, np.uint8))
    if store is None:
        return [Sized(plan.subplan(plan.with_neighbours(wanted).tolist(), fields))]
    group = group_of(store, plan, wanted)
    return [Sized(plan.subplan(group.members.tolist(), fields), group)]


def writing(runs: Sequence[Sized], folder: Path, threads: int) -> tuple[float, int]:
    """Predict the time of writing a store, from a trial that writes and removes metadata, and from the disk's speed.

    Returns: Time for metadata, chunks and the wait until the disk has the last blocks [s]; size of the metadata
        [bytes].
    """
    from lgvi_warp.results.provenance import messages, provenance

    with tempfile.TemporaryDirectory(dir=folder) as name:
        path = Path(name) / "run.zarr"
        start = time.perf_counter()
        for sized in runs:
            assert sized.store is not None
            place = path / sized.store.folder.relative_to(sized.store.whole)
            content = of_store(provenance(sized.plan), sized.plan.ensemble)
            create(replace(sized.store, path=place), sized.plan, content, messages(sized.plan))
        Folder(path).finish()
        begin = time.perf_counter() - start
        metadata = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
        start = time.perf_counter()
        for i in range(SYNCS):
            durable.write_whole(Path(name) / f"{i}", b"0")
        # At the end of a run it waits twice: for the files of the last blocks, then for their markers.
        wait = 2.0 * (time.perf_counter() - start) / SYNCS * len(runs)
    return begin + sum(sized.disk for sized in runs) / disk_speed(folder, threads) + wait, metadata


def disk_speed(folder: Path, threads: int) -> float:
    """Measure the speed at which all threads together write and sync files [bytes/s]; the files are removed again."""
    data = np.random.default_rng(0).bytes(PROBE_BYTES // threads)

    def write(i: int) -> None:
        durable.write_whole(place / f"{i}", data)

    with tempfile.TemporaryDirectory(dir=folder) as name, ThreadPoolExecutor(threads) as pool:
        place = Path(name)
        start = time.perf_counter()
        list(pool.map(write, range(threads)))
        return len(data) * threads / (time.perf_counter() - start)
