"""To be said in one sentence."""

from __future__ import annotations

import contextlib
import pickle
import signal
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future
from typing import Any, Protocol, runtime_checkable

from lgvi_warp.common.errors import SceneError
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.work import Work

# Called with a block and the vehicle-steps made of it so far, from any thread.
Advanced = Callable[[Block, int], None]


# A block whose worker died this many times is not tried again: the block itself may be what kills them.
MOST_DEATHS = 3


@runtime_checkable
class Executor(Protocol):
    """Runs blocks, in any order and anywhere: the bits do not depend on it."""

    def run(self, work: Work, blocks: Sequence[Block], advanced: Advanced) -> Generator[tuple[Block, Any], None, None]:
        """Do the work of every block; each block and its result, as they are done. Closing it ends what still runs."""


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


def ended(futures: Mapping[Future[Any], Block]) -> Iterator[tuple[Block, Any]]:
    """Blocks that came to their end, of those whose run was interrupted."""
    for future, block in futures.items():
        if future.done() and not future.cancelled() and future.exception() is None and future.result() is not None:
            yield block, future.result()
