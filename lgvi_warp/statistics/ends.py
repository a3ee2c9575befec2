# SPDX-License-Identifier: Apache-2.0
"""Outcomes and end times of a block's members: data for statistics of outcomes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.common.status import Status, failed, stopped

# Outcomes that comprise several statuses: any event, any failure.
STOPPED, FAILED = "stopped", "failed"


@dataclass(frozen=True)
class Ends:
    """The ends of n members: `Status` (n,), number of the stopping event (n,), from 1, or 0, and time (n,) [s].

    The time is the time of the event or of the failure; for other members, the end of the run.
    """

    status: np.ndarray
    event: np.ndarray
    time: np.ndarray
    events: tuple[str, ...] = ()

    def are(self, outcome: str) -> np.ndarray:
        """Mask of members (n,) with this outcome."""
        if outcome in self.events:
            return np.asarray(self.event == 1 + self.events.index(outcome))
        if outcome == STOPPED:
            return stopped(self.status)
        if outcome == FAILED:
            return failed(self.status)
        return np.asarray(self.status == Status[outcome.upper()])


def outcomes(events: Iterable[str], statuses: Iterable[Status]) -> list[str]:
    """Names of the outcomes that members of a scene can have.

    Args:
        events: names of the scene's events.
        statuses: statuses of these events.

    Returns:
        Names of the events, of their statuses and of failures, and "stopped" and "failed".
    """
    failures = (status for status in Status if not status.stopped)
    names = [*events, STOPPED, FAILED, *(status.name.lower() for status in (*statuses, *failures))]
    return list(dict.fromkeys(names))


def check_outcomes(key: str, outcomes: Sequence[str], known: Sequence[str]) -> None:
    """Refuse outcomes that no member of a scene can have."""
    faults = Faults()
    for name in outcomes:
        if name not in known:
            faults.add(key, name, "is not an outcome of this scene", closest(name, known))
    faults.raise_if_any()
