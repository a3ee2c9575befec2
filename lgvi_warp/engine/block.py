"""The unit of work: a run of members through all steps, and what is kept of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass

SHAPES: dict[str, tuple[int, ...]] = {
    "position": (3,),
    "attitude": (3, 3),
    "velocity": (3,),
    "angular_velocity": (3,),
}


@dataclass(frozen=True)
class Block:
    """A run of members, first to stop: the unit of work."""

    first: int
    stop: int

    @property
    def count(self) -> int:
        """Members in it."""
        return self.stop - self.first


def block_size(members: int) -> int:
    """256 to 4096 members, a power of two. Depends on the number of members only, so bits and files do too."""
    size = 256
    while size < 4096 and size * 64 <= members:
        size *= 2
    return size


def blocks(members: int) -> list[Block]:
    """Runs of so many members as `block_size` says, the last one of what is left."""
    size = block_size(members)
    return [Block(i, min(i + size, members)) for i in range(0, members, size)]
