# SPDX-License-Identifier: Apache-2.0
"""Parameters of members that are drawn when they are first read."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
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
        self._ensemble, self._first, self._stop = ensemble, first, stop

    @functools.cached_property
    def _drawn(self) -> dict[str, np.ndarray]:
        parameters = self._ensemble.parameters(self._first, self._stop)
        return {name: values.copy() for name, values in parameters.items()}

    def __getitem__(self, name: str) -> np.ndarray:
        return self._drawn[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._drawn)

    def __len__(self) -> int:
        return len(self._drawn)
