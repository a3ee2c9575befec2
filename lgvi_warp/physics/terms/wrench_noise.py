"""White noise of force and torque, each member's its own."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, Setting, Term, quantity


def channel(key: str) -> int:
    """The first of a term's two channels of random numbers, as int32: twice a hash of its name, so no two overlap.

    Two names of one scene share it with a chance of 2^-31.
    """
    return _signed(2 * zlib.crc32(key.encode()))


def noise_key(key: str, setting: Setting) -> dict[str, Any]:
    """What a term's random numbers are keyed by, besides the step: the low 64 bits of the seed, the member, the term."""
    return {
        "member": setting.members.astype(np.int32),
        "seed0": _signed(setting.seed),
        "seed1": _signed(setting.seed >> 32),
        "channel": channel(key),
    }


def _signed(word: int) -> int:
    """The low 32 bits read as an int32."""
    return (word + 2**31) % 2**32 - 2**31


@dataclass(frozen=True, eq=False, kw_only=True)
class WrenchNoise(Term):
    """White noise of force and torque along the body's axes, about the body's origin.

    force: (3,) [N s^1/2]; torque: (3,) [N m s^1/2]: S with a variance S^2 t of the impulse over a time t.
    """

    type: ClassVar[str] = "wrench_noise"
    device: ClassVar[str] = "wrench_noise"
    timed: ClassVar[bool] = True

    force: Any = quantity((3,), "N s^1/2", (0.0, 0.0, 0.0), least=0.0)
    torque: Any = quantity((3,), "N m s^1/2", (0.0, 0.0, 0.0), least=0.0)

    def present(self, own: Numbers) -> bool:
        """Whether some member has one."""
        return bool(np.any(own["force"]) or np.any(own["torque"]))

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """What each of the user's axes adds: drawn there, a run's numbers do not depend on the kernel's axes."""
        frame, none = setting.frame, np.zeros((1, 3))
        values = noise_key(self.key, setting)
        for i, axis in enumerate("xyz"):
            force, torque = (own[name] * np.eye(3)[i] for name in ("force", "torque"))
            moment = frame.torque(none + 0.0 * force, force)
            values |= {
                f"force{axis}": frame.vector(force),
                f"moment{axis}": moment,
                f"torque{axis}": frame.vector(torque),
            }
        return Packed(values)
