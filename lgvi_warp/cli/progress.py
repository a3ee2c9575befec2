"""Show on stderr how far a command is."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import TextIO


class Progress:
    """Shows the fraction done and the time left: in place on a terminal, elsewhere a line every ten seconds.

    Args:
        stream: Where to write.
    """

    def __init__(self, stream: TextIO):
        self._stream, self._start, self._last = stream, time.perf_counter(), 0.0
        self._terminal = stream.isatty()
        self._interval = 0.1 if self._terminal else 10.0
        self._lock, self._shown = threading.Lock(), False

    def __call__(self, fraction: float) -> None:
        """Show the fraction done, at most once per interval.

        Args:
            fraction: Part of the work that is done, 0 to 1.
        """
        now = time.perf_counter() - self._start
        with self._lock:
            if now - self._last < self._interval:
                return
            self._last, self._shown = now, True
            time_left = f", {now * (1.0 / fraction - 1.0):.0f} s left" if fraction > 0.0 else ""
            text = f"{fraction:6.1%}{time_left}"
            self._stream.write(f"\r{text}   " if self._terminal else f"{text}\n")
            self._stream.flush()

    def close(self) -> None:
        """Clear the line on the terminal."""
        if self._terminal and self._shown:
            self._stream.write("\r" + " " * 40 + "\r")
            self._stream.flush()


@contextlib.contextmanager
def shown(quiet: bool) -> Iterator[Progress | None]:
    """Show progress on stderr inside the `with` block, and clear its line afterwards.

    Args:
        quiet: Whether to show nothing.

    Yields:
        The progress to call with fractions; None if quiet.
    """
    progress = None if quiet else Progress(sys.stderr)
    try:
        yield progress
    finally:
        if progress:
            progress.close()


def part_of(progress: Progress | None, i: int, n: int) -> Callable[[float], None] | None:
    """Turn the progress of one part into that of the whole.

    Args:
        progress: Progress of the whole; None for none.
        i: Index of the part.
        n: Number of parts, all equally long.

    Returns:
        A function of the part's fraction; None without a progress.
    """
    return progress and (lambda part: progress((i + part) / n))
