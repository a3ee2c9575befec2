"""Parts of blocks joined pairwise, in an order that the blocks' numbers fix: sums that are accurate, bits that are equal."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# What a statistic keeps of some members: named arrays.
Part = dict[str, np.ndarray]
Join = Callable[[Part, Part, tuple[int, int]], Part]


class Tree:
    """Parts of the blocks so far: at most one for each level, each of 2^level blocks.

    The part (level, i) is of the blocks from i 2^level on, and is made of its two halves as soon as both are there: what
    it holds does not depend on the order in which blocks come, and of b blocks log2(b) parts are kept.
    """

    def __init__(self, join: Join):
        self._join, self._parts = join, dict[tuple[int, int], Part]()

    def add(self, block: int, part: Part) -> None:
        """Take in the part of a block."""
        level, i = 0, block
        while (beside := self._parts.pop((level, i ^ 1), None)) is not None:
            left, right = (beside, part) if i % 2 else (part, beside)
            level, i = level + 1, i // 2
            part = self._join(left, right, (level, i))
        self._parts[level, i] = part

    def parts(self) -> list[Part]:
        """Those that are left, from the first block's on."""
        return [part for _, part in sorted(self._parts.items(), key=lambda item: item[0][1] << item[0][0])]
