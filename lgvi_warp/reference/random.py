# SPDX-License-Identifier: Apache-2.0
"""Random numbers from counters: Philox4x32-10, Salmon, Moraes, Dror & Shaw 2011, and Box & Muller 1958.

A number is a function of its key and counter, without a state. So any member, step and channel can be drawn alone, in
any order, on any machine.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Section 3.3 and table 2 of Salmon et al.: multipliers of words 0 and 2; the golden ratio and sqrt(3) - 1 for the key.
MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
KEY_STEPS = (0x9E3779B9, 0xBB67AE85)
ROUNDS = 10

WORD = 0xFFFFFFFF


def philox4x32(counter: ArrayLike, key: ArrayLike) -> NDArray[np.uint32]:
    """Philox4x32-10: four random words, shape (..., 4), of counters (..., 4) and keys (..., 2), all uint32."""
    # 64-bit words hold the products of two 32-bit words.
    c0, c1, c2, c3 = np.moveaxis(np.asarray(counter, dtype=np.uint64), -1, 0)
    k0, k1 = np.moveaxis(np.asarray(key, dtype=np.uint64), -1, 0)
    for _ in range(ROUNDS):
        product0, product1 = c0 * MULTIPLIERS[0], c2 * MULTIPLIERS[1]
        c0, c1 = (product1 >> 32) ^ c1 ^ k0, product1 & WORD
        c2, c3 = (product0 >> 32) ^ c3 ^ k1, product0 & WORD
        k0, k1 = (k0 + KEY_STEPS[0]) & WORD, (k1 + KEY_STEPS[1]) & WORD
    return np.stack([c0, c1, c2, c3], axis=-1).astype(np.uint32)


def box_muller(words: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Box & Muller 1958: two independent standard normals, shape (..., 2), of two words (..., 2)."""
    u = (words + 0.5) / 2.0**32
    radius, angle = np.sqrt(-2.0 * np.log(u[..., 0])), 2.0 * np.pi * u[..., 1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def normals(
    seed0: ArrayLike, seed1: ArrayLike, member: ArrayLike, step: ArrayLike, channel: ArrayLike
) -> NDArray[np.float64]:
    """Four independent standard normals, shape (..., 4), from 32-bit whole numbers that are broadcast together."""
    numbers = [np.asarray(x, dtype=np.int64) & WORD for x in (member, step, channel, 0, seed0, seed1)]
    *counter, seed0, seed1 = np.broadcast_arrays(*numbers)
    words = philox4x32(np.stack(counter, axis=-1), np.stack([seed0, seed1], axis=-1))
    return np.concatenate([box_muller(words[..., :2]), box_muller(words[..., 2:])], axis=-1)


def draws_of_step(law: Any, view: Any, stream: int = 0) -> NDArray[np.float64]:
    """Three standard normals for each draw of a step, shape (r, 3): step k has the draws k r to k r + r - 1.

    law: has the key (seed0, seed1 and channel) and `noise_step` [s], the time between two draws, or None for the step.
    view: has member, step and h [s].
    """
    count = 1 if law.noise_step is None else round(view.h / law.noise_step)
    draws = view.step * count + np.arange(count)
    return normals(law.seed0, law.seed1, view.member, draws, law.channel + stream)[:, :3]
