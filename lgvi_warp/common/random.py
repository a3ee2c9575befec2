# SPDX-License-Identifier: Apache-2.0
"""Counter-based random numbers: each member's numbers depend only on the seed, its index and a name."""

from __future__ import annotations

import functools
import hashlib

import numpy as np

# Standard deviations beyond which a normal's tail is computed from its logarithm.
FAR = -20.0
# Largest gap between two members over which drawing the members between costs less than a new start of the generator.
NEAR = 64


@functools.lru_cache(maxsize=1024)
def seed_words(seed: int, name: str) -> tuple[int, ...]:
    """Entropy for numpy.random.SeedSequence that depends on a seed and a name."""
    return (int(seed), *(int(word) for word in np.frombuffer(hashlib.sha256(name.encode()).digest(), dtype="<u4")))


def generator(seed: int, name: str, *more: int) -> np.random.Generator:
    """A random generator that depends on a seed and a name only."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence([*seed_words(seed, name), *more])))


@functools.lru_cache(maxsize=1024)
def _philox_key(seed: int, name: str) -> np.ndarray:
    return np.random.SeedSequence(seed_words(seed, name)).generate_state(2, np.uint64)


def uniforms(seed: int, name: str, first: int, count: int, components: int) -> np.ndarray:
    """Uniform random numbers of consecutive members in (0, 1), float64, (count, components).

    They depend only on the seed, the member's index and the name: Philox counters, a fixed number per member.
    """
    counters = -(-components // 4)
    generator = np.random.Philox(key=_philox_key(int(seed), name))
    generator.advance(first * counters)
    raw = generator.random_raw(count * counters * 4).reshape(count, counters * 4)[:, :components]
    return ((raw >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53


def uniforms_of(seed: int, name: str, members: np.ndarray, components: int) -> np.ndarray:
    """Uniform numbers like `uniforms`, (n, components), for members (n,) in any order; neighbours are drawn at once."""
    first, count = int(members[0]), len(members)
    if count == 1 or np.all(np.diff(members) == 1):
        return uniforms(seed, name, first, count, components)
    ascending, place = np.unique(members, return_inverse=True)
    ends = np.flatnonzero(np.diff(ascending) > NEAR) + 1
    runs = np.split(ascending, ends)
    blocks = [uniforms(seed, name, int(run[0]), int(run[-1] - run[0]) + 1, components)[run - run[0]] for run in runs]
    return np.concatenate(blocks)[place.reshape(-1)]
