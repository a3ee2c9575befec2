# SPDX-License-Identifier: Apache-2.0
"""Commits of blocks: the files of several blocks at a time are made durable, while other blocks are computed."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lgvi_warp.common.files import Files, finish_together

# How long a block waits for others that are made durable with it [s], and the most blocks in the queue.
PERIOD, MOST = 0.1, 64


@dataclass
class Commit:
    """The files of one block, and its marker, which says that all of them are on disk.

    files: The files, written but not yet synced.
    path: Path of the marker.
    done: Future that ends when the block is durable, or with an error.
    """

    files: Files
    path: Path
    marker: bytes
    done: Future[None] = field(default_factory=Future)


class Commits:
    """Queue of the blocks that are written but not durable yet. Used as a context, it waits for them at its end.

    A thread takes all waiting blocks as one group. It syncs their files and moves them to their places, then syncs each
    folder once, and only then does the same with the markers. The next `add`, or the end of the context, raises the
    first error. Blocks without an error are made durable all the same.

    waits: Whether `add` returns only when its block is durable. Copies in other processes wait, because nothing waits
        for the end of these processes. Default False.
    period, most: Time for which a block waits for others [s]; largest number of blocks in the queue.
    """

    def __init__(self, waits: bool = False, *, period: float = PERIOD, most: int = MOST):
        self._waits, self._changed = waits, threading.Condition()
        self._period, self._most = period, most
        self._waiting: list[Commit] = []
        self._at_work = self._ending = False
        self._error: BaseException | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Commits, (True,)

    def add(self, files: Files, path: Path, marker: bytes) -> None:
        """Add a block; wait while the queue is full."""
        commit = Commit(files, path, marker)
        with self._changed:
            self._changed.wait_for(lambda: len(self._waiting) < self._most)
            self._waiting.append(commit)
            self._changed.notify_all()
            if not self._at_work:
                self._at_work = True
                threading.Thread(target=self._work, name="lgvi_warp_commits").start()
        if self._waits:
            commit.done.result()
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
        """Run in its own thread: make group after group durable, until no block waits."""
        while group := self._group():
            try:
                _make_durable(group)
            except BaseException as failure:
                for commit in group:
                    if not commit.done.done():
                        commit.done.set_exception(failure)
            errors = (commit.done.exception() for commit in group)
            self._error = self._error or next((error for error in errors if error is not None), None)

    def _group(self) -> list[Commit]:
        """Take the waiting blocks, after some time in which more may come."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._waits or self._ending or len(self._waiting) == self._most, self._period
            )
            group, self._waiting = self._waiting, []
            self._at_work = bool(group)
            self._changed.notify_all()
            return group


def _make_durable(group: Sequence[Commit]) -> None:
    safe = _finished(group, [commit.files for commit in group])
    marked, markers = [], []
    for commit in safe:
        files = Files(commit.path.parent)
        try:
            files.write(commit.path.name, commit.marker)
        except OSError as error:
            commit.done.set_exception(error)
            continue
        marked.append(commit)
        markers.append(files)
    for commit in _finished(marked, markers):
        commit.done.set_result(None)


def _finished(group: Sequence[Commit], files: Sequence[Files]) -> list[Commit]:
    """Return the commits whose files are durable now; the others get their error."""
    safe = []
    for commit, error in zip(group, finish_together(files), strict=True):
        if error is None:
            safe.append(commit)
        else:
            commit.done.set_exception(error)
    return safe
