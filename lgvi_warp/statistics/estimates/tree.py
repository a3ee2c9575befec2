# SPDX-License-Identifier: Apache-2.0
"""Parts of blocks, joined pairwise in a fixed order of block numbers: accurate, bit-reproducible sums."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

# Named arrays that summarise some members for a statistic.
Part = dict[str, np.ndarray]
Join = Callable[[Part, Part, tuple[int, int]], Part]


def arrays_under(arrays: Mapping[str, np.ndarray], head: str) -> Part:
    """The arrays whose names begin with `head`; the head is removed."""
    return {name.removeprefix(head): array for name, array in arrays.items() if name.startswith(head)}


class Tree:
    """Parts of the blocks so far, joined pairwise: at most one part for each level, of 2^level blocks.

    The part (level, i) covers the blocks from i 2^level on. It is joined from its two halves as soon as both have
    arrived, so it does not depend on the order in which blocks arrive.
    """

    def __init__(self, join: Join):
        self._join, self._parts = join, dict[tuple[int, int], Part]()

    def add(self, block: int, part: Part) -> None:
        """Add the part of one block."""
        level, i = 0, block
        while (neighbour := self._parts.pop((level, i ^ 1), None)) is not None:
            earlier, later = (neighbour, part) if i % 2 else (part, neighbour)
            level, i = level + 1, i // 2
            part = self._join(earlier, later, (level, i))
        self._parts[level, i] = part

    def parts(self) -> list[Part]:
        """Return the parts that wait for a neighbour, in the order of the blocks."""
        return [part for _, part in sorted(self._parts.items(), key=lambda item: item[0][1] << item[0][0])]
