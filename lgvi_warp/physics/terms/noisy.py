# SPDX-License-Identifier: Apache-2.0
"""The base class of terms that draw random numbers, once a step or at fixed times."""

from __future__ import annotations

import zlib
from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import positive
from lgvi_warp.common.random import uniforms_of
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term

if TYPE_CHECKING:
    from lgvi_warp.physics.given_draws import Stream


def channel(key: str) -> int:
    """First of a term's two channels of random numbers: twice a hash of its name. Two names collide with probability 2^-31."""
    return _signed(2 * zlib.crc32(key.encode()))


def key_of(name: str, context: PackingContext) -> dict[str, Any]:
    """Keys of random numbers, except for the number of the draw: low 64 bits of the seed, member, and channel of the name."""
    return {"member": context.members.astype(np.int32), **words_of(context.seed, name)}


def words_of(seed: int, name: str) -> dict[str, int]:
    """The words of a key that all members share."""
    return {"seed0": _signed(seed), "seed1": _signed(seed >> 32), "channel": channel(name)}


def normals_at_start(seed: int, name: str, members: np.ndarray) -> np.ndarray:
    """Three standard normal numbers (n, 3) for each of some members (n,), drawn by the host for a term's initial state."""
    from scipy.special import ndtri

    return np.asarray(ndtri(uniforms_of(seed, f"{name}.start", members, 3)))


def _signed(word: int) -> int:
    """The low 32 bits read as an int32."""
    return (word + 2**31) % 2**32 - 2**31


@dataclass(frozen=True, eq=False, kw_only=True)
class NoisyTerm(Term):
    """Base class of terms with random numbers, which follow from seed, member, the term's name and the number of the draw.

    The author's device code must set NOISE = True, and gets the numbers of a step by `normals_over(view, p.key, stream)`.
    This class adds the field `key` to the device struct. A subclass that defines `packed` must add the value of `key` by
    `noise_key`, and device code that has its own `params` must declare `key`.

    Args:
        noise_step: Time from one draw to the next [s]. The step of a run must be a whole multiple of `noise_step`; then
            runs with different steps have the same noise path. With None, the default, the term draws once a step, so that
            runs with different steps have different paths.

    Methods:
        draws: Number of draws in one step of a run.

    Raises:
        SceneError: If `noise_step` is not above 0, or a number is invalid (see `Term`).
    """

    timed: ClassVar[bool] = True

    noise_step: float | None = positive(None, unit="s")

    def draws(self, h: float) -> int:
        """Number of draws in one step of a run.

        Args:
            h: Step of the run [s].

        Returns:
            1 without a `noise_step`; otherwise the whole number nearest to h / noise_step, at least 1.
        """
        return 1 if self.noise_step is None else max(1, round(h / self.noise_step))

    def streams(self, acting: Collection[str]) -> tuple[Stream, ...]:
        """Streams of the term's draws: by default two streams of three numbers each, if the term acts.

        Args:
            acting: Names of the term's numbers that vary or are not zero.

        Returns:
            The streams, with the names that `NoiseDraws` shows.
        """
        from lgvi_warp.physics.given_draws import Stream

        idle = bool(self.strengths) and not any(name in acting for name in self.strengths)
        return () if idle else (Stream("0"), Stream("1", number=1))

    def noise_key(self, context: PackingContext) -> dict[str, Any]:
        """Keys of the random numbers of this term (see `key_of`).

        Args:
            context: The scene's parameters, the frame and the run.

        Returns:
            The field `key` of the device struct, for `Packed`.
        """
        if context.given is not None:
            places = list(context.given.places(self.key).values())
            return {"key": {"row": 0, "apart": places[-1], "draws": self.draws(context.h)}}
        key = key_of(self.key, context)
        return {"key": key if self.noise_step is None else key | {"draws": self.draws(context.h)}}

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The numbers as `Term.packed` has them, with the key of the random numbers.
        return Packed(super().packed(numbers, context).values | self.noise_key(context))
