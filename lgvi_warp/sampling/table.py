"""Members' own values, from a file or from arrays."""

from __future__ import annotations

import csv
import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.errors import Faults
from lgvi_warp.sampling.base import Drawn, Sampling
from lgvi_warp.sampling.random import Random
from lgvi_warp.variations import Space


@dataclass(frozen=True, eq=False)
class Table(Sampling):
    """Members' own values: from a CSV file whose first line names the columns, or from arrays by name.

    file: its columns are numbers of the scene or entries of them, "vehicle.mass", "start.position[2]" (quote a name with a
    comma in it); values: name -> (n,) or (n, *shape). sha256: of the file as it must be, written by `to_dict`. Names of `vary`
    that the table does not have are drawn at random. The number of members is that of the lines; lines may be added.
    Raises SceneError naming every fault.
    """

    file: str | os.PathLike[str] | None = None
    values: Mapping[str, Any] | None = None
    sha256: str | None = None
    kind: ClassVar[str] = "table"

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.table.")
        if isinstance(self.file, Mapping) and self.values is None:  # Table({...})
            object.__setattr__(self, "values", self.file)
            object.__setattr__(self, "file", None)
        if (self.file is None) == (self.values is None):
            faults.add("file", self.file, "is given beside values, or neither is", "give one of file and values")
            faults.raise_if_any()
        read = self._from_file(faults) if self.file is not None else self._from_values(faults)
        lengths = {len(column) for column in read.values()}
        if not faults and (len(lengths) != 1 or 0 in lengths):
            faults.add("values", sorted(lengths), "are the columns' lengths", "give columns of one length, 1 or more")
        faults.raise_if_any()
        object.__setattr__(self, "_columns", read)

    def _from_values(self, faults: Faults) -> dict[str, np.ndarray]:
        read = {}
        assert self.values is not None
        for name, column in self.values.items():
            array = faults.finite(f'"{name}"', column)
            if array is not None and array.ndim == 0:
                faults.add(f'"{name}"', column, "is no column", "give one value for each member")
            elif array is not None:
                read[name] = array
        return read

    def _from_file(self, faults: Faults) -> dict[str, np.ndarray]:
        assert self.file is not None
        path = Path(self.file)
        try:
            content = path.read_bytes()
            found = hashlib.sha256(content).hexdigest()
            if self.sha256 not in (None, found):
                faults.add(
                    "sha256", self.sha256, f"is not that of {path}, which has changed", "leave sha256 out to take it"
                )
            object.__setattr__(self, "sha256", found)
            lines = content.decode("utf-8-sig").splitlines()
            names = [name.strip() for name in next(csv.reader(lines[:1]))]
            numbers = np.loadtxt(lines[1:], delimiter=",", ndmin=2) if lines[1:] else np.empty((0, len(names)))
        except (OSError, UnicodeDecodeError, StopIteration, ValueError) as error:
            faults.add(
                "file",
                os.fspath(path),
                f"cannot be read ({error})",
                "give a CSV file: names in its first line, then numbers",
            )
            return {}
        if numbers.size and numbers.shape[1] != len(names):
            faults.add(
                "file", os.fspath(path), f"has {len(names)} names for {numbers.shape[1]} columns", "name every column"
            )
            return {}
        if len(set(names)) < len(names):
            faults.add("file", os.fspath(path), "names a column twice", "give each column a name of its own")
        if not np.all(np.isfinite(numbers)):
            line = int(np.argmin(np.isfinite(numbers).all(axis=1)))
            faults.add(
                "file", os.fspath(path), f"holds a number that is not finite (line {line + 2})", "mend that line"
            )
        return dict(zip(names, np.ascontiguousarray(numbers.T), strict=True)) if numbers.size else {}

    def columns(self) -> dict[str, np.ndarray]:
        """As read."""
        return dict(self._columns)  # type: ignore[attr-defined]

    def own_members(self, space: Space) -> int:
        """Lines."""
        return len(next(iter(self.columns().values())))

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """At random, of what the table does not have."""
        return Random().draw(space, members)

    def to_dict(self) -> Any:
        """As in a scene file."""
        if self.file is not None:
            return {self.kind: {"file": os.path.abspath(self.file), "sha256": self.sha256}}
        return {self.kind: {"values": {name: column.tolist() for name, column in self.columns().items()}}}
