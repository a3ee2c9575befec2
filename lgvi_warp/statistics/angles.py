"""Means of what lives on a circle or on SO(3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.statistics import intervals
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimate import Estimate, along
from lgvi_warp.statistics.moments import component_dims, empty_as_nan, estimate, joined_means, sums
from lgvi_warp.statistics.tree import Part
from lgvi_warp.statistics.values import Values


@dataclass(frozen=True, eq=False)
class CircularMean(Statistic):
    """Mean direction of angles [rad] in (-pi, pi], with the resultant length: value, resultant_length, (k, d).

    resultant_length is 1 where all are equal and 0 where they spread over the circle, and has an interval too:
    resultant_length_lower, _upper. circular_deviation [rad]: sqrt(-2 log of it). Intervals: normal theory (delta method
    from the covariance of cosine and sine); the whole circle where the resultant is not clear of 0. Of the length that of
    the logarithm of 1 less it, as of a variance (see Covariance): 0 to 1 of two members.
    """

    type: ClassVar[str] = "circular_mean"

    def rows(self, values: Values) -> Part:
        """Moments of cosines and sines."""
        d = values.x.shape[1]
        both = Values(np.concatenate([np.cos(values.x), np.sin(values.x)], axis=1), values.good)
        c, s = both.centred[:, :d], both.centred[:, d:]
        found = {"count": both.count, "mean": both.mean}
        pairs = {"cc": (c, c), "cs": (c, s), "ss": (s, s)}
        return found | {key: np.einsum("kdn,kdn->kd", *pair) for key, pair in pairs.items()}

    def join(self, left: Part, right: Part, place: tuple[int, int]) -> Part:
        """Moments about the common mean."""
        both, *shifts = joined_means(left, right)
        d = left["cc"].shape[1]
        for key, i, j in (("cc", 0, 0), ("cs", 0, d), ("ss", d, d)):
            moments = (
                part[key] + part["count"][:, None] * a[:, i : i + d] * a[:, j : j + d]
                for part, a in zip((left, right), shifts, strict=True)
            )
            both[key] = np.asarray(sum(moments))
        return both

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        """atan2 of the mean sine and cosine; its error from their covariance along and across the mean direction."""
        count, d = part["count"], part["cc"].shape[1]
        n = count[:, None]
        C, S = empty_as_nan(part["mean"], count)[:, :d], empty_as_nan(part["mean"], count)[:, d:]
        length = np.hypot(C, S)
        safe = np.where(length > 0.0, length, 1.0)
        u, v = C / safe, S / safe
        scale = np.maximum(n - 1, 1) * np.maximum(n, 1)
        cc, cs, ss = (part[key] / scale for key in ("cc", "cs", "ss"))
        across = np.sqrt(np.maximum(v * v * cc - 2.0 * u * v * cs + u * u * ss, 0.0))
        along = np.sqrt(np.maximum(u * u * cc + 2.0 * u * v * cs + v * v * ss, 0.0))
        arrays = {"value": np.arctan2(S, C), "resultant_length": length}
        # The angles' spread about their own mean, as of a variance: 1 - cos of small angles is half their square.
        least, some = np.maximum(n - 1, 1), np.maximum(n, 1)
        wide = np.sqrt(along**2 + 3.0 * length * (1.0 - length) ** 2 / (some * least)) * (some / least)
        factors = (intervals.student(one, self.confidence) for one in (n, n - 1))
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
        """Intervals from the errors of the mean of (cosine, sine), across and along its direction, and of its length."""
        across, along, wide = errors
        error = across / np.where(length > 0.0, length, 1.0)
        clear = np.isfinite(factor) & (np.where(np.isfinite(factor), factor, 0.0) * np.maximum(across, along) < length)
        half = np.where(clear, np.minimum(np.where(clear, factor, 0.0) * error, np.pi), np.pi)
        high, low = (1.0 - end for end in intervals.of_logarithm(1.0 - length, wide, factor_of_length))
        found = {"lower": value - half, "upper": value + half, "standard_error": error}
        return found | {"resultant_length_lower": np.fmax(low, 0.0), "resultant_length_upper": np.fmin(high, 1.0)}

    def spread(self, whole: Estimate, each: Sequence[Estimate]) -> Estimate:
        """The delta method again, with the covariance of the mean that the replicates' means have."""
        turned = np.stack([one.value for one in each]) - whole.value
        length = np.stack([one["resultant_length"] for one in each])
        across, along = (
            intervals.of_replicates(length * part, self.confidence)[0] for part in (np.sin(turned), np.cos(turned))
        )
        factor = intervals.student(np.array(len(each)), self.confidence)
        found = self._ends(whole.value, whole["resultant_length"], (across, along, along), factor, factor)
        return whole.with_interval(f"delta method on the circle, Student's t of {len(each)} replicates", found)


@dataclass(frozen=True, eq=False)
class MeanAttitude(Statistic):
    """The rotation nearest the mean of the members' attitudes (chordal mean, Moakher 2002): value (k, 3, 3).

    dispersion (k,) [rad]: sqrt(mean of |R - value|^2 / 2), the root mean square angle where angles are small. covariance
    (k, 3, 3) [rad^2]: of v in R = value exp(hat(v)), body axes, to first order. rotation_half_width (k, 3) [rad]: of the
    interval of the mean, about each body axis. lower, upper: that for each entry of the matrix, to first order.
    """

    type: ClassVar[str] = "mean_attitude"
    default: ClassVar[str] = "attitude"

    def check(self, faults: Faults) -> None:
        """It is of the attitude, and of nothing else."""
        if self.of != "attitude":
            faults.add("of", self.of, "is no attitude", 'leave it out, or give "attitude"')

    @property
    def key(self) -> str:
        """mean_attitude, if no name was given."""
        return self.name or self.type

    def rows(self, values: Values) -> Part:
        """Mean and covariance of the nine entries."""
        return {"count": values.count, "mean": values.mean, "m11": sums(values.centred, values.centred)}

    def join(self, left: Part, right: Part, place: tuple[int, int]) -> Part:
        """Moments about the common mean."""
        both, a, b = joined_means(left, right)
        n, m = left["count"][:, None, None], right["count"][:, None, None]
        shifted = (left["m11"] + n * a[:, :, None] * a[:, None], right["m11"] + m * b[:, :, None] * b[:, None])
        return both | {"m11": shifted[0] + shifted[1]}

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        """Polar part of the mean M = R S; a change dM turns R by (tr(S) I - S)^-1 vee(R^T dM - dM^T R)."""
        count = part["count"]
        few = (count < 1)[:, None, None]
        M = np.where(few, np.eye(3), part["mean"].reshape(-1, 3, 3))
        U, sigma, Vt = np.linalg.svd(M)
        flip = np.sign(np.linalg.det(U @ Vt))
        U[:, :, 2] *= flip[:, None]
        sigma[:, 2] *= flip
        R = U @ Vt
        S = np.swapaxes(R, 1, 2) @ M
        trace = np.einsum("kii->k", S)
        spread = trace[:, None, None] * np.eye(3) - 0.5 * (S + np.swapaxes(S, 1, 2))
        # Turns that the mean leaves open, where attitudes spread over all of SO(3), have no finite error.
        known = np.linalg.eigvalsh(spread)[:, 0] > 1e-9
        inverse = np.linalg.inv(np.where(known[:, None, None], spread, np.eye(3)))
        vee = np.zeros((3, 3, 3))
        for i, (j, k) in enumerate(((2, 1), (0, 2), (1, 0))):
            vee[i, j, k], vee[i, k, j] = 1.0, -1.0
        # q_i = sum of vee[i, j, k] (R^T X)_jk, X an attitude; then turned into the angle about each axis.
        to_angle = (inverse @ np.einsum("ijk,tlj->tilk", vee, R).reshape(-1, 3, 9)).reshape(-1, 3, 9)
        n = np.maximum(count - 1, 1)[:, None, None]
        covariance = to_angle @ (part["m11"] / n) @ np.swapaxes(to_angle, 1, 2)
        # |R - X|^2 = 6 - 2 tr(R^T X), and the mean of X is M.
        dispersion = np.sqrt(np.maximum(3.0 - trace, 0.0))
        value = empty_as_nan(R, count)
        turn = covariance / np.maximum(count, 1)[:, None, None]
        ends = self._ends(value, turn, known, intervals.student(count, self.confidence))
        arrays = {"value": value} | ends | {"covariance": empty_as_nan(covariance, count, 2), "dispersion": dispersion}
        dims = along(("value", "lower", "upper", "covariance"), "time", "row", "column")
        dims |= {"rotation_half_width": ("time", "axis"), "standard_error": ("time", "axis")}
        arrays |= {"count": count}
        dims |= {"dispersion": ("time",), "count": ("time",)}
        axes = {"row": np.arange(3), "column": np.arange(3), "axis": np.array(["x", "y", "z"])}
        return estimate(self, "delta method on SO(3)", dims, arrays, time, axes, labels=())

    def _ends(self, R: np.ndarray, turn: np.ndarray, known: np.ndarray, factor: np.ndarray) -> dict[str, np.ndarray]:
        """Intervals from the covariance (k, 3, 3) of the mean's small turns, where it is known (k,)."""
        error = np.where(known[:, None], np.sqrt(np.maximum(np.einsum("kii->ki", turn), 0.0)), np.inf)
        some = known & np.isfinite(factor)
        t = np.where(some, factor, 0.0)
        half = np.where(some[:, None], t[:, None] * np.where(known[:, None], error, 0.0), np.pi)
        reach = np.where(some[:, None, None], t[:, None, None] * self._entries(R, turn), 2.0)
        found = {"lower": R - reach, "upper": R + reach}
        return found | {"rotation_half_width": np.minimum(half, np.pi), "standard_error": error}

    def spread(self, whole: Estimate, each: Sequence[Estimate]) -> Estimate:
        """The same from the turns of the replicates' means from that of all."""
        X = np.swapaxes(whole.value, 1, 2) @ np.stack([one.value for one in each])
        # v of X = exp(hat(v)), but for a third power of its length.
        v = 0.5 * np.stack([X[..., j, i] - X[..., i, j] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
        v = v - v.mean(axis=0)
        n = len(each)
        turn = np.einsum("rki,rkj->kij", v, v) / (n * (n - 1))
        known = np.isfinite(whole["standard_error"]).all(axis=1) & np.isfinite(turn).all(axis=(1, 2))
        factor = np.full(len(turn), intervals.student(np.array(n), self.confidence))
        found = self._ends(whole.value, np.where(known[:, None, None], turn, 0.0), known, factor)
        return whole.with_interval(f"rotations' Student's t of {n} replicates", found)

    @staticmethod
    def _entries(R: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Standard error of each entry of R under a small turn of this covariance (k, 3, 3): R hat(v)."""
        hats = np.zeros((3, 3, 3))
        for i, (j, k) in enumerate(((2, 1), (0, 2), (1, 0))):
            hats[i, j, k], hats[i, k, j] = 1.0, -1.0
        moves = np.einsum("tij,ajk->taik", R, hats)
        variance = np.einsum("taik,tab,tbik->tik", moves, turn, moves)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
