# SPDX-License-Identifier: Apache-2.0
"""Filling of missing values of a data set, on land and below the sea floor."""

from __future__ import annotations

import numpy as np

FILLS = ("nearest", "zero", "refuse")


def filled(field: np.ndarray, spacing: tuple[float, float], fill: str) -> np.ndarray:
    """The field (k, y, x) with missing values filled; all NaN if the field has no value.

    Args:
        field: Values, NaN where missing.
        spacing: Distances between nodes along y and x [m].
        fill: "nearest", the nearest level with a value in the same column, or else the nearest column with values; or "zero".
    """
    holes = np.isnan(field)
    if not holes.any() or holes.all():
        return field
    if fill == "zero":
        return np.where(holes, 0.0, field)
    from scipy.ndimage import distance_transform_edt

    field = np.take_along_axis(field, _nearest_level(holes), axis=0)
    dry = np.isnan(field[0])
    if not dry.any():
        return field
    j, i = distance_transform_edt(dry, sampling=spacing, return_distances=False, return_indices=True)
    return field[:, j, i]


def _nearest_level(holes: np.ndarray) -> np.ndarray:
    """Nearest level with a value at or above each node (k, y, x); above the first such level, that level."""
    level = np.arange(len(holes))[:, None, None]
    above = np.maximum.accumulate(np.where(holes, -1, level), axis=0)
    first = np.argmin(holes, axis=0)[None]
    return np.where(above < 0, first, above)
