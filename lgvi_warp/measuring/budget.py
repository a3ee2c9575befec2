# SPDX-License-Identifier: Apache-2.0
"""Processor time that a search may spend: that of the thread which runs it, so that other programs take none of it away."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator


class Budget:
    """Processor time of this thread from now on, without what is free, such as compiling.

    Searches run their members in the thread that asks, so its time is that of the run.
    """

    def __init__(self, seconds: float, clock: Callable[[], float] = time.thread_time):
        self.seconds, self._clock, self._begun = seconds, clock, clock()

    @property
    def spent(self) -> float:
        """Processor time spent so far [s]."""
        return self._clock() - self._begun

    @property
    def over(self) -> bool:
        """Whether all of it is spent."""
        return self.spent > self.seconds

    @contextlib.contextmanager
    def free(self) -> Iterator[None]:
        """Leave out what runs in the `with` block."""
        begun = self._clock()
        try:
            yield
        finally:
            self._begun += self._clock() - begun


def rounded_up(seconds: float) -> float:
    """The next length of a search that is easy to say: 1, 2, 3, 5 or 10 times a power of ten [s]."""
    power = 10.0 ** math.floor(math.log10(seconds))
    return next(nice * power for nice in (1.0, 2.0, 3.0, 5.0, 10.0) if nice * power >= seconds * (1.0 - 1e-9))
