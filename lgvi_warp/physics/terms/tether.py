# SPDX-License-Identifier: Apache-2.0
"""Tether: a spring between a fixed anchor and a point of the vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Array, Numbers, Term, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Tether(Term):
    """A spring from a fixed anchor to a point of the vehicle.

    The tension is stiffness (length - rest_length); the tether is slack if it is shorter than its rest length.

    Args:
        anchor: Fixed end, (3,) [m], in inertial axes.
        stiffness: Stiffness [N/m].
        attachment: End on the vehicle, (3,) [m] from the body's origin; by default the origin.
        rest_length: Length without tension [m]; 0 by default.
    """

    type: ClassVar[str] = "tether"
    anchored: ClassVar[bool] = True

    anchor: Any = number((3,), "m")
    stiffness: Any = number((), "N/m", least=0.0)
    attachment: Any = number((3,), "m", (0.0, 0.0, 0.0), axes="point")
    rest_length: Any = number((), "m", 0.0, least=0.0)

    @property
    def conserves(self) -> frozenset[str]:
        # Energy only: the anchor takes up momentum.
        return frozenset({"energy"})

    def potential(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array:
        # Energy U = stiffness max(length - rest_length, 0)^2 / 2, (k, n) [J].
        end = position + np.einsum("knij,nj->kni", attitude, np.broadcast_to(numbers["attachment"], position.shape[1:]))
        stretch = np.maximum(np.linalg.norm(end - numbers["anchor"], axis=-1) - numbers["rest_length"], 0.0)
        return 0.5 * numbers["stiffness"] * stretch**2
