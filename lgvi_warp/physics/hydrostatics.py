# SPDX-License-Identifier: Apache-2.0
"""The net force and the moment of weight and buoyancy, from the numbers of a vehicle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lgvi_warp.physics import vehicle

Numbers = Mapping[str, np.ndarray]


def net(p: Numbers) -> np.ndarray:
    """Weight less buoyancy, the net force downward (n,) [N], from the parameters by name."""
    return vehicle.weight(p) - p["vehicle.buoyancy"]


def moment(p: Numbers) -> np.ndarray:
    """The vector B r_b - W r_g about the user's origin, (n, 3) [N m] in body axes, from which the restoring moment follows."""
    lift = p["vehicle.buoyancy"][:, None] * p["vehicle.center_of_buoyancy"]
    if "vehicle.center_of_gravity" not in p:
        return lift
    return lift - vehicle.weight(p)[:, None] * p["vehicle.center_of_gravity"]
