# SPDX-License-Identifier: Apache-2.0
"""Budget of processor time for a search. Only the thread of the search counts, so other programs use none of it."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator


class Budget:
    """Processor time of this thread from now on, except for blocks marked as free, such as compiling.

    A search runs its members in the calling thread, so this thread's time is the time of the runs.
    """

    def __init__(self, seconds: float, clock: Callable[[], float] = time.thread_time):
        self.seconds, self._clock, self._begun = seconds, clock, clock()

    @property
    def spent(self) -> float:
        """Processor time spent so far [s]."""
        return self._clock() - self._begun

    @property
    def over(self) -> bool:
        """True if the whole budget is spent."""
        return self.spent > self.seconds

    @contextlib.contextmanager
    def free(self) -> Iterator[None]:
        """Do not count the time of the `with` block."""
        begun = self._clock()
        try:
            yield
        finally:
            self._begun += self._clock() - begun


def rounded_up(seconds: float) -> float:
    """Round a duration up to 1, 2, 3, 5 or 10 times a power of ten [s]."""
    power = 10.0 ** math.floor(math.log10(seconds))
    return next(nice * power for nice in (1.0, 2.0, 3.0, 5.0, 10.0) if nice * power >= seconds * (1.0 - 1e-9))
