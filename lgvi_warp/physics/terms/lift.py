# SPDX-License-Identifier: Apache-2.0
"""Lift of a hull that is proportional to its forward speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number
from lgvi_warp.physics.terms.drag import entry_words


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyLift(Term):
    """Lift of a hull proportional to its forward speed u, along the body's x axis: force_i = -u sum_j matrix_ij v_j.

    i runs over forces and torques, and j over velocities and angular velocities. Any matrix is allowed, even if this
    empirical law then accelerates the vehicle.

    Args:
        matrix: Coefficients, (6, 6) [kg/m, kg, kg m]: minus Prestero's (2001) Y_uv, Z_uw, M_uw, N_uv and so on.
    """

    type: ClassVar[str] = "body_lift"
    device: ClassVar[str] = "lift"
    braking_grows_with: ClassVar[tuple[str, ...]] = ("matrix",)
    strengths: ClassVar[tuple[str, ...]] = ("matrix",)
    dissipative: ClassVar[bool] = False
    pattern_device: ClassVar[str] = "lift_pattern"

    matrix: Any = number((6, 6), "kg/m, kg, kg m")

    def braking(self, numbers: Numbers, speeds: np.ndarray, water_density: np.ndarray) -> np.ndarray:
        # The matrix at the speed ahead; and by that speed itself the sizes of what it multiplies.
        ahead = np.eye(6)[0] * (np.abs(numbers["matrix"]) @ speeds[:, :, None])
        return np.asarray(numbers["matrix"] * speeds[:, :1, None] + ahead)

    def entries(self, numbers: Numbers) -> tuple[str, ...]:
        return entry_words(m=numbers["matrix"])

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Rows that measure u (6), and the matrix (36), in the axes and about the origin of the forces.
        X = context.frame.from_forces
        matrix = np.swapaxes(X, 1, 2) @ numbers["matrix"] @ X
        ahead = np.broadcast_to(X[:, 0, :], (len(matrix), 6))
        return Packed({}, np.concatenate([ahead, matrix.reshape(-1, 36)], axis=1))
