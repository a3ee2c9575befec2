# SPDX-License-Identifier: Apache-2.0
"""Commits of blocks: files are made durable several blocks at a time, while others are computed."""

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
    """The files of one block, and its marker, which says that all of them are safe.

    files: The files, written and not synced.
    path: Path of the marker.
    done: Done when the block is durable, or failed.
    """

    files: Files
    path: Path
    marker: bytes
    done: Future[None] = field(default_factory=Future)


class Commits:
    """Queue of the blocks that are written but not durable yet; as a context, it waits for them at its end.

    A thread takes all blocks that wait as one group: it syncs their files and puts them in their places, then syncs each
    folder once, and only then does the same with the markers. The first error is raised by the next `add`, or at the end;
    blocks that can be made durable nevertheless are.

    waits: Whether `add` returns only when its block is durable. Copies in other processes wait, because nothing waits for the
        end of these processes. Default False.
    period, most: How long a block waits for others [s], and the most blocks in the queue.
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
        """Add a block; waits where too many blocks are in the queue."""
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
        """In a thread of its own: make group after group durable, until none waits."""
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
        """Take the blocks that wait, after some time in which more may come."""
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
    """The commits whose files are safe now; the others get their error."""
    safe = []
    for commit, error in zip(group, finish_together(files), strict=True):
        if error is None:
            safe.append(commit)
        else:
            commit.done.set_exception(error)
    return safe
