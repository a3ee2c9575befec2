# SPDX-License-Identifier: Apache-2.0
"""Members that a small sample may miss: branches of a Choice as strata, and probes far from the middle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lgvi_warp.common.random import generator
from lgvi_warp.sampling.distributions.basic import Choice, floats
from lgvi_warp.scene.columns import as_given
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.uncertainty.estimating.estimators import fitted

# Branches below this probability are strata of their own: all of them together have at most a half, and are at most so many.
RARE, HALF, MOST_STRATA = 0.125, 0.5, 64
# Distances of probes from the middle [sd], of which the first is taken whose members are physical: 1 in 2,000 is beyond it.
FAR = (3.3, 2.3, 1.6)
# Axes along which there are probes at most, and directions that are drawn.
MOST_AXES, DIRECTIONS = 64, 32


@dataclass(frozen=True, eq=False)
class Stratum:
    """A part of the cube: its probability, and for each column the starts and widths (k,) of its intervals."""

    probability: float = 1.0
    columns: Mapping[int, tuple[np.ndarray, np.ndarray]] | None = None

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Points of the cube (n, d), moved into the part."""
        if not self.columns:
            return points
        points = points.copy()
        for column, (starts, widths) in self.columns.items():
            ends = np.cumsum(widths)
            at = points[:, column] * ends[-1]
            k = np.minimum(np.searchsorted(ends, at, side="right"), len(ends) - 1)
            # A member near the end of a branch must stay in it.
            share = np.clip((at - ends[k] + widths[k]) / widths[k], 1e-6, 1.0 - 1e-6)
            points[:, column] = starts[k] + share * widths[k]
        return points


def strata_of(fleet: Ensemble) -> list[Stratum]:
    """The common part of the cube, then one stratum for each rare branch of a Choice, with earlier Choices common.

    docs/theory/estimators.md, (E26).
    """
    rest, common, found = 1.0, dict[int, tuple[np.ndarray, np.ndarray]](), list[Stratum]()
    laws = [variation.distribution for variation in as_given(fleet) for _ in range(variation.size)]
    for column, law in enumerate(laws):
        if not isinstance(law, Choice):
            continue
        starts, widths, branch = branches(law)
        each = np.bincount(branch, widths)
        order = np.argsort(each)
        kept = (each[order] < RARE) & (np.cumsum(each[order]) <= HALF + 1e-9) & (each[order] > 0.0)
        rare = order[kept][max(int(kept.sum()) + len(found) - MOST_STRATA, 0) :]
        for i in rare:
            mine = branch == i
            found.append(Stratum(rest * float(each[i]), {**common, column: (starts[mine], widths[mine])}))
        if len(rare):
            others = ~np.isin(branch, rare) & (widths > 0.0)
            common[column] = starts[others], widths[others]
            rest *= float(widths[others].sum())
    return [Stratum(rest, common), *found]


def branches(law: Choice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The interval of levels of each value of a Choice, as starts and widths (k,), and groups of equal values (k,)."""
    values = floats(law.values)
    weights = np.ones(len(values)) if law.weights is None else floats(law.weights)
    ends = np.cumsum(weights) / weights.sum()
    same = np.unique(values.reshape(len(values), -1), axis=0, return_inverse=True)[1]
    return np.concatenate([[0.0], ends[:-1]]), weights / weights.sum(), np.asarray(same).ravel()


def probes(seed: int, normals: np.ndarray, far: float = FAR[0]) -> np.ndarray:
    """Members (m, d) from a pilot's normals (n, d), each moved to the distance `far` on one axis or direction."""
    d, random = normals.shape[1], generator(seed, "estimate probes")
    axes = np.eye(d)[:MOST_AXES]
    drawn = random.standard_normal((DIRECTIONS if d > 1 else 0, d))
    ways = np.concatenate([axes, drawn / np.linalg.norm(drawn, axis=1, keepdims=True)])
    ways = np.concatenate([ways, -ways])
    members = normals[np.arange(len(ways)) % len(normals)]
    return np.asarray(members + (far - np.einsum("ni,ni->n", members, ways))[:, None] * ways)


def reach_of(y: np.ndarray, normals: np.ndarray, far: np.ndarray, far_normals: np.ndarray) -> float:
    """The largest distance of probes' numbers (m,) from a regression on the members (n,).

    docs/theory/estimators.md, (E25).
    """
    n, d = normals.shape
    used = normals if n >= 2 * (d + 1) else normals[:, :0]
    factors, _ = fitted(y, used)
    with np.errstate(over="ignore", invalid="ignore"):
        apart = np.abs(far - factors[0] - np.einsum("ni,i->n", far_normals[:, : used.shape[1]], factors[1:]))
    return float(np.max(apart[np.isfinite(apart)], initial=0.0))
