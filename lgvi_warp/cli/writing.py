# SPDX-License-Identifier: Apache-2.0
"""Write the files at the end of a verb in parallel, complete even after an interrupt, and collect failures."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lgvi_warp.cli.signals import Ended
from lgvi_warp.common.errors import MissingExtra, NothingToDraw, install
from lgvi_warp.common.files import place_of
from lgvi_warp.common.sentences import capital

# Longest delay of a signal that arrives just before the main thread begins to wait [s].
PERIOD = 0.2


@dataclass
class Written:
    """Outcome of writing several files."""

    files: list[Path] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    empty: list[str] = field(default_factory=list)
    missing: dict[str, MissingExtra] = field(default_factory=dict)

    def take(self, path: Path, write: Callable[[], Path]) -> None:
        """Write a file into a folder, or record why it was not written."""
        try:
            place_of(path, path.parent)
            self.files.append(write())
        except MissingExtra as error:
            self.missing[path.name] = error
        except NothingToDraw as error:
            self.empty.append(f"{path} was not written: {error}")
        except (OSError, ImportError, ValueError) as error:
            self.faults.append(f"{path} was not written: {error}")

    def draw(self, plot: Callable[..., Any], study: Any, path: Path) -> None:
        """Draw a study's picture, or record why it was not drawn."""

        def drawn() -> Path:
            plot(study, path=path)
            return path

        self.take(path, drawn)

    def note_lines(self) -> list[str]:
        """Say which libraries are missing for pictures."""
        if not self.missing:
            return []
        files, errors = ", ".join(self.missing), self.missing.values()
        extras = ",".join(dict.fromkeys(error.extra for error in errors))
        libraries = " and ".join(dict.fromkeys(error.library for error in errors))
        remedy = f"to have pictures: {install(extras)}"
        return [f"note        {files}: not made without {libraries}. {capital(remedy)}"]


def side_by_side(
    writers: Mapping[Path, Callable[[Path], Path]], *, wait: Callable[..., Any] = wait
) -> dict[Path, Future[Path]]:
    """Write files in parallel, each in its own thread."""
    if not writers:
        return {}
    pool = ThreadPoolExecutor(len(writers))
    jobs: dict[Path, Future[Path]] = {}
    begun: list[Path] = []
    ended: list[Path] = []
    finished: list[Path] = []

    def make(path: Path) -> Path:
        begun.append(path)
        try:
            place_of(path, path.parent)
            finished.append(writers[path](path))
        finally:
            ended.append(path)
        return path

    try:
        for path in writers:
            jobs[path] = pool.submit(make, path)
        while wait(jobs.values(), timeout=PERIOD).not_done:
            pass
        pool.shutdown()
    except KeyboardInterrupt:
        pool.shutdown(cancel_futures=True)
        while len(begun) > len(ended):  # the pool does not wait for a thread that it was just starting
            time.sleep(0.01)
        raise (Ended(f"written: {', '.join(map(str, finished))}") if finished else KeyboardInterrupt()) from None
    return jobs
