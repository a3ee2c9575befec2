# SPDX-License-Identifier: Apache-2.0
"""Numbers of members that are drawn at their first use: parameters, and varied numbers of the start."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from lgvi_warp.common.summaries import as_table, few_digits

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.scene.ensemble import Ensemble


class DrawnParameters(Mapping[str, np.ndarray]):
    """Parameters of consecutive members of an ensemble, drawn at their first use.

    Before their first use they take no memory.

    Args:
        ensemble: The ensemble.
        stop: Index after the last member.
        first: Index of the first member; default 0.
    """

    def __init__(self, ensemble: Ensemble, stop: int, first: int = 0):
        self.ensemble, self._first, self._stop = ensemble, first, stop

    def select(self, first: int, stop: int) -> Members:
        """Return parameters and initial states of some of these members; indices count from the first of these members."""
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
        """Table of the first member's numbers, the varied numbers first; other members are not drawn for it."""
        first = type(self)(self.ensemble, self._first + 1, self._first)
        varied = {*self.ensemble.varied(), *self.ensemble.varied_starts()}
        names = sorted(first, key=lambda name: name not in varied)
        texts = [("varies; the first: " if name in varied else "") + few_digits(first[name][0]) for name in names]
        return as_table(f"Numbers of {self._stop - self._first:,} members", list(zip(names, texts, strict=True)))


class GivenParameters(dict[str, np.ndarray]):
    """Numbers of members in memory, each (1, ...) or (n, ...), printed as a table."""

    def __repr__(self) -> str:
        def text(values: np.ndarray) -> str:
            if len(values) == 1:
                return few_digits(values[0])
            spread = f", {values.min():.6g} to {values.max():.6g}" if values.ndim == 1 else ""
            return f"varies: {' x '.join(map(str, values.shape))} numbers{spread}"

        rows = sorted(((name, text(np.asarray(values))) for name, values in self.items()),
                      key=lambda row: not row[1].startswith("varies"))  # fmt: skip
        return as_table(f"Numbers of {max(map(len, self.values()), default=0):,} members", rows)


class DrawnStarts(DrawnParameters):
    """Varied numbers of the start, of consecutive members of an ensemble, drawn at their first use."""

    def _values(self) -> dict[str, np.ndarray]:
        return self.ensemble.starts(self._first, self._stop)

    def __iter__(self) -> Iterator[str]:
        return iter(self.ensemble.varied_starts())

    def __len__(self) -> int:
        return len(self.ensemble.varied_starts())
