# SPDX-License-Identifier: Apache-2.0
"""Linear feedback of the whole state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import ControlLaw, Numbers, Packed, PackingContext
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class StateFeedback(ControlLaw):
    """Linear state feedback, such as a linear quadratic regulator: the demand is w = -K x, where x (12,) is the error.

    x = (b - b_d, e_R, nu - R^T v_d, Omega - R^T R_d Omega_d), measured minus wanted values: position in inertial axes [m],
    attitude as in `PosePID` [1], velocity over ground [m/s] and angular velocity [rad/s] in body axes. The index d marks
    wanted values, and R is the attitude, from body to inertial axes.

    Args:
        K: Gains (6, 12) [N, N m per unit of x], a row for each of X, Y, Z, K, M, N and a column for each entry of x.
    """

    type: ClassVar[str] = "state_feedback"
    needs: ClassVar[tuple[str, ...]] = ("position", "attitude")
    demands: ClassVar[tuple[str, ...]] = ("X", "Y", "Z", "K", "M", "N")

    K: Any = number((6, 12), "N, N m per m, 1, m/s, rad/s")

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        K = numbers["K"]
        return Packed({}, K.reshape(len(K), -1))
