# SPDX-License-Identifier: Apache-2.0
"""Designs for sensitivity analyses: Saltelli's and Morris's."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, MissingExtra, refusal
from lgvi_warp.common.random import generator
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.sampling.designs.base import Drawn, Sampling
from lgvi_warp.sampling.designs.sequences import sobol_points
from lgvi_warp.sampling.designs.space import Space


@dataclass(frozen=True)
class Saltelli(Sampling):
    """Design for Sobol indices, in the order of SALib.sample.sobol: groups of 2 d + 2 members.

    d is the number of factors: the entries that vary by themselves, and each joint distribution. A group is a point A and a
    point B of one Sobol sequence, A with each factor of B, and B with each factor of A. Groups may be added; powers of two of
    them are balanced. Saltelli et al. (2010), Computer Physics Communications 181.

    Args:
        second_order: Whether second-order indices follow, True by default; without them groups have d + 2 members.

    Raises:
        SceneError: Where second_order is neither True nor False.
    """

    second_order: bool = True
    kind: ClassVar[str] = "saltelli"

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.saltelli.")
        faults.choice("second_order", self.second_order, (True, False))
        faults.raise_if_any()

    def group_size(self, space: Space) -> int:
        """Members in a group: 2 d + 2, or d + 2 without second-order indices."""
        return (2 if self.second_order else 1) * len(space.factors) + 2

    def check(self, faults: Faults, space: Space, members: int) -> None:
        # Also a fault where nothing varies.
        if not space.factors:
            faults.add("sampling", self.kind, "has nothing that varies", "give [ensemble.vary]")
            return
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """Levels of point A where the member has the factor of A, else of point B."""
        point, row = np.divmod(members, self.group_size(space))
        chosen, place = np.unique(point, return_inverse=True)
        D = space.dimensions
        AB = sobol_points(space.seed, "saltelli", 2 * D, chosen)[place.reshape(-1)]
        return space.split(np.where(self.rows(space)[row], AB[:, D:], AB[:, :D]))

    def rows(self, space: Space) -> np.ndarray:
        """Which columns each member of a group has from point B.

        Args:
            space: The cube: which names vary, with how many columns each.

        Returns:
            Mask (group size, dimensions).
        """
        from_B = np.zeros((len(space.factors), space.dimensions), dtype=bool)
        for number, (_, columns) in enumerate(space.factors):
            from_B[number, list(columns)] = True
        nothing = np.zeros((1, space.dimensions), dtype=bool)
        return np.concatenate([nothing, from_B, *([~from_B] if self.second_order else []), ~nothing])


@dataclass(frozen=True)
class Morris(Sampling):
    """Design of Morris's screening (SALib.sample.morris): paths of d + 1 members, each step of which changes one factor.

    Each side of the cube is divided into parts, and a member is in the middle of a part, so that distributions without bounds
    stay finite. Paths may be added. Needs SALib (extra: uq). Morris (1991), Technometrics 33; Campolongo, Cariboni & Saltelli
    (2007).

    Args:
        levels: Number of parts of each side, even, from 4; 4 by default.

    Raises:
        SceneError: Where levels is not an even number from 4.
    """

    levels: int = 4
    kind: ClassVar[str] = "morris"

    def __post_init__(self) -> None:
        levels = self.levels
        if not is_whole(levels, 4) or levels % 2:
            raise refusal("ensemble.sampling.morris.levels", levels, "is not an even number from 4", "give 4, 6, 8 ...")
        object.__setattr__(self, "levels", int(levels))

    def group_size(self, space: Space) -> int:
        """Members on a path, d + 1, d the number of factors."""
        return len(space.factors) + 1

    def check(self, faults: Faults, space: Space, members: int) -> None:
        # Also a fault where fewer than two factors vary.
        if len(space.factors) < 2:
            fault = f"needs two or more factors, and has {len(space.factors)}"
            faults.add("sampling", self.kind, fault, "vary two or more")
            return
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """Levels in the middle of each part."""
        x = self.design(space, members)
        return space.split((x * (self.levels - 1) + 0.5) / self.levels)

    def design(self, space: Space, members: np.ndarray) -> np.ndarray:
        """The design as SALib numbers it.

        Args:
            space: The cube: which names vary, with how many columns each.
            members: Indices of the members, (n,).

        Returns:
            Multiples of 1 / (levels - 1) from 0 to 1, (n, dimensions).

        Raises:
            ImportError: Where SALib is not installed.
        """
        paths = int(members.max()) // self.group_size(space) + 1
        # A longer design begins with the shorter one; lengths are powers of two, so that the cache holds few.
        return _morris(space, self.levels, 1 << (paths - 1).bit_length())[members]


@functools.lru_cache(maxsize=8)
def _morris(space: Space, levels: int, paths: int) -> np.ndarray:
    try:
        from SALib.sample import morris
    except ImportError as error:
        raise MissingExtra("Morris designs", "SALib", "uq") from error
    x = np.asarray(morris.sample(salib_problem(space), paths, num_levels=levels, seed=generator(space.seed, "morris")))
    x.setflags(write=False)
    return x


def salib_problem(space: Space) -> dict[str, Any]:
    """The unit cube as a problem of SALib.

    Args:
        space: The cube: which names vary, with how many columns each.

    Returns:
        "num_vars", "names" and "bounds" of the columns, and "groups" where a factor has several columns.
    """
    names: list[str] = []
    for label, columns in space.factors:
        names += [label] if len(columns) == 1 else [f"{label} {i}" for i in range(len(columns))]
    problem: dict[str, Any] = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    if len(space.factors) < len(names):
        problem["groups"] = [label for label, columns in space.factors for _ in columns]
    return problem
