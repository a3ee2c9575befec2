"""How far a command is, on stderr."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import TextIO


class Progress:
    """Fraction done and time left, on a terminal in place, elsewhere a line now and then."""

    def __init__(self, stream: TextIO):
        self._stream, self._start, self._last = stream, time.perf_counter(), 0.0
        self._terminal = stream.isatty()
        self._interval = 0.1 if self._terminal else 10.0
        self._lock, self._shown = threading.Lock(), False

    def __call__(self, fraction: float) -> None:
        """Take note of the fraction of the work that is done."""
        now = time.perf_counter() - self._start
        with self._lock:
            if now - self._last < self._interval:
                return
            self._last, self._shown = now, True
            left = f", {now * (1.0 / fraction - 1.0):.0f} s left" if fraction > 0.0 else ""
            text = f"{fraction:6.1%}{left}"
            self._stream.write(f"\r{text}   " if self._terminal else f"{text}\n")
            self._stream.flush()

    def close(self) -> None:
        """Leave the terminal's line clean."""
        if self._terminal and self._shown:
            self._stream.write("\r" + " " * 40 + "\r")
            self._stream.flush()


@contextlib.contextmanager
def shown(quiet: bool) -> Iterator[Progress | None]:
    """Progress on stderr, whose line is clean afterwards, whatever happens; None where nothing is to be said."""
    progress = None if quiet else Progress(sys.stderr)
    try:
        yield progress
    finally:
        if progress:
            progress.close()


def part_of(progress: Progress | None, i: int, n: int) -> Callable[[float], None] | None:
    """Progress of the whole from that of its part i of n."""
    return progress and (lambda part: progress((i + part) / n))
