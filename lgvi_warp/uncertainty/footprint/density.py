# SPDX-License-Identifier: Apache-2.0
"""Smallest regions that hold given shares of places: level sets of a kernel density on a grid.

The density at a member leaves out its own kernel, and the level of a region is a quantile of these densities. So the region
holds its share of new members, whatever the bandwidth (Lei, Robins & Wasserman 2013, Distribution-free prediction sets,
Journal of the American Statistical Association 108). Of several bandwidths each share takes the one of the smallest area.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy import fft

from lgvi_warp.common.errors import MissingExtra

# Nodes of the grid along each axis. The second is for clusters that are far apart, where the finest bandwidth is best.
SIZES = (384, 1536)
# Coarsest bandwidth, in those of Scott's rule; each of the next is half as wide, down to one cell.
COARSEST, RUNGS = 4.0, 9
# Finer ones are not looked at where the areas of all shares are so many times the least.
HOPELESS = 2.0
# The grid reaches so many of the coarsest bandwidths beyond these quantiles of the places; members outside count as outside.
REACH, TAIL = 3.0, 0.001
# A finer bandwidth must lessen the area so far, else it only follows the sample.
GAIN = 0.97
# A level below this part of the largest density is round-off.
LEAST_LEVEL = 1e-9
# The interval of an area.
CONFIDENCE = 0.95

# A polygon's rings (k, 2), the outer one first: north and east [m]. In axes east, north the outer one runs counterclockwise.
Polygon = tuple[np.ndarray, ...]


class Level(NamedTuple):
    """Region of a share: its area with an interval [m2], and its polygons."""

    area: float
    low: float
    high: float
    polygons: tuple[Polygon, ...]


class Grid:
    """Members binned on a square grid; coordinates are counted in cells."""

    def __init__(self, places: np.ndarray, weights: np.ndarray, low: np.ndarray, cell: float, size: int):
        self.low, self.cell, self.size, self.weights = low, cell, size, weights
        places = (places - low) / cell
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
    """Density on a grid; densities at the members without their own kernels, rising, and the shares of members up to them."""

    grid: Grid
    h: float
    density: np.ndarray
    shares: np.ndarray
    others: np.ndarray

    def level(self, outside: float) -> float:
        """Find the density above which all but a share of new members lie; 0 where that cannot be told."""
        found = float(np.interp(outside, self.shares, self.others, left=0.0, right=np.inf))
        return found if found > LEAST_LEVEL * self.density.max() else 0.0

    def cells(self, share: float) -> float:
        """Count the cells of a share's region; infinite where it cannot be told."""
        level = self.level(1.0 - share)
        return float(np.count_nonzero(self.density >= level)) if level else np.inf

    def region(self, share: float, middle: np.ndarray, root: np.ndarray) -> Level:
        """Trace a share's region, with the interval that order statistics of the densities give its level.

        middle, root: Place (2,) and Cholesky factor (2, 2) [m] of the grid's coordinates.
        """
        from scipy.stats import binom

        count = round(self.grid.count)
        first, last = binom.ppf([0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE], count, 1.0 - share)
        outside = (1.0 - share, (last + 1.0) / (count + 1.0), first / (count + 1.0))
        parts, fewer, more = map(self._polygons, map(self.level, outside))
        scale = self.grid.cell**2 * float(np.prod(np.diag(root)))
        # A ten-thousandth of a cell.
        digits = 4 - math.floor(math.log10(self.grid.cell * np.diag(root).min()))
        polygons = [
            tuple((middle + (self.grid.low + self.grid.cell * ring) @ root.T).round(digits) for ring in rings)
            for rings in parts or ()
        ]
        area, low, high = (math.inf if each is None else scale * _area(each) for each in (parts, fewer, more))
        return Level(area, low, high, tuple(polygons))

    def _polygons(self, level: float) -> list[list[np.ndarray]] | None:
        """Trace where the density is above a level: the rings of each part, in cells; None where it cannot be told."""
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


def _area(polygons: list[list[np.ndarray]]) -> float:
    """Sum the areas of polygons: rings of holes run the other way round."""
    rings = (ring for polygon in polygons for ring in polygon)
    return sum(0.5 * float(np.sum(r[:-1, 1] * r[1:, 0] - r[1:, 1] * r[:-1, 0])) for r in rings)


def regions(
    places: np.ndarray, weights: np.ndarray, covariance: np.ndarray, shares: Sequence[float], growing: float
) -> tuple[list[Level], dict[int, Level], bool]:
    """Find the regions of shares that the members suffice for.

    places: North and east (n, 2) [m], not all on a line. weights: (n,). growing: One of the shares.
    Returns: The regions; by number of members the region of the share `growing`; whether the grid resolves all clusters.
    """
    middle, root = places.mean(axis=0), np.linalg.cholesky(covariance)
    # In these coordinates the covariance is one, so that a kernel is as long and as oblique as the cloud.
    white = np.linalg.solve(root, (places - middle).T).T
    quarters = np.quantile(white, [0.25, 0.75], axis=0)
    # Of heavy tails the quartiles tell the width of the middle, as in Silverman's rule.
    spread = float(np.clip(np.diff(quarters, axis=0).min() / 1.349, 2.0**-5, 1.0))
    widest = COARSEST * spread * effective(weights) ** (-1.0 / 6.0)
    best: dict[float, tuple[float, Smoothed]] = {}
    for size in SIZES:
        low, high = np.quantile(white, [TAIL, 1.0 - TAIL], axis=0) + REACH * widest * np.array([[-1.0], [1.0]])
        cell = float((high - low).max()) / (size - 1)
        grid = Grid(white, weights, low, cell, size)
        for h in [h for h in widest / cell * 0.5 ** np.arange(RUNGS) if h >= 1.0] or [1.0]:
            smoothed, finest = grid.smoothed(h), h
            areas = {share: smoothed.cells(share) * cell**2 for share in shares}
            better = {share: (areas[share], smoothed) for share in shares
                      if share not in best or areas[share] < GAIN * best[share][0]}  # fmt: skip
            best |= better
            if all(areas[share] > HOPELESS * best[share][0] for share in shares):
                break
        resolved = all(smoothed.h > finest for _, smoothed in better.values())
        if resolved:
            break
        widest = COARSEST * finest * cell
    levels = [best[share][1].region(share, middle, root) for share in shares]
    chosen, order = best[growing][1], np.random.default_rng(0).permutation(len(places))
    grown = {}
    for part in (8, 4, 2):
        some = order[: len(places) // part]
        if len(some) >= least_members(growing):
            grid = Grid(white[some], weights[some], chosen.grid.low, chosen.grid.cell, chosen.grid.size)
            grown[len(some)] = grid.smoothed(chosen.h * part ** (1.0 / 6.0)).region(growing, middle, root)
    return levels, grown | {len(places): levels[shares.index(growing)]}, resolved


def effective(weights: np.ndarray) -> float:
    """Count members of equal weight that tell as much as members of these weights (Kish 1965, Survey sampling)."""
    return float(weights.sum() ** 2 / (weights**2).sum())


def least_members(share: float) -> int:
    """Count the members from which on a region can hold this share of new ones: one of them lies outside."""
    return math.ceil(round(1.0 / (1.0 - share) - 1.0, 9))
