# SPDX-License-Identifier: Apache-2.0
"""Allocation by a matrix."""

from typing import Any

import numpy as np

from lgvi_warp.reference.control import Part, cannot
from lgvi_warp.reference.rotation import Array


class AllocationMatrix(Part):
    """Attributes as in `lw.control.AllocationMatrix`; `to` names an actuator, which has a limit."""

    def allocate(self, w: Array, actuators: dict[str, Any]) -> Array:
        """u = A w within the limits; (I - A^+ A) w and A^+ times the part beyond the limits remain."""
        actuator, inverse = actuators[self.to], np.linalg.pinv(self.matrix)
        wanted = self.matrix @ w
        actuator.command = np.clip(wanted, -actuator.limit, actuator.limit)
        return np.asarray(cannot(inverse @ self.matrix) @ w + inverse @ (wanted - actuator.command))
