# SPDX-License-Identifier: Apache-2.0
"""Staggered grids of ROMS and CROCO: u lies between two rho points along xi, and v along eta."""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal

# Dimensions of points between two rho points, and the dimension of those.
BETWEEN = {"xi_u": "xi_rho", "xi_psi": "xi_rho", "eta_v": "eta_rho", "eta_psi": "eta_rho"}
PREFIXES = ("eta_", "xi_")
# Words of a mask of water, 1, and land, 0.
MASKS = ("mask_rho", "mask_u", "mask_v")


def trimmed(ds: Any) -> Any:
    """The data set without points beyond its last rho point; a file cut by equal index ranges has such points."""
    cut = {dim: slice(0, -1) for dim, rho in BETWEEN.items() if 1 < ds.sizes.get(dim, 0) == ds.sizes.get(rho)}
    ds = ds.isel(cut)
    for name in MASKS[1:] if cut else ():
        mask = ds.get(name)
        if mask is None or "mask_rho" not in ds or mask.ndim != 2:
            continue
        own, others = np.asarray(mask.values) > 0.5, land_at(ds[["mask_rho"]], mask.dims, mask.shape)
        if others is not None and np.any(own == others):
            raise refusal(name, mask.dims, "is not between the points of mask_rho with the same indices",
                          "cut the file so that xi_u and eta_v begin with xi_rho and eta_rho, and end one before")  # fmt: skip
    return ds


def averaged(values: np.ndarray, shift: tuple[int, int]) -> np.ndarray:
    """Means of neighbors along the last two axes where `shift` is 1."""
    if shift[0]:
        values = 0.5 * (values[..., :-1, :] + values[..., 1:, :])
    return 0.5 * (values[..., :-1] + values[..., 1:]) if shift[1] else values


def shift_of(field: Any, dims: tuple[Any, Any], shape: Any) -> tuple[int, int] | None:
    """Numbers of points, 0 or 1, that a field has more than a grid along y and x; None if it does not fit the grid."""
    shift = []
    for own, dim, size in zip(field.dims[-2:], dims, shape[-2:], strict=False):
        family = own == dim or any(str(own).startswith(p) and str(dim).startswith(p) for p in PREFIXES)
        shift.append(field.sizes[own] - size if family else -1)
    return (shift[0], shift[1]) if len(shift) == 2 and set(shift) <= {0, 1} else None


def at_nodes(ds: Any, name: str, dims: tuple[Any, Any], shape: Any) -> np.ndarray | None:
    """A field of the rho points at the nodes of a grid (y, x), as the mean of neighbors; None without such a field."""
    if name not in ds.variables or (shift := shift_of(ds[name], dims, shape)) is None or ds[name].ndim != 2:
        return None
    return averaged(np.asarray(ds[name].values, dtype=np.float64), shift)


def places_at(ds: Any, variable: Any) -> tuple[tuple[Any, Any], np.ndarray, np.ndarray] | None:
    """Dimensions, latitudes and longitudes (y, x) of a variable between rho points; None if the file has no rho points."""
    dims = [[dim for dim in variable.dims if str(dim).startswith(prefix)] for prefix in PREFIXES]
    if [len(found) for found in dims] != [1, 1]:
        return None
    pair, shape = (dims[0][0], dims[1][0]), [variable.sizes[found[0]] for found in dims]
    latitude = at_nodes(ds, "lat_rho", pair, shape)
    if latitude is None or "lon_rho" not in ds.variables or (shift := shift_of(ds["lon_rho"], pair, shape)) is None:
        return None
    # Means of unit vectors: a longitude may jump by a turn from one point to the next.
    angle = np.deg2rad(ds["lon_rho"].values)
    longitude = np.rad2deg(np.arctan2(averaged(np.sin(angle), shift), averaged(np.cos(angle), shift)))
    return pair, latitude, longitude


def land_at(ds: Any, dims: tuple[Any, Any], shape: Any) -> np.ndarray | None:
    """Land nodes (y, x) by a ROMS mask at these nodes, or else at the rho points next to them; None without a mask."""
    for name in MASKS:
        if name in ds.variables and tuple(ds[name].dims) == tuple(dims):
            return np.asarray(ds[name].values) < 0.5
    water = at_nodes(ds, MASKS[0], dims, shape)
    return None if water is None else ~(water > 0.999)
