# SPDX-License-Identifier: Apache-2.0
"""White noise of force and torque, independent for each member."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number
from lgvi_warp.physics.terms.noisy import NoisyTerm

if TYPE_CHECKING:
    from lgvi_warp.physics.given_draws import Stream


@dataclass(frozen=True, eq=False, kw_only=True)
class WrenchNoise(NoisyTerm):
    """White noise of force and torque along the body's axes, about the body's origin.

    Over a time t, each component of the impulse has the variance S^2 t, where S is its strength.

    Args:
        force: Strength of the force, (3,) [N s^1/2]; 0 by default.
        torque: Strength of the torque, (3,) [N m s^1/2]; 0 by default.
    """

    type: ClassVar[str] = "wrench_noise"
    strengths: ClassVar[tuple[str, ...]] = ("force", "torque")

    force: Any = number((3,), "N s^1/2", (0.0, 0.0, 0.0), least=0.0)
    torque: Any = number((3,), "N m s^1/2", (0.0, 0.0, 0.0), least=0.0)

    def streams(self, acting: Collection[str]) -> tuple[Stream, ...]:
        from lgvi_warp.physics.given_draws import Stream

        return tuple(Stream(name, number=i) for i, name in enumerate(self.strengths) if name in acting)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The force and moment of each of the user's axes: drawn there, the numbers do not depend on the kernel's axes.
        frame, none = context.frame, np.zeros((1, 3))
        values = self.noise_key(context)
        for i, axis in enumerate("xyz"):
            force, torque = (numbers[name] * np.eye(3)[i] for name in ("force", "torque"))
            values[f"force{axis}"] = frame.vector(force)
            values[f"moment{axis}"] = frame.torque(none + 0.0 * force, force)
            values[f"torque{axis}"] = frame.vector(torque)
        return Packed(values)
