# SPDX-License-Identifier: Apache-2.0
"""The bias of a statistic by method and step: paired differences of the same members against finer steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lgvi_warp.uncertainty.estimating.estimators import REPLICATES, plain, replicated, slope

# Two settings agree where what they differ by is at most this part of the error asked for.
AGREE = 0.25
# Steps halve a difference of first order; where halvings fell by this factor twice, the next is a third of the last.
FALLING = 3.0
# Where settings leave more than this of each other's variance, their members are apart: chaos, or noise that is not shared.
APART = 0.5
# Spreads that differ by more than this factor are not alike.
ALIKE = 2.0


@dataclass(frozen=True)
class StepChange:
    """Change of a statistic from a coarse setting to a fine one, both on the same members and noise.

    value: coarse minus fine. half: half width of its 95 % interval. left: 1 - correlation^2. members: number of pairs.
    alike: True if both have similar spreads, as with chaos; if a step is too long, they differ.
    """

    value: float
    half: float
    left: float
    members: int
    alike: bool = True

    @property
    def largest(self) -> float:
        """Largest absolute value in the interval."""
        return abs(self.value) + self.half

    @property
    def apart(self) -> bool:
        """True if members of both settings are nearly uncorrelated, but no step is too long."""
        return self.alike and self.left > APART


@dataclass(frozen=True)
class Bias:
    """The bias of a setting, with half the width of its 95 % interval."""

    value: float
    half: float

    @property
    def mean_square(self) -> float:
        """Contribution to the squared error: half an interval is two standard errors."""
        return self.value * self.value + 0.25 * self.half * self.half


def difference(coarse: np.ndarray, fine: np.ndarray, least: float = 0.0) -> StepChange:
    """The paired difference of two settings' contributions (n,), by replicates if there are enough.

    least: as in `estimators.plain`; if none of n members differs, up to 3 / n of all may, at 95 % confidence.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # numbers of steps that are too long may be huge
        apart, n = coarse - fine, len(coarse)
        part = replicated(apart) if n >= 2 * REPLICATES else plain(apart)
        half = part.half_width(0.95)
        a, b = float(np.std(coarse)), float(np.std(fine))
        left = slope(fine, coarse)[1]
    if not apart.any():
        half = 3.0 * least / n
    return StepChange(part.value, half, left if np.isfinite(left) else 1.0, n, a <= ALIKE * b and b <= ALIKE * a)


def beyond(halvings: Sequence[StepChange], order: int = 1) -> float:
    """Bound of the bias at the finest step, from the last two halvings.

    docs/theory/estimators.md, (E24).

    The last difference may be near 0 by chance. So the difference before, divided by four, is taken if it is larger;
    for a method of order 8, whose differences fall by a factor of 256, the divisor is sixteen.
    """
    sizes = [abs(each.value) for each in halvings]
    last = max(sizes[-1], sizes[-2] / max(4.0, 2.0 ** (0.5 * order))) if len(sizes) > 1 else sizes[-1]
    fell = len(sizes) > 1 and sizes[-2] >= FALLING * sizes[-1]
    return last / 3.0 if fell else last


def biases(halvings: Sequence[StepChange], order: int = 1) -> list[Bias]:
    """The bias of every step of a ladder, the coarsest first, from the differences of successive steps.

    docs/theory/estimators.md, (E24).

    All differences of a ladder use the same members. Values and half widths are simply added, which bounds the sum.

    order: order of the method, 1 with noise.
    """
    if not halvings:
        return [Bias(0.0, float("inf"))]
    rest = beyond(halvings, order)
    found, value, half = [Bias(0.0, rest + halvings[-1].half)], 0.0, 0.0
    for each in reversed(halvings):
        value, half = value + each.value, half + each.half
        found.append(Bias(value, half + rest))
    return found[::-1]


def interval(value: float, sampling_half: float, bias: Bias) -> tuple[float, float]:
    """The 95 % interval of a value whose bias is reported but not subtracted.

    The random errors of both are added in squares; the bias widens the interval on the side where the true value lies.
    """
    half = float(np.hypot(sampling_half, bias.half))
    return value - max(bias.value, 0.0) - half, value - min(bias.value, 0.0) + half
