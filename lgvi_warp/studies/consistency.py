# SPDX-License-Identifier: Apache-2.0
"""Whether the filters of an ensemble believe what is so: chi-square tests of their errors and innovations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import result_of
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.summaries import Rows, Summarized

# States of the filter: what NEES is of (see lgvi_warp/control/error_state_filter.py).
STATES = 15
NEEDED = ("nees", "nis", "nis_count")


@dataclass(frozen=True, eq=False, repr=False)
class Consistency(Summarized):
    """Means of NEES and NIS over the members at each time, beside the bands in which chance leaves those of a right filter.

    Attributes:
        time: Times of the samples (k,) [s].
        members: Members that were still under way (k,).
        nees: Mean over the members of e^T P^-1 e, 15 for a right filter (k,); NaN where a filter's covariance lost its digits.
        nees_band: Lower and upper end of its band (k, 2).
        nis: Sum of squared innovations over their variances, by their number, 1 for a right filter (k,); NaN where none was.
        nis_band: Lower and upper end of its band (k, 2); NaN where none was.
        level: Probability of each band.
    """

    time: np.ndarray
    members: np.ndarray
    nees: np.ndarray
    nees_band: np.ndarray
    nis: np.ndarray
    nis_band: np.ndarray
    level: float

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
        for name, values, band, share in (
            ("NEES", self.nees, self.nees_band, self.nees_share),
            ("NIS", self.nis, self.nis_band, self.nis_share),
        ):
            known = np.isfinite(values)
            if not known.any():
                rows.append((name, "no innovation at the times of the samples"))
                continue
            widest = f"{band[known, 0].min():.4g} to {band[known, 1].max():.4g}"
            text = f"mean {values[known].mean():.4g}, band {widest}, inside at {100.0 * share:.3g} % of the times"
            rows.append((name, text))
        return f"Consistency of {self.members.max():,} filters at {len(self.time):,} times, {percent:g} % bands", rows


def consistency(result: Any, level: float = 0.95) -> Consistency:
    """Compare what the filters of an ensemble believe with what is so, by chi-square tests at each time.

    A filter is consistent where its errors are as large as its covariance says. Then NEES, e^T P^-1 e by the truth, has 15
    degrees of freedom, and the squared innovations over their variances (NIS) have one each, if the model is linear and the
    noise is normal; members are independent, so sums over them have as many times these. Bar-Shalom, Li & Kirubarajan (2001),
    *Estimation with Applications to Tracking and Navigation*, section 5.4. Errors of one member at two times are not
    independent: one ensemble may be outside its NEES band for long, by chance.

    Args:
        result: Result of a run with an `lw.control.ErrorStateFilter` that saved "nees", "nis" and "nis_count".
        level: Probability of each band, in (0, 1); 0.95 by default.

    Returns:
        The means and their bands, by time.

    Raises:
        SceneError: Where the result lacks these samples, or the level is not in (0, 1).

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.SaveAt(every=1.0, fields=("nees", "nis", "nis_count")).fields
        ('nees', 'nis', 'nis_count')
    """
    result_of(result)
    faults = Faults()
    chance = faults.number("level", level)
    if chance is not None and not 0.0 < chance < 1.0:
        faults.add("level", level, "is no probability between 0 and 1", "give 0.95, say")
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
    return Consistency(result.time, members, means, bands, rate, nis_bands, float(level))


def _share(values: np.ndarray, band: np.ndarray) -> float:
    """The share of those that have a band and are in it, which NaN is not; NaN for none."""
    known = np.isfinite(band).all(axis=1)
    inside = (values >= band[:, 0]) & (values <= band[:, 1])
    return float(inside[known].mean()) if known.any() else np.nan
