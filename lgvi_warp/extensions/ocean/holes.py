# SPDX-License-Identifier: Apache-2.0
"""Values that a data set does not have, on land and below the sea floor: counted, and filled."""

from __future__ import annotations

import numpy as np

FILLS = ("nearest", "zero", "refuse")


def filled(field: np.ndarray, spacing: tuple[float, float], fill: str) -> np.ndarray:
    """The field (k, y, x) without holes; all NaN where no value is there to fill them with.

    Args:
        field: NaN where a value is missing.
        spacing: Of the nodes along y and x [m].
        fill: "nearest", the nearest level in the same column, and where it has none, the nearest column that has; or "zero".
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
    """Nearest level above each place that has a value; above the first, the first (k, y, x)."""
    level = np.arange(len(holes))[:, None, None]
    above = np.maximum.accumulate(np.where(holes, -1, level), axis=0)
    first = np.argmin(holes, axis=0)[None]
    return np.where(above < 0, first, above)
