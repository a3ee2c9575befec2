# SPDX-License-Identifier: Apache-2.0
"""Check of a store's arrays and files against what this package writes: names, types, shapes, sizes.

Before this check, no name from a store is joined to a path, opened or read. zarr gets metadata that is written anew
from the checked values, so it never loads another codec, data type or kind of chunk.
"""

from __future__ import annotations

import contextlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import scratch
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.sentences import capital
from lgvi_warp.control.signals import SAVED, has_shape
from lgvi_warp.engine.block import block_size
from lgvi_warp.results import member_fields
from lgvi_warp.store.layout import KEPT_MEMBER, MEMBER, WEIGHT, StoreArray

# Types of arrays: NumPy's type strings by zarr's names.
TYPES = {"float64": "<f8", "float32": "<f4", "int64": "<i8", "uint16": "<u2", "uint8": "|u1"}
ARRAY_KEYS = {
    "shape", "data_type", "chunk_grid", "chunk_key_encoding", "fill_value", "codecs", "attributes", "dimension_names",
    "zarr_format", "node_type", "storage_transformers",
}  # fmt: skip
# Size of the file of a chunk [bytes].
MOST_CHUNK_BYTES = 1_000_000_000
MOST_DIMENSIONS, MOST_NAME = 8, 200
# Chunks of an array along the times.
MOST_CHUNKS = 1_000_000
KEPT = "kept"
# Characters that some file system takes for a path, a drive or a pattern, and those that control a terminal.
UNFIT = re.compile(r"""[/\\:*?"<>|]|[^ -~\w]|^[. ]|[. ]$""")
REQUIRED = (MEMBER, *(field.name for field in member_fields.EVERY))
FILE = re.compile(
    r"(?:kept(?:\.[^/]+)?/)?(?:zarr\.json|created\.json|blocks/\d{9,12}\.json|parts/\d{9,12}\.npy"
    r"|(?:explicit/)?(?:[^/]+/)?(?:zarr\.json|c(?:\.\d{1,12})*))"
)


class NotOursError(ValueError):
    """Raised if a store's metadata is not what this package writes; the text says what differs."""


def is_name(name: Any) -> bool:
    """Tell whether a name is safe for a folder on every system."""
    return isinstance(name, str) and 0 < len(name.encode(errors="replace")) <= MOST_NAME and not UNFIT.search(name)


def is_file_of_store(name: str) -> bool:
    """Tell whether a run, or a killed process that wrote one, may have left a file of this name."""
    folder, _, last = name.rpartition("/")
    if scratch.is_unfinished(last):
        ends = (dot.start() for dot in re.finditer(r"\.", last))
        return any(FILE.fullmatch(f"{folder}/{last[:end]}".lstrip("/")) for end in ends)
    return bool(FILE.fullmatch(name))


@dataclass(frozen=True)
class StoredArray:
    """An array of a store, described by its checked metadata.

    dtype: NumPy's type string.
    dims: Names of the dimensions.
    """

    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    dtype: str
    dims: tuple[str, ...]
    attributes: dict[str, Any]

    @property
    def bytes(self) -> int:
        """Size of a chunk's file [bytes]: its numbers and their checksum."""
        return math.prod(self.chunk) * np.dtype(self.dtype).itemsize + 4

    @property
    def whole(self) -> bool:
        """Whether the array has exactly one chunk."""
        return self.chunk == self.shape

    def metadata(self) -> dict[str, Any]:
        """Its metadata in zarr's form, with this package's own codecs."""
        (kind,) = (name for name, dtype in TYPES.items() if dtype == self.dtype)
        real = self.dtype[1] == "f"
        numbers = {"name": "bytes"} | ({} if self.dtype == "|u1" else {"configuration": {"endian": "little"}})
        return {
            "shape": list(self.shape),
            "data_type": kind,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": list(self.chunk)}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "."}},
            "fill_value": "NaN" if real else 0,
            "codecs": [numbers, {"name": "crc32c"}],
            "attributes": self.attributes,
            "dimension_names": list(self.dims),
            "zarr_format": 3,
            "node_type": "array",
            "storage_transformers": [],
        }


@dataclass(frozen=True)
class Layout:
    """The arrays of a store.

    arrays: Arrays of the run by name, without those of its kept members.
    columns: The arrays that are written block by block.
    times: Number of sample times.
    """

    arrays: dict[str, StoredArray]
    groups: tuple[str, ...]
    columns: tuple[StoreArray, ...]
    times: int

    def frame(self) -> dict[str, int | None]:
        """Sizes [bytes] of the files that belong to no block, by path below the root; None if unknown."""
        files: dict[str, int | None] = {f"{name}/zarr.json": None for name in (*self.arrays, *self.groups)}
        block_names = {column.name for column in self.columns}
        for name, array in self.arrays.items():
            if name not in block_names:
                files[f"{name}/c{'.0' * len(array.shape)}"] = array.bytes
        return files

    def chunk_bytes(self, key: str) -> int | None:
        """Look up the size of a chunk's file [bytes]; None if the layout has no such file."""
        name, _, last = key.rpartition("/")
        array = self.arrays.get(name)
        if array is None or not re.fullmatch(r"c(\.\d{1,12})*", last):
            return None
        places = [int(index) for index in last.split(".")[1:]]
        counts = [-(-size // chunk) for size, chunk in zip(array.shape, array.chunk, strict=True)]
        inside = len(places) == len(counts) and all(p < c for p, c in zip(places, counts, strict=True))
        return array.bytes if inside else None

    def root(self, attributes: Mapping[str, Any]) -> bytes:
        """The root's metadata for zarr, which contains the metadata of all arrays."""
        group = {"attributes": {}, "zarr_format": 3, "node_type": "group"}
        empty = {"kind": "inline", "must_understand": False, "metadata": {}}
        inner = {name: group | {"consolidated_metadata": empty} for name in self.groups}
        inner |= {name: array.metadata() for name, array in self.arrays.items()}
        consolidated = {"kind": "inline", "must_understand": False, "metadata": inner}
        return json.dumps(group | {"attributes": dict(attributes), "consolidated_metadata": consolidated}).encode()


def layout_of(content: Mapping[str, Any], members: int) -> Layout:
    """Read and check the layout in a root's metadata."""
    inner = _table(_table(content, "zarr.json").get("consolidated_metadata"), "consolidated_metadata").get("metadata")
    arrays, groups = dict[str, StoredArray](), list[str]()
    for name, metadata in _table(inner, "metadata").items():
        if name.partition("/")[0] == KEPT:
            continue  # a group with metadata of its own, which is looked at when it is opened
        if not all(is_name(part) for part in name.split("/")) or name.count("/") > 1:
            raise NotOursError(f"{name!r} is not a name of an array")
        if _table(metadata, name).get("node_type") == "group":
            groups.append(name)
        else:
            arrays[name] = _array(name, metadata)
    parents = {name.partition("/")[0] for name in arrays if "/" in name}
    if not parents <= set(groups) <= {"explicit"}:
        raise NotOursError("it has groups that no run has")
    return _checked(arrays, tuple(groups), members)


def _table(value: Any, name: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise NotOursError(f"{name} is not a table")
    return value


def _array(name: str, metadata: dict[str, Any]) -> StoredArray:
    """Make an array from metadata that must be exactly what this package would write. Raises NotOursError."""
    shape, dims = metadata.get("shape"), metadata.get("dimension_names")
    grid = _table(metadata.get("chunk_grid"), f"chunk_grid of {name}").get("configuration")
    chunk = _table(grid, f"chunk_grid of {name}").get("chunk_shape")
    dtype = TYPES.get(metadata["data_type"]) if isinstance(metadata.get("data_type"), str) else None
    for value, least in ((shape, 0), (chunk, 1)):
        if not isinstance(value, list) or not all(type(n) is int and least <= n < 2**40 for n in value):
            raise NotOursError(f"{name} has the shape {_short(value)}")
    if dtype is None or not isinstance(dims, list) or not all(is_name(dim) for dim in dims):
        raise NotOursError(f"{name} has the type {_short(metadata.get('data_type'))} and the dimensions {_short(dims)}")
    assert isinstance(shape, list)
    assert isinstance(chunk, list)
    if not 0 < len(shape) == len(chunk) == len(dims) <= MOST_DIMENSIONS:
        raise NotOursError(f"{name} has the shape {_short(shape)} and chunks {_short(chunk)}")
    attributes = _table(metadata.get("attributes"), f"attributes of {name}")
    _plain(attributes, f"attributes of {name}")
    described = StoredArray(tuple(shape), tuple(chunk), dtype, tuple(dims), attributes)
    if described.bytes > MOST_CHUNK_BYTES:
        raise NotOursError(f"{name} has chunks of {described.bytes:,} bytes")
    wanted = described.metadata()
    for key in sorted(ARRAY_KEYS | metadata.keys()):
        if metadata.get(key) != wanted.get(key):
            raise NotOursError(f"{key} of {name} is {_short(metadata.get(key))}, not {_short(wanted.get(key))}")
    return described


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _plain(attributes: Mapping[str, Any], name: str) -> None:
    """Check that attributes of an array are texts, numbers and lists of them. Raises NotOursError."""
    for key, value in attributes.items():
        single = value if isinstance(value, list) else [value]
        if not is_text(key) or not all(is_text(item) or type(item) in (int, float) for item in single):
            raise NotOursError(f"{name}: {_short(key)} is {_short(value)}")


def is_text(value: Any) -> bool:
    """Tell whether a value is a text without terminal control characters."""
    return isinstance(value, str) and (value.isprintable() or value.replace("\n", " ").isprintable())


def _checked(arrays: dict[str, StoredArray], groups: tuple[str, ...], members: int) -> Layout:
    """Make the layout of arrays, which must be consistent with each other and with the run. Raises NotOursError."""
    if missing := [name for name in ("time", "step", *REQUIRED) if name not in arrays]:
        raise NotOursError(f"it has no {', '.join(missing)}")
    k, length = arrays["time"].shape[0], min(block_size(members), members)
    along = KEPT_MEMBER if KEPT_MEMBER in arrays else MEMBER
    fixed = {"time": ("<f8", (k,)), "step": ("<i8", (k,))}
    fixed |= {KEPT_MEMBER: ("<i8", (members,)), "chosen": ("|u1", (members,))}
    of_members = {item.name: item.dtype for item in member_fields.FIELDS} | {MEMBER: "<i8", WEIGHT: "<f8"}
    columns = []
    for name, array in arrays.items():
        timed = name in SAVED
        if name.startswith("explicit/"):
            good = array.whole and array.bytes <= MOST_CHUNK_BYTES
        elif name in fixed:
            good = array.whole and (array.dtype, array.shape) == fixed[name]
        elif timed:
            good = array.dtype[1] == "f" and array.shape[:2] == (k, members) and has_shape(name, array.shape[2:])
            good = good and array.chunk[1:] == (length, *array.shape[2:]) and -(-k // array.chunk[0]) <= MOST_CHUNKS
        else:
            good = array.dtype == of_members.get(name, "<f8" if "." in name else "")
            good = good and array.shape[0] == members and array.chunk == (length, *array.shape[1:])
            good = good and (len(array.shape) == 1 or "." in name)
        if not good:
            raise NotOursError(f"{name} has the type {array.dtype}, shape {array.shape} and chunks {array.chunk}")
        if name not in fixed and not name.startswith("explicit/"):
            tail, times = array.shape[1 + timed :], array.chunk[0] if timed else 0
            columns.append(StoreArray(name, tail, array.dtype, length, times, array.attributes, along))
    return Layout(arrays, groups, tuple(columns), k)


@contextlib.contextmanager
def corrupt_store_as_scene_error(path: Path) -> Iterator[None]:
    """Turn errors that arise while a store is read into SceneErrors that name the file."""
    try:
        yield
    except SceneError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, ArithmeticError, RecursionError) as error:
        text = " ".join(str(error).split())[:200] or type(error).__name__
        reason = text if isinstance(error, NotOursError) else f"cannot be used ({type(error).__name__}: {text})"
        remedy = "ask for the run anew, or run it again"
        raise SceneError([f"{path} is not what lgvi-warp writes: {reason}. {capital(remedy)}"]) from error


def is_sum(value: Any) -> bool:
    """Tell whether a value is a list of a size and a checksum."""
    return isinstance(value, list) and len(value) == 2 and all(type(number) is int and number >= 0 for number in value)
