"""White noise of force and torque, independent for each member."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number


def channel(key: str) -> int:
    """The first of a term's two channels of random numbers: twice a hash of its name, so that no two overlap.

    Two names of one scene have the same channel with a probability of 2^-31.

    Args:
        key: Name of the term.

    Returns:
        The channel, an int32.
    """
    return _signed(2 * zlib.crc32(key.encode()))


def noise_key(key: str, context: PackingContext) -> dict[str, Any]:
    """What keys a term's random numbers, besides the step: the low 64 bits of the seed, the member, the term.

    Args:
        key: Name of the term.
        context: The scene's parameters, the frame and the run.

    Returns:
        Fields "member", "seed0", "seed1" and "channel" of the device struct.
    """
    return {
        "member": context.members.astype(np.int32),
        "seed0": _signed(context.seed),
        "seed1": _signed(context.seed >> 32),
        "channel": channel(key),
    }


def _signed(word: int) -> int:
    """The low 32 bits read as an int32."""
    return (word + 2**31) % 2**32 - 2**31


@dataclass(frozen=True, eq=False, kw_only=True)
class WrenchNoise(Term):
    """White noise of force and torque along the body's axes, about the body's origin.

    Over a time t the impulse has the variance S^2 t, S the strength.

    Args:
        force: Strength of the force, (3,) [N s^1/2]; 0 by default.
        torque: Strength of the torque, (3,) [N m s^1/2]; 0 by default.
    """

    type: ClassVar[str] = "wrench_noise"
    strengths: ClassVar[tuple[str, ...]] = ("force", "torque")
    timed: ClassVar[bool] = True

    force: Any = number((3,), "N s^1/2", (0.0, 0.0, 0.0), least=0.0)
    torque: Any = number((3,), "N m s^1/2", (0.0, 0.0, 0.0), least=0.0)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """The force and moment of each of the user's axes: drawn there, the numbers do not depend on the kernel's axes."""
        frame, none = context.frame, np.zeros((1, 3))
        values = noise_key(self.key, context)
        for i, axis in enumerate("xyz"):
            force, torque = (numbers[name] * np.eye(3)[i] for name in ("force", "torque"))
            values[f"force{axis}"] = frame.vector(force)
            values[f"moment{axis}"] = frame.torque(none + 0.0 * force, force)
            values[f"torque{axis}"] = frame.vector(torque)
        return Packed(values)
