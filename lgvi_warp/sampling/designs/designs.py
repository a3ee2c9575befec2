"""Designs for sensitivity analyses: Saltelli's and Morris'."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.sampling.designs.base import Drawn, Sampling, generator
from lgvi_warp.sampling.designs.sequences import sobol_points
from lgvi_warp.sampling.designs.space import Space


@dataclass(frozen=True)
class Saltelli(Sampling):
    """The design for Sobol indices, in the order of SALib.sample.sobol: groups of 2 d + 2 members, or d + 2.

    d + 2: without second_order. d: factors, which are the entries that vary by themselves and each joint law. A group is a
    point A and a point B of one Sobol sequence, A with each factor of B, and B with each of A. Groups may be added; powers
    of two of them are balanced. Saltelli et al. (2010), Computer Physics Communications 181.
    """

    second_order: bool = True
    kind: ClassVar[str] = "saltelli"

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.saltelli.")
        faults.choice("second_order", self.second_order, (True, False))
        faults.raise_if_any()

    def group_size(self, space: Space) -> int:
        """2 d + 2, or d + 2."""
        return (2 if self.second_order else 1) * len(space.factors) + 2

    def check(self, faults: Faults, space: Space, members: int) -> None:
        """Something must vary."""
        if not space.factors:
            faults.add("sampling", self.kind, "has nothing that varies", "give [ensemble.vary]")
            return
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """A where a factor is of A, else B."""
        point, row = np.divmod(members, self.group_size(space))
        chosen, place = np.unique(point, return_inverse=True)
        D = space.dimensions
        AB = sobol_points(space.seed, "saltelli", 2 * D, chosen)[place.reshape(-1)]
        return space.split(np.where(self.rows(space)[row], AB[:, D:], AB[:, :D]))

    def rows(self, space: Space) -> np.ndarray:
        """(group, dimensions), whether a row of a group has its column from B."""
        own = np.zeros((len(space.factors), space.dimensions), dtype=bool)
        for number, (_, columns) in enumerate(space.factors):
            own[number, list(columns)] = True
        none = np.zeros((1, space.dimensions), dtype=bool)
        return np.concatenate([none, own, *([~own] if self.second_order else []), ~none])


@dataclass(frozen=True)
class Morris(Sampling):
    """The design of Morris' screening (SALib.sample.morris): paths of d + 1 members, each step moving one factor.

    levels: even, the parts of each side; a member is at the middle of a part, so that laws without bounds stay finite. Paths
    may be added. Morris (1991), Technometrics 33; Campolongo, Cariboni & Saltelli (2007). Needs SALib (extra: uq).
    """

    levels: int = 4
    kind: ClassVar[str] = "morris"

    def __post_init__(self) -> None:
        levels = self.levels
        faults = Faults("ensemble.sampling.morris.")
        if isinstance(levels, bool) or not isinstance(levels, int | np.integer) or levels < 4 or levels % 2:
            faults.add("levels", levels, "is not an even number from 4", "give 4, 6, 8 ...")
        faults.raise_if_any()
        object.__setattr__(self, "levels", int(levels))

    def group_size(self, space: Space) -> int:
        """d + 1."""
        return len(space.factors) + 1

    def check(self, faults: Faults, space: Space, members: int) -> None:
        """Something must vary."""
        if len(space.factors) < 2:
            faults.add("sampling", self.kind, f"has {len(space.factors)} factors to tell apart", "vary two or more")
            return
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """The middle of each part."""
        x = self.design(space, members)
        return space.split((x * (self.levels - 1) + 0.5) / self.levels)

    def design(self, space: Space, members: np.ndarray) -> np.ndarray:
        """SALib's numbers (n, dimensions): multiples of 1 / (levels - 1) from 0 to 1."""
        paths = int(members.max()) // self.group_size(space) + 1
        # A longer design begins with the shorter one; few lengths, for the cache.
        return _morris(space, self.levels, 1 << (paths - 1).bit_length())[members]


@functools.lru_cache(maxsize=8)
def _morris(space: Space, levels: int, paths: int) -> np.ndarray:
    try:
        from SALib.sample import morris
    except ImportError as error:
        raise ImportError("Morris' screening needs SALib: pip install 'lgvi-warp[uq]'") from error
    x = np.asarray(morris.sample(salib_problem(space), paths, num_levels=levels, seed=generator(space, "morris")))
    x.setflags(write=False)
    return x


def salib_problem(space: Space) -> dict[str, Any]:
    """The unit cube as SALib describes it: columns, and groups of them where a factor has several."""
    names = [
        label if len(columns) == 1 else f"{label} {i}" for label, columns in space.factors for i in range(len(columns))
    ]
    problem: dict[str, Any] = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    if len(space.factors) < len(names):
        problem["groups"] = [label for label, columns in space.factors for _ in columns]
    return problem
