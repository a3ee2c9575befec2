# SPDX-License-Identifier: Apache-2.0
"""Loop over all members of an ensemble in groups that need little memory, on all cores."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from lgvi_warp.common import machine

# Members that are checked together: some tens of megabytes per thread.
AT_ONCE = 16_384
Finding = TypeVar("Finding")


def over_members(look: Callable[[int, int], Finding], members: int) -> list[Finding]:
    """Apply a function to all members in groups that need little memory, on all cores."""
    firsts = range(0, members, AT_ONCE)
    if len(firsts) < 2:
        return [look(0, members)] if members else []
    with ThreadPoolExecutor(min(machine.thread_count(), max(1, len(firsts)))) as pool:
        return list(pool.map(lambda first: look(first, min(first + AT_ONCE, members)), firsts))
