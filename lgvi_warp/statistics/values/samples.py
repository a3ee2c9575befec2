# SPDX-License-Identifier: Apache-2.0
"""Samples of a block of members, as statistics and stores receive them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.status import failed


class Fields(dict[str, np.ndarray]):
    """Samples of a block by field name: arrays (k, n, ...) for k sample times and n members.

    fields: the arrays by name, such as "position" (k, n, 3) [m].
    time: (k,) [s], sample times.
    steps: (k,), number of steps before each sample time.
    ends: function that returns the status (n,) of the members, and the last step (n,) after which each was still running.
    controller: the controller of the scene; None (the default) if there is none.
    events: the events of the scene; by default none.
    """

    def __init__(
        self,
        fields: Mapping[str, np.ndarray],
        time: np.ndarray,
        steps: np.ndarray,
        terms: Sequence[Any],
        ends: Callable[[], tuple[np.ndarray, np.ndarray]],
        controller: Any = None,
        events: Sequence[Any] = (),
    ):
        super().__init__(fields)
        self.time, self.terms, self._steps, self._when_ended = time, terms, steps, ends
        self.controller, self.events = controller, events

    def last(self) -> Fields:
        """Return the samples at the last sample time."""
        return self.at(np.array([len(self.time) - 1]))

    def at(self, places: np.ndarray) -> Fields:
        """Return the samples at some sample times, by their indices (m,)."""
        values = {name: values[places] for name, values in self.items()}
        others = self.time[places], self._steps[places], self.terms, self._when_ended, self.controller, self.events
        return type(self)(values, *others)

    def of_members(self, some: slice) -> Fields:
        """Return the samples of some members, as views."""
        values = {name: values[:, some] for name, values in self.items()}

        def ends() -> tuple[np.ndarray, np.ndarray]:
            # Asked once of all members, whatever number of parts they come in.
            status, step = self._all_ends
            return status[some], step[some]

        return type(self)(values, self.time, self._steps, self.terms, ends, self.controller, self.events)

    @functools.cached_property
    def _all_ends(self) -> tuple[np.ndarray, np.ndarray]:
        return self._when_ended()

    @functools.cached_property
    def _ends(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Status (n,) of each member and the last step (n,) after which it still ran; None if all are still running."""
        status, step = self._all_ends
        return (status, step) if np.any(status) else None

    def good(self, held: bool = True) -> np.ndarray | None:
        """Return the mask (k, n) of members that are valid at each time; None if all are valid at all times."""
        if self._ends is None:
            return None
        status, step = self._ends
        ended = failed(status) if held else status != 0
        if not ended.any():
            return None
        return np.asarray(~ended | (self._steps[:, None] <= step))
