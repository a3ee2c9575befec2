# SPDX-License-Identifier: Apache-2.0
"""Members with shifted copies, in which one number differs: their kernel inputs give derivatives of these inputs.

The kernel's inputs, such as inertia about another origin, are smooth but long functions of a scene's numbers. Their
derivatives are central differences of six points, whose error at a step of 0.2 % is round-off, about 1e-13.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.sampling.members import Shifted
from lgvi_warp.scene import variations
from lgvi_warp.scene.variations import Target

if TYPE_CHECKING:
    from lgvi_warp.scene.ensemble import Ensemble

# Where the shifted copies of a member stand, in steps, and the weights of the differences: of all six, of the error h^6, and
# of the four inner ones, of the error h^4, by which a number is found that is not smooth.
OFFSETS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
SIX_POINTS = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0
FOUR_POINTS = np.array([0.0, 1.0, -8.0, 8.0, -1.0, 0.0]) / 12.0
BETWEEN = np.array([1.0, -6.0, 15.0, 15.0, -6.0, 1.0]) / 20.0
# A step over the number itself, or, where that is far smaller than other entries of its array, over these; of nothing but
# zeros it is a step over 1.
STEP, LEAST_PART = 2e-3, 1e-2


@dataclass(frozen=True, eq=False)
class Copies:
    """The shifted copies of an ensemble's members.

    targets: The shifted numbers, in order. ensemble: Each member followed by its copies. steps: (members, targets), as in
    `Shifted`. surveyed: The copies that determine the kernel, if it is to serve further numbers; else `ensemble`.
    """

    targets: tuple[Target, ...]
    ensemble: Ensemble
    steps: np.ndarray
    surveyed: Ensemble

    def of(self, first: int, stop: int) -> Shifted:
        """The copies of some members."""
        each = repeats(len(self.targets))
        return Shifted(self.ensemble.select(first * each, stop * each), self.steps[first:stop])


def with_copies(fleet: Ensemble, keys: Sequence[str], surveyed: Ensemble | None = None) -> Ensemble:
    """The same members, each followed by copies with one number shifted.

    keys: Names of single numbers. surveyed: The same with more numbers, if one kernel is to serve all of them.
    """
    ensemble = copy.copy(fleet)
    copies = copies_of(fleet, keys)
    ensemble.copies = copies if surveyed is None else replace(copies, surveyed=surveyed.copies.ensemble)
    return ensemble


def repeats(targets: int) -> int:
    """Number of copies of each member."""
    return 1 + len(OFFSETS) * targets


def targets_of(fleet: Ensemble, keys: Sequence[str]) -> tuple[Target, ...]:
    """The single numbers that names refer to; refuse a name of no number or of several."""
    faults = Faults("tangents.")
    values = fleet.numbers(0, 1)
    listed = []
    for key in keys:
        named = variations.targets(key)
        shapes = {name: value[0] for name, value in values.items()}
        if not all([variations.known_target(faults, key, "...", target, shapes) for target in named]):
            continue
        size = sum(target.of(shapes[target.name]).size for target in named)
        if size != 1 or shapes[named[0].name].dtype.kind != "f":
            faults.add(f'"{key}"', "...", f"names {size} numbers", f'give one, such as "{_entry(named[0], shapes)}"')
            continue
        listed.append(named[0])
    twice = sorted({target.label for target in listed if listed.count(target) > 1})
    for label in twice:
        faults.add(f'"{label}"', "...", "is named twice", "name it once")
    faults.raise_if_any()
    return tuple(listed)


def _entry(target: Target, shapes: dict[str, Any]) -> str:
    indices = ",".join("0" * shapes[target.name].ndim)
    return f"{target.name}[{indices}]" if indices else "vehicle.mass"


def copies_of(fleet: Ensemble, keys: Sequence[str]) -> Copies:
    """Each member of a fleet, followed by copies with each of these numbers shifted in turn."""
    targets = targets_of(fleet, keys)
    each, n = repeats(len(targets)), fleet.members
    values = fleet.numbers(0, n)
    _check_finite(values, targets)
    names = [name for name in values if name in fleet.varied_names or any(name == t.name for t in targets)]
    arrays = {
        name: np.repeat(np.broadcast_to(values[name], (n, *values[name].shape[1:])), each, axis=0) for name in names
    }
    steps = np.stack([_step(values[target.name], target, n) for target in targets], axis=1)
    for i, target in enumerate(targets):
        shift = np.outer(steps[:, i], OFFSETS)
        array = arrays[target.name].reshape(n, each, *arrays[target.name].shape[1:])
        places = slice(1 + i * len(OFFSETS), 1 + (i + 1) * len(OFFSETS))
        index: tuple[Any, ...] = target.index or ()
        array[:, places, *index] += shift
        if target.name in variations.MATRICES and index != index[::-1]:
            array[:, places, *index[::-1]] += shift
    ensemble = fleet.given_as_arrays(arrays, each)
    return Copies(targets, ensemble, steps, ensemble)


def _check_finite(values: dict[str, np.ndarray], targets: Sequence[Target]) -> None:
    faults = Faults("tangents.")
    for target in targets:
        index: tuple[Any, ...] = target.index or ()
        if not np.isfinite(values[target.name][:, *index]).all():
            faults.add(f'"{target.label}"', "...", "is infinite, or no number, for some member", "leave it out")
    faults.raise_if_any()


def _step(values: np.ndarray, target: Target, members: int) -> np.ndarray:
    """Difference steps (members,) of a number."""
    largest = np.abs(values).reshape(len(values), -1).max(axis=1)
    index: tuple[Any, ...] = target.index or ()
    size = np.maximum(np.abs(values[:, *index]), LEAST_PART * largest)
    return np.broadcast_to(STEP * np.where(size > 0.0, size, 1.0), members)
