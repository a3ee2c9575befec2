# SPDX-License-Identifier: Apache-2.0
"""Conversion of columns with geodetic coordinates in a table of members to columns of positions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.fields import PLACE_UNIT
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.scene.start import positions_of

PLACE = "start.geodetic"
ENTRIES = tuple(f"{PLACE}[{i}]" for i in range(3))


def positions_in_place_of_places(columns: Mapping[str, Any], scene: SceneLike) -> Mapping[str, Any]:
    """Columns by name, with "start.geodetic" or its entries converted to "start.position" [m].

    An entry without a column is taken from the scene's start.
    """
    named = [name for name in columns if name.replace(" ", "") in (PLACE, *ENTRIES)]
    faults = Faults("ensemble.sampling.table.")
    places = _places(faults, {name.replace(" ", ""): columns[name] for name in named}, scene.start.geodetic)
    faults.raise_if_any()
    others = {name: column for name, column in columns.items() if name not in named}
    return others | {"start.position": positions_of(scene.environment, PLACE, places)}


def _places(faults: Faults, columns: Mapping[str, Any], own: np.ndarray | None) -> np.ndarray:
    """Latitude, longitude and depth of each member (n, 3), from the columns or else from the scene's start."""
    read = {name: faults.finite(f'"{name}"', column, None, PLACE_UNIT) for name, column in columns.items()}
    if faults:
        return np.empty((0, 3))
    if PLACE in read:
        places = np.asarray(read[PLACE])
        if places.ndim != 2 or places.shape[1] != 3 or len(read) > 1:
            problem = "is given beside entries of it" if len(read) > 1 else f"has shape {places.shape}"
            faults.add(f'"{PLACE}"', "...", problem, "give latitude, longitude and depth of each member, (n, 3)")
        return places
    missing = [name for name in ENTRIES if name not in read]
    if missing and own is None:
        remedy = "give it a column too, or the scene a start.geodetic"
        faults.add(f'"{missing[0]}"', "", "is missing", remedy)
        return np.empty((0, 3))
    count = len(next(iter(columns.values())))
    given = [read.get(name, None if own is None else np.full(count, own[i])) for i, name in enumerate(ENTRIES)]
    return np.stack([np.asarray(column) for column in given], axis=1)
