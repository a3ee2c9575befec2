# SPDX-License-Identifier: Apache-2.0
"""Allocation by a matrix that the user gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.control.base import Allocation, rest_rows
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number, side_by_side


@dataclass(frozen=True, eq=False, kw_only=True)
class AllocationMatrix(Allocation):
    """Allocation by a given matrix A: commands u = A w for the demand w = (X, Y, Z, K, M, N), limited channel by channel.

    The undelivered part of the demand is fed back to the laws. It is w - A^+ A w, plus A^+ times the part of the commands
    that the limits cut off, where A^+ is the pseudo-inverse of A.

    Args:
        to: Key of the term that takes the commands.
        matrix: A, (channels, 6), in units of the command per N and per N m.

    Examples:
        >>> import lgvi_warp as lw
        >>> rudder_and_stern = [[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 1, 0]]
        >>> lw.control.AllocationMatrix(to="control_fins", matrix=rudder_and_stern).reach().shape
        (6, 2)
    """

    type: ClassVar[str] = "matrix"

    matrix: Any = number(("n", 6), "unit/N, unit/(N m)")

    def check_actuator(self, faults: Faults) -> None:
        rows, count = len(self.matrix), self.actuator.channels
        if rows != count:
            faults.add(
                f"{self.key}.matrix",
                f"{rows} x 6",
                f"has {rows} rows",
                f"give {count}, one for each channel of {self.to}",
            )

    def device_in(self, aligned: bool) -> str:
        # The code that leaves channels out only where some may be lost.
        return f"matrix:{'lost' if self.losses else 'all'}"

    def reach(self) -> np.ndarray:
        # The pseudo-inverse of the matrix, a column for each axis.
        return np.asarray(np.linalg.pinv(self.matrix))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # For each command its line of A, its column of A^+ and its limit.
        A = numbers["matrix"]
        limit = context.own(self.actuator)["limit"]
        inverse = np.linalg.pinv(A)
        rows = side_by_side(A, np.swapaxes(inverse, -1, -2), limit[..., None], self.steps_of_loss(context)[..., None])
        first, count = self.bus.commands[self.to]
        return Packed(
            {"commands": first, "count": count}, side_by_side(rest_rows(inverse @ A), rows.reshape(len(rows), -1))
        )
