# SPDX-License-Identifier: Apache-2.0
"""Blocks on the workers of a Dask cluster, on one or many machines; a dead worker loses only its current block."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import time
import uuid
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from lgvi_warp.common import machine
from lgvi_warp.common.errors import SceneError, install
from lgvi_warp.common.sentences import sentences
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.executors.base import MOST_DEATHS, Advanced, deaf, received, sent
from lgvi_warp.engine.work import Work

# Interval at which a worker reports its progress [s].
PERIOD = 0.2
# How long a scheduler may take to answer [s].
TIMEOUT = 10.0


@dataclass(frozen=True)
class Dask:
    """Runs blocks on a Dask cluster.

    scheduler: address of the scheduler, or a distributed.Client; None (default) starts a cluster on this machine.
    """

    scheduler: Any = None
    workers: int = 1

    def run(self, work: Work, blocks: Sequence[Block], advanced: Advanced) -> Generator[tuple[Block, Any], None, None]:
        """Run all blocks and yield each with its result."""
        data, topic = sent(work, "dask"), f"lgvi_warp-{uuid.uuid4()}"
        with self._client() as client:
            from distributed import KilledWorker, as_completed

            kind = machine.kind()
            # A task, not data put on a worker: when that worker dies, the scheduler makes it again.
            held = client.submit(bytes, data, pure=False)
            client.subscribe_topic(topic, lambda event: advanced(Block(*event[1][:2]), event[1][2]))
            waiting = {client.submit(_work, held, block, topic, kind, pure=False, retries=0): block for block in blocks}
            try:
                for future in as_completed(list(waiting), loop=client.loop):
                    block = waiting.pop(future)
                    value = future.result()
                    advanced(block, block.count * work.plan.grid.steps)
                    yield block, value
            except KilledWorker as error:
                raise RuntimeError(
                    f"workers died {MOST_DEATHS} times over a block: too little memory, or killed from outside. Give them "
                    "more memory"
                ) from error
            finally:
                client.unsubscribe_topic(topic)
                if waiting:
                    client.cancel(list(waiting))
                    # A block that is running when the run ends must not write into the store afterwards.
                    with contextlib.suppress(OSError, TimeoutError):
                        client.run(_end, topic, on_error="ignore")

    def check(self) -> None:
        """Check that the scheduler responds, before anything is written."""
        if isinstance(self.scheduler, str):
            with self._client():
                pass

    @contextlib.contextmanager
    def _client(self) -> Iterator[Any]:
        # Not the default one of this process: Dask collections and xarray's locks of the caller must not come to depend on it.
        try:
            import distributed
        except ImportError as error:
            raise SceneError([f"executor = 'dask': {error}. Install it: {install('cluster')}"]) from error
        if isinstance(self.scheduler, distributed.Client):
            yield self.scheduler
            return
        if self.scheduler is not None:
            try:
                client = distributed.Client(self.scheduler, timeout=TIMEOUT, set_as_default=False)
            except (OSError, ValueError, MemoryError) as error:  # memory: what answers is no scheduler
                problem = f"does not answer ({type(error).__name__}: {error})"
                remedy = "give the address that dask scheduler prints"
                raise SceneError([sentences(f"scheduler = {self.scheduler!r}", problem, remedy)]) from error
            with client:
                yield client
            return
        import logging

        with deaf():
            cluster = distributed.LocalCluster(
                n_workers=self.workers, threads_per_worker=1, processes=True, memory_limit=None, dashboard_address=None,
                # The scheduler's own pages: any free port, and of this machine alone.
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"}, silence_logs=logging.CRITICAL,
            )  # fmt: skip
        with cluster, distributed.Client(cluster, set_as_default=False) as client:
            yield client


@functools.lru_cache(maxsize=2)
def _received(data: bytes) -> Work:
    return received(data, "dask")


def _work(data: bytes, block: Block, topic: str, kind: dict[str, str]) -> Any:
    """On a worker: run one block, if the worker's machine is of the same kind as the client's."""
    worker_kind = machine.kind()
    if worker_kind != kind:
        raise SceneError(
            [f"worker {worker_kind} is not of the kind of the machine that asks, {kind}, and would give other bits; "
             "let workers be of one kind, and run from one of them"]
        )  # fmt: skip
    tasks_at_work[topic] += 1
    try:
        return _received(data)(block, lambda: topic in _ended, _teller(topic, block))
    finally:
        tasks_at_work[topic] -= 1


# On a worker: number of running blocks of each run, and runs that ended early.
tasks_at_work: Counter[str] = Counter()
_ended: set[str] = set()


async def _end(topic: str) -> None:
    """On a worker: halt the blocks of a run, and wait until none is running."""
    _ended.add(topic)
    while tasks_at_work[topic] > 0:
        await asyncio.sleep(0.05)


def _teller(topic: str, block: Block) -> Callable[[int], None]:
    """Make a function that reports a block's progress to the client, at most once every PERIOD."""
    from distributed import get_worker

    worker, last = get_worker(), 0.0

    def tell(steps: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last > PERIOD:
            last = now
            worker.log_event(topic, [block.first, block.stop, steps])

    return tell
