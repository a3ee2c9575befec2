# SPDX-License-Identifier: Apache-2.0
"""Kernel densities: smooth distributions of one number, or jointly of several, from draws."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.sampling.distributions.joint import JointLaw, combined, components, normals, root_of_covariance, split

# Kernels reach so many bandwidths: levels down to 2^-54 lie within, for some 10^4 draws.
REACH = 9
# Points of the table of levels in a bandwidth, where there are draws: between them levels are right to 1e-7.
POINTS = 32
# Numbers of the table's kernels that are computed at once.
AT_ONCE = 4_000_000


@dataclass(frozen=True, eq=False)
class KernelDensity(JointLaw):
    """Gaussian kernel density of draws, such as posterior draws, of one number or of several numbers jointly.

    Its values are absolute: the scene's own value is not used. The density is the mean of normal distributions
    (kernels) about the draws. A level is a coordinate in the unit cube. For one number, the value rises with its level,
    so that Sobol points and other designs remain evenly spread. For several numbers, one level selects a draw, and the
    other levels select the displacement from this draw.

    Args:
        draws: n draws, (n,) of one number or (n, d) of d numbers jointly. The d numbers are the entries of a vector, or
            of several quantities with the key "a, b" in `vary`.
        bandwidth: Standard deviation of the kernels, in the unit of the quantity: one number, or (d,). By default
            Scott's rule: the covariance of the kernels is the covariance of the draws times n^(-2 / (d + 4)).

    Raises:
        SceneError: If the draws do not vary or are fewer than 2, or a bandwidth is not above 0.

    Examples:
        >>> import lgvi_warp as lw
        >>> import numpy as np
        >>> draws = np.random.default_rng(1).normal([306.0, 0.5], [1.0, 0.1], (500, 2))
        >>> vary = {"vehicle.buoyancy, start.velocity[0]": lw.distributions.KernelDensity(draws)}
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> print(f"{lw.Ensemble(scene, members=1000, vary=vary).parameters(0, 1000)['vehicle.buoyancy'].mean():.0f}")
        306
    """

    draws: Any = ()
    bandwidth: Any = None
    kind: ClassVar[str] = "kernel_density"
    several: ClassVar[bool] = True

    def __post_init__(self) -> None:
        faults = Faults(f"{self.kind}.")
        draws = faults.finite("draws", self.draws)
        if draws is not None and (draws.ndim not in (1, 2) or len(draws) < 2 or draws.size == 0):
            faults.add("draws", draws, f"have shape {draws.shape}", "give (n,) or (n, d) numbers, n from 2")
        elif draws is not None:
            columns = draws.reshape(len(draws), -1)
            object.__setattr__(self, "_draws", columns)
            if self.bandwidth is None and not (np.ptp(columns, axis=0) > 0.0).all():
                which = int(np.argmin(np.ptp(columns, axis=0) > 0.0))
                faults.add(
                    "draws", columns[0, which], f"of number {which} do not vary", "give a bandwidth, or leave it out"
                )
            elif not faults:
                self._check_bandwidth(faults, columns)
        faults.raise_if_any()

    def _check_bandwidth(self, faults: Faults, columns: np.ndarray) -> None:
        """Set the root of the kernels' covariance."""
        n, d = columns.shape
        if self.bandwidth is None:
            covariance = np.atleast_2d(np.cov(columns, rowvar=False)) * n ** (-2.0 / (d + 4))
            object.__setattr__(self, "_root", root_of_covariance(covariance))
            return
        width = faults.finite("bandwidth", self.bandwidth)
        if width is None:
            return
        if width.ndim > 1 or width.size not in (1, d) or not (width > 0.0).all():
            faults.add("bandwidth", self.bandwidth, "is not above 0 for each number", f"give one number, or {d}")
        else:
            object.__setattr__(self, "_root", np.diag(np.broadcast_to(width, d)))

    @property
    def joint(self) -> bool:
        return bool(self._columns.shape[1] > 1)

    @property
    def _columns(self) -> np.ndarray:
        return np.asarray(self._draws)  # type: ignore[attr-defined]

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        d, named = self._columns.shape[1], components(shapes)
        if d == 1:
            # Of one number it is the same for each entry.
            return None if len(shapes) == 1 else ("draws one quantity, several are named", "give draws (n, d)")
        fit = f"give draws (n, {named}), in the order of the names"
        return None if named == d else (f"has draws of {d} numbers, {named} are named", fit)

    def size(self, bases: Sequence[np.ndarray]) -> int:
        # One uniform number chooses the draw.
        return 1 + self._columns.shape[1]

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        n = len(self._columns)
        chosen = np.minimum((u[:, 0] * n).astype(np.int64), n - 1)
        kernel: np.ndarray = self._root  # type: ignore[attr-defined]
        return split(self._columns[chosen] + combined(kernel, normals(u[:, 1:])), bases)

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        return np.asarray(self._inverse(normals(np.clip(u, 2.0**-54, 1.0 - 2.0**-53))))

    @functools.cached_property
    def _inverse(self) -> Callable[[np.ndarray], np.ndarray]:
        """Function from the normal score of a level to the value, by monotone cubic interpolation of a table."""
        from scipy.interpolate import PchipInterpolator

        draws, h = np.sort(self._columns[:, 0]), float(self._root[0, 0])  # type: ignore[attr-defined]
        x = _points(draws, h)
        score = _scores(x, draws, h)
        # Where no draw is near, the level stands still: of such points the first and the last are kept.
        moves = np.diff(score) > 0.0
        kept = np.concatenate([[True], moves]) | np.concatenate([moves, [True]])
        kept &= np.isfinite(score)
        x, score = x[kept], score[kept]
        rises = np.concatenate([[True], np.diff(score) > 0.0])
        inverse: Callable[[np.ndarray], np.ndarray] = PchipInterpolator(score[rises], x[rises], extrapolate=True)
        return inverse

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_inverse"}


def _points(draws: np.ndarray, h: float) -> np.ndarray:
    """Rising points, dense wherever a kernel of the sorted draws reaches."""
    near = REACH * h
    ends = np.flatnonzero(np.diff(draws) > 2.0 * near)
    first, last = draws[np.append(0, ends + 1)] - near, draws[np.append(ends, len(draws) - 1)] + near
    counts = 1 + np.ceil((last - first) / h * POINTS).astype(np.int64)
    return np.concatenate([np.linspace(*heap) for heap in zip(first, last, counts, strict=True)])


def _scores(x: np.ndarray, draws: np.ndarray, h: float) -> np.ndarray:
    """Normal scores (m,) of the levels of points x (m,), from the nearer tail, so that small levels keep their digits."""
    from scipy.special import ndtr, ndtri

    scores = np.empty(len(x))
    pieces = max(1, AT_ONCE // len(draws))
    for begin in range(0, len(x), pieces):
        z = (x[begin : begin + pieces, None] - draws) / h
        below, above = ndtr(z).mean(axis=1), ndtr(-z).mean(axis=1)
        scores[begin : begin + pieces] = np.where(below < above, ndtri(below), -ndtri(above))
    return scores
