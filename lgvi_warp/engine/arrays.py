# SPDX-License-Identifier: Apache-2.0
"""The kernel's arrays of structs and of lanes, written through NumPy; numbers that all members share are written once."""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from lgvi_warp.physics.terms.base import Packed


def put(target: np.ndarray, column: Any) -> None:
    """Write one number of each member into lanes; lanes beyond the last member get the last member's number.

    target: (packets, width), or (1, width) for a shared number. column: a number, or an array (1,) or (m,).
    """
    if np.ndim(column) == 0 or len(column) == 1:
        target[...] = column
    elif len(column) == target.size:
        target[...] = column.reshape(target.shape)
    else:
        padded = np.empty(target.size, column.dtype)
        padded[: len(column)], padded[len(column) :] = column, column[-1]
        target[...] = padded.reshape(target.shape)


def put_rows(target: np.ndarray, rows: np.ndarray) -> None:
    """Write rows (1 or m, d) of members into lanes (packets or 1, d, width); lanes beyond the last member get its rows."""
    packets, d, width = target.shape
    if len(rows) == 1:
        target[...] = rows[:, :, None]
        return
    full_packets = len(rows) // width
    target[:full_packets] = rows[: full_packets * width].reshape(full_packets, width, d).transpose(0, 2, 1)
    if full_packets < packets:
        target[full_packets, :, : len(rows) - full_packets * width] = rows[full_packets * width :].T
        target[full_packets, :, len(rows) - full_packets * width :] = rows[-1][:, None]


class Writing(NamedTuple):
    """Functions that write members' numbers into lanes: like `put`, and like `put_rows`."""

    put: Callable[[np.ndarray, Any], None]
    put_rows: Callable[[np.ndarray, np.ndarray], None]


PLAIN = Writing(put, put_rows)


def fill(target: np.ndarray, value: Any, put: Callable[[np.ndarray, Any], None] = put) -> None:
    """Write the numbers of members into a field (packets or 1,) of a structured array.

    value: a number, whole numbers (m,), numbers (1 or m,), vectors (1 or m, 3), matrices (1 or m, 3, 3), a pair of
        diagonal and off-diagonal of symmetric matrices, or a mapping of these by name.
    """
    names = target.dtype.names or ()
    if isinstance(value, dict):
        for name, entry in value.items():
            fill(target[name], entry, put)
    elif isinstance(value, tuple):
        for name, entry in zip(("diagonal", "off_diagonal"), value, strict=True):
            fill(target[name], entry, put)
    elif names == ("x", "y", "z"):
        for i, axis in enumerate(names):
            put(target[axis], value[:, i])
    elif names:
        for i, name in enumerate(("row0", "row1", "row2")):
            fill(target[name], value[:, i], put)
    else:
        put(target, value)


def longest(value: Any) -> int:
    """Leading dimension of a value for `fill`."""
    if isinstance(value, dict):
        return max(map(longest, value.values()), default=1)
    if isinstance(value, tuple):
        return max(map(longest, value))
    return len(value) if np.ndim(value) else 1


class Structs:
    """A Warp array of structs whose fields are written through NumPy; fields that all members share are written only once.

    array: one struct, or one per packet if a number varies; None before `write`. view: the same memory in NumPy.
    """

    def __init__(self, struct: Any, dtype: np.dtype, writing: Writing = PLAIN):
        assert dtype.itemsize == ctypes.sizeof(struct.ctype)
        self._struct, self._dtype, self._put = struct, dtype, writing.put
        self.view = np.empty(0, dtype)
        self.array: Any = None
        self._written: Any = None

    def forget(self) -> None:
        """Make the next `write` write everything into a new array."""
        self.view = np.empty(0, self._dtype)

    def write(self, packets: int, parts: list[tuple[tuple[str, ...], Any, bool]]) -> None:
        """Write numbers of members."""
        varying = [(path, fields) for path, fields, shared in parts if not shared]
        count = packets if packets > 1 and max((longest(fields) for _, fields in varying), default=1) > 1 else 1
        names = [tuple(fields) for _, fields, _ in parts]
        if names != self._written:
            # A field that is not written any more would keep the number of other members.
            self.forget()
            self._written = names
        if count != len(self.view):
            template = np.zeros(1, self._dtype)
            for path, fields, shared in parts:
                if shared:
                    fill(_at(template, path), fields, self._put)
            self.array = wp.empty(count, dtype=self._struct, device="cpu")
            # The array's own memory: wp.array(values) lets NumPy parse the struct's type from text, which in several
            # threads occasionally fails (Python before 3.11.8 and 3.12.2, python/cpython#106905).
            memory: Any = (ctypes.c_char * (count * self._dtype.itemsize)).from_address(self.array.ptr)
            self.view = np.ndarray(count, self._dtype, memory)
            self.view[:] = np.repeat(template, count)
        for path, fields in varying:
            fill(_at(self.view, path), fields, self._put)


def _at(target: np.ndarray, path: tuple[str, ...]) -> np.ndarray:
    for name in path:
        target = target[name]
    return target


class Lanes:
    """A Warp array (packets, rows) of lanes or of single numbers, written through a view (packets, rows, width or 1)."""

    def __init__(self, packets: int, rows: int, Lane: Any):
        self.array: Any = wp.zeros((packets, rows), dtype=Lane, device="cpu")
        view = self.array.numpy()
        self.view = view if view.ndim == 3 else view[:, :, None]


# The field of an event's struct that is filled in with the row of the account of the energy used.
ACCOUNT_FIELD = "account_row"
# That of a part's struct with the row of the memory where an actuator is, by the row of the bus in which it reports that.
PLACE_FIELD = "place_row"
# The struct of a law that is held to its own rows: its numbers, and where its rows lie (lgvi_kernels.maps.bounded).
FIELDS = ("own", "bounds")


class Group(NamedTuple):
    """Packed numbers of several terms, whether all members share them, and whether they equal those of earlier calls."""

    packed: Sequence[Packed]
    shared: Sequence[bool]


class LawArrays:
    """The numbers of a kernel's laws: their structs, their rows of a table, and their memory.

    kinds: for each group of laws (terms, a controller's parts, events) Warp's struct of its numbers, and its NumPy type.
    memory: memory of laws and method from step to step; the second half is a backup.
    places: positions of each law's rows in table and memory; empty before `write`.
    remembered: memory rows of each law, without its scratch rows. scratch: the first of the method's own rows.
    account: the first memory row of the law that accounts for the energy used; -1 if there is none.
    """

    table: Lanes
    memory: Lanes
    remembered: list[slice]
    scratch: int
    account: int

    def __init__(
        self,
        packets: int,
        kinds: Sequence[tuple[Any, np.dtype]],
        Lane: Any,
        Number: Any = None,
        writing: Writing = PLAIN,
    ):
        self._packets, self._Lane, self._Number = packets, Lane, Number or Lane
        self._put_rows = writing.put_rows
        self.structs = [Structs(*kind, writing) for kind in kinds]
        self._bounded = [_bounded(dtype) for _, dtype in kinds]
        self.places: list[Any] = []
        self._sizes: Any = None
        # Rows of the memory, and what laws remember in them at the start.
        self._remembering: list[tuple[slice, np.ndarray]] = []
        # Bits of rows that one number fills, as they were written, by their place in the table: b"" of those that all members
        # share, None of those that members own.
        self._written: dict[int, bytes | None] = {}

    def write(self, groups: Sequence[Group], scratch: int = 0, bus: int = 0, account: int | None = None) -> None:
        """Write the packed numbers of terms and of a controller's parts; account: number of the law of the energy used."""
        laws = [law for group in groups for law in group.packed]
        rows = [row_parts(law) for law in laws]
        widths = [[part.shape[1] for part in parts] for parts in rows]
        sizes = widths, [(memory_count(law), law.work) for law in laws], scratch, bus
        moved = self._sizes != sizes
        if moved:
            # A law may have as many rows as its members need: those after it, though shared, then lie elsewhere.
            for structs in self.structs:
                structs.forget()
            self._sizes, self._written = sizes, {}
            self._place(laws, bus, account)
        next_places = iter(self.places)
        for structs, bounded, group in zip(self.structs, self._bounded, groups, strict=True):
            structs.write(
                self._packets, _nested(group, bounded, list(itertools.islice(next_places, len(group.packed))))
            )
        self._write_table(rows, [known for group in groups for known in group.shared], moved)
        if moved:
            self.memory = Lanes(self._packets, 2 * (self.scratch + scratch), self._Lane)
        self._remembering, first = [], bus
        for law in laws:
            if law.memory is not None:
                self._remembering.append((slice(first, first + law.memory.shape[1]), law.memory))
            first += memory_rows(law)
        self.write_memory()

    def _place(self, laws: Sequence[Packed], bus: int, account: int | None) -> None:
        """Assign rows of table and memory to each law."""
        row, memory = 1, bus
        self.account = -1 if account is None else bus + sum(map(memory_rows, laws[:account]))
        self.places, self.remembered = [], []
        moving: dict[int, int] = {}
        for law in laws:
            # The table's first row is none's: it is 0, and what a law without rows reads.
            size, end = row_count(law), memory + memory_rows(law)
            work = end - law.work
            wanted = ("first", row, law.rows), ("memory", memory, law.memory), ("work", work, law.work or None)
            row_fields: dict[str, Any] = {name: place for name, place, part in wanted if part is not None}
            if ACCOUNT_FIELD in law.values:
                row_fields[ACCOUNT_FIELD] = self.account
            if "report" in law.values:
                moving[law.values["report"]] = memory
            if PLACE_FIELD in law.values:
                report = max(row for row in moving if row <= law.values[PLACE_FIELD])
                row_fields[PLACE_FIELD] = law.values[PLACE_FIELD] - report + moving[report]
            if law.normals is not None:
                row_fields["key"] = law.values["key"] | {"row": row + size - law.normals.shape[1]}
            ends = (row, row + size - 1) if size else (0, 0)
            self.places.append((row_fields, (*ends, memory, end - 1, bus)))
            self.remembered.append(slice(memory, work))
            row, memory = row + size, end
        self._rows, self.scratch = row, memory

    def _write_table(self, parts_of_laws: Sequence[Sequence[np.ndarray]], shared: Sequence[bool], moved: bool) -> None:
        """Write the laws' rows; the table's first row belongs to no law. Shared rows are written when they change."""
        count = self._packets if any(len(part) > 1 for parts in parts_of_laws for part in parts) else 1
        if moved or len(self.table.view) != count:
            # A vector of rows that members share is one load of four: one row more than there are.
            rows = self._rows + (self._Number is not self._Lane)
            self.table, self._written = Lanes(count, rows, self._Number), {}
        first = 1
        for parts, known in zip(parts_of_laws, shared, strict=True):
            for part in parts:
                at, first = first, first + part.shape[1]
                bits = None if len(part) > 1 else b"" if known else part.tobytes()
                if bits is None or bits != self._written.get(at):
                    self._put_rows(self.table.view[:, at:first], part)
                    self._written[at] = bits

    def write_memory(self) -> None:
        """Write the initial memory of the laws, and zeros into all other rows of the memory."""
        view = self.memory.view
        if not view.size:
            return
        view[...] = 0.0
        for rows, memory in self._remembering:
            self._put_rows(view[:, rows], memory)
        half = view.shape[1] // 2
        view[:, half:] = view[:, :half]


def _bounded(dtype: np.dtype) -> list[tuple[str, ...]]:
    """Names of the bounds next to the numbers of each law in a struct, in order."""
    names: list[tuple[str, ...]] = []
    while "own" in (dtype.names or ()):
        first_law = dtype["own"]
        names.append((first_law["bounds"].names or ()) if first_law.names == FIELDS else ())
        dtype = dtype["rest"]
    return names


def memory_rows(law: Packed) -> int:
    """Number of a law's rows in the memory, including its scratch rows."""
    return memory_count(law) + law.work


def memory_count(law: Packed) -> int:
    """Number of memory rows in which a law stores data."""
    return 0 if law.memory is None else law.memory.shape[1]


def row_parts(law: Packed) -> tuple[np.ndarray, ...]:
    """Rows of a law in the table as arrays (1 or n, rows) side by side, given normals last; empty without rows."""
    rows = law.rows if isinstance(law.rows, tuple) else () if law.rows is None else (law.rows,)
    return rows if law.normals is None else (*rows, law.normals)


def row_count(law: Packed) -> int:
    """Number of a law's rows in the table."""
    return sum(part.shape[1] for part in row_parts(law))


def _nested(
    group: Group, bounded: Sequence[tuple[str, ...]], places: Sequence[tuple[dict[str, Any], tuple[int, ...]]]
) -> list[tuple[tuple[str, ...], Any, bool]]:
    """Numbers of a group as parts of the kernel's struct, which contains those of the first law, and the rest.

    bounded: as in `_bounded`. places: for each law the fields with the positions of its rows, and its bounds.
    """
    parts: list[tuple[tuple[str, ...], Any, bool]] = []
    each = zip(group.packed, group.shared, bounded, places, strict=True)
    for i, (packed, known, names, (row_fields, bounds)) in enumerate(each):
        path = (*("rest",) * i, "own")
        parts.append((path + FIELDS[:1] * bool(names), {**packed.values, **row_fields}, known))
        if names:
            parts.append((path + FIELDS[1:], dict(zip(names, bounds, strict=True)), known))
    return parts
