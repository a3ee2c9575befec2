# SPDX-License-Identifier: Apache-2.0
"""Coordinates of learned numbers that a filter may change freely: normal scores of the numbers' distributions.

A Kalman filter adds normal corrections. Every normal score z = Phi^-1(F(x)) belongs to a possible value of the distribution
(Gaussian anamorphosis: Bertino, Evensen & Wackernagel 2003, Int. Stat. Rev. 71). The scores of a normal number are its
values up to scale and shift, and those of a log-normal number are its logarithms up to scale and shift.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.sampling.designs.base import inside
from lgvi_warp.scene import variations
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.variations import MATRICES, Target, Variation

# Distributions whose values, or their logarithms, are linear in normal scores; those of draws together are taken as they are.
LINEAR, LOGARITHMIC, OF_DRAWS = ("normal", "correlated_normal"), "lognormal", "kernel_density"
# Levels at which a distribution is looked at: one with fewer than half as many values chooses among separate ones.
LEVELS = 400


@dataclass(frozen=True, eq=False)
class _Values:
    """Coordinates of a number that are its values, or the logarithms of their sizes.

    at: (p, n), coordinates at the start. sign: (p,), the sign of entries that move as logarithms, 0 for entries that are
    constant, NaN for others.
    """

    target: Target
    at: np.ndarray
    sign: np.ndarray
    separate: bool = False

    @classmethod
    def of(cls, target: Target, values: np.ndarray, logarithmic: np.ndarray) -> _Values:
        """Coordinates of values (n, ...); logarithmic: (p,), mask of the entries that move as logarithms."""
        rows = np.asarray(values, np.float64).reshape(len(values), -1).T
        sign = np.where(logarithmic, np.sign(rows[:, 0]), np.nan)
        with np.errstate(divide="ignore"):
            logs = np.where(sign[:, None] == 0.0, 0.0, np.log(np.abs(rows)))
        return cls(target, np.where(logarithmic[:, None], logs, rows), sign)

    def numbers(self, rows: np.ndarray, shapes: Mapping[str, tuple[int, ...]]) -> list[tuple[Target, np.ndarray]]:
        """The number, with its values (n, ...)."""
        sign = self.sign[:, None]
        with np.errstate(over="ignore"):  # the run refuses what is too large
            values = np.where(np.isnan(sign), rows, sign * np.exp(np.where(np.isnan(sign), 0.0, rows)))
        index = self.target.index
        return [(self.target, values.T.reshape(-1, *(shapes[self.target.name] if index is None else ())))]


@dataclass(frozen=True, eq=False)
class _Scores:
    """Coordinates of numbers that are normal scores of the uniform levels from which one distribution draws them.

    columns: Indices of the levels that move. entry: The only learned number of the distribution; None for all of them.
    """

    variation: Variation
    columns: list[int]
    entry: Target | None
    at: np.ndarray

    @functools.cached_property
    def separate(self) -> bool:
        """Whether the distribution is discrete."""
        for column in self.columns:
            u = np.full((LEVELS, self.variation.size), 0.5)
            u[:, column] = (np.arange(LEVELS) + 0.5) / LEVELS
            drawn = np.concatenate([values.reshape(LEVELS, -1) for _, values in self.variation.values(u)], axis=1)
            if 1 < len(np.unique(drawn, axis=0)) < LEVELS // 2:
                return True
        return False

    def numbers(self, rows: np.ndarray, shapes: Mapping[str, tuple[int, ...]]) -> list[tuple[Target, np.ndarray]]:
        """The numbers, each with its values (n, ...)."""
        from scipy.special import ndtr

        u = np.full((rows.shape[1], self.variation.size), 0.5)
        u[:, self.columns] = inside(ndtr(rows.T))
        drawn = self.variation.values(u)
        if self.entry is None:
            return [pair for pair in drawn if pair[0].name in shapes]
        return [(self.entry, _of(self.entry, drawn[0][1]))]


class Coordinates:
    """Rows of coordinates that a filter changes, and the members' numbers that follow from them.

    Attributes:
        at: Rows (p, n) at the start.
        targets: Learned numbers, and the numbers drawn jointly with them.
        separate: (p,), mask of the rows that belong to a discrete distribution.
    """

    def __init__(self, fleet: Ensemble, targets: Sequence[Target], parameters: Mapping[str, np.ndarray]):
        n = fleet.members
        self.shapes = {name: rows.shape[1:] for name, rows in parameters.items()}
        self._parts, levels, together = list[Any](), dict[str, np.ndarray](), dict[str, Variation]()
        for target in (entry for each in targets for entry in self._entries(each, fleet.variations)):
            laws = [one for one in fleet.variations if any(_meet(each, target) for each in one.targets)]
            values = _of(target, np.broadcast_to(parameters[target.name], (n, *self.shapes[target.name])))
            if not laws:
                self._parts.append(_Values.of(target, values, _one_sided(fleet.scene, target, values)))
            elif _as_values(laws[0]):
                logarithmic = np.full(max(1, values[0].size), laws[0].distribution.kind == LOGARITHMIC)
                self._parts.append(_Values.of(target, values, logarithmic))
            elif laws[0].key not in together:
                levels = levels or dict(fleet.levels(0, n))
                self._parts.append(_scores(laws[0], target, levels[laws[0].key]))
                together |= {laws[0].key: laws[0]} if laws[0].distribution.joint else {}
        drawn = [target for law in together.values() for target in law.targets if target.name in self.shapes]
        self.targets = [*targets, *(one for one in drawn if not any(_meet(one, each) for each in targets))]
        self.at = np.concatenate([np.empty((0, n)), *(part.at for part in self._parts)])
        counts = [len(part.at) for part in self._parts]
        self._ends = np.cumsum(counts)[:-1]
        self.separate = np.repeat(np.array([part.separate for part in self._parts], bool), counts)

    def _entries(self, target: Target, laws: Sequence[Variation]) -> list[Target]:
        """The target, or its entries if distributions draw them separately."""
        own = [each for law in laws for each in law.targets if each.name == target.name]
        if target.index is not None or not own or any(each.index is None for each in own):
            return [target]
        places = [place for place in np.ndindex(*self.shapes[target.name])
                  if target.name not in MATRICES or place[0] <= place[1]]  # fmt: skip
        return [Target(target.name, place) for place in places]

    def values(self, rows: np.ndarray, parameters: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """{label: learned numbers (n, ...)}, in the form that `run.states` takes; parameters: Members' numbers by name."""
        n, numbers = rows.shape[1], dict[str, np.ndarray]()
        for part, own in zip(self._parts, np.split(rows, self._ends) if self._parts else [], strict=True):
            for target, values in part.numbers(own, self.shapes):
                whole = numbers.get(
                    target.name, np.broadcast_to(parameters[target.name], (n, *self.shapes[target.name]))
                )
                numbers[target.name] = np.array(whole)
                variations.put(numbers, target, values, into=True)
        return {target.label: _of(target, numbers[target.name]) for target in self.targets}

    def groups(self, rows: np.ndarray) -> np.ndarray:
        """Group indices from 0 (n,); members of a group have the same discrete values."""
        parts = [np.zeros((1, rows.shape[1]))]
        for part, own in zip(self._parts, np.split(rows, self._ends), strict=True):
            if part.separate:
                parts += [values.reshape(len(values), -1).T for _, values in part.numbers(own, self.shapes)]
        return np.unique(np.concatenate(parts), axis=1, return_inverse=True)[1].ravel()


def _of(target: Target, rows: np.ndarray) -> np.ndarray:
    """The target's values (n, ...), taken from those of the entire number."""
    index: tuple[Any, ...] = (slice(None), *(target.index or ()))
    return np.asarray(rows[index])


def _meet(first: Target, second: Target) -> bool:
    """Whether two targets have an entry in common."""
    if first.name != second.name or first.index is None or second.index is None:
        return first.name == second.name
    return (sorted(first.index) == sorted(second.index)) if first.name in MATRICES else first.index == second.index


def _as_values(variation: Variation) -> bool:
    """Whether the coordinates of a distribution's numbers are their values or logarithms, not normal scores."""
    law = variation.distribution
    return law.kind in LINEAR or law.kind == LOGARITHMIC or (law.kind == OF_DRAWS and law.joint)


def _scores(variation: Variation, target: Target, levels: np.ndarray) -> _Scores:
    """The scores of those levels (n, size) of a distribution on which the target depends."""
    from scipy.special import ndtri

    columns, entry = list(range(levels.shape[1])), None
    if not variation.distribution.joint and variation.targets[0].index is None and target.index is not None:
        entry = target
        columns = [i for i, label in enumerate(variation.labels()) if _meet(variations.targets(label)[0], target)]
    return _Scores(variation, columns, entry, ndtri(levels[:, columns]).T)


def _one_sided(scene: Any, target: Target, values: np.ndarray) -> np.ndarray:
    """Mask (p,) of entries without a distribution that must keep their sign, since the scene refuses the opposite sign."""
    rows = values.reshape(len(values), -1)
    signs = (np.sign(rows) == np.sign(rows[:1])).all(axis=0) & (rows[0] != 0.0) & (np.ptp(rows, axis=0) > 0.0)

    def refused(entry: int) -> bool:
        flipped = rows[0].copy()
        flipped[entry] *= -1.0
        try:
            scene.with_numbers({target.label: flipped.reshape(values.shape[1:])})
        except SceneError:
            return True
        return False

    return np.array([bool(same) and refused(entry) for entry, same in enumerate(signs)])
