"""Blocks: runs of consecutive members, the unit of work of executors and stores."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Block:
    """A run of consecutive members, the unit of work.

    Attributes:
        first: index of its first member.
        stop: index after its last member.
    """

    first: int
    stop: int

    @property
    def count(self) -> int:
        """Number of members in the block."""
        return self.stop - self.first


def block_size(members: int) -> int:
    """Number of members of a block: a power of two from 256 to 4096.

    It depends on the number of members only, so that bits and files do not depend on the machine.

    Args:
        members: number of members of the run.

    Returns:
        Members of each block but the last.
    """
    size = 256
    while size < 4096 and size * 64 <= members:
        size *= 2
    return size


def shares(members: int, threads: int) -> int:
    """Number of members of a block of a run whose bits and files do not depend on blocks.

    Fewer blocks cost less; some blocks for each thread keep all threads at work until the end.

    Args:
        members: number of members of the run.
        threads: number of threads.

    Returns:
        Members of each block but the last, a multiple of 256 up to 16,384.
    """
    wanted = -(-members // (4 * threads if threads > 1 else 1))
    return min(16_384, -(-wanted // 256) * 256)


def blocks(members: int, size: int | None = None) -> list[Block]:
    """Divide the members of a run into blocks.

    Args:
        members: number of members of the run.
        size: members of a block; default `block_size(members)`.

    Returns:
        Blocks of that many members in order; the last one has the rest.
    """
    size = size or block_size(members)
    return [Block(i, min(i + size, members)) for i in range(0, members, size)]
