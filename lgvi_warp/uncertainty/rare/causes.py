# SPDX-License-Identifier: Apache-2.0
"""Numbers and noise that differ between failing and all members, and the probability of each condition."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

# Times the spread that chains tell, since these begin at members that are related.
RELATED = 1.2
# A z-score from which a difference is no chance, and the least one that is worth a line: of a mean [sd], of a size or spread.
SIGNIFICANT, LEAST_MEAN, LEAST_RATIO = 4.5, 0.3, 0.2
# Mean absolute value of a standard normal.
SIZE = math.sqrt(2.0 / math.pi)
# Draws of a source up to which errors are told draw by draw; independent parts that mean paths are compared between.
FEW_DRAWS, PARTS = 20, 4


class Chance(NamedTuple):
    """A probability with the ends of its 95 % interval."""

    probability: float
    lower: float
    upper: float


class Moves(NamedTuple):
    """Failing members against all: mean, mean absolute value and standard deviation [sd], and the largest z-score."""

    mean: np.ndarray
    size: np.ndarray
    spread: np.ndarray
    z: np.ndarray


def mean_and_error(x: np.ndarray, weights: np.ndarray, chains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weighted mean of numbers (m, k), and its standard error if members of one chain are related. (E15)."""
    mean = weights @ x
    order, first = np.argsort(chains, kind="stable"), np.unique(np.sort(chains), return_index=True)[1]
    away = np.add.reduceat((weights[:, None] * (x - mean))[order], first, axis=0)
    return mean, np.sqrt((away**2).sum(axis=0))


def moves_of(u: np.ndarray, weights: np.ndarray, chains: np.ndarray) -> Moves:
    """Differences of the normals (m, k) of failing members from standard normals. docs/theory/rare_events.md, (B16)."""
    tests = []
    for x, nominal in ((u, 0.0), (np.abs(u), SIZE), (u**2, 1.0)):
        mean, error = mean_and_error(x, weights, chains)
        tests.append((mean - nominal) / np.maximum(RELATED * error, 1e-12))
    z = np.stack(tests)
    mean, size = weights @ u, weights @ np.abs(u)
    spread = np.sqrt(np.maximum(weights @ u**2 - mean**2, 0.0))
    return Moves(mean, size, spread, np.take_along_axis(z, np.abs(z).argmax(axis=0)[None], axis=0)[0])


def noise_score(x: np.ndarray, weights: np.ndarray, chains: np.ndarray, parts: np.ndarray) -> float:
    """The z-score of a source's draws (m, k): the larger z-score of their mean path and their sum of squares.

    docs/theory/rare_events.md, (B17).
    """
    k = x.shape[1]
    mean, error = mean_and_error(np.column_stack([x, (x**2).sum(axis=1)]), weights, chains)
    squares = float(mean[-1] - k) / max(RELATED * float(error[-1]), 1e-12)
    if k <= FEW_DRAWS:
        path = float(((mean[:-1] / np.maximum(RELATED * error[:-1], 1e-12)) ** 2).sum() - k) / math.sqrt(2.0 * k)
        return max(path, abs(squares))
    means = [weights[own] @ x[own] / weights[own].sum() for i in range(PARTS) if weights[own := parts == i].sum() > 0.0]
    pairs = [(a @ b, (a @ a) * (b @ b)) for i, a in enumerate(means) for b in means[:i]]
    path = float(sum(pair[0] for pair in pairs) / math.sqrt(max(sum(pair[1] for pair in pairs) / k, 1e-300)))
    return max(path, abs(squares))


def moved_texts(moved: Mapping[str, Sequence[float]], noise: Mapping[str, float], normal: Container[str]) -> list[str]:
    """Texts of significant differences, the clearest first.

    moved: name -> (mean, size, spread, z). noise: name -> z. normal: names of normal numbers, whose middle is their mean.
    """
    said = [(z, f"the noise of {name} differs from that of all (z = {z:.0f})") for name, z in noise.items()]
    for name, (mean, size, spread, z) in moved.items():
        if words := _words("mean" if name in normal else "median", mean, size, spread):
            said.append((abs(z), f"{name} {words}"))
    return [words for z, words in sorted(said, key=lambda pair: -pair[0]) if z >= SIGNIFICANT]


def _words(middle: str, mean: float, size: float, spread: float) -> str:
    """Text of a difference; "" if it is small. For distributions that are not normal, it concerns the normal score."""
    deviations = "standard deviations" if middle == "mean" else "standard deviations of its normal score"
    away = f"is on average {abs(mean):.1f} {deviations} {'below' if mean < 0.0 else 'above'} its {middle}"
    if abs(mean) >= max(LEAST_MEAN, 0.5 * size):
        return away
    if size >= (1.0 + LEAST_RATIO) * SIZE:
        return f"is on average {size:.1f} {deviations} from its {middle}, to both sides"
    if size <= (1.0 - LEAST_RATIO) * SIZE or spread <= 1.0 - LEAST_RATIO:
        return f"is near its {middle}, with a spread of {spread:.1f} {deviations}"
    return away if abs(mean) >= LEAST_MEAN else ""


# Independent failing members from which on their weights tell how likely a condition is.
FEW_MET = 10.0


def chances_of(
    names: Iterable[str], rows: np.ndarray, weights: np.ndarray, ancestors: np.ndarray, of_any: Chance, spread: float
) -> dict[str, Chance]:
    """Probabilities of each condition alone, of any and of all of them, from the failing members' limits (k, m).

    ancestors: (m,), members with the same ancestor are related. spread: relative error of the probability of any.
    docs/theory/rare_events.md, (B13).
    """
    from scipy.stats import chi2, t

    happens = rows > 0.0
    place = np.unique(ancestors, return_inverse=True)[1]
    events = {**dict(zip(names, happens, strict=True)), "any": None, "all": happens.all(axis=0)}
    found = {}
    for name, event in events.items():
        if event is None:
            found[name] = of_any
            continue
        share, error = (float(each[0]) for each in mean_and_error(event[:, None].astype(float), weights, ancestors))
        total = mean_and_error(np.ones((len(weights), 1)), weights, ancestors)[0][0]
        clusters = np.bincount(place, weights)
        count = float(total**2 / (clusters**2).sum())
        # None or all of so many may be chance: three of them bound what is hidden.
        hidden = min(1.0, 3.0 / count)
        if not event.any():
            found[name] = Chance(0.0, 0.0, hidden * of_any.upper)
        elif event.all():
            found[name] = Chance(of_any.probability, (1.0 - hidden) * of_any.lower, of_any.upper)
        else:
            away = float(t.ppf(0.975, max(1.0, count - 1.0))) * math.hypot(spread, error / share)
            p, own = of_any.probability * share, np.bincount(place, weights * event)
            # Few ancestors have it: no interval is narrower than that of their number (Garwood 1936).
            few = float(own.sum() ** 2 / (own**2).sum())
            low = min(math.exp(-away), float(chi2.ppf(0.025, 2.0 * few)) / (2.0 * few))
            high = max(math.exp(away), float(chi2.ppf(0.975, 2.0 * few + 2.0)) / (2.0 * few))
            # Where hardly any meets it, those that do may be its odd ones: it reaches as far as if none had.
            least = hidden * of_any.upper if few < FEW_MET else 0.0
            found[name] = Chance(p, p * low, min(of_any.upper, max(p * high, least)))
    return found
