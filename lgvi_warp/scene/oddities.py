"""What is odd of many members: counted, and the first of them named."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Odd:
    """What is odd of one quantity.

    text: of the first member that has it. first: its index. count: how many have it; shared: all do, by one number.
    """

    text: str
    first: int
    count: int
    shared: bool


@dataclass(frozen=True)
class Oddities:
    """What is odd by name, of some members; `|` joins those of more members after them."""

    found: Mapping[str, Odd]

    def __or__(self, other: Oddities) -> Oddities:
        joined = dict(self.found)
        for key, odd in other.found.items():
            mine = joined.get(key)
            joined[key] = odd if mine is None else replace(mine, count=mine.count + odd.count)
        return Oddities(joined)

    def messages(self, members: int, most: int | None = None) -> tuple[str, ...]:
        """A sentence each, with how many of so many members; most: how many of them were looked at."""
        return tuple(f"{key}: {odd.text}{_whose(odd, members, most)}" for key, odd in self.found.items())


def _whose(odd: Odd, members: int, most: int | None) -> str:
    if members == 1:
        return ""
    if odd.shared or odd.count == members:
        return f" (all {members:,} members)"
    whole = f"{members:,}" if most is None or members <= most else f"the first {most:,}"
    return f" ({odd.count:,} of {whole} members; first: member {odd.first})"


# A quantity's name, which members are odd (1 or n,), and what to say of member i.
Look = tuple[str, np.ndarray, Callable[[int], str]]


def gathered(looks: Iterable[Look], first: int, stop: int) -> Oddities:
    """What is odd of the members first to stop.

    Args:
        looks: By quantity; of one name the first that is odd is said.
        first: Index of the first member.
        stop: Index after the last.

    Returns:
        What is odd, by name.
    """
    found: dict[str, Odd] = {}
    for key, odd, text in looks:
        odd = np.atleast_1d(odd)
        if key not in found and odd.any():
            i = int(odd.argmax())
            # One number for many, or the only one that was looked at for all; the last of many may be alone, too.
            shared = len(odd) == 1 and (stop - first > 1 or first == 0)
            found[key] = Odd(text(i), first + i, stop - first if shared else int(odd.sum()), shared)
    return Oddities(found)
