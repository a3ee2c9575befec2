"""Weight, buoyancy and restoring moment: they follow from the vehicle, and no scene needs to list them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.physics import vehicle
from lgvi_warp.physics.terms.base import CONSERVED, Numbers, Packed, Setting, Term


@dataclass(frozen=True, eq=False, kw_only=True)
class Weight(Term):
    """Weight less buoyancy, along the vertical (section IV of Nordkvist & Sanyal 2010)."""

    type: ClassVar[str] = "weight"
    device: ClassVar[str] = "weight"

    @property
    def conserves(self) -> frozenset[str]:
        """All: its potential depends on depth alone."""
        return CONSERVED

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """(m - rho V) g cancels: formed here in float64, whatever the kernel's precision."""
        return Packed({"net": net(setting.parameters)})

    def potential(self, own: Numbers, position: np.ndarray, attitude: np.ndarray, setting: Numbers) -> np.ndarray:
        """U = -net b3."""
        return -net(setting) * position[..., 2]


@dataclass(frozen=True, eq=False, kw_only=True)
class Restoring(Term):
    """Moment of buoyancy and weight about the body's origin (section IV of Nordkvist & Sanyal 2010)."""

    type: ClassVar[str] = "restoring"
    device: ClassVar[str] = "restoring"

    @property
    def conserves(self) -> frozenset[str]:
        """All: its potential depends on the attitude to the vertical alone."""
        return CONSERVED

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """B r_b - W r_g about the origin of the forces."""
        p, origin = setting.parameters, setting.frame.forces
        return Packed({"moment": setting.frame.vector(moment(p) + net(p)[:, None] * origin)})

    def potential(self, own: Numbers, position: np.ndarray, attitude: np.ndarray, setting: Numbers) -> np.ndarray:
        """U = (B r_b - W r_g).R^T e3."""
        return np.sum(moment(setting) * attitude[..., 2, :], axis=-1)


def net(p: Numbers) -> np.ndarray:
    """Weight less buoyancy (n,) [N]."""
    return vehicle.weight(p) - p["vehicle.buoyancy"]


def moment(p: Numbers) -> np.ndarray:
    """B r_b - W r_g about the user's origin (n, 3) [N m]."""
    lift = p["vehicle.buoyancy"][:, None] * p["vehicle.center_of_buoyancy"]
    if "vehicle.center_of_gravity" not in p:
        return lift
    return lift - vehicle.weight(p)[:, None] * p["vehicle.center_of_gravity"]
