# SPDX-License-Identifier: Apache-2.0
"""Buoyancy that varies with depth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.extensions.gliders import DEVICE
from lgvi_warp.physics.terms.base import CONSERVED, Array, Numbers, Packed, PackingContext, Term, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Stratification(Term):
    """Buoyancy that varies with depth: B (1 + gradient x) (1 - compressibility x), where x = d - reference_depth.

    B is the vehicle's buoyancy, and d is the depth of the centre of buoyancy.

    Args:
        gradient: Relative change of buoyancy per depth [1/m], positive if denser water lies below. With `compressibility`,
            give the change due to the water alone. Without `compressibility`, give the net change due to the water and the
            hull's volume.
        reference_depth: Depth [m] at which the buoyancy is B; 0 by default.
        compressibility: Relative loss of the hull's volume per depth [1/m] (Eriksen et al. 2001); none by default.

    Examples:
        >>> import lgvi_warp as lw
        >>> water = lw.terms.Stratification(gradient=5e-6, compressibility=4e-6, reference_depth=100.0)
        >>> lw.Scene.named("seawing", terms=[water]).parameters()["stratification.compressibility"]
        array(4.e-06)
    """

    type: ClassVar[str] = "stratification"
    device: ClassVar[str] = f"{DEVICE}.stratification"
    strengths: ClassVar[tuple[str, ...]] = ("gradient",)
    usual: ClassVar[Mapping[str, Any]] = {
        "compressibility": (5e-3, "hulls lose millionths of their volume a metre"),
        "reference_depth": "a check of depths looks at it",
    }
    depth_field: ClassVar[str] = "reference_depth"

    gradient: Any = number((), "1/m")
    reference_depth: Any = number((), "m", 0.0)
    compressibility: Any = number((), "1/m", None, optional=True)

    def device_in(self, aligned: bool) -> str:
        return self.device if self.compressibility is None else f"{self.device}_compressed"

    def odd_at(self, numbers: Numbers, position: Array) -> Mapping[str, tuple[Array, str]]:
        lost = numbers.get("compressibility", np.zeros(1)) * (position[:, 2] - numbers["reference_depth"])
        return {"compressibility": (lost >= 1.0, "the hull has no volume left at the start's depth of {:.4g} m")}

    def present(self, numbers: Numbers) -> bool:
        return super().present(numbers) or bool(np.any(numbers.get("compressibility", 0.0)))

    @property
    def conserves(self) -> frozenset[str]:
        # All three: its potential depends on the depth of the centre of buoyancy alone.
        return CONSERVED

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Only the deviation from B, since B itself is part of `Weight`.
        center = context.frame.point(context.parameters["vehicle.center_of_buoyancy"])
        stiffness, curve = _deviation(numbers, context.parameters["vehicle.buoyancy"])
        values = {"stiffness": stiffness, "center": center, "reference_depth": numbers["reference_depth"]}
        return Packed(values if curve is None else values | {"curve": curve})

    def potential(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array:
        # Energy U = stiffness x^2 / 2 - curve x^3 / 3, (k, n) [J].
        center = np.sum(parameters["vehicle.center_of_buoyancy"] * attitude[..., 2, :], axis=-1)
        x = position[..., 2] + center - numbers["reference_depth"]
        stiffness, curve = _deviation(numbers, parameters["vehicle.buoyancy"])
        energy = 0.5 * stiffness * x**2
        return energy if curve is None else energy - curve * x**3 / 3.0


def _deviation(numbers: Numbers, buoyancy: Array) -> tuple[Array, Array | None]:
    """Stiffness [N/m] and curvature [N/m2] or None of the deviation from B, stiffness x - curvature x^2."""
    gradient = numbers["gradient"]
    if "compressibility" not in numbers:
        return buoyancy * gradient, None
    kappa = numbers["compressibility"]
    return buoyancy * (gradient - kappa), buoyancy * gradient * kappa
