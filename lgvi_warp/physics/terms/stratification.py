"""Buoyancy that varies with depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import CONSERVED, Numbers, Packed, Setting, Term, quantity


@dataclass(frozen=True, eq=False, kw_only=True)
class Stratification(Term):
    """Buoyancy B (1 + gradient (d - reference_depth)), d the depth of the centre of buoyancy, B the vehicle's.

    gradient [1/m]: positive where denser water lies below, negative for a hull that yields; reference_depth [m].
    """

    type: ClassVar[str] = "stratification"
    device: ClassVar[str] = "stratification"

    gradient: Any = quantity((), "1/m")
    reference_depth: Any = quantity((), "m", 0.0)

    def present(self, own: Numbers) -> bool:
        """Whether some member has one."""
        return bool(np.any(own["gradient"]))

    @property
    def conserves(self) -> frozenset[str]:
        """All: its potential depends on the depth of the centre of buoyancy alone."""
        return CONSERVED

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """The deviation from B alone: B is the vehicle's weight less buoyancy's."""
        center = setting.frame.point(setting.parameters["vehicle.center_of_buoyancy"])
        stiffness = setting.parameters["vehicle.buoyancy"] * own["gradient"]
        return Packed({"stiffness": stiffness, "center": center, "reference_depth": own["reference_depth"]})

    def potential(self, own: Numbers, position: np.ndarray, attitude: np.ndarray, setting: Numbers) -> np.ndarray:
        """U = B gradient (d - d0)^2 / 2."""
        center = np.sum(setting["vehicle.center_of_buoyancy"] * attitude[..., 2, :], axis=-1)
        depth = position[..., 2] + center - own["reference_depth"]
        return 0.5 * setting["vehicle.buoyancy"] * own["gradient"] * depth**2
