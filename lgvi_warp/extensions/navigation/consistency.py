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
    """Test of a mean over all members and times against the mean that a consistent filter has.

    Attributes:
        mean: Mean over all members and times; NaN if there are no values.
        degrees: Degrees of freedom of one value, equal to the mean that a consistent filter has.
        effective: Effective sample size, the number of independent values with the same information.
        p: Probability that a consistent filter's mean is at least as far from `degrees` (two-sided); NaN without mean.
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
        members: Number of members still under way at each time (k,).
        nees: Mean over the members of e^T P^-1 e (k,), with a filter's error e and covariance P: 15 for a consistent
            filter; NaN if round-off spoils a covariance.
        nees_band: Lower and upper end of the band of `nees` (k, 2).
        nis: Mean of squared innovations divided by their variances (k,), 1 for a consistent filter; NaN at times without
            innovations.
        nis_band: Lower and upper end of the band of `nis` (k, 2); NaN at times without innovations.
        level: Probability that a consistent filter is inside its band at a time.
        nees_average: Test of the mean of NEES over members and times, with its effective sample size and its p-value.
        nis_average: Test of the mean of NIS over members and times; in a consistent filter its values are independent.
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
        """Verdict of the tests: "consistent", "too sure" (errors larger than predicted), "too careful" or "unknown".

        A filter is consistent if the p-values of both averages are at least half of 1 - level (Bonferroni).
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
        """Fraction of the times at which NEES is in its band."""
        return _share(self.nees, self.nees_band)

    @property
    def nis_share(self) -> float:
        """Fraction of the times with innovations at which NIS is in its band."""
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

    A filter is consistent if its errors have the size that its covariance predicts. If in addition the model is linear and
    the noise is normal, NEES = e^T P^-1 e (error e, covariance P) is chi-square distributed with 15 degrees of freedom.
    Each squared innovation divided by its variance (NIS) has one degree of freedom. Members are independent, so the degrees
    of freedom of sums over members add up (Bar-Shalom, Li & Kirubarajan 2001, *Estimation with Applications to Tracking and
    Navigation*, section 5.4). Errors of one member at two times are not independent, so an ensemble may by chance be
    outside its NEES band for long. The fraction of the times in the band is therefore not a test; the mean over all times
    is tested instead. Its effective sample size is the number of values divided by 1 + 2 times the sum of their
    autocorrelations. For a consistent filter, the sum of that many independent values has a chi-square distribution.

    Args:
        result: Result of a run with an `lw.control.ErrorStateFilter` that saved "nees", "nis" and "nis_count".
        level: Probability that a consistent filter is inside its band at a time, in (0, 1); 0.95 by default.

    Returns:
        The means and their bands at each time, and the tests of the means over all times.

    Raises:
        SceneError: If the result lacks these samples, or `level` is not in (0, 1).

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
    """The test of NEES (k, n) of n members at k times; missing values are NaN."""
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
    """The test of the mean of `count` values with the sum `total`, each chi-square distributed with `degrees`."""
    from scipy.stats import chi2

    if not (count > 0.0 and np.isfinite(total)):
        return TimeAverage(np.nan, degrees, 0.0, np.nan)
    mean = total / count
    law = chi2(degrees * effective)
    below = law.cdf(mean * effective), law.sf(mean * effective)
    return TimeAverage(mean, degrees, effective, float(min(1.0, 2.0 * min(below))))


def _share(values: np.ndarray, band: np.ndarray) -> float:
    """Fraction of the values with a band that lie in it; NaN counts as outside. NaN if no value has a band."""
    known = np.isfinite(band).all(axis=1)
    inside = (values >= band[:, 0]) & (values <= band[:, 1])
    return float(inside[known].mean()) if known.any() else np.nan
