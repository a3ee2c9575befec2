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

    value: coarse less fine. half: of its 95 % interval. left: 1 - rho^2. members: number of pairs.
    alike: whether both spread about as much, as members that are apart by chaos do, and steps that are too long do not.
    """

    value: float
    half: float
    left: float
    members: int
    alike: bool = True

    @property
    def largest(self) -> float:
        """The farther end of the interval from 0."""
        return abs(self.value) + self.half

    @property
    def apart(self) -> bool:
        """Whether members of both settings have little in common, and no step is too long."""
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
    """The paired difference of two settings' contributions (n,), of replicates where these are enough.

    least: as in `estimators.plain`; where none of n members differs, up to 3 / n of them may, with 95 %.
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

    A difference that happens to be near 0 says little: the one before, divided by four, is taken where that is larger; by
    sixteen for a method of order 8, whose halvings fall by 256.
    """
    sizes = [abs(each.value) for each in halvings]
    last = max(sizes[-1], sizes[-2] / max(4.0, 2.0 ** (0.5 * order))) if len(sizes) > 1 else sizes[-1]
    fell = len(sizes) > 1 and sizes[-2] >= FALLING * sizes[-1]
    return last / 3.0 if fell else last


def biases(halvings: Sequence[StepChange], order: int = 1) -> list[Bias]:
    """The bias of every step of a ladder, the coarsest first, from the difference of each to the next.

    docs/theory/estimators.md, (E24).

    The differences of one ladder are of the same members and are added as they come, halves too, which bounds their sum.

    order: of the method, 1 in noise.
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
    """The 95 % interval of a value whose bias is told and not taken off.

    What is random of both adds in squares; the bias itself widens the side on which the truth then lies.
    """
    half = float(np.hypot(sampling_half, bias.half))
    return value - max(bias.value, 0.0) - half, value - min(bias.value, 0.0) + half
