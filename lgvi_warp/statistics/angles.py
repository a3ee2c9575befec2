# SPDX-License-Identifier: Apache-2.0
"""Means of quantities on the circle and on SO(3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, among
from lgvi_warp.physics import notation
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.statistics.estimates.estimate import Estimate, along
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.moments import component_dims, empty_as_nan, estimate, joined_means, sums
from lgvi_warp.statistics.values.values import Values
from lgvi_warp.statistics.weighted import Weighted

# The skew matrices of the axes; + 0.0 leaves no -0.
HATS = notation.hat(np.eye(3)) + 0.0


@dataclass(frozen=True, eq=False)
class CircularMean(Statistic):
    """Mean direction of angles [rad], with the resultant length.

    The interval of the direction follows from normal theory (delta method, covariance of cosine and sine). It is the
    whole circle if the resultant length is not significantly above 0. The interval of the resultant length is computed
    for the logarithm of 1 minus the length, as for a variance (see Covariance). With two members it is (0, 1).

    Arrays of the estimate, in addition to lower, upper and count (k,), for k sample times and d components:

    * value (k, d) [rad]: the mean direction, in (-pi, pi].
    * resultant_length (k, d): length of the mean of the unit vectors: 1 if all angles are equal, 0 if they spread
      evenly over the circle. Its interval is resultant_length_lower to resultant_length_upper.
    * circular_deviation (k, d) [rad]: sqrt(-2 log(resultant_length)).
    * standard_error (k, d) [rad]: standard error of the mean direction.

    Args:
        of: A quantity in rad, such as "euler[2]" (see lw.statistics.Quantity).
    """

    type: ClassVar[str] = "circular_mean"

    def rows(self, values: Values) -> Part:
        d = values.x.shape[1]
        both = values.with_numbers(np.concatenate([np.cos(values.x), np.sin(values.x)], axis=1))
        c, s = both.centred[:, :d], both.centred[:, d:]
        moments = {"count": both.count, "mean": both.mean}
        pairs = {"cc": (c, c), "cs": (c, s), "ss": (s, s)}
        return moments | {key: np.einsum("kdn,kdn->kd", a, both.weighed(b)) for key, (a, b) in pairs.items()}

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        # Join the moments about the common mean.
        both, *shifts = joined_means(first, second)
        d = first["cc"].shape[1]
        for key, i, j in (("cc", 0, 0), ("cs", 0, d), ("ss", d, d)):
            moments = (
                part[key] + part["count"][:, None] * a[:, i : i + d] * a[:, j : j + d]
                for part, a in zip((first, second), shifts, strict=True)
            )
            both[key] = np.asarray(sum(moments))
        return both

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        # Atan2 of the mean sine and cosine; its error follows from their covariance about that direction.
        # docs/theory/estimators.md, (E18).
        n = part["count"][:, None]
        scale = np.maximum(n - 1, 1) * np.maximum(n, 1)
        variances = tuple(part[key] / scale for key in ("cc", "cs", "ss"))
        return self._estimate(empty_as_nan(part["mean"], part["count"]), variances, part["count"], time)

    def weighted_read(self, weighted: Weighted, time: np.ndarray) -> Estimate:
        # The covariance of the linearised means of cosine and sine.
        mean, squares, d = weighted.own["mean"], weighted.squares, weighted.own["cc"].shape[1]
        c, s = weighted.off(mean)[:, :d], weighted.off(mean)[:, d:]
        total, scale = squares["count"][:, None], (weighted.unbiased / weighted.weight**2)[:, None]
        scale = np.where(np.isfinite(scale), scale, 0.0)
        pairs = {"cc": c * c, "cs": c * s, "ss": s * s}
        variances = tuple(scale * (squares[key] + total * pair) for key, pair in pairs.items())
        return self._estimate(empty_as_nan(mean, weighted.members), variances, weighted.effective, time)

    def _estimate(
        self, mean: np.ndarray, variances: tuple[np.ndarray, ...], count: np.ndarray, time: np.ndarray
    ) -> Estimate:
        """The estimate from the means (k, 2 d) of cosine and sine, their variances and covariance (k, d), and the count."""
        n, d = count[:, None], mean.shape[1] // 2
        C, S = mean[:, :d], mean[:, d:]
        length = np.hypot(C, S)
        safe = np.where(length > 0.0, length, 1.0)
        u, v = C / safe, S / safe
        cc, cs, ss = variances
        across = np.sqrt(np.maximum(v * v * cc - 2.0 * u * v * cs + u * u * ss, 0.0))
        along = np.sqrt(np.maximum(u * u * cc + 2.0 * u * v * cs + v * v * ss, 0.0))
        arrays = {"value": np.arctan2(S, C), "resultant_length": length}
        # 1 - cos of small angles is half their square: 1 - length is treated as a variance.
        least, some = np.maximum(n - 1, 1), np.maximum(n, 1)
        wide = np.sqrt(along**2 + 3.0 * length * (1.0 - length) ** 2 / (some * least)) * (some / least)
        factors = (intervals.student(size, self.confidence) for size in (n, n - 1))
        arrays |= self._ends(arrays["value"], length, (across, along, wide), *factors)
        arrays |= {"circular_deviation": np.sqrt(-2.0 * np.log(np.clip(length, 1e-300, 1.0))), "count": count}
        return estimate(self, "delta method on the circle", component_dims(*list(arrays)[:-1]), arrays, time)

    @staticmethod
    def _ends(
        value: np.ndarray,
        length: np.ndarray,
        errors: tuple[np.ndarray, np.ndarray, np.ndarray],
        factor: np.ndarray,
        factor_of_length: np.ndarray,
    ) -> dict[str, np.ndarray]:
        """Intervals of the mean direction (k, d) [rad] and of the resultant length (k, d).

        errors: standard errors (k, d) of the mean of (cosine, sine) across and along its direction, and of its length.
        """
        across, along, wide = errors
        error = across / np.where(length > 0.0, length, 1.0)
        clear = np.isfinite(factor) & (np.where(np.isfinite(factor), factor, 0.0) * np.maximum(across, along) < length)
        half = np.where(clear, np.minimum(np.where(clear, factor, 0.0) * error, np.pi), np.pi)
        high, low = (1.0 - end for end in intervals.of_logarithm(1.0 - length, wide, factor_of_length))
        arrays = {"lower": value - half, "upper": value + half, "standard_error": error}
        return arrays | {"resultant_length_lower": np.fmax(low, 0.0), "resultant_length_upper": np.fmin(high, 1.0)}

    def spread(self, pooled: Estimate, each: Sequence[Estimate]) -> Estimate:
        # Apply the delta method with the covariance of the mean that follows from the replicates' means.
        turned = np.stack([replicate.value for replicate in each]) - pooled.value
        length = np.stack([replicate["resultant_length"] for replicate in each])
        across, along = (
            intervals.of_replicates(length * projection, self.confidence)[0]
            for projection in (np.sin(turned), np.cos(turned))
        )
        factor = intervals.student(np.array(len(each)), self.confidence)
        arrays = self._ends(pooled.value, pooled["resultant_length"], (across, along, along), factor, factor)
        return pooled.with_interval(f"delta method on the circle, Student's t of {len(each)} replicates", arrays)


@dataclass(frozen=True, eq=False)
class MeanAttitude(Statistic):
    """Mean attitude: the rotation nearest to the mean of the members' rotation matrices (chordal mean, Moakher 2002).

    Arrays of the estimate, in addition to count (k,), for k sample times; R is a member's attitude:

    * value (k, 3, 3): the mean rotation; lower, upper: interval of each of its entries, to first order.
    * dispersion (k,) [rad]: sqrt(mean of |R - value|^2 / 2); for small angles it is the root mean square angle.
    * covariance (k, 3, 3) [rad^2]: covariance of the rotation vector v of value^T R, in body axes, to first order.
    * rotation_half_width (k, 3) [rad]: half width of the mean's interval about each body axis.
    * standard_error (k, 3) [rad]: standard error of the mean about each body axis.

    Args:
        of: "attitude", the only allowed quantity and the default.
    """

    type: ClassVar[str] = "mean_attitude"
    default: ClassVar[str] = "attitude"

    def check(self, faults: Faults) -> None:
        if not among(self.of, ("attitude",)):
            faults.add("of", self.of, "is not an attitude", 'leave it out, or give "attitude"')

    @property
    def key(self) -> str:
        return self.name or self.type

    def rows(self, values: Values) -> Part:
        return {"count": values.count, "mean": values.mean, "m11": sums(values.centred, values.weighed(values.centred))}

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        # Join the moments about the common mean.
        both, a, b = joined_means(first, second)
        n, m = first["count"][:, None, None], second["count"][:, None, None]
        shifted = (first["m11"] + n * a[:, :, None] * a[:, None], second["m11"] + m * b[:, :, None] * b[:, None])
        return both | {"m11": shifted[0] + shifted[1]}

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        # The polar part R of the mean M = R S; a change dM turns R by (tr(S) I - S)^-1 vee(R^T dM - dM^T R).
        count = part["count"]
        covariance = part["m11"] / np.maximum(count - 1, 1)[:, None, None]
        return self._estimate(part["mean"], covariance, None, count, time)

    def weighted_read(self, weighted: Weighted, time: np.ndarray) -> Estimate:
        # The same, with the covariance of the linearised mean.
        mean, squares, unbiased = weighted.own["mean"], weighted.squares, weighted.unbiased[:, None, None]
        unbiased, W, a = (
            np.where(np.isfinite(unbiased), unbiased, 0.0),
            weighted.weight[:, None, None],
            weighted.off(mean),
        )
        turn = (squares["m11"] + squares["count"][:, None, None] * a[:, :, None] * a[:, None]) / W**2 * unbiased
        return self._estimate(mean, weighted.own["m11"] / W * unbiased, turn, weighted.effective, time)

    def _estimate(
        self, mean: np.ndarray, spread: np.ndarray, of_mean: np.ndarray | None, count: np.ndarray, time: np.ndarray
    ) -> Estimate:
        """The estimate from the mean (k, 9) of the matrices, their and the mean's covariance (k, 9, 9), and the count.

        of_mean: covariance of the mean; None for independent members.
        """
        few = (count <= 0)[:, None, None]
        M = np.where(few, np.eye(3), mean.reshape(-1, 3, 3))
        U, sigma, Vt = np.linalg.svd(M)
        flip = np.sign(np.linalg.det(U @ Vt))
        U[:, :, 2] *= flip[:, None]
        sigma[:, 2] *= flip
        R = U @ Vt
        S = np.swapaxes(R, 1, 2) @ M
        trace = np.einsum("kii->k", S)
        stiffness = trace[:, None, None] * np.eye(3) - 0.5 * (S + np.swapaxes(S, 1, 2))
        # Where attitudes spread over all of SO(3) the mean leaves some turns undetermined: their error is infinite.
        known = np.linalg.eigvalsh(stiffness)[:, 0] > 1e-9
        inverse = np.linalg.inv(np.where(known[:, None, None], stiffness, np.eye(3)))
        # q_i = sum of vee[i, j, k] (R^T X)_jk for an attitude X; `inverse` converts q to angles about the axes.
        to_angle = (inverse @ np.einsum("ijk,tlj->tilk", HATS, R).reshape(-1, 3, 9)).reshape(-1, 3, 9)
        covariance = to_angle @ spread @ np.swapaxes(to_angle, 1, 2)
        # |R - X|^2 = 6 - 2 tr(R^T X), and the mean of X is M.
        dispersion = np.sqrt(np.maximum(3.0 - trace, 0.0))
        value = empty_as_nan(R, count)
        turn = covariance / np.maximum(count, 1)[:, None, None]
        if of_mean is not None:
            turn = to_angle @ of_mean @ np.swapaxes(to_angle, 1, 2)
        ends = self._ends(value, turn, known, intervals.student(count, self.confidence))
        arrays = {"value": value} | ends | {"covariance": empty_as_nan(covariance, count, 2), "dispersion": dispersion}
        dims = along(("value", "lower", "upper", "covariance"), "time", "row", "column")
        dims |= {"rotation_half_width": ("time", "axis"), "standard_error": ("time", "axis")}
        arrays |= {"count": count}
        dims |= {"dispersion": ("time",), "count": ("time",)}
        axes = {"row": np.arange(3), "column": np.arange(3), "axis": np.array(["x", "y", "z"])}
        return estimate(self, "delta method on SO(3)", dims, arrays, time, axes, labels=())

    def _ends(self, R: np.ndarray, turn: np.ndarray, known: np.ndarray, factor: np.ndarray) -> dict[str, np.ndarray]:
        """Intervals from the covariance `turn` (k, 3, 3) [rad^2] of small rotations of the mean, if it is known."""
        error = np.where(known[:, None], np.sqrt(np.maximum(np.einsum("kii->ki", turn), 0.0)), np.inf)
        some = known & np.isfinite(factor)
        t = np.where(some, factor, 0.0)
        half = np.where(some[:, None], t[:, None] * np.where(known[:, None], error, 0.0), np.pi)
        reach = np.where(some[:, None, None], t[:, None, None] * self._entries(R, turn), 2.0)
        arrays = {"lower": R - reach, "upper": R + reach}
        return arrays | {"rotation_half_width": np.minimum(half, np.pi), "standard_error": error}

    def spread(self, pooled: Estimate, each: Sequence[Estimate]) -> Estimate:
        # Form the intervals from the turns of the replicates' means relative to the mean of all members.
        X = np.swapaxes(pooled.value, 1, 2) @ np.stack([replicate.value for replicate in each])
        # v of X = exp(hat(v)), with an error of third order in its length.
        v = 0.5 * np.stack([X[..., j, i] - X[..., i, j] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
        v = v - v.mean(axis=0)
        n = len(each)
        turn = np.einsum("rki,rkj->kij", v, v) / (n * (n - 1))
        known = np.isfinite(pooled["standard_error"]).all(axis=1) & np.isfinite(turn).all(axis=(1, 2))
        factor = np.full(len(turn), intervals.student(np.array(n), self.confidence))
        arrays = self._ends(pooled.value, np.where(known[:, None, None], turn, 0.0), known, factor)
        return pooled.with_interval(f"rotations' Student's t of {n} replicates", arrays)

    @staticmethod
    def _entries(R: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Standard error of each entry of R; `turn` (k, 3, 3) [rad^2] is the covariance of v in the change R hat(v)."""
        moves = np.einsum("tij,ajk->taik", R, HATS)
        variance = np.einsum("taik,tab,tbik->tik", moves, turn, moves)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
