# SPDX-License-Identifier: Apache-2.0
"""What one case at one point of the grid showed, member by member, in memory or in a file that a resumed sweep finds."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import files as durable

# Folder of the records, within that of the sweep.
FOLDER = "cells"


@dataclass(frozen=True, eq=False)
class Record:
    """What the members of a cell showed.

    Args:
        status: (n,), of `Status`.
        numbers: metrics by name, (n,).
        messages: what the run said.
        refused: why it did not run; "" (default) where it did.
    """

    status: np.ndarray
    numbers: Mapping[str, np.ndarray]
    messages: tuple[str, ...] = ()
    refused: str = ""

    @classmethod
    def of_refusal(cls, text: str) -> Record:
        """Return the record of a cell that did not run.

        Args:
            text: why.
        """
        return cls(np.zeros(0, np.uint8), {}, (), text)

    def save(self, path: Path) -> None:
        """Write the record; the file is there whole or not at all, and the same record has the same bytes.

        Args:
            path: of the file.

        Raises:
            OSError: it cannot be written.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        names = list(self.numbers)
        words = np.frombuffer(json.dumps({"metrics": names, "messages": self.messages}).encode(), np.uint8)
        table = np.array([self.numbers[name] for name in names], np.float64).reshape(len(names), len(self.status))
        with durable.placed(path) as beside, beside.open("xb") as file:
            np.savez(file, words=words, status=self.status, numbers=table)

    @classmethod
    def load(cls, path: Path) -> Record | None:
        """Return the record of a file; None where there is none, or none that is whole.

        Args:
            path: of the file.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                words = json.loads(file["words"].tobytes())
                table, status = file["numbers"], file["status"]
            return cls(status, dict(zip(words["metrics"], table, strict=True)), tuple(words["messages"]))
        except (OSError, ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile):
            return None


@dataclass
class Records:
    """The records of all cells.

    Args:
        folder: folder of the sweep; None (default): they are kept in memory.
    """

    folder: Path | None = None
    _kept: dict[str, Record] = field(default_factory=dict)

    def __getitem__(self, key: str) -> Record:
        """Return the record of a key, which there must be."""
        record = self.get(key)
        assert record is not None
        return record

    def get(self, key: str) -> Record | None:
        """Return the record of a key; None where there is none.

        Args:
            key: that of the cell.
        """
        if key in self._kept or self.folder is None:
            return self._kept.get(key)
        return Record.load(self.path(key))

    def put(self, key: str, record: Record, lasting: bool = True) -> None:
        """Keep a record. Refusals stay in memory: what a case lacks may be mended before the sweep goes on.

        Args:
            key: that of the cell.
            record: the record.
            lasting: whether another call may take it for its own; default True.

        Raises:
            OSError: it cannot be written.
        """
        if self.folder is None or record.refused or not lasting:
            self._kept[key] = record
        else:
            record.save(self.path(key))

    def path(self, key: str) -> Path:
        """Return the file of a record.

        Args:
            key: that of the cell.
        """
        assert self.folder is not None
        return self.folder / FOLDER / f"{key}.npz"


def key_of(content: Mapping[str, Any]) -> str:
    """Return a key for what decides a cell's numbers: 32 hexadecimal digits.

    Args:
        content: what decides them, of plain types.
    """
    text = json.dumps(content, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return repr(value)
