# SPDX-License-Identifier: Apache-2.0
"""Tests of innovations: those of a consistent filter, normalised by their covariance, are independent standard normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgvi_warp.common.summaries import Rows, Summarized


@dataclass(frozen=True, eq=False, repr=False)
class InnovationTest(Summarized):
    """Innovations of one instrument, with the bands that a consistent filter stays within.

    Attributes:
        count: Number of values that were compared.
        left_out: Number of values that the gate left out, which are not compared.
        ratio: Root mean square of the innovations divided by the value that their covariance predicts, 1 if consistent.
        ratio_band: Lower and upper end of the band of `ratio` (2,).
        mean: Mean of each component's innovations divided by their standard deviations (m,), 0 for a consistent filter.
        mean_band: Half width of the band of `mean` (m,).
        correlation: Correlation of innovations with those of the previous measurement, 0 for a consistent filter.
        correlation_band: Half width of the band of `correlation`.
        level: Probability that a consistent filter is inside all of these bands.
        verdict: "consistent", or the numbers that are outside their bands.
    """

    count: int
    left_out: int
    ratio: float
    ratio_band: np.ndarray
    mean: np.ndarray
    mean_band: np.ndarray
    correlation: float
    correlation_band: float
    level: float

    @property
    def verdict(self) -> str:
        """Verdict of the test: "consistent", or the numbers that are outside their bands."""
        if not self.count:
            return "nothing to compare"
        found = {
            "biased": bool((np.abs(self.mean) > self.mean_band).any()),
            "too sure": self.ratio > self.ratio_band[1],
            "not sure enough": self.ratio < self.ratio_band[0],
            "correlated in time": abs(self.correlation) > self.correlation_band,
        }
        return ", ".join(word for word, holds in found.items() if holds) or "consistent"

    def summary_rows(self) -> tuple[str, Rows]:
        """Each number with its band, and the verdict."""
        low, high = self.ratio_band
        means = ", ".join(f"{mean:.3g} (+-{band:.3g})" for mean, band in zip(self.mean, self.mean_band, strict=True))
        rows = [
            ("verdict", self.verdict),
            ("root mean square", f"{self.ratio:.3g}, band {low:.3g} to {high:.3g}"),
            ("mean", means),
            ("lag-1 correlation", f"{self.correlation:.3g} (+-{self.correlation_band:.3g})"),
        ]
        rows += [("left out", f"{self.left_out:,} values")] * (self.left_out > 0)
        return f"Test of {self.count:,} innovations, {100.0 * self.level:g} % bands", rows


def tested(normalised: np.ndarray, whitened: np.ndarray, left_out: int, level: float) -> InnovationTest:
    """Test innovations, normalised by standard deviations (k, m) and whitened by their covariance; NaN for missing values.

    The bands share the probability 1 - level equally (Bonferroni), that of the mean over its components. The band of the
    correlation is normal: N normal numbers divided by their length are uniform on the sphere, where products have the
    variance 1 / (N (N + 2)).
    """
    from scipy.stats import chi2, norm

    m, there = normalised.shape[1], np.isfinite(whitened)
    z, count = np.where(there, whitened, 0.0), int(there.sum())
    tail = (1.0 - level) / 6.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        total = np.sum(z * z)
        ratio_band = np.sqrt(np.array([chi2.ppf(tail, count), chi2.isf(tail, count)]) / count)
        numbers = np.isfinite(normalised).sum(axis=0)
        mean = np.where(np.isfinite(normalised), normalised, 0.0).sum(axis=0) / numbers
        mean_band = norm.isf(tail / m) / np.sqrt(numbers)
        own = there.any(axis=1)
        z, there = z[own], there[own]
        pairs = int((there[1:] & there[:-1]).sum())
        correlation = float(np.sum(z[1:] * z[:-1]) / total) if pairs else np.nan
        correlation_band = float(norm.isf(tail) * np.sqrt(pairs / (count * (count + 2.0)))) if pairs else np.nan
        ratio = float(np.sqrt(total / count))
    return InnovationTest(count, left_out, ratio, ratio_band, mean, mean_band, correlation, correlation_band, level)
