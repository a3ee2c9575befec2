# SPDX-License-Identifier: Apache-2.0
"""The floors of a scene, as drawn in pictures and recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.physics.terms.events import from_list
from lgvi_warp.physics.terms.floor import Floor

# Places along an axis at which a floor on a grid is drawn.
MOST_PLACES = 121


class Relief(NamedTuple):
    """Depths (a, b) [m] at north coordinates (a,) [m] and east coordinates (b,) [m]."""

    north: np.ndarray
    east: np.ndarray
    depth: np.ndarray


def flat_depths(scene: Mapping[str, Any]) -> list[float]:
    """Depths of the flat floors in the tables of a scene [m], in their order."""
    return [float(event["depth"]) for event in _tables(scene) if np.ndim(event["depth"]) == 0]


def reliefs(scene: Mapping[str, Any], low: np.ndarray, high: np.ndarray) -> list[Relief]:
    """The gridded floors in the tables of a scene, within a box from low to high (2,) [m]; floors outside are left out."""
    grids: list[Any] = [table for table in _tables(scene) if np.ndim(table["depth"]) > 0]
    found = [_relief(floor, low, high) for floor in from_list(grids) if isinstance(floor, Floor)]
    return [relief for relief in found if relief is not None]


def _tables(scene: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [event for event in scene.get("events", ()) if event["type"] == Floor.type]


def _relief(floor: Floor, low: np.ndarray, high: np.ndarray) -> Relief | None:
    """The floor at its nodes within the box and at the box's edges, or at evenly spaced points if nodes are too many."""
    sides = []
    for i in (0, 1):
        nodes = floor.origin[i] + floor.spacing[i] * np.arange(floor.depth.shape[i])
        first, last = max(low[i], nodes[0]), min(high[i], nodes[-1])
        if first >= last:
            return None
        side = np.unique(np.concatenate([[first, last], nodes[(nodes > first) & (nodes < last)]]))
        sides.append(side if len(side) <= MOST_PLACES else np.linspace(first, last, MOST_PLACES))
    north, east = sides
    return Relief(north, east, floor.depth_at(*np.meshgrid(north, east, indexing="ij")))
