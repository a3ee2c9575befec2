# SPDX-License-Identifier: Apache-2.0
"""Density of the water against depth, a table that the hull, ballast and buoyancy engine share."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.extensions.gliders import DEVICE, casts
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import (
    CONSERVED,
    Array,
    Numbers,
    Packed,
    PackingContext,
    Term,
    knots,
    number,
    own,
    side_by_side,
)

DENSE = (1500.0, "brines of the deep sea have 1,300 kg/m3 at most")


@dataclass(frozen=True, eq=False, kw_only=True)
class DensityProfile(Term):
    """Density of the water against depth: a table rho(d), linear between its depths and constant outside.

    The hull's buoyancy is B rho(d) / rho0 (1 - compressibility (d - d0)). B is the vehicle's buoyancy, rho0 the water
    density of the environment, and d the depth of the centre of buoyancy. `ballast` and `buoyancy_engine` displace water
    of the density rho(d), and their pumps work against the pressure of this water. Drag and added mass use rho0.

    Args:
        depths: Depths, (k,) [m], rising.
        densities: In-situ densities at these depths, (k,) [kg/m3], that is, at the pressure of the depth.
        compressibility: Relative loss of the hull's volume per depth [1/m]; none by default.
        reference_depth: Depth d0 at which the hull's volume is B / (rho0 g) [m]; 0 if omitted.

    Methods:
        from_cast: Profile of a CTD cast, from arrays of temperature and salinity or from a file.
        density_at: Density at given depths.

    Raises:
        SceneError: If depths do not rise, or a number is invalid (see `Term`). A scene refuses a profile together with a
            `stratification` or with an engine that has a `gradient`.

    Examples:
        >>> import lgvi_warp as lw
        >>> water = lw.terms.DensityProfile(depths=[0.0, 50.0, 200.0], densities=[1024.0, 1026.5, 1027.8])
        >>> water.density_at([25.0, 125.0, 500.0])
        array([1025.25, 1027.15, 1027.8 ])
    """

    type: ClassVar[str] = "density_profile"
    device: ClassVar[str] = f"{DEVICE}.density_profile:"
    looks_at_surface: ClassVar[bool] = True
    unique: ClassVar[bool] = True
    usual: ClassVar[Mapping[str, Any]] = {
        "depths": "a check of depths looks at it",
        "densities": DENSE,
        "compressibility": (5e-3, "hulls lose millionths of their volume a metre"),
        "reference_depth": "a place in the sea may be anywhere",
    }
    depth_field: ClassVar[str] = "depths"

    depths: Any = number(("k",), "m", rising=True)
    densities: Any = number(("k",), "kg/m3", above=0.0)
    compressibility: Any = number((), "1/m", None, optional=True)
    reference_depth: Any = number((), "m", None, optional=True)

    @classmethod
    def from_cast(cls, file: Any = None, **columns: Any) -> Self:
        """Profile of a CTD cast.

        Args:
            file: Path of a CSV file with a line of names, or of a NetCDF file; None if columns are given instead. The file
                has depth or pressure, and density or temperature and salinity. Units may follow the names; case is ignored.
            **columns: Columns (k,) instead of a file: `depth` [m] or `pressure` [dbar], and either `density` [kg/m3] or
                `temperature` [deg C, in situ] with `salinity` [practical]. `latitude` and `longitude` [deg] are 0 by default.
                Fields of the term, such as `compressibility`, may be given as well.

        Returns:
            The profile. Densities follow from temperatures by TEOS-10 (McDougall & Barker 2011).

        Raises:
            SceneError: If a column is missing or invalid; the message names the remedy.
            MissingExtra: If temperatures are given, and the package gsw, which computes the densities, is not installed.

        Examples:
            >>> import lgvi_warp as lw
            >>> water = lw.terms.DensityProfile.from_cast(depth=[0.0, 100.0], density=[1024.0, 1027.0], compressibility=4e-6)
            >>> water.densities
            array([1024., 1027.])
        """
        names = ("compressibility", "reference_depth", "name")
        others = {name: columns.pop(name) for name in names if name in columns}
        depths, densities = casts.profile_of(file, columns)
        return cls(depths=depths, densities=densities, **others)

    def density_at(self, depth: Any) -> Array:
        """Density at given depths, from the profile's own numbers.

        Args:
            depth: Depths of any shape [m].

        Returns:
            Densities of the same shape [kg/m3].
        """
        return np.interp(np.asarray(depth, np.float64), self.depths, self.densities)

    def check(self, faults: Faults) -> None:
        if self.reference_depth is not None and self.compressibility is None:
            remedy = "give compressibility, or leave it out"
            faults.add("reference_depth", float(self.reference_depth), "is given for a stiff hull", remedy)

    def beside(self, terms: Sequence[Term]) -> Any:
        faults = Faults()
        for term in terms:
            if term.type == "stratification":
                problem = "is given beside a density_profile, which has the density of the water"
                faults.add(f"{term.key}.gradient", float(term.gradient), problem, "leave one of the two out")  # type: ignore[attr-defined]
            if term.type == "buoyancy_engine" and np.any(term.gradient):  # type: ignore[attr-defined]
                problem = "is given beside a density_profile, by which the engine goes"
                faults.add(f"{term.key}.gradient", float(term.gradient), problem, "leave it out")  # type: ignore[attr-defined]
        faults.raise_if_any()
        return self

    def device_in(self, aligned: bool) -> str:
        return self.device + "compressed" * (self.compressibility is not None)

    @property
    def conserves(self) -> frozenset[str]:
        # All three: its potential depends on the depth of the centre of buoyancy alone.
        return CONSERVED if self.compressibility is None and self.surface_level is None else frozenset()

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Only the deviation from B, since B itself is part of `Weight`.
        p = context.parameters
        rows, count = self.rows(numbers, p["environment.water_density"])
        values = {"buoyancy": p["vehicle.buoyancy"], "center": context.frame.point(p["vehicle.center_of_buoyancy"])}
        if self.compressibility is not None:
            values |= {"compressibility": numbers["compressibility"]}
            values |= {"reference": numbers.get("reference_depth", np.zeros(1))}
        return Packed(values | {"density_knots": count}, rows)

    def rows(self, numbers: Numbers, reference: Array) -> tuple[Array, int]:
        """Rows of the table of rho / rho0, in the form that device/density.py reads.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            reference: Density rho0 of the environment, (n,) [kg/m3].

        Returns:
            The rows (n, rows), and the number of knots after the first.
        """
        depths, share, _ = repeated(numbers["depths"], numbers["densities"], reference)
        share = share / reference[:, None]
        count = depths.shape[1] - 1
        table = knots(depths, share[..., None]) if count else share
        # Of the column at the depth 0, which is 0, without the constant: see `column` of the device code.
        part = np.clip(-depths[:, :-1], 0.0, np.diff(depths))
        swept = 0.5 * part**2 / np.diff(depths) + np.maximum(-depths[:, 1:], 0.0)
        return side_by_side(table, -np.sum(np.diff(share) * swept, axis=1, keepdims=True)), count

    def column(self, numbers: Numbers, reference: Array, depth: Array) -> Array:
        """Integral of rho / rho0 from the surface to given depths.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            reference: Density rho0 of the environment, (n,) [kg/m3].
            depth: Depths (k, n) [m].

        Returns:
            Integrals (k, n) [m].
        """
        share = numbers["densities"] / reference[:, None]
        total = share[:, 0] * depth
        at = numbers["depths"]
        for i in range(at.shape[1] - 1):
            length = at[:, i + 1] - at[:, i]
            change = (share[:, i + 1] - share[:, i]) * length
            for place, sign in ((depth, 1.0), (np.zeros(1), -1.0)):
                part = (place - at[:, i]) / length
                total = total + sign * change * (0.5 * np.clip(part, 0.0, 1.0) ** 2 + np.maximum(part - 1.0, 0.0))
        return np.asarray(total)

    def potential(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array | float:
        # U = B (column - d), (k, n) [J], of a stiff hull.
        if self.compressibility is not None:
            return 0.0
        center = np.sum(parameters["vehicle.center_of_buoyancy"] * attitude[..., 2, :], axis=-1)
        depth = position[..., 2] + center
        above = self.column(numbers, parameters["environment.water_density"], depth)
        return np.asarray(parameters["vehicle.buoyancy"] * (above - depth))


def in_profile(term: Any, terms: Sequence[Term]) -> Any:
    """The term, with the scene's density profile if there is one."""
    profile = next((other for other in terms if isinstance(other, DensityProfile)), None)
    if profile is term.profile:
        return term
    term = copy.copy(term)
    object.__setattr__(term, "profile", profile)
    return term


def profile_rows(term: Any, parameters: Numbers) -> tuple[Array, int]:
    """Rows of the density profile of a term, and the number of its knots after the first."""
    rows: tuple[Array, int] = term.profile.rows(own(term.profile, parameters), parameters["environment.water_density"])
    return rows
