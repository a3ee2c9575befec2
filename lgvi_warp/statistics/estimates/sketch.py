# SPDX-License-Identifier: Apache-2.0
"""A sketch of sorted values: quantiles of any number of values from a few thousand, with a proven bound on the rank.

A tree of buffers after Munro & Paterson (1980) with the coin flips of Karnin, Lang & Liberty (2016). Two sorted buffers
whose values have weight w are merged, and every other value is kept with weight 2 w; a coin decides whether this is the
first or the second of each pair. If the first is kept, the count of values up to any number grows by w or stays the
same; if the second, it falls by w or stays the same. Half of this change is known from the coin and corrected by
`shift`, so the rank error of a merge is at most w / 2, with a sign that depends on the coin. For N values in buffers of
s, the sum of these bounds is at most N (log2(N / s) + 2) / (4 s), for every order and any coins. The sum of their
squares is at most (N / 2 s)^2, so the error exceeds t N / 2 s with a probability below 2 exp(-t^2 / 2) (Hoeffding
1963). The coin of a merge depends only on its place in the tree, so the sketch of a set of blocks has the same bits for
any order of arrival. Many streams (times, components) with the same number of values share coins and one array. Values
that do not count are +inf: they leave the ranks of the others unchanged.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from lgvi_warp.statistics.estimates.tree import Part


def coin(level: int, place: int, sides: int) -> int:
    """Return a pseudo-random whole number from 0 to sides - 1 that depends only on the place, so every run has the same."""
    digest = hashlib.blake2b(b"%d %d" % (level, place), digest_size=8).digest()
    return int.from_bytes(digest, "little") % sides


def sketch_of(x: np.ndarray, members: int, size: int, block: int) -> Part:
    """Return the sketch of one block of values (k, d, n), +inf if a member does not count.

    Returns: sorted values (k, d, m), their weights (m,), and error, variance and shift of the rank, (1,) each.
    """
    k, d, n = x.shape
    values = np.empty((k, d, max(members, n)), x.dtype)
    values[..., :n] = x
    values[..., n:] = np.inf
    values.sort(axis=2)
    weight = max(1, values.shape[2] // size)
    first = coin(-1, block, weight)
    if weight > 1:
        values = np.ascontiguousarray(values[..., first::weight])
    # One of `weight` values is kept: counts change by -first to weight - 1 - first.
    error = 0.5 * (weight - 1)
    return _part(values, np.full(values.shape[2], weight), error, error**2, error - first)


def _part(values: np.ndarray, weights: np.ndarray, error: float, variance: float, shift: float) -> Part:
    numbers = {"error": error, "variance": variance, "shift": shift}
    return {"values": values, "weights": weights} | {name: np.array([value]) for name, value in numbers.items()}


def merged(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Merge rows of two arrays that are sorted along the last axis: NumPy's stable sort merges two sorted runs."""
    both = np.concatenate([first, second], axis=2)
    both.sort(axis=2, kind="stable")
    return both


def join(first_part: Part, second_part: Part, size: int, place: tuple[int, int]) -> Part:
    """Join two sketches of equal weight and length; place: (level, index) of the result in the tree of blocks.

    docs/theory/estimators.md, (E9).
    """
    a, b = first_part["values"].shape[2], second_part["values"].shape[2]
    error, variance, shift = (float(first_part[key][0] + second_part[key][0]) for key in ("error", "variance", "shift"))
    weight = int(first_part["weights"][0])
    if a != b or weight != second_part["weights"][0]:
        raise ValueError(f"sketches of {a} and {b} values are no neighbours")
    values = merged(first_part["values"], second_part["values"])
    if a + b > size:
        first, half = coin(*place, 2), 0.5 * weight
        values = np.ascontiguousarray(values[..., first::2])
        return _part(values, np.full(a, 2 * weight), error + half, variance + half**2, shift + half - first * weight)
    return _part(values, np.full(a + b, weight), error, variance, shift)


def together(parts: Sequence[Part]) -> Part:
    """Concatenate sketches of any weights to one part."""
    values = np.concatenate([part["values"] for part in parts], axis=2)
    weights = np.concatenate([part["weights"] for part in parts])
    numbers = (float(sum(part[key][0] for part in parts)) for key in ("error", "variance", "shift"))
    return _part(values, weights, *numbers)


def sorted_values(part: Part) -> tuple[np.ndarray, np.ndarray]:
    """Return the sorted values of a sketch, and their ranks from 0, both (k, d, m).

    A rank is the middle of the ranks that the value represents, corrected by the shift.
    """
    values, weights = part["values"], part["weights"]
    if np.all(weights == 1):
        values = np.sort(values, axis=2, kind="stable")
        return values, np.broadcast_to(np.arange(values.shape[2], dtype=np.float64), values.shape)
    order = np.argsort(values, axis=2, kind="stable")
    stands = weights[order]
    middles = np.cumsum(stands, axis=2) - 0.5 * (stands + 1) - part["shift"][0]
    return np.take_along_axis(values, order, axis=2), middles


def fraction(parts: Sequence[Part], x: np.ndarray) -> np.ndarray:
    """Return the fraction of members whose values do not exceed numbers (k, q, d); NaN if no member counts."""
    below = sum(
        part["weights"][0] * np.count_nonzero(part["values"][:, None] <= x[..., None], axis=3) - part["shift"][0]
        for part in parts
    )
    count = np.sum([part["count"] for part in parts], axis=0)[:, None, None]
    return np.where(count > 0, below / np.maximum(count, 1), np.nan)


def at_rank(values: np.ndarray, middles: np.ndarray, finite: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Return values (k, q, d) at given ranks from 0, interpolated linearly between finite values; NaN if none is finite.

    values, middles, finite: (k, d, m), the sorted values, their ranks, and the mask of finite values.
    """
    k, d = values.shape[:2]
    interpolated = np.full(rank.shape, np.nan)
    last = finite.sum(axis=2) - 1
    for i in range(k):
        for j in range(d):
            if last[i, j] >= 0:
                stop = last[i, j] + 1
                interpolated[i, :, j] = np.interp(rank[i, :, j], middles[i, j, :stop], values[i, j, :stop])
    return interpolated
