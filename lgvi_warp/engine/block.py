# SPDX-License-Identifier: Apache-2.0
"""Blocks: groups of consecutive members, the unit of work of executors and stores."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Block:
    """A group of consecutive members, the unit of work: from `first` to `stop` - 1."""

    first: int
    stop: int

    @property
    def count(self) -> int:
        """Number of members in the block."""
        return self.stop - self.first


def block_size(members: int) -> int:
    """Members of a block, a power of two from 256 to 4096, from their number alone, so that bits and files are portable."""
    size = 256
    while size < 4096 and size * 64 <= members:
        size *= 2
    return size


# Fewer members run on one thread by default, unless their steps are so many that several threads save more than they cost.
FEW_MEMBERS, FEW_STEPS = 2_000, 1_000_000


def default_threads(members: int, steps: int, cores: int) -> int:
    """Default number of threads of a run: one for few members of a short run, else all cores.

    A block costs about a millisecond in addition to its kernel, and so does a second thread.
    """
    return 1 if members < FEW_MEMBERS and members * steps < FEW_STEPS else cores


# Steps of vehicles in a block beyond which its own cost, a millisecond, is small beside that of its kernel.
WORTHWHILE = 4_000_000


def shares(members: int, threads: int, steps: int) -> int:
    """Members of a block, for runs whose bits and files do not depend on blocks.

    Fewer blocks cost less. Several blocks per thread keep all threads busy until the end. Long runs have small blocks,
    so that many members are finished at an interrupt.
    """
    wanted = min(-(-members // (4 * threads if threads > 1 else 1)), -(-WORTHWHILE // steps))
    return min(16_384, -(-wanted // 256) * 256)


def blocks(members: int, size: int | None = None) -> list[Block]:
    """Divide the members of a run into blocks."""
    size = size or block_size(members)
    return [Block(i, min(i + size, members)) for i in range(0, members, size)]


def parts(members: int, steps: int, threads: int, apart: bool, gathered: bool = False) -> list[Block]:
    """The blocks of a run.

    apart: whether each block must run alone: if a run may end after any block, in a store, or outside of threads.
    gathered: whether statistics are gathered for each block; then several blocks may run as one.
    """
    if apart:
        return blocks(members)
    size = shares(members, threads, steps)
    own = block_size(members) if gathered else size
    return blocks(members, max(own, size // own * own))
