# SPDX-License-Identifier: Apache-2.0
"""Numbers of members that the user gives as arrays: states, parameters and the columns of a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.labelled import columns_by_name, is_labelled, match
from lgvi_warp.common.real_numbers import column_names
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.scene import variations
from lgvi_warp.scene.variations import MATRICES


def given_members(
    base: Mapping[str, np.ndarray],
    position: Any,
    attitude: Any,
    velocity: Any,
    angular_velocity: Any,
    parameters: Any,
) -> tuple[int, dict[str, np.ndarray]]:
    """Number n of members and arrays (n, ...) by name from the arguments of `Ensemble.from_states`; states are "start."."""
    faults = Faults()
    states = dict(zip(FIELDS, (position, attitude, velocity, angular_velocity), strict=True))
    explicit = {f"start.{key}": _state(faults, key, value) for key, value in states.items()}
    faults.raise_if_any()
    n = len(explicit["start.position"]) if explicit["start.position"].ndim else 0
    if n == 0:
        faults.add("position", position, "holds no member", "give arrays of length 1 or more")
    for key, value in explicit.items():
        shape = (n, 3, 3) if key == "start.attitude" else (n, 3)
        if value.shape != shape:
            faults.add(key, value, f"has shape {value.shape}", f"give an array of shape {shape}")
    faults.raise_if_any()
    R = explicit["start.attitude"]
    bad = np.isfinite(R).all(axis=(1, 2)) & ~notation.rotations(R)
    if bad.any():
        problem = f"is not a rotation to 1e-9 ({bad.sum()} of {n} members)"
        faults.add(f"attitude of member {bad.argmax()}", R[bad.argmax()], problem, "give R^T R = I, det R = 1")
    explicit |= _given_parameters(faults, base, parameters, n)
    faults.raise_if_any()
    return n, explicit


def _state(faults: Faults, key: str, value: Any) -> np.ndarray:
    """A copy of a state in float64, which may hold NaN; later changes of the argument do not affect the ensemble.

    A data frame's columns may be called position[0], position[1], position[2], in any order.
    """
    names = column_names(value)
    if key != "attitude" and names is not None and all(isinstance(name, str) for name in names):
        columns = columns_by_name(faults, key, value)
        entries = [f"{key}[{i}]" for i in range(3)]
        if not columns or not match(faults, key, list(columns), entries):
            return np.empty(0)
        value = _numbers(faults, key, [columns[entry] for entry in entries])
        return np.ascontiguousarray(value.T)
    return _numbers(faults, key, value)


def _numbers(faults: Faults, key: str, value: Any) -> np.ndarray:
    """Numbers of an array; an empty array after a fault."""
    array = faults.real(key, value, "give an array of numbers")
    return np.empty(0) if array is None else array


def _given_parameters(faults: Faults, base: Mapping[str, np.ndarray], arrays: Any, n: int) -> dict[str, np.ndarray]:
    """Return arrays (n, *shape) by name, from parameters given as arrays or by their entries."""
    if arrays is None or (isinstance(arrays, Mapping) and not arrays):
        return {}
    if not is_labelled(arrays):
        remedy = 'give {"vehicle.mass": array, ...} or a DataFrame with such names'
        faults.add("parameters", arrays, "has no names", remedy)
        return {}
    parameters: dict[str, np.ndarray] = {}
    named = []
    for key, column in columns_by_name(faults, "parameters", arrays).items():
        (target, *more) = variations.targets(key)
        if more or target.name not in base:
            faults.keys("", {key: column}, base)
        elif variations.known_target(faults, key, "...", target, base):
            named.append((key, (target,)))
            name = key if target.index is not None else target.name
            values = explicit_parameter(faults, name, column, (n, *target.of(base[target.name]).shape))
            if target.index is None:
                parameters[target.name] = values
            elif values.shape == (n,):
                parameters.setdefault(target.name, np.repeat(base[target.name][None], n, axis=0))
                variations.put(parameters, target, values)
    variations.clashes(faults, named)
    return parameters


def explicit_parameter(faults: Faults, key: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Values of a parameter, or of one entry of it, as an array of this shape; a matrix may be given by its diagonal."""
    array = faults.real(key, value, "give an array of numbers")
    if array is None:
        return np.empty(0)
    if key in MATRICES and array.shape == shape[:2]:
        return np.where(np.eye(shape[1], dtype=bool), array[:, :, None], 0.0)
    if array.shape != shape:
        also = f" or {shape[:2]}" if key in MATRICES else ""
        faults.add(key, value, f"has shape {array.shape}", f"give an array of shape {shape}{also}")
    elif key in MATRICES and _skew(array):
        faults.add(key, "...", "holds a matrix that is not symmetric", "give symmetric matrices")
    return array


def _skew(matrices: np.ndarray) -> bool:
    """Return whether one of the matrices (n, d, d) is not symmetric; matrices that are not finite are checked elsewhere."""
    with np.errstate(invalid="ignore"):
        return bool(np.any(np.abs(matrices - np.swapaxes(matrices, 1, 2)) > 1e-9 * np.abs(matrices).max()))
