# SPDX-License-Identifier: Apache-2.0
"""Means, covariances, and the moments for their errors; joined by shifts to the common mean (Chan 1979)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.statistics.estimates.estimate import Dims, Estimate, along
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.values.values import Values
from lgvi_warp.statistics.weighted import Weighted


def sums(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the sums (k, d, d) over members of a_i b_j, for two arrays (k, d, n)."""
    # BLAS pays only for more than a few rows; pieces keep each product too small for BLAS to start threads of its own.
    if a.shape[1] <= 4:
        return np.einsum("kin,kjn->kij", a, b)
    parts = (a[..., i : i + 512] @ np.swapaxes(b[..., i : i + 512], 1, 2) for i in range(0, a.shape[2], 512))
    return np.asarray(sum(parts))


def joined_means(first: Part, second: Part) -> tuple[Part, np.ndarray, np.ndarray]:
    """Return count (k,) and mean (k, d) of two joined sets, and each set's mean minus the joined mean, (k, d) each.

    docs/theory/estimators.md, (E2).
    """
    n = first["count"] + second["count"]
    share = (second["count"] / np.where(n > 0, n, 1))[:, None]
    delta = second["mean"] - first["mean"]
    none = (first["count"] == 0)[:, None]
    mean = np.where(none, second["mean"], first["mean"] + share * delta)
    return {"count": n, "mean": mean}, -share * delta, (1.0 - share) * delta


def outer(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the products a_i b_j (k, d, d) at each time, for two arrays (k, d)."""
    return np.asarray(a[:, :, None] * b[:, None, :])


def moved(part: Part, a: np.ndarray) -> Part:
    """Return second to fourth moments about the mean minus `a` (k, d), (k, d, d) each.

    For x minus its mean, m11[i, j] is the sum of x_i x_j, m21 of x_i^2 x_j, m22 of x_i^2 x_j^2 (if the part has these).
    About the new point they are the sums of (x_i + a_i) (x_j + a_j) and so on.
    """
    n, m11, aa = part["count"][:, None, None], part["m11"], outer(a, a)
    moments = {"m11": m11 + n * aa}
    if "m21" in part:
        squares = np.einsum("kii->ki", m11)
        m20, m02, ai, aj = squares[:, :, None], squares[:, None], a[:, :, None], a[:, None]
        m21, m12 = part["m21"], np.swapaxes(part["m21"], 1, 2)
        moments["m21"] = m21 + 2.0 * ai * m11 + aj * m20 + n * ai * aa
        moments["m22"] = (
            part["m22"] + 2.0 * (aj * m21 + ai * m12) + aj**2 * m20 + ai**2 * m02 + 4.0 * aa * m11 + n * aa**2
        )
    return moments


def joined(first: Part, second: Part) -> Part:
    """Return the moments of two joined sets of members about their common mean."""
    both, a, b = joined_means(first, second)
    moments, more = moved(first, a), moved(second, b)
    return both | {key: moments[key] + more[key] for key in moments}


def empty_as_nan(values: np.ndarray, count: np.ndarray, least: int = 1) -> np.ndarray:
    """Return values (k, ...) with NaN at times that have fewer members (k,) than `least`."""
    few = (count < least).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(np.where(few, np.nan, values))


def component_dims(*names: str) -> Dims:
    """Return the dimensions (time, component) of several arrays, and (time,) for the count."""
    return {"count": ("time",)} | along(names, "time", "component")


@dataclass(frozen=True, eq=False)
class Mean(Statistic):
    """Mean and standard deviation over members, with Student's t interval of the mean.

    Arrays of the estimate, in addition to lower, upper and count (k,), for k sample times and d components:

    * value (k, d): the mean.
    * standard_deviation (k, d): standard deviation of the members.
    * standard_error (k, d): standard error of the mean.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, statistics=[lw.statistics.Mean("depth")])
        >>> result.statistics["mean depth"].half_width.shape
        (2, 1)
    """

    type: ClassVar[str] = "mean"

    def rows(self, values: Values) -> Part:
        c = values.centred
        return {"count": values.count, "mean": values.mean, "m2": np.einsum("kdn,kdn->kd", c, values.weighed(c))}

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        # Join as Chan, Golub & LeVeque (1979).
        # docs/theory/estimators.md, (E2).
        both, a, b = joined_means(first, second)
        n, m = first["count"][:, None], second["count"][:, None]
        return both | {"m2": first["m2"] + n * a**2 + (second["m2"] + m * b**2)}

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        # The mean with the interval mean -+ t s / sqrt(n).
        # docs/theory/estimators.md, (E1).
        count = part["count"]
        n = count[:, None]
        mean = empty_as_nan(part["mean"], count)
        deviation = empty_as_nan(np.sqrt(part["m2"] / np.maximum(n - 1, 1)), count, 2)
        error = deviation / np.sqrt(np.maximum(n, 1))
        return self._estimate(mean, deviation, error, count, time)

    def weighted_read(self, weighted: Weighted, time: np.ndarray) -> Estimate:
        # The deviation and the error of the linearised ratio.
        # docs/theory/estimators.md, (E16).
        own, squares, W, few = weighted.own, weighted.squares, weighted.weight[:, None], weighted.members
        mean = own["mean"]
        spread = squares["m2"] + squares["count"][:, None] * weighted.off(mean) ** 2
        unbiased = np.where(np.isfinite(weighted.unbiased), weighted.unbiased, np.nan)[:, None]
        deviation, error = np.sqrt(own["m2"] / W * unbiased), np.sqrt(spread * unbiased) / W
        return self._estimate(empty_as_nan(mean, few), deviation, error, weighted.effective, time)

    def _estimate(
        self, mean: np.ndarray, deviation: np.ndarray, error: np.ndarray, count: np.ndarray, time: np.ndarray
    ) -> Estimate:
        """The estimate from the mean, the members' deviation and the mean's error (k, d), and the number of members (k,)."""
        n = count[:, None]
        lower, upper = intervals.about(mean, error, intervals.student(n, self.confidence))
        arrays = {"value": mean, "lower": lower, "upper": upper, "standard_error": error}
        arrays |= {"standard_deviation": deviation, "count": count}
        return estimate(self, "Student's t", component_dims(*list(arrays)[:-1]), arrays, time)


@dataclass(frozen=True, eq=False)
class Covariance(Statistic):
    """Covariance matrix over members, within one quantity or across several.

    The interval uses Student's t with n - 2 degrees of freedom for n members. Its standard error follows from their
    fourth moments (delta method); normality is not assumed. For a variance, the interval is that of its logarithm,
    which is closer to normal. Fourth moments of few members are biased towards small values; the bias for normal
    members, a term of order 1 / n, is corrected (Bonett 2006 for variances). With two members the interval is infinite.

    Arrays of the estimate, in addition to lower, upper and count (k,), for k sample times and d components:

    * value (k, d, d): the covariance, with divisor n - 1.
    * standard_error (k, d, d): standard error of the covariance.
    * correlation (k, d, d): the correlation, without an interval.
    * mean (k, d): the mean.

    Args:
        of: a quantity, or several: of=("position", "speed") has four components.
    """

    type: ClassVar[str] = "covariance"

    def rows(self, values: Values) -> Part:
        c = values.centred
        square = c * c
        moments = {"count": values.count, "mean": values.mean, "m11": sums(c, values.weighed(c))}
        return moments | {"m21": sums(square, values.weighed(c)), "m22": sums(square, values.weighed(square))}

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        # Join the moments about the common mean.
        return joined(first, second)

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        """Return the covariance matrix with its interval.

        docs/theory/estimators.md, (E3).

        For deviations x from the mean of n members, the interval of the covariance s_ij is s_ij -+ t n / (n - 1)
        sqrt((E[x_i^2 x_j^2] - E[x_i x_j]^2 + (E[x_i^2] E[x_j^2] + 2 E[x_i x_j]^2) / n) / (n - 1)).
        """
        count = part["count"]
        n = count[:, None, None]
        value = empty_as_nan(part["m11"] / np.maximum(n - 1, 1), count, 2)
        some = np.maximum(n, 1)
        m11, least = part["m11"] / some, np.maximum(n - 1, 1)
        squares = np.einsum("kii->ki", m11)
        spread = np.maximum(part["m22"] / some - m11**2, 0.0) + (outer(squares, squares) + 2.0 * m11**2) / some
        error = empty_as_nan(np.sqrt(spread / least) * (some / least), count, 2)
        return self._estimate(value, error, empty_as_nan(part["mean"], count), count, time)

    def weighted_read(self, weighted: Weighted, time: np.ndarray) -> Estimate:
        # The same, with the fourth moments under the squares about the weighted mean and covariance.
        own, W, n = weighted.own, weighted.weight[:, None, None], weighted.effective[:, None, None]
        unbiased = np.where(np.isfinite(weighted.unbiased), weighted.unbiased, np.nan)[:, None, None]
        m11 = own["m11"] / W
        about = moved(weighted.squares, weighted.off(own["mean"]))
        squared = about["m22"] - 2.0 * m11 * about["m11"] + m11**2 * weighted.squares["count"][:, None, None]
        squares = np.einsum("kii->ki", m11)
        few = np.maximum(n, 1.0)
        spread = np.maximum(squared, 0.0) / W**2 + (outer(squares, squares) + 2.0 * m11**2) / few**2
        error = np.sqrt(spread * unbiased) * unbiased
        mean = empty_as_nan(own["mean"], weighted.members)
        return self._estimate(m11 * unbiased, error, mean, weighted.effective, time)

    def _estimate(
        self, value: np.ndarray, error: np.ndarray, mean: np.ndarray, count: np.ndarray, time: np.ndarray
    ) -> Estimate:
        """The estimate from the covariance and its error (k, d, d), the mean (k, d) and the number of members (k,)."""
        n = count[:, None, None]
        lower, upper = self._ends(value, error, intervals.student(n - 1, self.confidence))
        deviation = np.sqrt(np.einsum("kii->ki", value))
        scale = outer(deviation, deviation)
        correlation = value / np.where(scale > 0.0, scale, np.inf)
        arrays = {"value": value, "lower": lower, "upper": upper, "standard_error": error, "correlation": correlation}
        arrays |= {"mean": mean, "count": count}
        dims = along(arrays, "time", "component", "component_2")
        dims |= {"mean": ("time", "component"), "count": ("time",)}
        labels = {"component_2": np.array(self.quantity.labels)}
        unit = self.quantity.unit
        unit = "products of the components' units" if "," in unit else f"({unit})^2"
        text = "delta method: fourth moments; of the logarithm for variances"
        return estimate(self, text, dims, arrays, time, labels, unit)

    @staticmethod
    def _ends(value: np.ndarray, error: np.ndarray, factor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Interval value -+ factor error; for variances s^2 exp(-+ factor error / s^2), or from 0 if unbounded."""
        diagonal = np.eye(value.shape[-1], dtype=bool)
        both = zip(intervals.of_logarithm(value, error, factor), intervals.about(value, error, factor), strict=True)
        lower, upper = (np.where(diagonal, variance, covariance) for variance, covariance in both)
        return lower, upper

    def spread(self, pooled: Estimate, each: Sequence[Estimate]) -> Estimate:
        # Form the same intervals with the standard errors of the replicates' estimates.
        error, _ = intervals.of_replicates(np.stack([replicate.value for replicate in each]), self.confidence)
        factor = intervals.student(np.array(len(each)), self.confidence)
        ends = dict(zip(("lower", "upper"), self._ends(pooled.value, error, factor), strict=True))
        text = f"Student's t of {len(each)} replicates; of the logarithm for variances"
        return pooled.with_interval(text, ends | {"standard_error": error})


def estimate(
    statistic: Statistic,
    interval: str,
    dims: Dims,
    arrays: dict[str, np.ndarray],
    time: np.ndarray,
    coordinates: dict[str, np.ndarray] | None = None,
    unit: str | None = None,
    labels: Sequence[str] | None = None,
) -> Estimate:
    """Return the Estimate of a statistic at the sample times (k,) [s]."""
    components = np.array(statistic.quantity.labels if labels is None else labels)
    return Estimate(
        statistic.key,
        statistic.to_dict(),
        statistic.quantity.unit if unit is None else unit,
        statistic.confidence,
        interval,
        dims,
        arrays,
        {"time": time, "component": components} | (coordinates or {}),
    )
