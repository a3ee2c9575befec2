# SPDX-License-Identifier: Apache-2.0
"""Net force and moment of weight and buoyancy, from the numbers of a vehicle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lgvi_warp.physics import vehicle

Numbers = Mapping[str, np.ndarray]


def net(p: Numbers) -> np.ndarray:
    """Weight minus buoyancy, the net downward force (n,) [N], from the parameters by name."""
    return vehicle.weight(p) - p["vehicle.buoyancy"]


def moment(p: Numbers) -> np.ndarray:
    """The vector B r_b - W r_g about the user's origin, (n, 3) [N m] in body axes; it gives the restoring moment."""
    lift = p["vehicle.buoyancy"][:, None] * p["vehicle.center_of_buoyancy"]
    if "vehicle.center_of_gravity" not in p:
        return lift
    return lift - vehicle.weight(p)[:, None] * p["vehicle.center_of_gravity"]
