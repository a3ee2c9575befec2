# SPDX-License-Identifier: Apache-2.0
"""Levels that follow the sea floor, as in ROMS, CROCO and Delft3D: depths by the CF conventions, appendix D."""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.extensions.ocean.staggered import averaged, shift_of
from lgvi_warp.extensions.ocean.units import factor

# The formula by the standard_name of the levels; ROMS tells it by Vtransform. The plain one is that of Song and Haidvogel.
KINDS = {"ocean_s_coordinate": 0, "ocean_s_coordinate_g1": 1, "ocean_s_coordinate_g2": 2, "ocean_sigma_coordinate": 2}


@dataclass(frozen=True, eq=False)
class SLevels:
    """Depths of levels that follow the floor.

    kind: Number of the formula, 0, 1 or 2. s, C: (k,), -1 at the floor, 0 at the surface. critical: depth_c [m].
    floor: Depth (y, x) [m]. surface: Elevation, times `scale` [m], (y, x) or lazily (t, y, x); None for 0. It has `shift`
    more rows and columns than the floor, and neighbours are averaged. time: Name of its time dimension.
    """

    kind: int
    s: np.ndarray
    C: np.ndarray
    critical: float
    floor: np.ndarray
    surface: Any
    scale: float
    shift: tuple[int, int]
    time: Any

    def depths(self, time: int) -> np.ndarray:
        """Depths of the nodes (k, y, x) [m] below the mean surface at a time, in the order of s."""
        floor, surface = self.floor[None], self._surface(time)
        s, C = self.s[:, None, None], self.C[:, None, None]
        if self.kind == 2:
            stretched = (self.critical * s + floor * C) / (self.critical + floor)
            return -(surface + (surface + floor) * stretched)
        stretched = self.critical * s + (floor - self.critical) * C
        return -(stretched + surface * (1.0 + (stretched / floor if self.kind else s)))

    def part(self, rows: slice, columns: slice) -> SLevels:
        """The levels of some rows and columns."""
        surface = self.surface
        if surface is not None:
            index = {dim: slice(part.start, part.stop + more) for dim, part, more in
                     zip(surface.dims[-2:], (rows, columns), self.shift, strict=True)}  # fmt: skip
            surface = surface.isel(index)
        return dataclasses.replace(self, floor=self.floor[rows, columns], surface=surface)

    def _surface(self, time: int) -> Any:
        if self.surface is None:
            return 0.0
        surface = self.surface.isel({self.time: time}) if self.time in self.surface.dims else self.surface
        return averaged(np.nan_to_num(np.asarray(surface.values, dtype=np.float64)), self.shift)[None] * self.scale


def s_levels(ds: Any, name: str, level: str, horizontal: tuple[Any, Any], shape: Any, time: Any) -> SLevels:
    """The levels of a variable along the dimension `level`: by formula_terms, else by the names of ROMS and CROCO."""
    about = dict(ds[level].attrs) if level in ds.variables else {}
    terms = dict(re.findall(r"(\w+)\s*:\s*(\w+)", str(about.get("formula_terms", ""))))
    standard = str(about.get("standard_name", "")).strip().lower()

    def numbers(term: str, *names: str) -> np.ndarray | None:
        for word in (terms.get(term), *names):
            if word in ds.variables:
                return np.asarray(ds[word].values, dtype=np.float64)
        found = next((ds.attrs[word] for word in names if word in ds.attrs), None)
        found = found.strip("[] ").replace(",", " ").split() if isinstance(found, str) else found
        try:
            return None if found is None else np.squeeze(np.asarray(found, dtype=np.float64))
        except ValueError:
            return None

    def on_nodes(term: str, *names: str) -> tuple[Any, tuple[int, int], float] | None:
        """A field, the numbers of rows and columns that it has more than the nodes, and its unit in metres."""
        word = next((word for word in (terms.get(term), *names) if word in ds.variables), None)
        if word is None:
            return None
        field = ds[word]
        if set(horizontal) <= set(field.dims):
            field = field.transpose(..., *horizontal)
        if (shift := shift_of(field, horizontal, shape)) is None:
            raise refusal(f"{name}.{level}", word, f"stands at other nodes than {name}", f"interpolate {word} to them")
        # Terms of the formula are metres, where they do not say otherwise.
        return field, shift, factor(word, field.attrs.get("units", "m"), "m")

    said = numbers("", "Vtransform")
    kind = KINDS.get(standard) if said is None else int(said)
    if said is None and ds.attrs.get("VertCoordType") == "NEW":
        kind = 2
    if kind not in (0, 1, 2) or (said is not None and standard[-3:] in ("_g1", "_g2") and standard[-1] != str(kind)):
        raise refusal(f"{name}.{level}", f"{standard or 'no standard_name'}, Vtransform {said}",
                      "does not tell one formula of its depths", "give attributes = {'Vtransform': 1}, or 2")  # fmt: skip
    if standard == "ocean_sigma_coordinate":
        s = C = numbers("sigma", level)
        critical: Any = 0.0
    else:
        s, C, critical = numbers("s", level, "sc_r"), numbers("C", "Cs_r", "Cs_rho"), numbers("depth_c", "hc")
        a, b = numbers("a"), numbers("b")
        if C is None and kind == 0 and s is not None and a is not None and b is not None:
            C = (1.0 - b) * np.sinh(a * s) / np.sinh(a) + b * (0.5 * np.tanh(a * (s + 0.5)) / np.tanh(0.5 * a) - 0.5)
    depth, surface = on_nodes("depth", "h"), on_nodes("eta", "zeta")
    count = (ds.sizes[level],)
    missing = [word for word, found in (("s", s), ("C", C), ("depth_c", critical), ("depth", depth)) if found is None]
    missing += [word for word, found in (("s", s), ("C", C)) if found is not None and found.shape != count]
    if missing or s is None or C is None or depth is None:
        raise refusal(f"{name}.{level}.formula_terms", about.get("formula_terms", ""),
                      f"does not tell the depths of its levels: {', '.join(missing)}",
                      "name s, C, depth and depth_c there, or interpolate the data onto levels of depth")  # fmt: skip
    field, shift, scale = depth
    floor = averaged(np.asarray(field.values, dtype=np.float64), shift) * scale
    if floor.ndim != 2:
        raise refusal(f"{name}.{level}", field.dims, "has a floor that moves", "take one time of it, by ds.isel")
    lazily, more, size = surface or (None, (0, 0), 1.0)
    return SLevels(kind, s, C, float(critical), floor, lazily, size, more, time)


def at_depths(field: np.ndarray, depths: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Values (m, y, x) at depths (m,) of a field (k, y, x) at rising depths (k, y, x): linear, constant beyond the ends."""
    result = np.empty((len(wanted), *field.shape[1:]))
    most = max(len(field) - 2, 0)
    for number, depth in enumerate(wanted):
        low = np.clip(np.count_nonzero(depths <= depth, axis=0) - 1, 0, most)[None]
        high = np.minimum(low + 1, len(field) - 1)
        (a, b), (x, y) = ([np.take_along_axis(v, k, axis=0)[0] for k in (low, high)] for v in (depths, field))
        part = np.clip((depth - a) / np.where(b > a, b - a, 1.0), 0.0, 1.0)
        result[number] = x + part * (y - x)
    return result
