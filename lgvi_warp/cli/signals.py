# SPDX-License-Identifier: Apache-2.0
"""Signals that end the command from outside: Ctrl-C, SIGTERM, SIGHUP, and a closed terminal."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any, TextIO

NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
# Errors of a terminal or a pipe that nobody reads any more.
GONE = {errno.EPIPE, errno.EIO, errno.ESHUTDOWN}


class Ended(KeyboardInterrupt):
    """An interrupt with a text on the saved files."""


class Signals:
    """A context in which the first signal raises KeyboardInterrupt, and the second ends the process at once.

    A thread waits for the second signal, since the main thread may be in a long call of native code. Ignored signals
    stay ignored; previous handlers are restored at the end. Outside the main thread the context does nothing.
    """

    def __init__(self, what_is_left: Callable[[], str], *, end: Callable[[Signals], None] | None = None):
        self._left, self._end = what_is_left, end or Signals.end_now
        self._before: dict[int, Any] = {}
        # Number of the first signal heard; None without one.
        self.number: int | None = None
        # Whether the end has been reported.
        self.said = False
        # Count of the signal that ends the process at once.
        self._last = 2

    def __enter__(self) -> Signals:
        if threading.current_thread() is not threading.main_thread():
            return self
        for number in (getattr(signal, name) for name in NAMES if hasattr(signal, name)):
            before = signal.getsignal(number)
            if before is not signal.SIG_IGN:
                self._before[number] = before
                signal.signal(number, self._hear)
        reader, self._writer = os.pipe()
        if hasattr(os, "set_blocking"):  # Windows has it from Python 3.12 on, and does not ask for it
            os.set_blocking(self._writer, False)
        self._wakeup = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        self._unraisable, sys.unraisablehook = sys.unraisablehook, self._again
        threading.Thread(target=self._listen, args=(reader,), name="lgvi_warp_signals", daemon=True).start()
        return self

    def __exit__(self, *_: Any) -> None:
        if not self._before:
            return
        for number, before in self._before.items():
            signal.signal(number, before or signal.SIG_DFL)
        signal.set_wakeup_fd(self._wakeup)
        sys.unraisablehook = self._unraisable
        os.close(self._writer)

    @property
    def exit_code(self) -> int:
        """128 plus the signal's number, as in shells; without a signal, the number of Ctrl-C is used."""
        return 128 + (self.number or signal.SIGINT)

    @property
    def text(self) -> str:
        """Cause of the end, as "interrupted by SIGTERM"."""
        if self.number in (None, signal.SIGINT):
            return "interrupted"
        return f"interrupted by {signal.Signals(self.number).name}"

    def _hear(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal in the main thread, at its next Python instruction."""
        if self.number is None:
            self.number = number
            raise KeyboardInterrupt

    def _listen(self, reader: int) -> None:
        """Read the numbers of signals in a thread, as they arrive."""
        heard = 0
        with open(reader, "rb", buffering=0) as file:
            while data := file.read(1):
                heard += data[0] in self._before
                if heard == self._last:
                    self.number = self.number or data[0]
                    self._end(self)

    def end_now(self) -> None:
        """End the process after one line, without waiting."""
        try:
            if not self.said:
                os.write(2, f"lgvi-warp: {self.text} twice, ended at once; {self._left()}\n".encode())
        finally:
            os._exit(self.exit_code)

    def _again(self, lost: Any) -> None:
        """Send an interrupt again after a moment, if it arrived where no exception can be raised, as in a finaliser."""
        if isinstance(lost.exc_value, KeyboardInterrupt) and self.number is not None:
            number, self.number = self.number, None
            self._last += 1
            threading.Timer(0.01, os.kill, (os.getpid(), number)).start()
        else:
            self._unraisable(lost)


class Lasting:
    """A stream whose reader may disappear, or that may be None from the start: a run continues without its terminal."""

    # Whether texts are in colors: "auto", "always" or "never".
    color = "auto"

    def __init__(self, stream: TextIO | None):
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text, unless the reader has disappeared."""
        self._unless_gone(lambda stream: stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Flush the stream, unless the reader has disappeared."""
        self._unless_gone(lambda stream: stream.flush())

    def isatty(self) -> bool:
        """Tell whether the stream is a terminal."""
        return self._stream is not None and self._stream.isatty()

    def _unless_gone(self, act: Callable[[TextIO], Any]) -> None:
        if self._stream is None:
            return
        try:
            act(self._stream)
        except OSError as error:
            if error.errno not in GONE:
                raise
            self._stream = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class Streams:
    """A context in which standard output and standard error are `Lasting`."""

    def __enter__(self) -> Streams:
        self._before = sys.stdout, sys.stderr
        sys.stdout, sys.stderr = (Lasting(stream) for stream in self._before)
        return self

    @staticmethod
    def color(choice: str) -> None:
        """Choose whether output is colored."""
        for stream in (sys.stdout, sys.stderr):
            stream.color = choice  # type: ignore[union-attr]

    def __exit__(self, *_: Any) -> None:
        with contextlib.suppress(OSError):
            sys.stdout.flush()
        sys.stdout, sys.stderr = self._before
