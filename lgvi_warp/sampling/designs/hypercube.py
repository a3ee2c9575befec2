# SPDX-License-Identifier: Apache-2.0
"""Latin hypercubes, which are added group by group."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.random import generator
from lgvi_warp.common.real_numbers import is_whole, whole_remedy
from lgvi_warp.sampling.designs.base import Drawn, Replicated, inside
from lgvi_warp.sampling.designs.space import Space

LARGEST_GROUP = 2**20


@dataclass(frozen=True)
class LatinHypercube(Replicated):
    """Latin hypercubes: each column of the unit cube has `group` equal parts, with one member of a hypercube in each.

    Members are added group by group. Adding a name to `vary` does not change the values of the other names. McKay,
    Beckman & Conover (1979); scipy.stats.qmc.LatinHypercube.

    Args:
        group: Number of members in a hypercube, 2 to 2^20; required. The number of members must be a multiple of
            `group` times `replicates`.
        replicates: Number R of hypercubes that are filled together: member i goes to hypercube i mod R; 1 by default.

    Raises:
        SceneError: If a setting is wrong. The message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> vary = {"vehicle.buoyancy": lw.distributions.Uniform(low=306.0, high=310.0)}
        >>> fleet = lw.Ensemble(scene, 4, vary=vary, sampling=lw.designs.LatinHypercube(group=4))
        >>> sorted(fleet.parameters(0, 4)["vehicle.buoyancy"].astype(int).tolist())
        [306, 307, 308, 309]
    """

    group: int = None  # type: ignore[assignment]  # it has no default, but replicates of every design have one
    kind: ClassVar[str] = "latin_hypercube"

    def check_own(self, faults: Faults) -> None:
        group, example = self.group, "give how many members make a hypercube: group = 256"
        if group is None:
            faults.add("group", group, "is missing", example)
        elif not is_whole(group, 2, LARGEST_GROUP):
            faults.add("group", group, f"is not a whole number from 2 to {LARGEST_GROUP}", whole_remedy(group, example))
        else:
            object.__setattr__(self, "group", int(group))

    def group_size(self, space: Space) -> int:
        # Members in one hypercube of each replicate.
        return self.group * self.replicates

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        # Levels from the hypercube of each member's group; each name is drawn by itself, and so may be added.
        R = self.replicates
        group, place = np.divmod(members, self.group * R)
        levels = {}
        for key, size in zip(space.keys, space.sizes, strict=True):
            levels[key] = np.empty((len(members), size))
            for g in np.unique(group):
                mine = group == g
                cubes = _hypercubes(space.seed, key, int(g) * R, R, self.group, size)
                levels[key][mine] = cubes[place[mine]]
        return levels


# A block of members is within few groups: their hypercubes are cached from one block to the next.
@functools.lru_cache(maxsize=64)
def _hypercubes(seed: int, key: str, first: int, number: int, size: int, columns: int) -> np.ndarray:
    """Points of `number` hypercubes from `first` on, one of each in turn: (size * number, columns)."""
    from scipy.stats import qmc

    cubes = np.empty((size, number, columns))
    for i in range(number):
        cubes[:, i] = qmc.LatinHypercube(columns, rng=generator(seed, f"latin {key}", first + i)).random(size)
    return inside(cubes.reshape(size * number, columns))
