# SPDX-License-Identifier: Apache-2.0
"""An ideal actuator, which produces the wrench that a controller demands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.actuators import UNLIMITED, motion, packed_following, refuse_unread
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number

# Components of a wrench: forces along the body's axes and moments about them.
COMPONENTS = ("X", "Y", "Z", "K", "M", "N")


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlWrench(Term):
    """An ideal actuator: a controller commands force and torque about the body's origin; without a controller they are 0.

    Each component n follows n' = (command - n) / time constant, with |n'| at most the rate limit and the command within the
    limit.

    Args:
        limit: Largest size of each component, (6,) [N, N m]; 1e6 by default.
        rate_limit: Largest rate of each component, (6,) [N/s, N m/s]; by default there is no limit.
        time_constant: Time constant of the lag of each component, (6,) [s]; 0 by default, for no lag.
    """

    type: ClassVar[str] = "control_wrench"

    limit: Any = number((6,), "N, N m", (1e6,) * 6, least=0.0)
    rate_limit: Any = number((6,), "N/s, N m/s", (UNLIMITED,) * 6, least=0.0)
    time_constant: Any = number((6,), "s", (0.0,) * 6, least=0.0)

    def __post_init__(self) -> None:
        for name in ("limit", "rate_limit", "time_constant"):
            value = getattr(self, name)
            if np.ndim(np.asarray(value, dtype=object)) == 0:
                object.__setattr__(self, name, (value,) * 6)
        super().__post_init__()

    @property
    def channels(self) -> int:
        return 6

    @property
    def memory(self) -> bool:
        # Whether it follows its commands with a lag or at a limited rate.
        return any(motion(self).values())

    def device_in(self, aligned: bool) -> str:
        return f"control_wrench:{','.join(['driven', *(name for name, acts in motion(self).items() if acts)])}"

    def present(self, numbers: Numbers) -> bool:
        return self.driver is not None

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, raises SceneError for members' numbers that would have no effect.
        if self.driver is not None:
            refuse_unread(self, numbers)
        return super().unphysical(numbers)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The wrench of each channel in the kernel's axes, and its limits.
        force, torque = (np.eye(6)[None, :, i : i + 3] for i in (0, 3))
        blocks = [context.frame.vector(force), context.frame.torque(torque, force)]
        blocks_of_channels = np.concatenate(np.broadcast_arrays(*blocks), axis=-1)
        return packed_following(self, numbers, blocks_of_channels, start=context.time)

    def effect(self, numbers: Numbers, parameters: Numbers, speed: np.ndarray) -> np.ndarray:
        # The wrench of a unit of effort of each channel, about the body's origin.
        return np.eye(6)[None]
