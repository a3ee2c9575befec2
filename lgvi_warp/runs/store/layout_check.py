"""What a store says of its arrays and files, checked against what this package writes: names, types, shapes, sizes.

Nothing that a store says is joined to a path, opened or read before it has been found here. zarr gets metadata that is
written anew from what was found, so that no other codec, data type or kind of chunk is ever looked for.
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
from lgvi_warp.engine.block import SHAPES, block_size
from lgvi_warp.runs import member_fields
from lgvi_warp.runs.store.layout import KEPT_MEMBER, MEMBER, Column

# Types of arrays: zarr's names, NumPy's.
TYPES = {"float64": "<f8", "float32": "<f4", "int64": "<i8", "uint16": "<u2", "uint8": "|u1"}
CODECS = ("bytes", "crc32c")
ARRAY_KEYS = {
    "shape", "data_type", "chunk_grid", "chunk_key_encoding", "fill_value", "codecs", "attributes", "dimension_names",
    "zarr_format", "node_type", "storage_transformers",
}  # fmt: skip
GROUP_KEYS = {"attributes", "zarr_format", "node_type", "consolidated_metadata"}
# Of a chunk, as a file.
MOST_CHUNK_BYTES = 1_000_000_000
MOST_DIMENSIONS, MOST_NAME = 8, 200
# Of an array, along the time.
MOST_CHUNKS = 1_000_000
KEPT = "kept"
# What a file system somewhere takes for a path, a drive or a pattern, and what would write on a terminal.
UNFIT = re.compile(r"""[/\\:*?"<>|]|[^ -~\w]|^[. ]|[. ]$""")
REQUIRED = (MEMBER, *(one.name for one in member_fields.FIELDS if not one.name.startswith("steps_")))
FILE = re.compile(
    r"(?:kept(?:\.[^/]+)?/)?(?:zarr\.json|created\.json|blocks/\d{9,12}\.json|parts/\d{9,12}\.npy"
    r"|(?:explicit/)?(?:[^/]+/)?(?:zarr\.json|c(?:\.\d{1,12})*))"
)


class NotOursError(ValueError):
    """A store says what this package does not write; the text says what."""


def is_name(name: Any) -> bool:
    """Whether a folder of a store may be called so on every system: printed letters, no path, no drive, no wild card."""
    return isinstance(name, str) and 0 < len(name.encode(errors="replace")) <= MOST_NAME and not UNFIT.search(name)


def is_file_of_store(name: str) -> bool:
    """Whether a run, or a writer of one that was killed, may have left a file called so below its folder."""
    folder, _, last = name.rpartition("/")
    if scratch.is_unfinished(last):
        return any(bool(FILE.fullmatch(f"{folder}/{last[:place]}".lstrip("/"))) for place in _dots(last))
    return bool(FILE.fullmatch(name))


def _dots(text: str) -> list[int]:
    return [place for place, letter in enumerate(text) if letter == "."]


@dataclass(frozen=True)
class StoredArray:
    """An array of a store as its metadata tells, after the check: shape of the array and of its chunks, NumPy's type."""

    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    dtype: str
    dims: tuple[str, ...]
    attributes: dict[str, Any]

    @property
    def bytes(self) -> int:
        """Of a chunk's file: its numbers and their checksum."""
        return math.prod(self.chunk) * np.dtype(self.dtype).itemsize + 4

    @property
    def whole(self) -> bool:
        """Whether it has one chunk."""
        return self.chunk == self.shape

    def metadata(self) -> dict[str, Any]:
        """As zarr writes it, of this package's own codecs."""
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
    """The arrays of a store: those of its run, by name, and the names of its groups; columns: those written by blocks."""

    arrays: dict[str, StoredArray]
    groups: tuple[str, ...]
    columns: tuple[Column, ...]
    times: int

    def frame(self) -> dict[str, int | None]:
        """Files that belong to no block, below the root, and their sizes where these are known."""
        files: dict[str, int | None] = {f"{name}/zarr.json": None for name in (*self.arrays, *self.groups)}
        own = {one.name for one in self.columns}
        for name, array in self.arrays.items():
            if name not in own:
                files[f"{name}/c{'.0' * len(array.shape)}"] = array.bytes
        return files

    def chunk_bytes(self, key: str) -> int | None:
        """The size of a chunk's file; None where the layout has no such file."""
        name, _, last = key.rpartition("/")
        array = self.arrays.get(name)
        if array is None or not re.fullmatch(r"c(\.\d{1,12})*", last):
            return None
        places = [int(one) for one in last.split(".")[1:]]
        counts = [-(-size // chunk) for size, chunk in zip(array.shape, array.chunk, strict=True)]
        inside = len(places) == len(counts) and all(p < c for p, c in zip(places, counts, strict=True))
        return array.bytes if inside else None

    def root(self, attributes: Mapping[str, Any]) -> bytes:
        """The root's metadata for zarr, with that of all arrays in it."""
        group = {"attributes": {}, "zarr_format": 3, "node_type": "group"}
        empty = {"kind": "inline", "must_understand": False, "metadata": {}}
        inner = {name: group | {"consolidated_metadata": empty} for name in self.groups}
        inner |= {name: array.metadata() for name, array in self.arrays.items()}
        whole = {"kind": "inline", "must_understand": False, "metadata": inner}
        return json.dumps(group | {"attributes": dict(attributes), "consolidated_metadata": whole}).encode()


def layout_of(content: Mapping[str, Any], members: int) -> Layout:
    """The layout that the root's metadata tells, of a run of so many members. Raises NotOursError."""
    inner = _table(_table(content, "zarr.json").get("consolidated_metadata"), "consolidated_metadata").get("metadata")
    arrays, groups = dict[str, StoredArray](), list[str]()
    for name, one in _table(inner, "metadata").items():
        if name.partition("/")[0] == KEPT:
            continue  # a group with metadata of its own, which is looked at when it is opened
        if not all(is_name(part) for part in name.split("/")) or name.count("/") > 1:
            raise NotOursError(f"{name!r} is no name of an array")
        if _table(one, name).get("node_type") == "group":
            groups.append(name)
        else:
            arrays[name] = _array(name, one)
    if any(name != "explicit" for name in groups) or any(
        "/" in name and not (name.startswith("explicit/") and "explicit" in groups) for name in arrays
    ):
        raise NotOursError("it has groups that no run has")
    return _checked(arrays, tuple(groups), members)


def _table(value: Any, name: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise NotOursError(f"{name} is no table")
    return value


def _array(name: str, one: dict[str, Any]) -> StoredArray:
    """An array whose metadata is the same as this package would write. Raises NotOursError."""
    shape, dims = one.get("shape"), one.get("dimension_names")
    grid = _table(one.get("chunk_grid"), f"chunk_grid of {name}").get("configuration")
    chunk = _table(grid, f"chunk_grid of {name}").get("chunk_shape")
    dtype = TYPES.get(one["data_type"]) if isinstance(one.get("data_type"), str) else None
    for value, least in ((shape, 0), (chunk, 1)):
        if not isinstance(value, list) or not all(type(n) is int and least <= n < 2**40 for n in value):
            raise NotOursError(f"{name} has the shape {_short(value)}")
    if dtype is None or not isinstance(dims, list) or not all(is_name(dim) for dim in dims):
        raise NotOursError(f"{name} has the type {_short(one.get('data_type'))} and the dimensions {_short(dims)}")
    assert isinstance(shape, list) and isinstance(chunk, list)
    if not 0 < len(shape) == len(chunk) == len(dims) <= MOST_DIMENSIONS:
        raise NotOursError(f"{name} has the shape {_short(shape)} and chunks {_short(chunk)}")
    attributes = _table(one.get("attributes"), f"attributes of {name}")
    _plain(attributes, f"attributes of {name}")
    found = StoredArray(tuple(shape), tuple(chunk), dtype, tuple(dims), attributes)
    if found.bytes > MOST_CHUNK_BYTES:
        raise NotOursError(f"{name} has chunks of {found.bytes:,} bytes")
    wanted = found.metadata()
    for key in sorted(ARRAY_KEYS | one.keys()):
        if one.get(key) != wanted.get(key):
            raise NotOursError(f"{key} of {name} is {_short(one.get(key))}, not {_short(wanted.get(key))}")
    return found


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _plain(attributes: Mapping[str, Any], name: str) -> None:
    """Attributes of an array are texts, numbers and lists of them. Raises NotOursError."""
    for key, value in attributes.items():
        single = value if isinstance(value, list) else [value]
        if not is_text(key) or not all(is_text(one) or type(one) in (int, float) for one in single):
            raise NotOursError(f"{name}: {_short(key)} is {_short(value)}")


def is_text(value: Any) -> bool:
    """Whether it is a text without what would write on a terminal but letters."""
    return isinstance(value, str) and (value.isprintable() or value.replace("\n", " ").isprintable())


def _checked(arrays: dict[str, StoredArray], groups: tuple[str, ...], members: int) -> Layout:
    """Arrays that fit each other and the run. Raises NotOursError."""
    missing = [name for name in ("time", "step", *REQUIRED) if name not in arrays]
    if missing:
        raise NotOursError(f"it has no {', '.join(missing)}")
    k, length = arrays["time"].shape[0], min(block_size(members), members)
    along = KEPT_MEMBER if KEPT_MEMBER in arrays else MEMBER
    fixed = {
        "time": ("<f8", (k,)),
        "step": ("<i8", (k,)),
        KEPT_MEMBER: ("<i8", (members,)),
        "chosen": ("|u1", (members,)),
    }
    of_members = {one.name: one.dtype for one in member_fields.FIELDS} | {MEMBER: "<i8"}
    columns = []
    for name, array in arrays.items():
        timed = name in SHAPES
        if name.startswith("explicit/"):
            good = array.whole and array.bytes <= MOST_CHUNK_BYTES
        elif name in fixed:
            good = array.whole and (array.dtype, array.shape) == fixed[name]
        elif timed:
            good = array.dtype[1] == "f" and array.shape == (k, members, *SHAPES[name]) and array.chunk[1] == length
            good = good and array.chunk[2:] == array.shape[2:] and -(-k // array.chunk[0]) <= MOST_CHUNKS
        else:
            good = array.dtype == of_members.get(name, "<f8" if "." in name else "")
            good = good and array.shape[0] == members and array.chunk == (length, *array.shape[1:])
            good = good and (len(array.shape) == 1 or "." in name)
        if not good:
            raise NotOursError(f"{name} has the type {array.dtype}, shape {array.shape} and chunks {array.chunk}")
        if name not in fixed and not name.startswith("explicit/"):
            tail, times = array.shape[1 + timed :], array.chunk[0] if timed else 0
            columns.append(Column(name, tail, array.dtype, length, times, array.attributes, along))
    return Layout(arrays, groups, tuple(columns), k)


@contextlib.contextmanager
def understood(path: Path) -> Iterator[None]:
    """What is no error of its own while a file is read is one of the file. Raises SceneError."""
    try:
        yield
    except SceneError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, ArithmeticError, RecursionError) as error:
        text = " ".join(str(error).split())[:200] or type(error).__name__
        what = text if isinstance(error, NotOursError) else f"cannot be used ({type(error).__name__}: {text})"
        raise SceneError(
            [f"{path}: is not what lgvi-warp writes: {what}; ask for the run anew, or run it again"]
        ) from error


def is_sum(value: Any) -> bool:
    """Whether it is a size and a checksum."""
    return isinstance(value, list) and len(value) == 2 and all(type(one) is int and one >= 0 for one in value)
