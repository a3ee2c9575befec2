# SPDX-License-Identifier: Apache-2.0
"""The time that a search may spend is its own: other programs, other threads and compiling take none of it away."""

import threading
import time

import pytest

from lgvi_warp.measuring.budget import Budget, rounded_up


def work(seconds):
    """Keep this thread busy."""
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def test_waiting_and_other_threads_cost_nothing():
    budget = Budget(10.0)
    other = threading.Thread(target=work, args=(0.1,))
    other.start()
    time.sleep(0.1)
    other.join()
    assert budget.spent < 0.05
    work(0.1)
    assert 0.1 <= budget.spent < 0.2
    assert not budget.over


def test_what_is_free_does_not_count():
    now = [5.0]
    budget = Budget(3.0, clock=lambda: now[0])
    now[0] += 2.0
    with budget.free():
        now[0] += 100.0
    assert budget.spent == 2.0
    assert not budget.over
    with pytest.raises(KeyError), budget.free():
        now[0] += 50.0
        raise KeyError
    now[0] += 1.5
    assert budget.spent == 3.5
    assert budget.over


@pytest.mark.parametrize(("seconds", "output"), [(0.011, 0.02), (1.0, 1.0), (40.0, 50.0), (51.0, 100.0), (2.1, 3.0)])
def test_a_length_that_is_easy_to_say(seconds, output):
    assert rounded_up(seconds) == pytest.approx(output)
