# SPDX-License-Identifier: Apache-2.0
"""Designs for sensitivity analyses: Saltelli's and Morris's."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, MissingExtra, closest, refusal
from lgvi_warp.common.random import generator
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.sampling.designs.base import Drawn, Sampling, check_replicates
from lgvi_warp.sampling.designs.sequences import sobol_points
from lgvi_warp.sampling.designs.space import Space

Factors = tuple[tuple[str, tuple[int, ...]], ...]


@dataclass(frozen=True)
class Saltelli(Sampling):
    """Design for Sobol indices, as SALib.sample.sobol: groups of 2 d + 2 members, for d factors.

    A factor is an entry that varies independently, or a joint distribution. A group has points A and B of a Sobol
    sequence, d copies of A with one factor from B, and d copies of B with one factor from A. Groups can be added; the
    design is balanced if their number is a power of two. Saltelli et al. (2010), Computer Physics Communications 181.

    Args:
        second_order: True, the default, allows second-order indices; False leaves out the copies of B (d + 2 members).
        replicates: Number R of independently scrambled sequences, which are used in turn, group by group; 1 by default.
        groups: {name: list of factors that form one factor}; "current.velocity" means all its entries. None by default.

    Raises:
        SceneError: If a setting is wrong. The message lists every fault.
    """

    second_order: bool = True
    replicates: int = 1
    groups: Any = None
    kind: ClassVar[str] = "saltelli"

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.saltelli.")
        faults.choice("second_order", self.second_order, (True, False))
        check_replicates(faults, self.replicates)
        groups = {} if self.groups is None else self.groups
        example = 'give {"start": ["start.position", "start.velocity"]}'
        pairs = list(groups.items()) if isinstance(groups, Mapping) else items_of(groups)
        pairs = [groups] if pairs is None else pairs
        if not all(isinstance(pair, list | tuple) and len(pair) == 2 and isinstance(pair[0], str) for pair in pairs):
            faults.add("groups", groups, "is not a mapping of names to lists of factors", example)
            pairs = []
        pairs = [(name, items_of(members)) for name, members in pairs]
        for name, members in pairs:
            if not members or not all(isinstance(m, str) for m in members):
                faults.add(f"groups.{name}", members, "is not a list of names of factors", example)
        faults.raise_if_any()
        object.__setattr__(self, "replicates", int(self.replicates))
        object.__setattr__(self, "groups", tuple((name, tuple(members)) for name, members in pairs) or None)

    def to_dict(self) -> Any:
        content = super().to_dict()
        if self.groups:
            content[self.kind]["groups"] = {name: list(members) for name, members in self.groups}
        return content

    def factors(self, space: Space) -> Factors:
        """Label and columns of each factor; a group of factors has the place of its first factor.

        Args:
            space: The unit cube: the varied names with their numbers of columns.
        """
        group_of = {
            label: name for name, members in self.groups or () for member in members for label in _labels(space, member)
        }
        joined: dict[str, tuple[int, ...]] = {}
        for label, columns in space.factors:
            name = group_of.get(label, label)
            joined[name] = (*joined.get(name, ()), *columns)
        return tuple(joined.items())

    def group_size(self, space: Space) -> int:
        # Members in a group: 2 d + 2, or d + 2 without second-order indices.
        return (2 if self.second_order else 1) * len(self.factors(space)) + 2

    def check(self, faults: Faults, space: Space, members: int) -> None:
        # Also a fault where nothing varies, where groups have what does not vary, or share it.
        if not space.factors:
            faults.add("sampling", self.kind, "has nothing that varies", "give [ensemble.vary]")
            return
        known, taken = [label for label, _ in space.factors], dict[str, str]()
        for name, group in self.groups or ():
            for member in group:
                if not (labels := _labels(space, member)):
                    faults.add(f"groups.{name}", member, "does not vary by itself", closest(member, known))
                for label in labels:
                    if taken.setdefault(label, name) != name:
                        faults.add(f"groups.{name}", label, f"is in {taken[label]!r} as well", "keep it in one of them")
            if name in known and name not in group:
                faults.add("groups", name, "is the name of a factor that is not in it", "give the group another name")
        super().check(faults, space, members)

    def replicate_of(self, groups: np.ndarray) -> np.ndarray:
        """Index of the Sobol sequence to which each group of members belongs.

        Args:
            groups: Indices of n groups, (n,).
        """
        return groups % self.replicates

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        # Levels of point A where the member has the factor of A, else of point B.
        group, row = np.divmod(members, self.group_size(space))
        chosen, place = np.unique(group, return_inverse=True)
        replicate, D = self.replicate_of(chosen), space.dimensions
        AB = np.empty((len(chosen), 2 * D))
        for r in np.unique(replicate):
            mine, name = replicate == r, "saltelli" if r == 0 else f"saltelli {r}"
            AB[mine] = sobol_points(space.seed, name, 2 * D, chosen[mine] // self.replicates)
        AB = AB[place.reshape(-1)]
        return space.split(np.where(self.rows(space)[row], AB[:, D:], AB[:, :D]))

    def rows(self, space: Space) -> np.ndarray:
        """Mask of the columns that each member of a group takes from point B; it takes the others from point A.

        Args:
            space: The unit cube: the varied names with their numbers of columns.

        Returns:
            Mask (group size, dimensions of the cube).
        """
        factors = self.factors(space)
        from_B = np.zeros((len(factors), space.dimensions), dtype=bool)
        for number, (_, columns) in enumerate(factors):
            from_B[number, list(columns)] = True
        nothing = np.zeros((1, space.dimensions), dtype=bool)
        return np.concatenate([nothing, from_B, *([~from_B] if self.second_order else []), ~nothing])


def _labels(space: Space, name: str) -> list[str]:
    """The factors for a name: the factor with this label, or the entries of this number."""
    return [label for label, _ in space.factors if label == name or label.startswith(f"{name}[")]


@dataclass(frozen=True)
class Morris(Sampling):
    """Morris's screening design (SALib.sample.morris): paths of d + 1 members for d factors; a step changes one factor.

    Each side of the unit cube is divided into equal parts. Each coordinate of a member is the middle of a part, so that
    unbounded distributions give finite values. Paths can be added. The design needs SALib (extra: uq). Morris (1991),
    Technometrics 33; Campolongo, Cariboni & Saltelli (2007).

    Args:
        levels: Number of parts of each side of the cube, an even number of at least 4; 4 by default.

    Raises:
        SceneError: If levels is not an even number of at least 4.
    """

    levels: int = 4
    kind: ClassVar[str] = "morris"

    def __post_init__(self) -> None:
        levels = self.levels
        if not is_whole(levels, 4) or levels % 2:
            raise refusal("ensemble.sampling.morris.levels", levels, "is not an even number from 4", "give 4, 6, 8 ...")
        object.__setattr__(self, "levels", int(levels))

    def group_size(self, space: Space) -> int:
        # Members on a path, d + 1, d the number of factors.
        return len(space.factors) + 1

    def check(self, faults: Faults, space: Space, members: int) -> None:
        # Also a fault where fewer than two factors vary.
        if len(space.factors) < 2:
            fault = f"needs two or more factors, and has {len(space.factors)}"
            faults.add("sampling", self.kind, fault, "vary two or more")
            return
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        # Levels in the middle of each part.
        x = self.design(space, members)
        return space.split((x * (self.levels - 1) + 0.5) / self.levels)

    def design(self, space: Space, members: np.ndarray) -> np.ndarray:
        """The design as SALib returns it.

        Args:
            space: The unit cube: the varied names with their numbers of columns.
            members: Indices of the n members, (n,).

        Returns:
            Multiples of 1 / (levels - 1) from 0 to 1, (n, dimensions of the cube).

        Raises:
            ImportError: If SALib is not installed.
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
    """The unit cube as a problem of SALib."""
    names: list[str] = []
    for label, columns in space.factors:
        names += [label] if len(columns) == 1 else [f"{label} {i}" for i in range(len(columns))]
    problem: dict[str, Any] = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    if len(space.factors) < len(names):
        problem["groups"] = [label for label, columns in space.factors for _ in columns]
    return problem
