# SPDX-License-Identifier: Apache-2.0
"""The columns of a model: their names, their order, and selection of columns that a user gives by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.labelled import match
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.variations import MATRICES, Target, Variation, targets


def names_of(faults: Faults, vary: Any, argument: str = "vary") -> tuple[str, ...]:
    """Check and normalise a list of names without distributions; argument: name of the list in error messages."""
    listed = [vary] if isinstance(vary, str) else items_of(vary)
    if not listed or not all(isinstance(name, str) for name in listed):
        remedy = (
            'give {"vehicle.mass": lw.distributions.Normal(...)} '
            'or a list of names, ["vehicle.mass", "start.position[2]"]'
        )
        faults.add(argument, vary, "is neither a list of names nor a mapping of names to distributions", remedy)
        return ()
    names = tuple(", ".join(target.label for target in targets(name)) for name in listed)
    for name in sorted({name for name in names if names.count(name) > 1}):
        faults.add(argument, name, "is named twice", "name each number once")
    return names


def as_given(fleet: Ensemble) -> list[Variation]:
    """List the variations in the order of `vary`, followed by those of the sampling itself."""
    place = {key: number for number, key in enumerate(fleet.vary)}
    return sorted(fleet.variations, key=lambda variation: place.get(variation.key, len(place)))


def columns_of(space: Space, key: str) -> range:
    """Find the columns of the cube that belong to a key."""
    place = space.keys.index(key)
    first = sum(space.sizes[:place])
    return range(first, first + space.sizes[place])


def whole_columns(
    faults: Faults, names: Sequence[str], scene: Mapping[str, np.ndarray], by_label: Mapping[str, Any]
) -> dict[str, np.ndarray]:
    """Select one column (n,) for each name from data given by label; none after a fault.

    by_label: {label: (n,)}, or (n, *shape) for an array whose entries are named.
    """
    columns: dict[str, np.ndarray] = {}
    labels: list[str] = []
    for key, column in by_label.items():
        label = ", ".join(target.label for target in targets(key)) if key not in names else key
        entries = {name: target for name in names for target in targets(name)
                   if target.name == label and target.index is not None}  # fmt: skip
        array = faults.real(f'X["{key}"]', column)
        if array is None:
            labels += entries or [label]
        elif entries and label not in names:
            parts = _entries(faults, key, array, entries, scene[label])
            labels += entries
            columns |= parts
        else:
            labels.append(label)
            columns[label] = array
    doubled_labels = {label for label in labels if labels.count(label) > 1}
    for label in sorted(doubled_labels):
        faults.add(f'X["{label}"]', "...", "is given twice", "keep one of them")
    good = match(faults, "X", list(dict.fromkeys(labels)), names)
    return columns if good and not faults else {}


def _entries(
    faults: Faults, key: str, array: np.ndarray, entries: Mapping[str, Target], full: np.ndarray
) -> dict[str, np.ndarray]:
    """Select the varied entries {name: (n,)} from the array (n, *shape) of all entries of a number."""
    if array.shape[1:] != full.shape or array.ndim == 0:
        shape = ", ".join(map(str, full.shape))
        faults.add(f'X["{key}"]', "...", f"has shape {array.shape}", f"give an array of shape (n, {shape})")
        return {}
    fixed = np.ones(full.shape, dtype=bool)
    entry_columns = {}
    for name, target in entries.items():
        index = target.index or ()
        fixed[index] = False
        if target.name in MATRICES:
            fixed[index[::-1]] = False
        place: tuple[Any, ...] = (slice(None), *index)
        entry_columns[name] = array[place]
    if key in MATRICES and not np.array_equal(array, np.swapaxes(array, 1, 2)):
        faults.add(f'X["{key}"]', "...", "holds a matrix that is not symmetric", "give symmetric matrices")
    elif np.any(array[:, fixed] != full[fixed]):
        odd = ", ".join(f"{key}{list(map(int, index))}" for index in np.argwhere(fixed)[:4])
        faults.add(f'X["{key}"]', "...", "changes entries that do not vary", f"keep the scene's {odd}, or vary them")
    return entry_columns


def stacked(faults: Faults, key: str, names: Sequence[str], columns: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Put columns (n,) side by side in the order of the names, (n, d); None after a fault."""
    shapes = {name: columns[name].shape for name in names}
    if all(len(shape) == 1 for shape in shapes.values()) and len(set(shapes.values())) == 1:
        return np.column_stack([columns[name] for name in names])
    listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
    faults.add(key, "...", f"has columns of other shapes than one (n,): {listed}", "give one number for each member")
    return None
