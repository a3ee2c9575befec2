# SPDX-License-Identifier: Apache-2.0
"""Smallest regions that contain given shares of positions: level sets of a kernel density on a grid.

The density at a member leaves out its own kernel, and the level of a region is a quantile of these densities. So the
region contains its share of new members with any bandwidth (Lei, Robins & Wasserman 2013, Distribution-free prediction
sets, Journal of the American Statistical Association 108). Each share uses the bandwidth with the smallest area.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy import fft

from lgvi_warp.common.errors import MissingExtra

# Nodes of the grid along each axis, at the first look and where there are clusters, or where the finest bandwidth is best.
SIZES = (384, 512, 1536)
# Coarsest bandwidth, in those of Scott's rule; each of the next is half as wide, down to one cell.
COARSEST, RUNGS = 4.0, 9
# Finer ones are not looked at where the areas of all shares are so many times the least.
HOPELESS = 2.0
# The grid reaches so many of the coarsest bandwidths beyond these quantiles of the places; members outside count as outside.
REACH, TAIL = 3.0, 0.001
# A part of a region with so large a share of the members is a cluster.
SOME = 0.01
# Clusters whose spread is below this part of the whole are as points.
POINT = 1e-6
# A finer bandwidth must lessen the area so far, else it only follows the sample.
GAIN = 0.97
# A level below this part of the largest density is round-off.
LEAST_LEVEL = 1e-9
# Members beyond so many standard deviations of the middle ones are far away.
FAR = 30.0
# The middle ones are this share of the members; so many steps find them, by at most so many members.
MIDDLE, STEPS, ENOUGH = 0.75, 8, 10_000
# Share of the region that the answer is about.
MAIN = 0.95
# Places whose spread across is below this part of that along lie on a line.
THIN = 1e-6
# The interval of an area.
CONFIDENCE = 0.95

# A polygon's rings (k, 2), the outer one first: north and east [m]. In axes east, north the outer one runs counterclockwise.
Polygon = tuple[np.ndarray, ...]


class Outline(NamedTuple):
    """Region of a share: its area with an interval [m2], and its polygons."""

    area: float
    low: float
    high: float
    polygons: tuple[Polygon, ...]


class Whitening:
    """Coordinates in which a covariance is the identity, and wide gaps without density between clusters are shortened.

    So kernels have the shape of a cluster, and clusters far apart fit on one grid.
    """

    def __init__(self, places: np.ndarray, covariance: np.ndarray, widest: float):
        self.middle, self.root, self.widest = places.mean(axis=0), np.linalg.cholesky(covariance), widest
        self.cuts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        least = 4.0 * REACH * widest
        for axis in np.sort(self._white(places), axis=0).T:
            at = np.flatnonzero(np.diff(axis) > least)
            # Lengths cut out before each gap, and after it.
            lost = np.concatenate([[0.0], np.cumsum(axis[at + 1] - axis[at] - least)])
            middles = 0.5 * (axis[at] + axis[at + 1])
            self.cuts.append((middles, middles - 0.5 * (lost[1:] + lost[:-1]), lost))

    def _white(self, places: np.ndarray) -> np.ndarray:
        return np.linalg.solve(self.root, (places - self.middle).T).T

    def of(self, places: np.ndarray) -> np.ndarray:
        """Convert north and east (n, 2) [m] to these coordinates."""
        axes = zip(self._white(places).T, self.cuts, strict=True)
        return np.stack([axis - lost[np.searchsorted(at, axis)] for axis, (at, _, lost) in axes], axis=1)

    def back(self, places: np.ndarray) -> np.ndarray:
        """Convert coordinates (n, 2) to north and east [m]."""
        axes = zip(places.T, self.cuts, strict=True)
        white = np.stack([axis + lost[np.searchsorted(at, axis)] for axis, (_, at, lost) in axes], axis=1)
        return self.middle + white @ self.root.T


class DensityGrid:
    """Members (n, 2) [m] binned on a square grid in the frame's coordinates, which are counted in cells.

    like: A grid whose frame and cells are used; default None makes a grid that contains all but the outermost members.
    """

    def __init__(
        self, places: np.ndarray, weights: np.ndarray, frame: Whitening, size: int, like: DensityGrid | None = None
    ):
        self.frame, self.size, self.weights = frame, size, weights
        places = frame.of(places)
        if like is None:
            margin = REACH * frame.widest
            low, high = np.quantile(places, [TAIL, 1.0 - TAIL], axis=0) + np.array([[-margin], [margin]])
            self.low, self.cell = low, float((high - low).max()) / (size - 1)
        else:
            self.low, self.cell = like.low, like.cell
        # Of a cell [m2].
        self.area = self.cell**2 * float(np.prod(np.diag(frame.root)))
        places = (places - self.low) / self.cell
        self.inside = ((places >= 0.0) & (places < size - 1)).all(axis=1)
        self.at = places[self.inside]
        node = np.floor(self.at).astype(np.int64)
        part, counts = self.at - node, np.zeros(size * size)
        # Binning and interpolation share a member between two nodes of each axis: so much goes from one to the other.
        self.shared = 2.0 * part * (1.0 - part)
        for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
            near = np.where(corner, part, 1.0 - part).prod(axis=1)
            counts += np.bincount((node + corner) @ [size, 1], near * weights[self.inside], size * size)
        self.spectrum = fft.rfft2(counts.reshape(size, size))
        self.count = effective(weights)

    def smoothed(self, h: float) -> Smoothed:
        """Convolve with a normal kernel of standard deviation h [cells]."""
        from scipy.ndimage import map_coordinates

        # The transform of the kernel is a product of one for each axis.
        first, last = (np.exp(-2.0 * (np.pi * h * f(self.size)) ** 2) for f in (fft.fftfreq, fft.rfftfreq))
        density = fft.irfft2(self.spectrum * (first[:, None] * last), s=(self.size, self.size))
        kernel = fft.irfft(last, self.size)
        others = np.zeros(len(self.weights))
        others[self.inside] = map_coordinates(density, self.at.T, order=1)
        own = (kernel[0] + self.shared * (kernel[1] - kernel[0])).prod(axis=1)
        others[self.inside] -= self.weights[self.inside] * own
        order = np.argsort(others)
        shares = np.cumsum(self.weights[order]) / self.weights.sum() * self.count / (self.count + 1.0)
        return Smoothed(self, h, density, shares, others[order])


class Smoothed(NamedTuple):
    """Density on a grid; densities at members without their own kernels, rising, and cumulative shares of members."""

    grid: DensityGrid
    h: float
    density: np.ndarray
    shares: np.ndarray
    others: np.ndarray

    def level(self, outside: float) -> float:
        """Find the density above which all but a share of new members lie; 0 if it cannot be determined."""
        found = float(np.interp(outside, self.shares, self.others, left=0.0, right=np.inf))
        return found if found > LEAST_LEVEL * self.density.max() else 0.0

    def cells(self, share: float) -> float:
        """Count the cells of a share's region; infinite if it cannot be determined."""
        level = self.level(1.0 - share)
        return float(np.count_nonzero(self.density >= level)) if level else np.inf

    def within(self, share: float, places: np.ndarray) -> np.ndarray | None:
        """Pool the covariance (2, 2) [m2] of members (n, 2) [m] within the parts of a region; None for one part."""
        from scipy.ndimage import label

        grid = self.grid
        parts, count = label(self.density >= self.level(1.0 - share))
        part = parts[tuple(np.round(grid.at).astype(np.int64).T)]
        places, weights = places[grid.inside], grid.weights[grid.inside]
        total = np.bincount(part, weights, count + 1)
        large = 1 + np.flatnonzero(total[1:] > SOME * grid.weights.sum())
        if len(large) < 2:
            return None
        means = np.stack([np.bincount(part, weights * axis, count + 1) for axis in places.T], axis=1)
        away = places - (means / np.maximum(total, 1e-300)[:, None])[part]
        some = np.isin(part, large)
        return np.asarray((away[some].T * weights[some]) @ away[some] / weights[some].sum())

    def region(self, share: float) -> Outline:
        """Trace a share's region, with an interval of its area from order statistics of the densities."""
        from scipy.stats import binom

        count = round(self.grid.count)
        first, last = binom.ppf([0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE], count, 1.0 - share)
        outside = (1.0 - share, (last + 1.0) / (count + 1.0), first / (count + 1.0))
        parts, fewer, more = map(self.parts, map(self.level, outside))
        grid = self.grid
        # A ten-thousandth of a cell.
        digits = 4 - math.floor(math.log10(grid.cell * np.diag(grid.frame.root).min()))
        polygons = [
            tuple(grid.frame.back(grid.low + grid.cell * ring).round(digits) for ring in rings) for rings in parts or ()
        ]
        area, low, high = (math.inf if each is None else grid.area * enclosed(each) for each in (parts, fewer, more))
        return Outline(area, low, high, tuple(polygons))

    def parts(self, level: float) -> list[list[np.ndarray]] | None:
        """Trace the region of densities above a level: rings of each part, in cells; None if this is impossible."""
        try:
            from contourpy import FillType, contour_generator
        except ImportError as error:
            raise MissingExtra("footprints", "contourpy", "viz") from error
        above = self.density >= level
        if not level or not above.any():
            return [] if level else None
        # The part of the grid around the region, and one node beyond.
        ends = [np.flatnonzero(above.any(axis=axis))[[0, -1]] for axis in (1, 0)]
        (i, k), (j, m) = ((max(0, a - 1), b + 2) for a, b in ends)
        lines = contour_generator(z=self.density[i:k, j:m], fill_type=FillType.OuterOffset)
        traced: Any = zip(*lines.filled(level, 2.0 * self.density.max()), strict=True)
        return [[points[a:b, ::-1] + [i, j] for a, b in pairwise(offsets)] for points, offsets in traced]


def enclosed(polygons: Iterable[Iterable[np.ndarray]]) -> float:
    """Sum the areas of polygons; rings of holes have the opposite orientation."""
    rings = (ring - ring[0] for polygon in polygons for ring in polygon)
    return sum(0.5 * float(np.sum(r[:-1, 1] * r[1:, 0] - r[1:, 1] * r[:-1, 0])) for r in rings)


def regions(
    places: np.ndarray, weights: np.ndarray, covariance: np.ndarray, shares: Sequence[float], growing: float
) -> tuple[list[Outline], dict[int, Outline], bool]:
    """Find the regions of the shares for which there are enough members.

    places: North and east (n, 2) [m], not all on a line. weights: (n,). growing: The share whose growth is computed.
    covariance: Covariance of the members (2, 2) [m2], without those far away.
    Returns: The regions; number of members -> region of the share `growing`; True if the grid resolves all clusters.
    """
    scott, least = COARSEST * effective(weights) ** (-1.0 / 6.0), POINT**2 * np.trace(covariance)
    quarters = np.quantile(Whitening(places, covariance, math.inf).of(places), [0.25, 0.75], axis=0)
    # Of heavy tails the quartiles tell the width of the middle, as in Silverman's rule.
    frame = Whitening(places, covariance, scott * float(np.clip(np.diff(quarters, axis=0).min() / 1.349, 2.0**-5, 1.0)))
    best: dict[float, tuple[float, Smoothed]] = {}
    former = best
    pooled = resolved = False
    for size in SIZES:
        grid = DensityGrid(places, weights, frame, size)
        for h in [h for h in frame.widest / grid.cell * 0.5 ** np.arange(RUNGS) if h >= 1.0] or [1.0]:
            smoothed = grid.smoothed(h)
            areas = {share: smoothed.cells(share) * grid.area for share in shares}
            best |= {share: (areas[share], smoothed) for share in shares
                     if share not in best or areas[share] < GAIN * best[share][0]}  # fmt: skip
            if all(areas[share] > HOPELESS * best[share][0] for share in shares):
                break
        resolved = all(each is not smoothed for _, each in best.values())
        within = None if pooled else best[growing][1].within(growing, places)
        if within is None and resolved:
            break
        if within is None:
            covariance, widest = frame.root @ frame.root.T, COARSEST * smoothed.h * grid.cell
        else:
            covariance, widest, pooled, former, best = within, scott, True, best, {}
        if np.linalg.eigvalsh(covariance)[0] <= least:
            resolved = False
            break
        frame = Whitening(places, covariance, widest)
    best = {share: best.get(share, each) if each[0] >= GAIN * best.get(share, each)[0] else each
            for share, each in former.items()}  # fmt: skip
    levels = [best[share][1].region(share) for share in shares]
    chosen, order = best[growing][1], np.random.default_rng(0).permutation(len(places))
    grown = {}
    for part in (8, 4, 2):
        some = order[: len(places) // part]
        if len(some) >= least_members(growing):
            grid = DensityGrid(places[some], weights[some], chosen.grid.frame, chosen.grid.size, chosen.grid)
            grown[len(some)] = grid.smoothed(chosen.h * part ** (1.0 / 6.0)).region(growing)
    return levels, grown | {len(places): levels[shares.index(growing)]}, resolved


def moments(places: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (2,) and unbiased covariance (2, 2) of positions."""
    centre, count = np.average(places, axis=0, weights=weights), effective(weights)
    away = places - centre
    return centre, (away.T * weights) @ away / weights.sum() * (count / max(count - 1.0, 1.0))


def spread(covariance: np.ndarray) -> tuple[float, float]:
    """Standard deviations of a cloud of positions along its major and minor axes."""
    across, along = np.sqrt(np.maximum(np.linalg.eigvalsh(covariance), 0.0)).tolist()
    return along, across


def near(places: np.ndarray, weights: np.ndarray, least: float) -> np.ndarray:
    """Mask (n,) of the members that are not far from the middle ones; all if these are on a line or too few.

    The middle members minimise the determinant of their covariance (concentration steps of Rousseeuw & Van Driessen
    1999, A fast algorithm for the minimum covariance determinant estimator, Technometrics 41).

    least: A smaller spread counts as round-off [m].
    """
    everyone = np.ones(len(places), bool)
    some = slice(None, None, -(-len(places) // ENOUGH))
    drawn, weight = places[some], weights[some]
    if effective(weight) < least_members(MAIN):
        return everyone
    centre, inverse = np.median(drawn, axis=0), np.eye(2)
    for step in range(STEPS + 1):
        squared = _squared(drawn - centre, inverse)
        order = np.argsort(squared)
        held = np.cumsum(weight[order]) / weight.sum()
        if step == STEPS:
            break
        inner = order[: np.searchsorted(held, MIDDLE) + 1]
        centre, covariance = moments(drawn[inner], weight[inner])
        along, across = spread(covariance)
        if across <= max(least, THIN * along):
            return everyone
        inverse = np.linalg.inv(covariance)
    # The median tells the standard deviation, as of a normal distribution.
    variance = squared[order[np.searchsorted(held, 0.5)]] / (2.0 * math.log(2.0))
    return _squared(places - centre, inverse) <= FAR**2 * variance


def _squared(away: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Squared Mahalanobis distances (n,)."""
    return np.einsum("ij,ij->i", away @ inverse, away)


def effective(weights: np.ndarray) -> float:
    """Effective sample size: equivalent number of equally weighted members (Kish 1965, Survey sampling)."""
    return float(weights.sum() ** 2 / (weights**2).sum())


def least_members(share: float) -> int:
    """Fewest members for which a region can contain this share of new members: one member lies outside."""
    return math.ceil(round(1.0 / (1.0 - share) - 1.0, 9))
