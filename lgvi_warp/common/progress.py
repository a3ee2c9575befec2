# SPDX-License-Identifier: Apache-2.0
"""Progress of a long call: shown in place on a terminal and in a notebook, elsewhere as a line every ten seconds."""

from __future__ import annotations

import contextlib
import functools
import sys
import threading
import time
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, ParamSpec, TextIO, TypeVar

from lgvi_warp.common.errors import refusal
from lgvi_warp.common.near import arguments_of, refuse_unknown

P = ParamSpec("P")
R = TypeVar("R")

# Characters of the bar on a terminal.
BAR = 24
# Time between two looks at what takes long [s].
TICK = 1.0
# A call that is expected to take longer than this shows its progress on a terminal [s].
LONG = 10.0


class Progress:
    """Shows the current phase, the finished fraction and the time left: in place, or as a line every ten seconds.

    Args:
        stream: Stream for the output.
        phase: Name of the work before the first fraction above 0; default "compiling".
        in_place: Whether to overwrite the previous line; default None: on a terminal.
        clock: Function that returns the time [s].
        interval: Shortest time between two lines [s]; default None: 0.1 in place and 10 otherwise.
    """

    def __init__(
        self, stream: TextIO, phase: str = "compiling", in_place: bool | None = None, *,
        clock: Callable[[], float] = time.perf_counter, interval: float | None = None,
    ):  # fmt: skip
        self._stream, self._phase = stream, phase
        self._in_place = stream.isatty() if in_place is None else in_place
        self._clock, self._interval = clock, (0.1 if self._in_place else 10.0) if interval is None else interval
        self._start = self._last = clock()
        # The first fraction above 0, from which on the time left is reckoned.
        self._first = self._fraction = 0.0
        self._length = 0
        self._lock, self._closed = threading.Lock(), threading.Event()
        if self._in_place:
            self._show(self._start)
        threading.Thread(target=self._tick, name="progress", daemon=True).start()

    def __call__(self, fraction: float) -> None:
        """Show the finished fraction, at most once per interval."""
        now = self._clock()
        with self._lock:
            if self._first == 0.0 < fraction:
                self._phase, self._start, self._first = "running", now, fraction
            self._fraction = fraction
            if now - self._last >= self._interval:
                self._show(now)

    def _show(self, now: float) -> None:
        """Write the line."""
        self._last, seconds = now, now - self._start
        text = f"{self._phase}, {seconds:.0f} s"
        if self._first > 0.0:
            done = round(BAR * self._fraction)
            bar = f" [{'#' * done}{'.' * (BAR - done)}]" if self._in_place else ""
            text = f"{self._phase}{bar} {self._fraction:.1%}"
        if self._fraction > self._first:
            remaining = seconds * (1.0 - self._fraction) / (self._fraction - self._first)
            text += f", {remaining:.0f} s left"
        padding = " " * (self._length - len(text))
        self._stream.write(f"\r{text}{padding}" if self._in_place else f"{text}\n")
        self._stream.flush()
        self._length = len(text)

    def _tick(self) -> None:
        """Show a phase that takes long without a fraction."""
        while not self._closed.wait(TICK):
            with self._lock, contextlib.suppress(OSError, ValueError):
                now = self._clock()
                if not self._closed.is_set() and now - self._last >= self._interval:
                    self._show(now)

    def close(self) -> None:
        """Clear the line on the terminal."""
        self._closed.set()
        with self._lock:
            if self._in_place:
                self._stream.write("\r" + " " * self._length + "\r")
                self._stream.flush()


class NotebookBar:
    """A bar of tqdm in a notebook."""

    def __init__(self, tqdm: Any):
        self._bar = tqdm(total=1.0, desc="compiling", bar_format="{desc} {percentage:3.0f}% |{bar}| {remaining} left")
        self._lock = threading.Lock()

    def __call__(self, fraction: float) -> None:
        """Show the finished fraction."""
        with self._lock:
            if fraction > 0.0 == self._bar.n:
                self._bar.set_description_str("running")
            self._bar.update(fraction - self._bar.n)

    def close(self) -> None:
        """Leave the bar unchanged."""
        self._bar.close()


def bar(
    *, modules: Mapping[str, Any] = sys.modules, load: Callable[[str], Any] = import_module
) -> Progress | NotebookBar:
    """Start the display of a call's progress: a bar of tqdm in a notebook that has it, otherwise `Progress` on stderr."""
    notebook = "ipykernel" in modules
    if notebook:
        with contextlib.suppress(ImportError):
            return NotebookBar(load("tqdm.auto").tqdm)
    return Progress(sys.stderr, in_place=notebook or None)


def shows_progress(call: Callable[P, R]) -> Callable[P, R]:
    """Decorator: `progress=True` shows the function's progress, and unknown keywords are refused with the nearest one.

    Returns: The same function, which also takes True (a bar on a terminal or in a notebook, lines elsewhere) and False
        (nothing).
    """
    names = arguments_of(call)
    known = None if names is None else frozenset(names)

    @functools.wraps(call)
    def wrapper(*args: P.args, **settings: P.kwargs) -> R:
        if known is not None and not known.issuperset(settings):
            refuse_unknown(call, settings, names)
        progress = settings.get("progress")
        if progress is not None and not isinstance(progress, bool) and not callable(progress):
            raise refusal(
                "progress", progress, "is not a function", "give True, or a function of the fraction that is done"
            )
        if progress is not True:
            return call(*args, **settings)
        shown = bar()
        try:
            return call(*args, **settings | {"progress": shown})  # type: ignore[arg-type]
        finally:
            shown.close()

    return wrapper


class LateBar:
    """A bar that appears if a call takes long: predicted from its pace, or after some time."""

    def __init__(
        self, begin: Callable[[], Progress | NotebookBar] = bar, clock: Callable[[], float] = time.perf_counter
    ):
        self._begin, self._clock, self._start = begin, clock, clock()
        self._bar: Progress | NotebookBar | None = None

    def __call__(self, fraction: float) -> None:
        """Take the finished fraction; show it if the whole call takes long."""
        passed = self._clock() - self._start
        if self._bar is None and passed > 1.0 and passed > LONG * fraction:
            self._bar = self._begin()
        if self._bar is not None:
            self._bar(fraction)

    def close(self) -> None:
        """End the bar, if it was shown."""
        if self._bar is not None:
            self._bar.close()


def shows_if_long(call: Callable[P, R]) -> Callable[P, R]:
    """Decorator: a function shows its progress on a terminal if it takes long and `progress` is None.

    Returns: The same function, with this meaning of `progress=None`.
    """

    @functools.wraps(call)
    def wrapper(*args: P.args, **settings: P.kwargs) -> R:
        if settings.get("progress") is not None or not sys.stderr.isatty():
            return call(*args, **settings)
        late = LateBar()
        try:
            return call(*args, **settings | {"progress": late})  # type: ignore[arg-type]
        finally:
            late.close()

    return wrapper


def callback(progress: Callable[[float], None] | bool | None) -> Callable[[float], None] | None:
    """Convert the `progress` argument of a function with `shows_progress` to a function of the fraction.

    progress: The function, False or None.
    Returns: The function; None without progress.
    """
    return progress if callable(progress) else None
