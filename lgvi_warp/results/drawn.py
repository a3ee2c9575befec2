# SPDX-License-Identifier: Apache-2.0
"""Numbers of members that are drawn when they are first read: parameters, and those of the start."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.scene.ensemble import Ensemble


class DrawnParameters(Mapping[str, np.ndarray]):
    """Parameters of members of an ensemble that follow each other, drawn when they are first read.

    Before that they take no memory.

    Args:
        ensemble: The ensemble.
        stop: Index after the last member.
        first: Index of the first member; default 0.
    """

    def __init__(self, ensemble: Ensemble, stop: int, first: int = 0):
        self.ensemble, self._first, self._stop = ensemble, first, stop

    def select(self, first: int, stop: int) -> Members:
        """Return parameters and initial states of some of these members, counted from the first of them."""
        return self.ensemble.select(self._first + first, self._first + stop)

    @functools.cached_property
    def _drawn(self) -> dict[str, np.ndarray]:
        return {name: values.copy() for name, values in self._values().items()}

    def _values(self) -> dict[str, np.ndarray]:
        return self.ensemble.parameters(self._first, self._stop)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._drawn[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._drawn)

    def __len__(self) -> int:
        return len(self._drawn)

    def __repr__(self) -> str:
        """The names and the number of members, for which nothing is drawn."""
        few = type(self)(self.ensemble, self._first + 1, self._first) if self._stop > self._first + 1 else self
        return f"{type(self).__name__} of {self._stop - self._first:,} members: {', '.join(few) or 'none'}"


class DrawnStarts(DrawnParameters):
    """Numbers of the start that vary, of members of an ensemble that follow each other, drawn when they are first read."""

    def _values(self) -> dict[str, np.ndarray]:
        return self.ensemble.starts(self._first, self._stop)

    def __iter__(self) -> Iterator[str]:
        return iter(self.ensemble.varied_starts())

    def __len__(self) -> int:
        return len(self.ensemble.varied_starts())
