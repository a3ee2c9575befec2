"""Where blocks run: threads of this process, processes of this machine, or workers of a Dask cluster."""

from __future__ import annotations

import contextlib
import multiprocessing
import pickle
import signal
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future
from typing import Any, Protocol, runtime_checkable

from lgvi_warp import machine
from lgvi_warp.blocks import Block, Work
from lgvi_warp.errors import Faults, SceneError, closest

# Called with a block and the vehicle-steps made of it so far, from any thread.
Advanced = Callable[[Block, int], None]

NAMES = ("threads", "processes", "dask")
# Those that start processes of their own.
STARTING = ("processes", "dask")
# Threads, processes or workers: of the largest clusters.
MOST_THREADS = 100_000
# A block whose worker died this many times is not tried again: the block itself may be what kills them.
MOST_DEATHS = 3


@runtime_checkable
class Executor(Protocol):
    """Runs blocks, in any order and anywhere: the bits do not depend on it."""

    def run(self, work: Work, blocks: Sequence[Block], advanced: Advanced) -> Generator[tuple[Block, Any], None, None]:
        """Do the work of every block; each block and its result, as they are done. Closing it ends what still runs."""


def check_threads(faults: Faults, threads: Any) -> None:
    """Note what is wrong with a number of threads."""
    if threads is None:
        return
    remedy = "give 1 or more, or leave it out for all cores"
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        faults.add("threads", threads, "is not a whole number above 0", remedy)
    elif threads > MOST_THREADS:
        faults.add("threads", threads, f"is more than {MOST_THREADS:,}", remedy)


def executor_of(given: Any, threads: int | None = None, scheduler: str | None = None) -> Executor:
    """The executor that a name stands for, with so many threads (default: all cores), or the one given.

    scheduler: the address of a Dask scheduler; without one, "dask" starts a cluster on this machine.
    Raises SceneError, also where no scheduler answers.
    """
    faults = Faults()
    check_threads(faults, threads)
    if not isinstance(given, Executor) and given not in NAMES:
        faults.add("executor", given, "is not known", f"{closest(str(given), NAMES)}; or give an object with run(...)")
    if scheduler is not None and given != "dask":
        faults.add("scheduler", scheduler, "is for the executor dask alone", 'give executor="dask", or leave it out')
    if given in STARTING and scheduler is None and multiprocessing.current_process().daemon:
        what = "starts processes, which a worker of multiprocessing or Celery may not"
        faults.add("executor", given, what, 'use executor="threads" in it, or run outside of it')
    faults.raise_if_any()
    if isinstance(given, Executor):
        return given
    count = threads or machine.thread_count()
    if given == "processes":
        from lgvi_warp.executors.processes import Processes

        return Processes(count)
    if given == "dask":
        from lgvi_warp.executors.dask import Dask

        cluster = Dask(scheduler, count)
        cluster.check()
        return cluster
    from lgvi_warp.executors.threads import Threads

    return Threads(count)


def ended(futures: Mapping[Future[Any], Block]) -> Iterator[tuple[Block, Any]]:
    """Blocks that came to their end, of those whose run was interrupted."""
    for future, block in futures.items():
        if future.done() and not future.cancelled() and future.exception() is None and future.result() is not None:
            yield block, future.result()


@contextlib.contextmanager
def deaf() -> Iterator[None]:
    """Processes that are started inside leave what a terminal sends to all of them to this one, from their first moment."""
    before: dict[int, Any] = {}
    try:
        for number in (getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name)):
            before[number] = signal.signal(number, signal.SIG_IGN)
    except ValueError:  # not in the main thread, where no signal is heard
        yield
        return
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def sent(work: Work, name: str) -> bytes:
    """The work as bytes for another process. Raises SceneError naming what cannot be sent, and why."""
    try:
        return pickle.dumps(work, pickle.HIGHEST_PROTOCOL)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise SceneError([_refusal(name, "cannot be sent to other processes", error)]) from error


def received(data: bytes, name: str) -> Work:
    """The work again, in the process that got it. Raises SceneError where it cannot be read there."""
    try:
        work: Work = pickle.loads(data)
    except (pickle.UnpicklingError, AttributeError, ImportError) as error:
        raise SceneError([_refusal(name, "cannot be read by other processes", error)]) from error
    work.plan.compile()
    return work


def _refusal(name: str, what: str, error: Exception) -> str:
    remedy = (
        'define laws and functions at the top level of a module that the workers can import, or use executor="threads"'
    )
    return f"executor = {name!r}: the run {what} ({type(error).__name__}: {error}); {remedy}"
