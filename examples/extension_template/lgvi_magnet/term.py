# SPDX-License-Identifier: Apache-2.0
"""The numbers of the law, and what a run must know of it on the host."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

import lgvi_warp as lw


@dataclass(frozen=True, eq=False, kw_only=True)
class Magnet(lw.laws.Term):
    """A permanent magnet that turns the hull to the field: torque m x R^T B, from the potential -m . R^T B.

    Args:
        moment: Magnetic moment m, (3,) [A m2], body axes.
        field: Field B, (3,) [T], north, east, down.
    """

    type: ClassVar[str] = "magnet"
    # The path of the device code: Warp is imported with it, when a kernel is made.
    device: ClassVar[str] = "lgvi_magnet.device"

    moment: Any = lw.laws.number((3,), "A m2", axes="vector")
    field: Any = lw.laws.number((3,), "T", (2e-5, 0.0, 4e-5))

    @property
    def conserves(self) -> frozenset[str]:
        return frozenset({"energy", "horizontal_momentum"})

    def potential(self, numbers: Any, position: np.ndarray, attitude: np.ndarray, parameters: Any) -> np.ndarray:
        turned = np.einsum("knij,nj->kni", attitude, np.broadcast_to(numbers["moment"], position.shape[1:]))
        return -np.sum(turned * numbers["field"], axis=-1)
