"""Blocks on their way to the disk: made durable several at a time, while others are computed."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lgvi_warp.common.files import Files, finish_together

# How long a block waits for others that are made durable with it [s], and how many of them at most.
PERIOD, MOST = 0.1, 64


@dataclass
class Commit:
    """The files of a block, and the marker that will say that all of them are safe."""

    files: Files
    path: Path
    marker: bytes
    done: Future[None] = field(default_factory=Future)


class Commits:
    """The blocks of a run that are written and not durable yet; as a context, waits for them at its end.

    A thread takes all that wait as one group: their files are synced and put in their places, then each folder is synced
    once, and only then the same is done with the markers. The first error is raised by the next `add` or at the end; what
    can be made durable nevertheless is.
    waits: `add` returns when its block is durable. So do copies in other processes, whose end nobody waits for.
    """

    def __init__(self, waits: bool = False):
        self._waits, self._changed = waits, threading.Condition()
        self._waiting: list[Commit] = []
        self._at_work = self._ending = False
        self._error: BaseException | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Commits, (True,)

    def add(self, files: Files, path: Path, marker: bytes) -> None:
        """Hand over a block; waits where the disk is far behind. Raises OSError, of this or an earlier block."""
        one = Commit(files, path, marker)
        with self._changed:
            self._changed.wait_for(lambda: len(self._waiting) < MOST)
            self._waiting.append(one)
            self._changed.notify_all()
            if not self._at_work:
                self._at_work = True
                threading.Thread(target=self._work, name="lgvi_warp_commits").start()
        if self._waits:
            one.done.result()
        elif self._error is not None:
            raise self._error

    def __enter__(self) -> Commits:
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        with self._changed:
            self._ending = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._at_work)
        if kind is None and self._error is not None:
            raise self._error

    def _work(self) -> None:
        """In a thread of its own: group after group, until nothing waits."""
        while group := self._group():
            try:
                _make_durable(group)
            except BaseException as failure:
                for one in group:
                    if not one.done.done():
                        one.done.set_exception(failure)
            found = (one.done.exception() for one in group)
            self._error = self._error or next((error for error in found if error is not None), None)

    def _group(self) -> list[Commit]:
        """What waits, after some time in which more may come."""
        with self._changed:
            self._changed.wait_for(lambda: self._waits or self._ending or len(self._waiting) == MOST, PERIOD)
            group, self._waiting = self._waiting, []
            self._at_work = bool(group)
            self._changed.notify_all()
            return group


def _make_durable(group: Sequence[Commit]) -> None:
    safe = _finished(group, [one.files for one in group])
    marked, markers = [], []
    for one in safe:
        files = Files(one.path.parent)
        try:
            files.write(one.path.name, one.marker)
        except OSError as error:
            one.done.set_exception(error)
            continue
        marked.append(one)
        markers.append(files)
    for one in _finished(marked, markers):
        one.done.set_result(None)


def _finished(group: Sequence[Commit], files: Sequence[Files]) -> list[Commit]:
    """Those whose files are safe; the others are told what went wrong."""
    safe = []
    for one, error in zip(group, finish_together(files), strict=True):
        if error is None:
            safe.append(one)
        else:
            one.done.set_exception(error)
    return safe
