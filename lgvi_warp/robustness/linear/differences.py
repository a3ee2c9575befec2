# SPDX-License-Identifier: Apache-2.0
"""Central differences of some steps of many members: each changed number has two copies of every member, in lanes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.robustness.linear.bench import AT_ONCE, COORDINATES, Motion, MotionBench

# Half a difference, of numbers of size 1: what is cut off and round-off are then alike, 1e-10.
STEP = 1e-5


@dataclass(frozen=True)
class Row:
    """A number in the memory."""

    key: str
    row: int
    name: str


def names_of(rows: Sequence[Row]) -> tuple[str, ...]:
    """Names of the states: the motion, then the memory."""
    return (*COORDINATES, *(row.name for row in rows))


@dataclass(frozen=True)
class Differences:
    """Derivatives of motion and rows `derived` after some steps by motion and rows `moved` at step k0."""

    bench: MotionBench
    k0: int
    steps: int
    moved: Sequence[Row]
    derived: Sequence[Row]
    motion: bool = True
    step: float = STEP

    def __call__(
        self, places: np.ndarray, about: Motion, numbers: Mapping[str, np.ndarray] | None = None
    ) -> np.ndarray:
        """The derivatives of members (n,); numbers: name -> (n, ...) that replace the members' own.

        Returns: (n, 12 + derived, 12 + moved), or without the motion (n, 12 + derived, moved); NaN if a copy failed.
        """
        most = max(1, AT_ONCE // (2 * max(12 * self.motion + len(self.moved), 1)))
        parts = []
        for first in range(0, len(places), most):
            some = np.arange(first, min(first + most, len(places)))
            chosen = {name: values[some] for name, values in (numbers or {}).items()}
            parts.append(self._of_some(places[some], about.of(some), chosen))
        return np.concatenate(parts)

    def _of_some(self, places: np.ndarray, about: Motion, numbers: Mapping[str, np.ndarray]) -> np.ndarray:
        n, head = len(places), 12 * self.motion
        count = head + len(self.moved)
        if count == 0:
            return np.zeros((n, 12 + len(self.derived), 0))
        ones = np.ones((n, 3))
        size = np.concatenate([about.position, ones, about.velocity, about.angular_velocity], axis=1)[:, :head]
        remembered = [about.memory[row.key][:, row.row, None] for row in self.moved]
        delta = self.step * np.maximum(1.0, np.abs(np.concatenate([size, *remembered], axis=1)))
        # (n, number, sign): the copies of a member side by side.
        each = np.repeat(np.arange(n), 2 * count)
        each_by = np.zeros((n, count, 2, count))
        diagonal = np.arange(count)
        each_by[:, diagonal, 0, diagonal], each_by[:, diagonal, 1, diagonal] = delta, -delta
        by = each_by.reshape(-1, count)
        copies = about.of(each)
        memory = copies.copied_memory()
        for j, row in enumerate(self.moved):
            memory[row.key][:, row.row] += by[:, head + j]
        copies = replace(copies, memory=memory)
        if self.motion:
            copies = copies.moved(by[:, :12])
        numbers = {name: values[each] for name, values in numbers.items()}
        after = self.bench.run(places[each], copies, self.k0, self.k0 + self.steps, numbers)
        plus, minus = after.of(np.arange(0, len(each), 2)), after.of(np.arange(1, len(each), 2))
        changed = [plus.apart(minus)]
        changed += [(plus.memory[row.key] - minus.memory[row.key])[:, row.row, None] for row in self.derived]
        derivatives = np.concatenate(changed, axis=1).reshape(n, count, -1) / (2.0 * delta[:, :, None])
        return np.swapaxes(derivatives, 1, 2)
