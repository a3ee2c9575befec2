# SPDX-License-Identifier: Apache-2.0
"""Values of every member, from a file or from arrays."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.common.labelled import columns_by_name, is_labelled
from lgvi_warp.common.reading import UnreadableError, file_bytes
from lgvi_warp.sampling.designs.base import Drawn, Sampling
from lgvi_warp.sampling.designs.csv_file import columns_of
from lgvi_warp.sampling.designs.random import Random
from lgvi_warp.sampling.designs.space import Space

# Name of the column of weights that are given as numbers.
WEIGHTS = "weights"
# First bytes of files of numpy.save and numpy.savez, and of archives. They are not opened, since they could hold code.
BINARY = (b"\x93NUMPY", b"PK\x03\x04", b"\x1f\x8b")


@dataclass(frozen=True, eq=False)
class Table(Sampling):
    """Table with the values of every member: a CSV file whose first line names the columns, or arrays by name.

    Names of `vary` that the table does not contain are drawn at random. By default, the number of members is the number
    of lines; with fewer members, the first lines are used. Lines can be added at the end.

    Args:
        file: Path of the file. Its columns are named by numbers of the scene or by entries, such as "vehicle.mass" or
            "start.position[2]"; quote a name that contains a comma. Commas, semicolons or tabs separate the columns.
            Empty lines and lines that begin with # are skipped.
        values: Arrays (n,) or (n, *shape) by name, for n members, instead of a file; or a data frame, a structured
            array or an xarray Dataset with these names. A Dataset may be a posterior with chains and draws (ArviZ:
            idata.posterior); each draw is a member.
        sha256: Checksum that the file must have, as written by `to_dict`; by default the file is not checked.
        columns: Names of the columns to use; all by default.
        ignore: Names of the columns to leave out, such as an id; none by default.
        weights: Statistical weights of the members: the name of a column, or numbers (n,) of at least 0, on any scale.
            The members then represent a target distribution that differs from the one of the draws. A member's weight
            is the target's density divided by the density of the draws (importance sampling), or the weight of a
            posterior draw. By default all weights are equal.

    Raises:
        SceneError: If the file cannot be read, or a cell has no number. The message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> table = lw.designs.Table({"vehicle.buoyancy": [306.0, 307.5, 309.0]})
        >>> lw.Ensemble(scene, sampling=table).parameters(0, 3)["vehicle.buoyancy"]
        array([306. , 307.5, 309. ])
    """

    file: str | os.PathLike[str] | None = None
    values: Mapping[str, Any] | None = None
    sha256: str | None = None
    columns: Sequence[str] | None = None
    ignore: Sequence[str] | None = None
    weights: Any = None
    kind: ClassVar[str] = "table"
    fewer: ClassVar[bool] = True

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.table.")
        if self.values is None and not isinstance(self.file, str | os.PathLike | None):  # Table({...})
            object.__setattr__(self, "values", self.file)
            object.__setattr__(self, "file", None)
        if (self.file is None) == (self.values is None):
            fault = "has no values beside it" if self.file is None else "is given beside values"
            faults.add("file", self.file, fault, "give one of file and values")
        self._check_options(faults)
        faults.raise_if_any()
        self._take_weights(faults)
        read = self._from_file(faults) if self.file is not None else self._from_values(faults)
        if isinstance(self.weights, str) and self.weights in read:
            check_weights(faults, "weights", read[self.weights])
        lengths = {len(column) for column in read.values()}
        if not faults and (len(lengths) != 1 or 0 in lengths):
            faults.add("values", sorted(lengths), "are the columns' lengths", "give columns of one length, 1 or more")
        faults.raise_if_any()
        object.__setattr__(self, "_own", read)

    @classmethod
    def kept(cls, settings: Mapping[str, Any], values: Mapping[str, np.ndarray]) -> Table:
        """Build a table from a store, which holds the numbers that were read from the file.

        Args:
            settings: Settings of the file as returned by `to_dict`, by key.
            values: Columns by name, (n,) or (n, *shape).

        Returns:
            The table. The file need not exist any more.

        Raises:
            SceneError: If the values are not columns of one length.
        """
        table = cls(values=values, weights=settings.get("weights"))
        for item in fields(cls):
            object.__setattr__(table, item.name, settings.get(item.name))
        return table

    def _check_options(self, faults: Faults) -> None:
        for name in ("columns", "ignore"):
            chosen = getattr(self, name)
            if chosen is None:
                continue
            listed = items_of(chosen)
            if not listed or not all(isinstance(entry, str) for entry in listed):
                faults.add(name, chosen, "is not a list of names", f'write {name} = ["vehicle.mass"]')
            else:
                object.__setattr__(self, name, listed)
        if self.columns is not None and self.ignore is not None:
            faults.add("ignore", self.ignore, "is given beside columns", "keep one of them")

    def _take_weights(self, faults: Faults) -> None:
        """Turn weights given as numbers into a column, which a store and a scene file can hold."""
        if self.weights is None or isinstance(self.weights, str):
            return
        if self.file is not None:
            faults.add("weights", self.weights, "are numbers beside a file", 'name a column of the file: weights = "w"')
        elif is_labelled(self.values):
            table = columns_by_name(Faults(), "values", self.values) or {}
            if WEIGHTS in table:
                faults.add(
                    "weights", self.weights, f"are given beside a column {WEIGHTS!r}", f'give weights="{WEIGHTS}"'
                )
            object.__setattr__(self, "values", {**table, WEIGHTS: self.weights})
            object.__setattr__(self, "weights", WEIGHTS)

    def _chosen(self, faults: Faults, names: Sequence[str]) -> list[str]:
        """The names of the columns to use."""
        known = set(names)
        for option in ("columns", "ignore"):
            for name in getattr(self, option) or ():
                if name not in known:
                    remedy = functools.partial(closest, name, names)
                    faults.add(option, name, "is not a column of the table", remedy)
        if self.weights is not None and self.weights not in known:
            faults.add(
                "weights", self.weights, "is not a column of the table", functools.partial(closest, self.weights, names)
            )
        wanted, unwanted = {*(self.columns or names), self.weights}, set(self.ignore or ()) - {self.weights}
        chosen = [name for name in names if name in wanted and name not in unwanted]
        if not chosen and not faults:
            faults.add("ignore", self.ignore, "leaves no column", "keep one or more")
        return chosen

    def _from_values(self, faults: Faults) -> dict[str, np.ndarray]:
        if not is_labelled(self.values):
            remedy = 'give a file, {"vehicle.mass": array, ...} or a DataFrame with such names'
            faults.add("values", self.values, "has no names of columns", remedy)
            return {}
        table = columns_by_name(faults, "values", self.values)
        if not table:
            return {}
        columns = {name: _column(faults, f'"{name}"', table[name]) for name in self._chosen(faults, list(table))}
        read = {name: column for name, column in columns.items() if column is not None}
        object.__setattr__(self, "values", read)
        return read

    def _from_file(self, faults: Faults) -> dict[str, np.ndarray]:
        assert self.file is not None
        path = os.fspath(self.file)
        try:
            content = file_bytes(path, "CSV file")
        except UnreadableError as error:
            faults.add("file", path, f"cannot be read ({error.what})", error.remedy)
            return {}
        if content.startswith(BINARY):
            remedy = "give a CSV file, or arrays: lw.designs.Table({name: array})"
            faults.add("file", path, "is a file of NumPy, or an archive", remedy)
            return {}
        checksum = hashlib.sha256(content).hexdigest()
        if self.sha256 not in (None, checksum):
            fault = f"is not that of {path}, which has changed"
            faults.add("sha256", self.sha256, fault, "leave sha256 out to take it")
            return {}
        object.__setattr__(self, "sha256", checksum)
        try:
            return columns_of(faults, path, content, self._chosen)
        except UnicodeDecodeError:
            faults.add("file", path, "is not a text in UTF-8", "save it as CSV in UTF-8")
            return {}

    def own_values(self) -> dict[str, np.ndarray]:
        own: dict[str, np.ndarray] = self._own  # type: ignore[attr-defined]
        return {name: column for name, column in own.items() if name != self.weights}

    def own_weights(self) -> np.ndarray | None:
        if self.weights is None:
            return None
        weights = self._own[self.weights]  # type: ignore[attr-defined]
        return np.asarray(weights / weights.mean())

    def arrays(self) -> dict[str, np.ndarray]:
        # The columns, also those of a file, since that may be moved or changed.
        return dict(self._own)  # type: ignore[attr-defined]

    def own_members(self, space: Space) -> int:
        return len(next(iter(self._own.values())))  # type: ignore[attr-defined]

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        # Random levels for the names that the table does not contain.
        return Random().draw(space, members)

    def to_dict(self) -> Any:
        named = {} if self.weights is None else {"weights": self.weights}
        if self.file is None:
            return {self.kind: {"values": {name: column.tolist() for name, column in self.arrays().items()}} | named}
        chosen = {
            name: getattr(self, name) for name in ("columns", "ignore") if getattr(self, name) is not None
        } | named
        return {self.kind: {"file": os.path.abspath(self.file), "sha256": self.sha256, **chosen}}


def moved(file: str, sha256: str | None, beside: Path) -> str:
    """Current path of a table that moved with a store: the file with its checksum, found by the last parts of its path."""
    parts = Path(file).parts[1:]
    if sha256 is None or Path(file).exists():
        return file
    for above in beside.absolute().parents:
        for k in range(len(parts)):
            path = above.joinpath(*parts[k:])
            with contextlib.suppress(OSError, UnreadableError):
                if path.is_file() and hashlib.sha256(file_bytes(str(path), "CSV file")).hexdigest() == sha256:
                    return str(path)
    return file


def check_weights(faults: Faults, key: str, weights: np.ndarray) -> None:
    """Add a fault unless numbers are weights of members: (n,), none negative, and some positive."""
    if weights.ndim != 1:
        faults.add(key, weights, f"has shape {weights.shape}", "give one number for each member")
    elif (weights < 0.0).any():
        worst = int(np.argmin(weights))
        faults.add(key, float(weights[worst]), f"is below 0, of member {worst}", "give numbers from 0")
    elif not (weights > 0.0).any():
        faults.add(key, weights, "are all 0", "give numbers from 0, of which some are above")


def _column(faults: Faults, key: str, column: Any) -> np.ndarray | None:
    """A column of finite numbers; None after adding a fault."""
    plain = isinstance(column, np.ndarray) and column.dtype.kind == "f" and column.ndim and not np.ma.is_masked(column)
    if plain and not np.isfinite(column).all():
        row = int(np.argmin(np.isfinite(column.reshape(len(column), -1)).all(axis=1)))
        faults.add(key, column[row], f"is not finite, of member {row}", "give a number, or drop that member")
        return None
    array = faults.finite(key, column)
    if array is not None and array.ndim == 0:
        faults.add(key, column, "is not a column", "give one value for each member")
        return None
    return array
