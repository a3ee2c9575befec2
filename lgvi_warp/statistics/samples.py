"""Samples of a block of members: what statistics and stores are handed."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.status import failed


class Fields(dict[str, np.ndarray]):
    """Samples of a block by field, (k times, n members, ...), and what else is known of its members at these times.

    time: (k,) [s]; steps: (k,), made before each time; terms: those of the scene. ends: gives the status (n,) of the members
    and the last step (n,) after which each was its own.
    """

    def __init__(
        self,
        fields: Mapping[str, np.ndarray],
        time: np.ndarray,
        steps: np.ndarray,
        terms: Sequence[Any],
        ends: Callable[[], tuple[np.ndarray, np.ndarray]],
    ):
        super().__init__(fields)
        self.time, self.terms, self._steps, self._when_ended = time, terms, steps, ends

    def last(self) -> Fields:
        """The last of these samples alone."""
        last = {name: values[-1:] for name, values in self.items()}
        return Fields(last, self.time[-1:], self._steps[-1:], self.terms, self._when_ended)

    @functools.cached_property
    def _ends(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Status of each member and the step after which it is no more its own; None if all still are."""
        status, step = self._when_ended()
        return (status, step) if np.any(status) else None

    def good(self, held: bool = True) -> np.ndarray | None:
        """(k, n), which members had not failed by each time; None: none had. held: one that an event stopped has not."""
        if self._ends is None:
            return None
        status, step = self._ends
        ended = failed(status) if held else status != 0
        if not ended.any():
            return None
        return np.asarray(~ended | (self._steps[:, None] <= step))
