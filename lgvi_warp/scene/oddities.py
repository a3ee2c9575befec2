# SPDX-License-Identifier: Apache-2.0
"""Odd values of many members: their number, and a description of the first."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Odd:
    """Number of members with an odd value of one quantity."""

    text: str
    first: int
    count: int
    shared: bool


@dataclass(frozen=True)
class Oddities:
    """Odd values by quantity; `a | b` joins the odd values of some members with those of later members."""

    by_name: Mapping[str, Odd]

    def __or__(self, later: Oddities) -> Oddities:
        joined = dict(self.by_name)
        for key, odd in later.by_name.items():
            earlier = joined.get(key)
            joined[key] = odd if earlier is None else replace(earlier, count=earlier.count + odd.count)
        return Oddities(joined)

    def messages(self, members: int, most: int | None = None) -> tuple[str, ...]:
        """Return one sentence for each odd quantity; `most`: number of members checked, None for all."""
        return tuple(f"{key}: {odd.text}{_whose(odd, members, most)}" for key, odd in self.by_name.items())


def _whose(odd: Odd, members: int, most: int | None) -> str:
    if members == 1:
        return ""
    if odd.shared or odd.count == members:
        return f" (all {members:,} members)"
    looked_at = f"{members:,}" if most is None or members <= most else f"the first {most:,}"
    return f" ({odd.count:,} of {looked_at} members; first: member {odd.first})"


# Name of a quantity, mask (1,) or (n,) of the odd members, and the text about member i.
OddityCheck = tuple[str, np.ndarray, Callable[[int], str]]


def gathered(checked: Iterable[OddityCheck], first: int, stop: int) -> Oddities:
    """Count the odd values of the members first to stop - 1.

    If several checks have the same name, the first one that finds an odd member counts.
    """
    odd_by_name: dict[str, Odd] = {}
    for key, odd, text in checked:
        odd = np.atleast_1d(odd)
        if key not in odd_by_name and odd.any():
            i = int(odd.argmax())
            # One number for many, or the only one that was looked at for all; the last of many may be alone, too.
            shared = len(odd) == 1 and (stop - first > 1 or first == 0)
            odd_by_name[key] = Odd(text(i), first + i, stop - first if shared else int(odd.sum()), shared)
    return Oddities(odd_by_name)
