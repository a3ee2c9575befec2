"""To be said in one sentence."""

from __future__ import annotations

import functools
import hashlib

import numpy as np

# Standard deviations beyond which the tail of a normal is known by its logarithm.
FAR = -20.0


# Between two members that are asked for, it costs less to draw so many others than to start again.
NEAR = 64


@functools.lru_cache(maxsize=1024)
def seed_words(seed: int, name: str) -> tuple[int, ...]:
    """Entropy that depends on the seed and the name, for numpy.random.SeedSequence."""
    return (int(seed), *(int(word) for word in np.frombuffer(hashlib.sha256(name.encode()).digest(), dtype="<u4")))


@functools.lru_cache(maxsize=1024)
def _philox_key(seed: int, name: str) -> np.ndarray:
    return np.random.SeedSequence(seed_words(seed, name)).generate_state(2, np.uint64)


def uniforms(seed: int, name: str, first: int, count: int, components: int) -> np.ndarray:
    """Uniform numbers in (0, 1), (count, components), of the members from `first` on.

    They depend on the seed, the member's index and the name only: Philox counters, a fixed number for each member.
    """
    counters = -(-components // 4)
    generator = np.random.Philox(key=_philox_key(int(seed), name))
    generator.advance(first * counters)
    raw = generator.random_raw(count * counters * 4).reshape(count, counters * 4)[:, :components]
    return ((raw >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53


def uniforms_of(seed: int, name: str, members: np.ndarray, components: int) -> np.ndarray:
    """The same of any members (n,), in any order: (n, components). Neighbours are drawn together."""
    first, count = int(members[0]), len(members)
    if count == 1 or np.all(np.diff(members) == 1):
        return uniforms(seed, name, first, count, components)
    ascending, place = np.unique(members, return_inverse=True)
    ends = np.flatnonzero(np.diff(ascending) > NEAR) + 1
    runs = np.split(ascending, ends)
    drawn = [uniforms(seed, name, int(run[0]), int(run[-1] - run[0]) + 1, components)[run - run[0]] for run in runs]
    return np.concatenate(drawn)[place.reshape(-1)]
