# SPDX-License-Identifier: Apache-2.0
"""Calls timed in turn by processor time: other work on the machine lengthens it least, and can only lengthen it."""

import time
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

from lgvi_warp.measuring.cost import in_turn


def least(
    calls: Sequence[Callable[[], Any]],
    rounds: int,
    begins: Sequence[Callable[[], Any]] = (),
    clock: Callable[[], float] = time.thread_time,
) -> list[float]:
    """The least time of each call [s].

    Args:
        calls: They take turns, so that what slows the machine for a while slows them all.
        rounds: Turns of each.
        begins: What comes before each call and is not timed; by default nothing.
        clock: Of this thread by default; time.process_time counts all threads of the process.
    """
    best = [float("inf")] * len(calls)
    for _ in range(rounds):
        for i, call in enumerate(calls):
            if begins:
                begins[i]()
            begun = clock()
            call()
            best[i] = min(best[i], clock() - begun)
    return best


def interleaved(
    calls: Sequence[Callable[[], None]], rounds: int = 5, *, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Median wall time of calls in turn [s], after one call of each to warm up."""
    in_turn(calls, 1, clock)
    return [median(seconds) for seconds in in_turn(calls, rounds, clock)]
