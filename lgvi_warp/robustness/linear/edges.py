# SPDX-License-Identifier: Apache-2.0
"""Bisection for the edge between two answers, for all members at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# Values of members (m,) and which members (m,) -> whether each holds.
Holds = Callable[[np.ndarray, np.ndarray], np.ndarray]


def edges(
    holds: Holds, start: np.ndarray, last: np.ndarray, guess: np.ndarray, narrow: float, whole_numbers: bool = False
) -> np.ndarray:
    """Find for each member (n,) the edge, from `start` to `last`, of a condition that holds at `start`.

    Brackets grow from the guess by doubling steps, and are then halved, in the logarithm except for whole numbers.
    start: NaN for members that are left out. guess: NaN or infinite if there is no guess.
    Returns: (n, 2): the nearest values at which the condition holds and fails; without an edge, the second is infinite
        or 0.
    """
    forward, backward = (lambda v: v, lambda v: v) if whole_numbers else (np.log, np.exp)
    n, least = len(start), 1.0 if whole_numbers else narrow
    with np.errstate(invalid="ignore", divide="ignore"):
        begin = forward(np.asarray(start, float))
        far, near = np.abs(forward(np.asarray(last, float)) - begin), np.abs(forward(guess) - begin)
    up = np.where(np.asarray(last) >= np.asarray(start), 1.0, -1.0)
    good, bad = np.zeros(n), np.full(n, np.inf)
    sought = np.flatnonzero(np.isfinite(begin))
    known = np.isfinite(near) & (near < far)

    def ask(members: np.ndarray, distance: np.ndarray) -> None:
        if not len(members):
            return
        well = holds(backward(begin[members] + up[members] * distance), members)
        good[members] = np.where(well, np.maximum(good[members], distance), good[members])
        bad[members] = np.where(well, bad[members], np.minimum(bad[members], distance))

    def rounded(values: np.ndarray) -> np.ndarray:
        return np.round(values) if whole_numbers else values

    width = np.where(known, np.maximum(0.02 * near, least), 1.0 if whole_numbers else 0.2)
    centre = np.where(known, near, 0.0)
    while True:
        # Those whose bracket is open above, then those whose guess lay beyond the edge.
        above = sought[np.isinf(bad[sought]) & (good[sought] < far[sought])]
        if not len(above):
            break
        ask(above, rounded(np.minimum(np.maximum(centre, good)[above] + width[above], far[above])))
        width[above] *= 2.0
    width = np.maximum(0.02 * near, least)
    while True:
        below = sought[known[sought] & (good[sought] == 0.0) & (bad[sought] < np.inf)]
        below = below[bad[below] > width[below]]
        if not len(below):
            break
        ask(below, rounded(bad[below] - width[below]))
        width[below] *= 2.0
    while True:
        open_ = sought[(bad[sought] < np.inf) & (bad[sought] - good[sought] > narrow * (1.0 + 1e-9))]
        if not len(open_):
            break
        ask(open_, rounded(0.5 * (good + bad)[open_]))
    with np.errstate(invalid="ignore"):
        return np.stack([backward(begin + up * good), backward(begin + up * bad)], axis=1)
