# SPDX-License-Identifier: Apache-2.0
"""Buoyancy that varies with depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import CONSERVED, Array, Numbers, Packed, PackingContext, Term, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Stratification(Term):
    """Buoyancy that varies with depth: B (1 + gradient (d - reference_depth)), d the depth of the centre of buoyancy.

    B is the vehicle's buoyancy.

    Args:
        gradient: Relative change of buoyancy per depth [1/m]: positive where denser water lies below, negative for a hull
            that is compressed.
        reference_depth: Depth [m] at which buoyancy is B; 0 by default.
    """

    type: ClassVar[str] = "stratification"
    strengths: ClassVar[tuple[str, ...]] = ("gradient",)

    gradient: Any = number((), "1/m")
    reference_depth: Any = number((), "m", 0.0)

    @property
    def conserves(self) -> frozenset[str]:
        # All three: its potential depends on the depth of the centre of buoyancy alone.
        return CONSERVED

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Only the deviation from B, since B itself is part of `Weight`.
        center = context.frame.point(context.parameters["vehicle.center_of_buoyancy"])
        stiffness = context.parameters["vehicle.buoyancy"] * numbers["gradient"]
        return Packed({"stiffness": stiffness, "center": center, "reference_depth": numbers["reference_depth"]})

    def potential(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array:
        # Energy U = B gradient (d - reference_depth)^2 / 2, (k, n) [J].
        center = np.sum(parameters["vehicle.center_of_buoyancy"] * attitude[..., 2, :], axis=-1)
        depth = position[..., 2] + center - numbers["reference_depth"]
        return 0.5 * parameters["vehicle.buoyancy"] * numbers["gradient"] * depth**2
