# SPDX-License-Identifier: Apache-2.0
"""Levels that follow the sea floor, as ROMS has them: depths by the formulas of the CF conventions, appendix D."""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal

KINDS = {"ocean_s_coordinate_g1": 1, "ocean_s_coordinate_g2": 2}


@dataclass(frozen=True, eq=False)
class SLevels:
    """Depths of levels that follow the floor.

    kind: 1 or 2, of the formula. s, C: (k,), -1 at the floor, 0 at the surface. critical: depth_c [m]. floor: (y, x) [m].
    surface: elevation of the surface [m], (y, x) or (t, y, x) lazily; None for 0. time: name of its dimension of time.
    """

    kind: int
    s: np.ndarray
    C: np.ndarray
    critical: float
    floor: Any
    surface: Any
    time: Any

    def depths(self, time: int) -> np.ndarray:
        """Depths of the nodes (k, y, x) [m] at a time, from the mean surface, in the order of s."""
        floor = np.asarray(self.floor.values, dtype=np.float64)[None]
        surface = self._surface(time)
        s, C = self.s[:, None, None], self.C[:, None, None]
        if self.kind == 1:
            stretched = self.critical * s + (floor - self.critical) * C
            return -(stretched + surface * (1.0 + stretched / floor))
        stretched = (self.critical * s + floor * C) / (self.critical + floor)
        return -(surface + (surface + floor) * stretched)

    def isel(self, index: Any) -> SLevels:
        """The same of some rows and columns."""
        surface = None if self.surface is None else self.surface.isel(index)
        return dataclasses.replace(self, floor=self.floor.isel(index), surface=surface)

    def _surface(self, time: int) -> Any:
        if self.surface is None:
            return 0.0
        surface = self.surface.isel({self.time: time}) if self.time in self.surface.dims else self.surface
        return np.nan_to_num(np.asarray(surface.values, dtype=np.float64))[None]


def s_levels(ds: Any, name: str, level: str, horizontal: tuple[Any, Any], time: Any) -> SLevels:
    """The levels of a variable whose coordinate `level` has the attribute formula_terms."""
    where, coordinate = f"{name}.{level}", ds[level]
    kind = KINDS.get(str(coordinate.attrs.get("standard_name", "")).lower())
    terms = dict(re.findall(r"(\w+)\s*:\s*(\w+)", str(coordinate.attrs.get("formula_terms", ""))))
    missing = [term for term in ("s", "C", "depth", "depth_c") if terms.get(term) not in ds.variables]
    if kind is None or missing:
        shown = coordinate.attrs.get("formula_terms", "")
        remedy = "name s, C, depth and depth_c there, or interpolate the data onto levels of depth"
        raise refusal(
            f"{where}.formula_terms", shown, "does not tell the depths of ocean_s_coordinate_g1 or _g2", remedy
        )
    floor = ds[terms["depth"]]
    if set(floor.dims) != set(horizontal):
        problem = f"has {terms['depth']} at other nodes than {name}"
        raise refusal(where, terms["depth"], problem, "bring the velocities to the rho points, where the depth is")
    surface = ds[terms["eta"]] if terms.get("eta") in ds.variables else None
    if surface is not None:
        surface = surface.transpose(*([time] if time in surface.dims else []), *horizontal)
    s, C = (np.asarray(ds[terms[term]].values, dtype=np.float64) for term in ("s", "C"))
    critical = float(np.asarray(ds[terms["depth_c"]].values))
    return SLevels(kind, s, C, critical, floor.transpose(*horizontal), surface, time)


def at_depths(field: np.ndarray, depths: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Values (m, y, x) at depths (m,) of a field (k, y, x) at depths (k, y, x) that rise: linear, held beyond the ends."""
    result = np.empty((len(wanted), *field.shape[1:]))
    most = max(len(field) - 2, 0)
    for number, depth in enumerate(wanted):
        low = np.clip(np.count_nonzero(depths <= depth, axis=0) - 1, 0, most)[None]
        high = np.minimum(low + 1, len(field) - 1)
        (a, b), (x, y) = ([np.take_along_axis(v, k, axis=0)[0] for k in (low, high)] for v in (depths, field))
        part = np.clip((depth - a) / np.where(b > a, b - a, 1.0), 0.0, 1.0)
        result[number] = x + part * (y - x)
    return result
