# SPDX-License-Identifier: Apache-2.0
"""Central differences of some steps of many members, in lanes: every number that is moved has two copies of a member."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.studies.linear.bench import AT_ONCE, COORDINATES, Motion, MotionBench

# Half a difference, of numbers of size 1: what is cut off and round-off are then alike, 1e-10.
STEP = 1e-5


@dataclass(frozen=True)
class Row:
    """A number that is remembered."""

    key: str
    row: int
    name: str


def names_of(rows: Sequence[Row]) -> tuple[str, ...]:
    """Names of the states: the motion, then what is remembered."""
    return (*COORDINATES, *(row.name for row in rows))


def differences(
    bench: MotionBench,
    places: np.ndarray,
    about: Motion,
    k0: int,
    steps: int,
    moved: Sequence[Row],
    derived: Sequence[Row] = (),
    *,
    motion: bool = True,
    numbers: Mapping[str, np.ndarray] | None = None,
    step: float = STEP,
) -> np.ndarray:
    """Derivatives of the motion and of rows of members (n,) after some steps, by the motion and rows before.

    numbers: values (n, ...) by name that replace those of the members.
    Returns: (n, 12 + derived, 12 + moved), without the motion (n, 12 + derived, moved); NaN where a copy of a member failed.
    """
    count = 12 * motion + len(moved)
    parts = []
    most = max(1, AT_ONCE // (2 * max(count, 1)))
    for first in range(0, len(places), most):
        some = np.arange(first, min(first + most, len(places)))
        chosen_numbers = {name: values[some] for name, values in (numbers or {}).items()}
        parts.append(
            _differences(bench, places[some], about.of(some), k0, steps, moved, derived, motion, chosen_numbers, step)
        )
    return np.concatenate(parts)


def _differences(
    bench: MotionBench, places: np.ndarray, about: Motion, k0: int, steps: int, moved: Sequence[Row], derived: Sequence[Row],
    motion: bool, numbers: Mapping[str, np.ndarray], step: float) -> np.ndarray:  # fmt: skip
    n, head = len(places), 12 * motion
    count = head + len(moved)
    if count == 0:
        return np.zeros((n, 12 + len(derived), 0))
    ones = np.ones((n, 3))
    size = np.concatenate([about.position, ones, about.velocity, about.angular_velocity], axis=1)[:, :head]
    remembered = [about.memory[row.key][:, row.row, None] for row in moved]
    delta = step * np.maximum(1.0, np.abs(np.concatenate([size, *remembered], axis=1)))
    # (n, number, sign): the copies of a member side by side.
    each = np.repeat(np.arange(n), 2 * count)
    each_by = np.zeros((n, count, 2, count))
    diagonal = np.arange(count)
    each_by[:, diagonal, 0, diagonal], each_by[:, diagonal, 1, diagonal] = delta, -delta
    by = each_by.reshape(-1, count)
    copies = about.of(each)
    memory = copies.copied_memory()
    for j, row in enumerate(moved):
        memory[row.key][:, row.row] += by[:, head + j]
    copies = replace(copies, memory=memory)
    if motion:
        copies = copies.moved(by[:, :12])
    after = bench.run(places[each], copies, k0, k0 + steps, {name: v[each] for name, v in numbers.items()})
    plus, minus = after.of(np.arange(0, len(each), 2)), after.of(np.arange(1, len(each), 2))
    changed = [plus.apart(minus)]
    changed += [(plus.memory[row.key] - minus.memory[row.key])[:, row.row, None] for row in derived]
    derivatives = np.concatenate(changed, axis=1).reshape(n, count, -1) / (2.0 * delta[:, :, None])
    return np.swapaxes(derivatives, 1, 2)
