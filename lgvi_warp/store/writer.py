# SPDX-License-Identifier: Apache-2.0
"""Writer of one block: samples are collected in chunks, and full chunks are written to disk."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.files import Files
from lgvi_warp.engine.block import Block
from lgvi_warp.results import member_fields
from lgvi_warp.store.layout import MEMBER, WEIGHT, StoreArray

if TYPE_CHECKING:
    from lgvi_warp.engine.outcome import MemberStatus
    from lgvi_warp.engine.plan import Plan
    from lgvi_warp.sampling.members import Members


class Room(list[dict[str, np.ndarray]]):
    """Pool of unused chunks: allocating fresh memory costs more than filling it."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle an empty pool: each process has its own pool."""
        return Room, ()


class BlockWriter:
    """Writer of one block into a store."""

    def __init__(
        self, root: Path, columns: tuple[StoreArray, ...], room: Room, plan: Plan, block: Block, members: Members
    ):
        self._plan, self._block, self._members = plan, block, members
        self._timed = [column for column in columns if column.times]
        self._of_members = [column for column in columns if not column.times]
        self._samples = len(plan.grid.times)
        self._files = Files(root)
        self._room = room
        try:
            self._chunks = room.pop()
        except IndexError:
            self._chunks = {column.name: np.empty(column.chunk, column.dtype) for column in self._timed}
        if block.count < columns[0].length:
            for column in self._timed:
                self._chunks[column.name][:, block.count :] = column.fill

    def take(self, when: slice, samples: dict[str, np.ndarray]) -> None:
        """Put samples (times, members of the block, ...) into their chunks, and write the chunks that are full."""
        for column in self._timed:
            self._take(column, when, samples[column.name])

    def _take(self, column: StoreArray, when: slice, values: np.ndarray) -> None:
        chunk = self._chunks[column.name]
        t = when.start
        while t < when.stop:
            number, place = divmod(t, column.times)
            stop = min((number + 1) * column.times, when.stop)
            chunk[place : place + stop - t, : self._block.count] = values[t - when.start : stop - when.start]
            if stop == self._samples:
                chunk[place + stop - t :] = column.fill
            if stop in ((number + 1) * column.times, self._samples):
                self._write(column, number, chunk)
            t = stop

    def _write(self, column: StoreArray, number: int, chunk: np.ndarray) -> None:
        self._files.write(column.key(self._block, number), chunk, checked=True)

    def close(self, outcome: MemberStatus) -> Files:
        """Write the fields and parameters of the members."""
        values = {MEMBER: self._members.indices} | self._members.parameters | self._members.starts
        values |= {} if self._members.weight is None else {WEIGHT: self._members.weight}
        values |= member_fields.member_fields(self._plan, outcome)
        for column in self._of_members:
            chunk = np.full(column.chunk, column.fill, column.dtype)
            chunk[: self._block.count] = values[column.name]
            self._write(column, 0, chunk)
        self._room.append(self._chunks)
        return self._files
