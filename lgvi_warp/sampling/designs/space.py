# SPDX-License-Identifier: Apache-2.0
"""The unit cube of an ensemble: the varied names with their numbers of columns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Space:
    """The unit cube that a sampling fills."""

    seed: int
    keys: tuple[str, ...]
    sizes: tuple[int, ...]
    factors: tuple[tuple[str, tuple[int, ...]], ...]

    @property
    def dimensions(self) -> int:
        """The number of columns of all keys."""
        return sum(self.sizes)

    def split(self, cube: np.ndarray) -> dict[str, np.ndarray]:
        """Split points (n, dimensions) into the columns (n, size) of each key."""
        parts = np.split(cube, np.cumsum(self.sizes)[:-1], axis=1) if self.keys else []
        return dict(zip(self.keys, parts, strict=True))

    def of(self, keys: Iterable[str]) -> Space:
        """The part of the cube that some keys span."""
        wanted = set(keys)
        starts = np.cumsum([0, *self.sizes])
        kept = [i for i, key in enumerate(self.keys) if key in wanted]
        old = [int(c) for i in kept for c in range(starts[i], starts[i + 1])]
        new = {column: place for place, column in enumerate(old)}
        factors = [(label, tuple(new[c] for c in columns)) for label, columns in self.factors if columns[0] in new]
        return Space(self.seed, tuple(self.keys[i] for i in kept), tuple(self.sizes[i] for i in kept), tuple(factors))
