# SPDX-License-Identifier: Apache-2.0
"""Common parts of executors: their protocol, and the transfer of work to other processes."""

from __future__ import annotations

import contextlib
import pickle
import signal
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future
from typing import Any, Protocol, runtime_checkable

from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.sentences import capital
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.work import Work

# Progress callback: takes a block and the vehicle-steps made of it so far, from any thread.
Advanced = Callable[[Block, int], None]


# A block whose worker died this many times is not tried again: the block itself may be the cause.
MOST_DEATHS = 3


@runtime_checkable
class Executor(Protocol):
    """Runs blocks in any order and anywhere; results do not depend on this."""

    def run(self, work: Work, blocks: Sequence[Block], advanced: Advanced) -> Generator[tuple[Block, Any], None, None]:
        """Run all blocks and yield each with its result as it finishes. Closing the generator cancels running blocks."""


@contextlib.contextmanager
def deaf() -> Iterator[None]:
    """Make processes that are started inside ignore interrupts from the terminal, from their start."""
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
    """Pickle the work for another process."""
    try:
        return pickle.dumps(work, pickle.HIGHEST_PROTOCOL)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise SceneError([_refusal(name, "cannot be sent to other processes", error)]) from error


def received(data: bytes, name: str) -> Work:
    """Unpickle the work in another process, and load its kernel."""
    try:
        work: Work = pickle.loads(data)
    except (pickle.UnpicklingError, AttributeError, ImportError) as error:
        raise SceneError([_refusal(name, "cannot be read by other processes", error)]) from error
    work.plan.compile()
    return work


def _refusal(name: str, problem: str, error: Exception) -> str:
    remedy = (
        'define laws and functions at the top level of a module that the workers can import, or use executor="threads"'
    )
    return f"executor = {name!r}: the run {problem} ({type(error).__name__}: {error}). {capital(remedy)}"


def finished_blocks(futures: Mapping[Future[Any], Block]) -> Iterator[tuple[Block, Any]]:
    """Blocks that finished although their run was interrupted."""
    for future, block in futures.items():
        done = future.done() and not future.cancelled() and future.exception() is None
        if done and not isinstance(future.result(), Exception | None):
            yield block, future.result()
