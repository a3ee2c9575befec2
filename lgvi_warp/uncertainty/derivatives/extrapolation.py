# SPDX-License-Identifier: Apache-2.0
"""Extrapolate differences at many increments to a derivative with its error, or find why there is none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Each increment is so many times the next.
RATIO = 4.0
# The largest increment as a part of the number's size, and how many there are, by the precision of the run.
LARGEST = 0.1
LEVELS = {"float64": 11, "float32": 6, "float32_compensated": 6}
# Differences at so many increments are extrapolated together.
WINDOW = 3
# Powers of the increment in the error of differences to both sides, and to one.
BOTH_SIDES, ONE_SIDE = (2, 4), (1, 2)
# What a slope leaves of a change vanishes by so many times at the next increment where there is a step or a kink between the
# two; of a kink it had grown by more than the second number from this increment to the one before.
ABRUPT, KINK_GROWTH = 1e4, 5.0
# A derivative is none whose error is above this part of it, so many times round-off, and this part of the slopes to each side.
MOST_ERROR, MOST_ROUND_OFF, MOST_OF_SLOPES = 0.1, 10.0, 1e-3
# Scatter of values at the least increments that is so many times round-off, of numbers of 1 or more, is none of it.
MOST_SCATTER = 1e6
FINE, FEW, ROUGH, STEPS, KINK = range(5)


@dataclass(frozen=True)
class Extrapolated:
    """Derivatives; all arrays have one shape.

    value, error: the derivative and its error. first: index of the largest increment used. jump: derivative from above
    minus derivative from below. rounding: error of a value, by the scatter at the smallest increments. code: FINE; FEW:
    few increments without failed copies; ROUGH: increments disagree; STEPS: a jump between two; KINK: the sides differ.
    """

    value: np.ndarray
    error: np.ndarray
    first: np.ndarray
    jump: np.ndarray
    rounding: np.ndarray
    code: np.ndarray

    def part(self, members: np.ndarray) -> Extrapolated:
        """Values of some members; the first axis must be the members."""
        return Extrapolated(*(values[members] for values in vars(self).values()))


def relative_increments(dtype: str) -> np.ndarray:
    """Increments as fractions of a number's size, the largest first."""
    return np.asarray(LARGEST * RATIO ** -np.arange(LEVELS[dtype]))


def extrapolated(
    at: np.ndarray,
    above: np.ndarray,
    below: np.ndarray,
    increments: np.ndarray,
    eps: float,
    rounding: np.ndarray | None = None,
) -> Extrapolated:
    """Derivatives from values at x (...), and above and below it by the increments (..., levels).

    above, below: NaN if a copy failed or is not allowed. For one-sided differences one of them is all NaN.
    eps: round-off of the run. rounding: error of a value (...), if known.
    """
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        return _extrapolated(at, above, below, increments, eps, rounding)


def _extrapolated(
    at: np.ndarray,
    above: np.ndarray,
    below: np.ndarray,
    increments: np.ndarray,
    eps: float,
    rounding: np.ndarray | None,
) -> Extrapolated:
    up, down = (above - at[..., None]) / increments, (at[..., None] - below) / increments
    one_sided = np.isnan(above).all(axis=-1) | np.isnan(below).all(axis=-1)
    single = np.where(np.isnan(up), down, up)
    central = (above - below) / (2.0 * increments)
    slopes = np.where(one_sided[..., None], single, central)
    value, disagreement = _windows(slopes, np.where(one_sided[..., None], 0, 1))
    if rounding is None:
        rounding = scatter(value, increments[..., WINDOW - 1 :])
    rounding = np.maximum(rounding, eps * np.abs(at))
    noise = rounding[..., None] / increments
    bounds = disagreement + 2.0 * noise[..., 2:]
    bounds = np.where(np.isfinite(bounds), np.maximum(bounds, _beyond_finer(value, noise[..., 2:])), np.inf)
    first = bounds.argmin(axis=-1)

    def chosen(each: np.ndarray, offset: int = 0) -> np.ndarray:
        return np.asarray(np.take_along_axis(each, first[..., None] + offset, axis=-1)[..., 0])

    best, error = chosen(value), chosen(bounds)
    jump, unsure = _jump(up - down, noise)
    jump, unsure = chosen(jump), chosen(unsure)
    steepest = np.fmax(np.abs(chosen(up)), np.abs(chosen(down)))
    rough = (error > MOST_ERROR * np.abs(best)) & (error > MOST_ROUND_OFF * chosen(noise, 2))
    code = np.full(best.shape, FINE)
    scattered = (error > MOST_ERROR * np.abs(best)) & (rounding > MOST_SCATTER * eps * np.maximum(np.abs(at), 1.0))
    code[(rough | scattered) & (error > MOST_OF_SLOPES * steepest)] = ROUGH
    code[~one_sided & (np.abs(jump) > 10.0 * unsure) & (np.abs(jump) > 1e-6 * np.abs(best))] = KINK
    left = [np.abs(each - best[..., None]) * increments for each in (up, down, slopes)]
    least = np.maximum(MOST_ERROR * np.abs(best)[..., None] * increments, ABRUPT * rounding[..., None])
    code[np.any([_abrupt(each, least) for each in left], axis=0)] = STEPS
    code[~np.isfinite(error)] = FEW
    return Extrapolated(best, error, first, np.where(one_sided, 0.0, jump), rounding, code)


def scatter(slopes: np.ndarray, increments: np.ndarray) -> np.ndarray:
    """Error of a value, from the scatter of slopes at the smallest increments."""
    seen = np.abs(np.diff(slopes, axis=-1)) * increments[..., 1:]
    count = np.isfinite(seen).sum(axis=-1, keepdims=True)
    place = np.cumsum(np.isfinite(seen), axis=-1)
    return np.asarray(2.0 * np.where(np.isfinite(seen) & (place > count - WINDOW), seen, 0.0).max(axis=-1))


def _windows(slopes: np.ndarray, sides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Richardson extrapolations from three successive increments each, and differences of those from two.

    sides: (..., 1): 1 if the error has only even powers of the increment, else 0.
    """
    low, high = (
        np.where(sides > 0, RATIO**even, RATIO**any_power) for even, any_power in zip(BOTH_SIDES, ONE_SIDE, strict=True)
    )
    once = slopes[..., 1:] + np.diff(slopes, axis=-1) / (low - 1.0)
    twice = once[..., 1:] + np.diff(once, axis=-1) / (high - 1.0)
    return twice, np.abs(np.diff(once, axis=-1))


def _beyond_finer(value: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Largest difference of each derivative from those of smaller increments, minus round-off."""
    beyond = np.zeros_like(value)
    for i in range(value.shape[-1] - 1):
        apart = np.abs(value[..., i : i + 1] - value[..., i + 1 :]) - 4.0 * noise[..., i + 1 :]
        beyond[..., i] = np.fmax.reduce(np.nan_to_num(apart, nan=0.0), axis=-1)
    return np.maximum(beyond, 0.0)


def _jump(gaps: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Limit, for increments to 0, of the difference between the slopes on both sides, and its uncertainty."""
    once = gaps[..., 1:] + np.diff(gaps, axis=-1) / (RATIO - 1.0)
    twice = once[..., 1:] + np.diff(once, axis=-1) / (RATIO**3 - 1.0)
    return twice, np.abs(np.diff(once, axis=-1)) + 8.0 * noise[..., 2:]


def _abrupt(left: np.ndarray, least: np.ndarray) -> np.ndarray:
    """True if residuals (..., levels) of a slope stay large, then vanish from one increment to the next.

    least: (..., levels), residuals below this do not count.
    """
    before, here, after = left[..., :-2], left[..., 1:-1], left[..., 2:]
    vanishes = (here > ABRUPT * after) & (here > np.maximum(least, np.finfo(float).tiny)[..., 1:-1])
    return np.asarray((vanishes & (before < KINK_GROWTH * here)).any(axis=-1))
