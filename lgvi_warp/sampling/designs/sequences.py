# SPDX-License-Identifier: Apache-2.0
"""Scrambled low-discrepancy sequences of Sobol and Halton, whose points follow directly from their indices."""

from __future__ import annotations

import copy
import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.random import generator
from lgvi_warp.sampling.designs.base import MOST_REPLICATES, Replicated, inside
from lgvi_warp.sampling.designs.space import Space

# Bits of a Sobol sequence. A point is in the middle of one of 2^32 parts of each side, so that no level is 0 or 1. The
# sequence has 2^32 points, more than an ensemble has members.
SOBOL_BITS = 32


@dataclass(frozen=True)
class Sobol(Replicated):
    """Scrambled Sobol sequence (linear matrix scramble and digital shift, scipy.stats.qmc.Sobol): member i is point i.

    Adding members does not change the first ones. The design is balanced if the number of members is a power of two.
    Varying another name changes the whole sequence.

    Args:
        replicates: Number R of independently scrambled sequences, which are used in turn, member by member: member i is
            then point i // R of sequence i mod R; 1 by default.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> vary = {"vehicle.buoyancy": lw.distributions.Normal(std=1.0)}
        >>> fleet = lw.Ensemble(scene, 64, vary=vary, sampling=lw.designs.Sobol())
        >>> buoyancy = fleet.parameters(0, 64)["vehicle.buoyancy"]
        >>> print(f"{buoyancy.mean() - scene.vehicle.buoyancy:.3f} N")
        -0.011 N
    """

    kind: ClassVar[str] = "sobol"

    def points(self, space: Space, replicate: int, indices: np.ndarray) -> np.ndarray:
        return sobol_points(space.seed, self.name(replicate), space.dimensions, indices)


def sobol_points(seed: int, name: str, dimensions: int, indices: np.ndarray, scramble: bool = True) -> np.ndarray:
    """Points (n, dimensions) in (0, 1) of a Sobol sequence by their indices (n,).

    A point is the exclusive or of point 0 and one number for each set bit of its index, so any point is computed
    directly.
    """
    if not dimensions:
        return np.empty((len(indices), 0))
    bits = max(int(indices.max()).bit_length(), 1)
    bits = -(-bits // 4) * 4  # so that few distinct tables are cached, whatever the number of members
    basis = _sobol_basis(seed, name, dimensions, min(bits, SOBOL_BITS), scramble)
    points = np.broadcast_to(basis[0], (len(indices), dimensions)).copy()
    for bit in range(min(bits, SOBOL_BITS)):
        points ^= np.where((indices >> bit & 1)[:, None] == 1, basis[bit + 1], np.uint64(0))
    return np.asarray((points.astype(np.float64) + 0.5) * 2.0**-SOBOL_BITS)


# The cache holds the tables of every replicate, for up to eight numbers of bits.
@functools.lru_cache(maxsize=8 * MOST_REPLICATES)
def _sobol_basis(seed: int, name: str, dimensions: int, bits: int, scramble: bool) -> np.ndarray:
    """Point 0, and the bits that each bit of an index flips in it: (bits + 1, dimensions), as integers."""
    from scipy.stats import qmc

    engine = qmc.Sobol(dimensions, scramble=scramble, bits=SOBOL_BITS, rng=generator(seed, name))
    points, position = [], 0
    for index in (0, *(1 << bit for bit in range(bits))):
        if index > position:
            engine.fast_forward(index - position)
        points.append(engine.random(1)[0])
        position = index + 1
    bit_words = (np.array(points) * 2.0**SOBOL_BITS).astype(np.uint64)
    bit_words[1:] ^= bit_words[0]
    return bit_words


@dataclass(frozen=True)
class Halton(Replicated):
    """Scrambled Halton sequence (random permutations of digits, scipy.stats.qmc.Halton): member i is point i.

    Any number of members can be added without changing the first ones. Varying another name changes the whole sequence.

    Args:
        replicates: Number R of independently scrambled sequences, which are used in turn, member by member: member i is
            then point i // R of sequence i mod R; 1 by default.
    """

    kind: ClassVar[str] = "halton"

    def points(self, space: Space, replicate: int, indices: np.ndarray) -> np.ndarray:
        ascending, place = np.unique(indices, return_inverse=True)
        runs = np.split(ascending, np.flatnonzero(np.diff(ascending) > 1) + 1)
        points = np.concatenate([self._run(space, replicate, int(run[0]), len(run)) for run in runs])
        return inside(points)[place.reshape(-1)]

    def _run(self, space: Space, replicate: int, first: int, count: int) -> np.ndarray:
        if not space.dimensions:
            return np.empty((count, 0))
        engine = copy.copy(_halton(space.seed, self.name(replicate), space.dimensions))
        engine.num_generated = first
        return np.asarray(engine.random(count))


@functools.lru_cache(maxsize=2 * MOST_REPLICATES)
def _halton(seed: int, name: str, dimensions: int) -> Any:
    from scipy.stats import qmc

    return qmc.Halton(dimensions, scramble=True, rng=generator(seed, name))
