"""What a run will take before it begins: time, memory and disk, from a small run of the same plan on this machine."""

from __future__ import annotations

import math
import os
import shutil
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common import machine
from lgvi_warp.common.errors import Faults
from lgvi_warp.engine.block import SHAPES, Block, blocks
from lgvi_warp.engine.executors import check_threads
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.engine.keepers.memory import Samples
from lgvi_warp.engine.keepers.observation import Observation, Observing, observe
from lgvi_warp.engine.keepers.protocol import Keeper
from lgvi_warp.engine.plan import SEGMENT_SAMPLE_BYTES, Plan
from lgvi_warp.engine.work import Work
from lgvi_warp.methods.saveat import SaveAt, TimeGrid
from lgvi_warp.runs import member_fields
from lgvi_warp.runs.sizes import Sizes, sizes
from lgvi_warp.runs.store.create import create
from lgvi_warp.runs.store.folder import Folder
from lgvi_warp.runs.store.kept import group_of
from lgvi_warp.runs.store.layout import columns, size
from lgvi_warp.runs.store.recipe import of_store
from lgvi_warp.runs.store.settings import Store
from lgvi_warp.runs.store.sink import Sink, marker
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

# A trial's time [s]; bytes, and small files, written to learn how fast a disk is.
TRIAL_SECONDS = 0.3
PROBE_BYTES, SYNCS = 64_000_000, 4


@dataclass(frozen=True)
class Prediction:
    """What a run takes. compile, set_up, advance, write: seconds of each part; seconds: of the run without compilation.

    compile is what loading the kernel took now, near 0 if Warp's cache had it. Writing goes on while blocks advance: the
    slower of the two decides. memory: of the process at its peak [bytes], what it holds already included; disk [bytes].
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

    @property
    def seconds(self) -> float:
        """Of the run, without compilation."""
        return self.set_up + max(self.advance, self.write)

    def __str__(self) -> str:
        lines = [
            f"members     {self.members:,} in {self.blocks:,} blocks, {self.steps:,} steps, {self.threads} threads",
            f"time        {_duration(self.seconds)}: set-up {_duration(self.set_up)}, steps {_duration(self.advance)}, disk "
            f"{_duration(self.write)} meanwhile; kernel loaded in {self.compile:.2f} s",
            f"memory      {self.memory / 1e9:.2f} GB" + _share(self.memory, self.free_memory, "the memory"),
            f"disk        {self.disk / 1e9:.3f} GB" + _share(self.disk, self.free_disk, "what is free"),
        ]
        if self.free_memory and self.memory > 0.8 * self.free_memory:
            lines.append("note        more than the memory holds: use --store zarr, save less often or fewer fields")
        if self.free_disk is not None and self.disk > self.free_disk:
            lines.append(
                "note        more than the disk holds: save less often, fewer fields, or --store-dtype float32"
            )
        return "\n".join(lines)


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


def _share(wanted: int, there: int | None, of: str) -> str:
    return f" ({wanted / there:.0%} of {of})" if there else ""


def predict(
    fleet: Ensemble | Scene, *, threads: int | None = None, store: Store | str | None = None, **settings: Any
) -> Prediction:
    """What lw.solve(fleet, **settings) will take, from a trial of about a second on so many threads.

    settings: those of solve that decide the plan and what is kept (method, h, t1, save, dtype, width, checks, statistics,
    keep, until: the whole ensemble is predicted). store: as for solve; the disk is that of its folder. Statistics count
    for time, memory and disk, and so do members of keep=[...], which are run again for their samples; those of
    keep="failed" do not: how many will fail is not known. A run whose cost changes on the way (events, steps that are
    chosen) costs something else. Raises SceneError.
    """
    from lgvi_warp.runs.settle import make_plan
    from lgvi_warp.runs.store.solve import settled

    ensemble = fleet if isinstance(fleet, Ensemble) else Ensemble.from_scene(fleet)
    statistics, keep, until = (settings.pop(name, None) for name in ("statistics", "keep", "until"))
    scene = ensemble.scene
    observed = observe(ensemble.members, scene.run, statistics, keep, until, scene.events)
    fields = (settings.get("save") or SaveAt()).fields
    plan = make_plan(ensemble, **settings, fields=observed.fields)
    compile_seconds = plan.compile()
    faults = Faults()
    check_threads(faults, threads)
    faults.raise_if_any()
    count = threads or machine.thread_count()
    set_up, step = costs(plan, count, observed)
    asked_store = store if isinstance(store, Store) or store is None else Store(store)
    into = settled(asked_store, plan, observed, fields) if asked_store else None
    place = _existing(into.folder) if into else Path.cwd()
    runs = [Sized(plan, into, fields if observed.samples else (), sizes(plan, observed.watch(plan.grid.times)[0]))]
    runs += again(plan, observed, asked_store, fields)
    write, metadata = writing(runs, place, count) if into else (0.0, 0)
    n, steps = ensemble.members, plan.grid.steps
    more = sum(one.plan.ensemble.members for one in runs) / n
    return Prediction(
        members=n,
        steps=steps,
        blocks=len(blocks(n)),
        threads=count,
        compile=compile_seconds,
        set_up=set_up,
        advance=step * steps * more,
        write=write,
        memory=_resident() + memory(runs, count),
        disk=metadata + sum(one.disk for one in runs),
        free_memory=machine.memory_bytes(),
        free_disk=shutil.disk_usage(place).free,
    )


def costs(plan: Plan, threads: int, observed: Observation | None = None) -> tuple[float, float]:
    """Seconds to set up, and of one step of all members with its samples, of all threads together.

    From trials of one block a thread: the steps are doubled until they take long enough, and half of them are taken away
    again, so that what they cost is told from what a block costs before its first step.
    """
    runs = blocks(plan.ensemble.members)
    chosen = runs[:threads]
    steps, most = min(64, plan.grid.steps), plan.grid.steps
    while (high := _seconds(plan, steps, chosen, threads, observed)) < TRIAL_SECONDS and steps < most:
        steps = min(most, steps * max(2, min(64, int(TRIAL_SECONDS / max(high, 1e-4)))))
    half = max(1, steps // 2)
    high = min(high, _seconds(plan, steps, chosen, threads, observed))
    low = min(_seconds(plan, half, chosen, threads, observed) for _ in range(2))
    slope = (high - low) / (steps - half) if steps > half and high > low else high / steps
    # In the last round of a run of few blocks some threads are idle.
    rounds = math.ceil(len(runs) / threads) if len(runs) < 8 * threads else len(runs) / threads
    return max(0.0, high - slope * steps) * rounds, slope * rounds


def _seconds(plan: Plan, steps: int, chosen: list[Block], threads: int, observed: Observation | None) -> float:
    """Time of these blocks until a step, with the samples due by then."""
    due = plan.grid.sample_steps[plan.grid.sample_steps < steps]
    due = np.append(due, steps)
    trial = replace(plan, grid=TimeGrid(plan.grid.h, due, due * plan.grid.h), width=plan.spec.width)
    trial.compile()
    keepers: tuple[Keeper, ...] = (Samples.elsewhere(trial.fields),)
    if observed is not None:
        fleet = plan.ensemble
        gathering = Observing(replace(observed, until=None), trial.grid.times, fleet.members, fleet.replicates)
        keepers = (*(keepers if observed.samples else ()), *gathering.keepers)
    work = Work(trial, keepers)
    start = time.perf_counter()
    for _ in Threads(threads).run(work, chosen, lambda block, vehicle_steps: None):
        pass
    return time.perf_counter() - start


def _result_bytes(plan: Plan, fields: Sequence[str] | None = None) -> int:
    """Of a result in memory, and about those of its file; fields: of its samples, by default all of the plan."""
    k, n = len(plan.grid.times), plan.ensemble.members
    real = np.dtype(machine.DTYPES[plan.dtype]).itemsize
    rows = {name: int(np.prod(SHAPES[name])) * real for name in (plan.fields if fields is None else fields)}
    if plan.spec.compensated and "position" in rows:
        rows["position"] = 24
    one = plan.ensemble.parameters(0, 1)
    varied = sum(one[name].nbytes for name in plan.ensemble.varied())
    return n * (k * sum(rows.values()) + varied + sum(np.dtype(f.dtype).itemsize for f in member_fields.present(plan)))


NO_STATISTICS = Sizes()


@dataclass(frozen=True)
class Sized:
    """A run whose bytes are told: its plan, store (None: in memory), fields of its samples, and its statistics."""

    plan: Plan
    store: Store | None = None
    fields: Sequence[str] | None = None
    statistics: Sizes = NO_STATISTICS

    @property
    def disk(self) -> int:
        """Bytes of its files but for a store's metadata; in memory, about those of its result's file."""
        if self.store is None:
            return _result_bytes(self.plan, self.fields) + self.statistics.estimates
        each = self.statistics.file + len(marker(self._sums()))
        return size(self.plan, self.store) + each * len(blocks(self.plan.ensemble.members))

    def _sums(self) -> dict[str, list[int]]:
        """What a block's marker lists."""
        assert self.store is not None
        block, k = blocks(self.plan.ensemble.members)[0], len(self.plan.grid.times)
        keys = {key: one.bytes for one in columns(self.plan, self.store) for key in one.keys(block, k)}
        keys |= {Sink.parts_key(block): self.statistics.file} if self.statistics.file else {}
        return {key: [count, 2**32 - 1] for key, count in keys.items()}

    @property
    def held(self) -> int:
        """Bytes that it holds at its end: its result, or what a store leaves of it in memory."""
        held = self.statistics.joined + self.statistics.estimates
        if self.store is None:
            return held + _result_bytes(self.plan, self.fields)
        each = sum(np.dtype(one.dtype).itemsize for one in member_fields.present(self.plan))
        return held + each * self.plan.ensemble.members

    def working(self, threads: int) -> int:
        """Bytes of the blocks at work."""
        plan, runs = self.plan, blocks(self.plan.ensemble.members)
        count = min(len(runs), threads)
        row = sum(plan.spec.sample_fields.values()) * np.dtype(machine.DTYPES[plan.dtype]).itemsize
        segment = min(SEGMENT_SAMPLE_BYTES, row * runs[0].count * len(plan.grid.times))
        # A segment's samples: the kernel's, the members' in order, and turned or moved copies. Parts: their rows, and
        # all together.
        each = 3 * segment + 2 * self.statistics.part + self.statistics.taking
        if self.store:
            each += self.statistics.file + sum(one.bytes for one in columns(plan, self.store))
        return count * each


def memory(runs: Sequence[Sized], threads: int) -> int:
    """Bytes that a run and those after it add to the process, at most."""
    peaks = [
        sum(one.held for one in runs[: i + 1]) + max(run.working(threads), run.statistics.reading)
        for i, run in enumerate(runs)
    ]
    return max(peaks)


def again(plan: Plan, observed: Observation, store: Store | None, fields: Sequence[str]) -> list[Sized]:
    """The run of the members that are kept after all, where their indices are known."""
    if isinstance(observed.keep, str):
        return []
    wanted = observed.again(np.zeros(plan.ensemble.members, np.uint8))
    if store is None:
        return [Sized(plan.part(plan.with_neighbours(wanted).tolist(), fields))]
    group = group_of(store, plan, wanted)
    own = tuple(name for name in fields if store.fields is None or name in store.fields)
    return [Sized(plan.part(group.members.tolist(), own), group)]


def writing(runs: Sequence[Sized], folder: Path, threads: int) -> tuple[float, int]:
    """(seconds, bytes): what the disk takes for metadata, chunks and the wait until blocks are safe; bytes of metadata."""
    from lgvi_warp.runs.provenance import messages, provenance

    with tempfile.TemporaryDirectory(dir=folder) as name:
        path = Path(name) / "run.zarr"
        start = time.perf_counter()
        for one in runs:
            assert one.store is not None
            place = path / one.store.folder.relative_to(one.store.whole)
            told = of_store(provenance(one.plan), one.plan.ensemble)
            create(replace(one.store, path=place), one.plan, told, messages(one.plan))
        Folder(path).finish()
        begin = time.perf_counter() - start
        metadata = sum(one.stat().st_size for one in path.rglob("*") if one.is_file())
        start = time.perf_counter()
        for i in range(SYNCS):
            durable.write_whole(Path(name) / f"{i}", b"0")
        # The files of a run's last blocks, then their markers.
        wait = 2.0 * (time.perf_counter() - start) / SYNCS * len(runs)
    return begin + sum(one.disk for one in runs) / disk_speed(folder, threads) + wait, metadata


def disk_speed(folder: Path, threads: int) -> float:
    """Bytes per second that so many threads write into a folder, synced."""
    data = np.random.default_rng(0).bytes(PROBE_BYTES // threads)

    def write(i: int) -> None:
        durable.write_whole(place / f"{i}", data)

    with tempfile.TemporaryDirectory(dir=folder) as name, ThreadPoolExecutor(threads) as pool:
        place = Path(name)
        start = time.perf_counter()
        list(pool.map(write, range(threads)))
        return len(data) * threads / (time.perf_counter() - start)


def _existing(folder: Path) -> Path:
    """The nearest folder above that is there."""
    folder = folder.absolute()
    while not folder.is_dir():
        folder = folder.parent
    return folder


def _resident() -> int:
    """Bytes of this process in memory; 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 0
