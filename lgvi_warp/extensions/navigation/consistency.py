# SPDX-License-Identifier: Apache-2.0
"""Consistency of the filters of an ensemble: chi-square tests of their errors and innovations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.common.arguments import result_of
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.summaries import Rows, Summarized

# States of the filter: what NEES is of (see control/error_state_filter.py).
STATES = 15
NEEDED = ("nees", "nis", "nis_count")


class TimeAverage(NamedTuple):
    """The mean over all members and times, beside that of a consistent filter.

    Attributes:
        mean: That mean; NaN where there is nothing to average.
        degrees: Degrees of freedom of one value, the mean of a consistent filter times their number.
        effective: How many independent values the mean is worth.
        p: Probability of a mean as far off, either way, for a consistent filter; NaN without a mean.
    """

    mean: float
    degrees: float
    effective: float
    p: float


@dataclass(frozen=True, eq=False, repr=False)
class Consistency(Summarized):
    """Means of NEES and NIS over the members at each time, with the bands that a consistent filter stays within.

    Attributes:
        time: Times of the samples (k,) [s].
        members: Members that were still under way (k,).
        nees: Mean over the members of e^T P^-1 e, 15 for a consistent filter (k,); NaN where a filter's covariance lost its
            digits.
        nees_band: Lower and upper end of its band (k, 2).
        nis: Sum of squared innovations over their variances, by their number, 1 for a consistent filter (k,); NaN where
            none was.
        nis_band: Lower and upper end of its band (k, 2); NaN where none was.
        level: Probability of each band.
        nees_average: Test of the mean of NEES over members and times, with its effective sample size and its p-value.
        nis_average: The same of NIS, whose innovations are independent of one another for a consistent filter.
    """

    time: np.ndarray
    members: np.ndarray
    nees: np.ndarray
    nees_band: np.ndarray
    nis: np.ndarray
    nis_band: np.ndarray
    level: float
    nees_average: TimeAverage
    nis_average: TimeAverage

    @property
    def verdict(self) -> str:
        """One of "consistent", "too sure", with errors or innovations larger than believed, "too careful" and "unknown".

        By the p-values of both averages, of which each has to be at least half of 1 - level (Bonferroni).
        """
        tests = [test for test in (self.nees_average, self.nis_average) if np.isfinite(test.p)]
        worst = min(tests, key=lambda test: test.p, default=None)
        if worst is None:
            return "unknown"
        if worst.p >= 0.5 * (1.0 - self.level):
            return "consistent"
        return "too sure" if worst.mean > worst.degrees else "too careful"

    @property
    def answer(self) -> str:
        """One sentence with the verdict, both means and their p-values."""
        tests = ("NEES", self.nees_average), ("NIS", self.nis_average)
        texts = [
            f"{name} is {test.mean:.4g} on average where {test.degrees:g} is right (p = {test.p:.2g})"
            for name, test in tests
            if np.isfinite(test.p)
        ]
        if not texts:
            return (
                "It is unknown whether the filters are consistent: NEES has lost its digits, and no reading was taken."
            )
        return f"The filters are {self.verdict}: {' and '.join(texts)}."

    @property
    def nees_share(self) -> float:
        """Share of the times at which NEES is in its band."""
        return _share(self.nees, self.nees_band)

    @property
    def nis_share(self) -> float:
        """Share of the times with innovations at which NIS is in its band."""
        return _share(self.nis, self.nis_band)

    def summary_rows(self) -> tuple[str, Rows]:
        percent = 100.0 * self.level
        rows = []
        for name, values, band, share, test in (
            ("NEES", self.nees, self.nees_band, self.nees_share, self.nees_average),
            ("NIS", self.nis, self.nis_band, self.nis_share, self.nis_average),
        ):
            known = np.isfinite(values)
            if not known.any():
                rows.append((name, "no innovation at the times of the samples"))
                continue
            widest = f"{band[known, 0].min():.4g} to {band[known, 1].max():.4g}"
            text = f"mean {values[known].mean():.4g}, band {widest}, inside at {100.0 * share:.3g} % of the times"
            rows.append((name, text))
            worth = f"{test.effective:,.4g} independent values"
            rows.append(("", f"over all times {test.mean:.5g} from {worth}, right {test.degrees:g}, p = {test.p:.2g}"))
        rows.append(("verdict", self.answer))
        return f"Consistency of {self.members.max():,} filters at {len(self.time):,} times, {percent:g} % bands", rows


def consistency(result: Any, level: float = 0.95) -> Consistency:
    """Test whether the filters of an ensemble are consistent: chi-square tests of NEES and NIS at each time.

    A filter is consistent where its errors are as large as its covariance says. Then NEES, e^T P^-1 e by the truth, has 15
    degrees of freedom, and the squared innovations over their variances (NIS) have one each, if the model is linear and the
    noise is normal; members are independent, so sums over them have as many times these. Bar-Shalom, Li & Kirubarajan (2001),
    *Estimation with Applications to Tracking and Navigation*, section 5.4. Errors of one member at two times are not
    independent: one ensemble may be outside its NEES band for long, by chance, so that the share of the times in the band
    is no test. The mean over all times is a test: its effective sample size is the number of values over 1 + 2 times
    the sum of their autocorrelations, and the sum of that many values of a consistent filter has a chi-square
    distribution.

    Args:
        result: Result of a run with an `lw.control.ErrorStateFilter` that saved "nees", "nis" and "nis_count".
        level: Probability of each band, in (0, 1); 0.95 by default.

    Returns:
        The means and their bands, by time, and the tests of the means over all times.

    Raises:
        SceneError: If the result lacks these samples, or the level is not in (0, 1).

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.SaveAt(every=1.0, fields=("nees", "nis", "nis_count")).fields
        ('nees', 'nis', 'nis_count')
    """
    result_of(result)
    faults = Faults()
    chance = faults.number("level", level)
    if chance is not None and not 0.0 < chance < 1.0:
        faults.add("level", level, "is not a probability between 0 and 1", "give 0.95, say")
    faults.raise_if_any()
    missing = [name for name in NEEDED if name not in result.samples]
    if missing:
        remedy = 'save=lw.SaveAt(every=..., fields=("nees", "nis", "nis_count"))'
        raise refusal("result", ", ".join(missing), "was not saved", remedy)
    from scipy.stats import chi2

    tails = 0.5 * (1.0 - level), 0.5 * (1.0 + level)
    alive = result.time[:, None] <= result.end_time[None, :]
    members = alive.sum(axis=1)
    nees, nis, count = (np.where(alive, np.asarray(getattr(result, name), float), 0.0) for name in NEEDED)
    with np.errstate(invalid="ignore", divide="ignore"):
        bands = np.stack([chi2.ppf(tail, STATES * members) / members for tail in tails], axis=1)
        numbers = count.sum(axis=1)
        rate = np.where(numbers > 0.0, nis.sum(axis=1) / numbers, np.nan)
        nis_bands = np.stack([chi2.ppf(tail, numbers) / numbers for tail in tails], axis=1)
        means = nees.sum(axis=1) / members
    ends = (
        time_average(np.where(alive, np.asarray(result.nees, float), np.nan)),
        _mean_test(float(nis.sum()), float(numbers.sum()), 1.0, float(numbers.sum())),
    )
    return Consistency(result.time, members, means, bands, rate, nis_bands, float(level), *ends)


def time_average(nees: np.ndarray) -> TimeAverage:
    """The test of NEES (k, n) of n members at k times; NaN where there is none."""
    known = np.isfinite(nees)
    count = int(known.sum())
    if not count or not known.any(axis=0).all():
        return TimeAverage(np.nan, STATES, 0.0, np.nan)
    total = float(nees[known].sum())
    apart = np.where(known, nees - total / count, 0.0)
    # Geyer's (1992) initial positive sequence of the correlations, pooled over the members.
    times, pairs = 1.0, 0.0
    power = float((apart**2).sum()) / count
    for lag in range(1, len(nees) - 1, 2) if power > 0.0 else ():
        pair = sum(float((apart[:-k] * apart[k:]).sum()) / count for k in (lag, lag + 1)) / power
        if pair <= 0.0:
            break
        pairs = min(pair, pairs) if lag > 1 else pair
        times += 2.0 * pairs
    return _mean_test(total, float(count), STATES, count / times)


def _mean_test(total: float, count: float, degrees: float, effective: float) -> TimeAverage:
    """The test of the mean of some values, whose sum is `total`, each of chi-square with these degrees of freedom."""
    from scipy.stats import chi2

    if not (count > 0.0 and np.isfinite(total)):
        return TimeAverage(np.nan, degrees, 0.0, np.nan)
    mean = total / count
    law = chi2(degrees * effective)
    below = law.cdf(mean * effective), law.sf(mean * effective)
    return TimeAverage(mean, degrees, effective, float(min(1.0, 2.0 * min(below))))


def _share(values: np.ndarray, band: np.ndarray) -> float:
    """The share of those that have a band and are in it, which NaN is not; NaN for none."""
    known = np.isfinite(band).all(axis=1)
    inside = (values >= band[:, 0]) & (values <= band[:, 1])
    return float(inside[known].mean()) if known.any() else np.nan
