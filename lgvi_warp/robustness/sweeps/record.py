# SPDX-License-Identifier: Apache-2.0
"""Outcomes of the members for one case at one point of the grid, in memory or in a file for a resumed sweep."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lgvi_warp.common.files import place_of
from lgvi_warp.common.npy_files import of_npz, write_npz
from lgvi_warp.common.safe_files import inside, parsed
from lgvi_warp.common.status import Status

# Folder of the records, within that of the sweep.
FOLDER = "cells"


@dataclass(frozen=True, eq=False)
class Record:
    """Outcomes of a cell's members: status (n,) of `Status`, and metrics, name -> (n,); or the refusal."""

    status: np.ndarray
    numbers: Mapping[str, np.ndarray]
    messages: tuple[str, ...] = ()
    refused: str = ""

    @classmethod
    def of_refusal(cls, text: str) -> Record:
        """The record of a cell that did not run."""
        return cls(np.zeros(0, np.uint8), {}, (), text)

    def save(self, path: Path, root: Path) -> None:
        """Write the record; a file is never partly written, and the same record gives the same bytes."""
        place_of(path, root).parent.mkdir(parents=True, exist_ok=True)
        names = list(self.numbers)
        table = np.array([self.numbers[name] for name in names], np.float64).reshape(len(names), len(self.status))
        crc = _checksum(path, names, self.messages, self.status, table)
        content = json.dumps({"metrics": names, "messages": self.messages, "crc32": crc})
        words = np.frombuffer(content.encode(), np.uint8)
        write_npz(path, {"words": words, "status": self.status, "numbers": table}, root)

    @classmethod
    def load(cls, path: Path, metrics: Sequence[str], members: int) -> Record | None:
        """Read a record from a file; None if the file is missing, damaged or of another cell."""
        try:
            arrays = of_npz(path)
            words = parsed(arrays["words"].tobytes())
            table, status, messages = arrays["numbers"], arrays["status"], words["messages"]
            of_this_cell = (
                (table.dtype, table.shape) == (np.float64, (len(metrics), members))
                and (status.dtype, status.shape) == (np.uint8, (members,))
                and bool(np.isin(status, [*Status]).all())
                and words["metrics"] == list(metrics)
                and all(isinstance(text, str) for text in messages)
                and words["crc32"] == _checksum(path, metrics, messages, status, table)
            )
            return cls(status, dict(zip(metrics, table, strict=True)), tuple(messages)) if of_this_cell else None
        except (OSError, ValueError, KeyError, TypeError):
            return None


def _checksum(
    path: Path, metrics: Sequence[str], messages: Sequence[str], status: np.ndarray, table: np.ndarray
) -> int:
    """The checksum of a record and of its cell."""
    words = json.dumps([path.name, list(metrics), list(messages)]).encode()
    return zlib.crc32(table.tobytes(), zlib.crc32(status.tobytes(), zlib.crc32(words)))


@dataclass
class Records:
    """The records of all cells, in the folder of a sweep; folder None: in memory."""

    folder: Path | None = None
    metrics: Sequence[str] = ()
    members: int = 0
    _kept: dict[str, Record] = field(default_factory=dict)

    def check(self) -> None:
        """Check the files that the folder already holds, before anything is run."""
        if self.folder is not None and (cells := inside(self.folder, FOLDER)).is_dir():
            for name in os.listdir(cells):
                place_of(self.folder / FOLDER / name, self.folder)

    def __getitem__(self, key: str) -> Record:
        """The record of a key; it must exist."""
        record = self.get(key)
        assert record is not None
        return record

    def get(self, key: str) -> Record | None:
        """The record of a key; None if there is none."""
        if key in self._kept or self.folder is None:
            return self._kept.get(key)
        return Record.load(self.path(key), self.metrics, self.members)

    def put(self, key: str, record: Record, lasting: bool = True) -> None:
        """Store a record. Refusals stay only in memory: their cause may be removed before the sweep continues."""
        if self.folder is None or record.refused or not lasting:
            self._kept[key] = record
        else:
            record.save(self.path(key), self.folder)

    def path(self, key: str) -> Path:
        """The file of a record."""
        assert self.folder is not None
        return self.folder / FOLDER / f"{key}.npz"
