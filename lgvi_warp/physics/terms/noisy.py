# SPDX-License-Identifier: Apache-2.0
"""The base class of terms that draw random numbers, once a step or on a grid of their own."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import positive
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term


def channel(key: str) -> int:
    """The first of a term's two channels of random numbers: twice a hash of its name (two names share one by 2^-31)."""
    return _signed(2 * zlib.crc32(key.encode()))


def key_of(name: str, context: PackingContext) -> dict[str, Any]:
    """What keys random numbers, besides the number of the draw: the low 64 bits of the seed, the member, who draws."""
    return {
        "member": context.members.astype(np.int32),
        "seed0": _signed(context.seed),
        "seed1": _signed(context.seed >> 32),
        "channel": channel(name),
    }


def _signed(word: int) -> int:
    """The low 32 bits read as an int32."""
    return (word + 2**31) % 2**32 - 2**31


@dataclass(frozen=True, eq=False, kw_only=True)
class NoisyTerm(Term):
    """A term that draws random numbers, which follow from the seed, the member, the term's name and the number of the draw.

    The device struct has their `key`, of which the device code asks `normals_over(view, p.key, stream)` for the numbers of a
    step; it sets NOISE = True.

    Args:
        noise_step: Time from one draw to the next [s]: runs whose steps are whole multiples of it see the same path, and no
            other step is allowed. None, the default, draws once a step: runs with different steps see different paths.

    Raises:
        SceneError: Where `noise_step` is not above 0, and as `Term`.
    """

    timed: ClassVar[bool] = True

    noise_step: float | None = positive(None, unit="s")

    def draws(self, h: float) -> int:
        """How many draws one step of a run takes.

        Args:
            h: Step of the run [s].

        Returns:
            1 without a `noise_step`; else the whole number that is nearest to h / noise_step, at least 1.
        """
        return 1 if self.noise_step is None else max(1, round(h / self.noise_step))

    def noise_key(self, context: PackingContext) -> dict[str, Any]:
        """What keys the random numbers of this term (see `key_of`).

        Args:
            context: The scene's parameters, the frame and the run.

        Returns:
            The field `key` of the device struct, for `Packed`.
        """
        key = key_of(self.key, context)
        return {"key": key if self.noise_step is None else key | {"draws": self.draws(context.h)}}

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The numbers as `Term.packed` has them, with the key of the random numbers.
        return Packed(super().packed(numbers, context).values | self.noise_key(context))
