# SPDX-License-Identifier: Apache-2.0
"""Reader of arrays in .npy format, in a sequence or in an .npz archive, from untrusted files; and a writer.

NumPy's own reader allocates the size in a header before it checks the size of the file. Here the file's size bounds
every array. Only numbers, truth values and texts are read: nothing is unpickled.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common import reading, safe_files

KINDS = "biufU"
# Most bytes of an .npz's list of files, and most arrays: a result has some tens, with statistics some hundreds.
MOST_LIST, MOST_ARRAYS = 4_000_000, 20_000


@contextlib.contextmanager
def opened(root: Path, key: str) -> Iterator[Iterator[np.ndarray]]:
    """Open a file of several arrays below a root folder."""
    with safe_files.opened(root, key) as raw:
        size = os.fstat(raw.fileno()).st_size
        with io.BufferedReader(raw) as file:  # type: ignore[type-var]
            yield _in_turn(file, size)


def _in_turn(file: BinaryIO, size: int) -> Iterator[np.ndarray]:
    while file.tell() < size:
        yield read(file, size - file.tell())


def read(file: Any, bytes_left: int) -> np.ndarray:
    """Read one array from a stream."""
    shape, fortran, dtype = _described(file)
    count = math.prod(shape)
    if dtype.kind not in KINDS or dtype.itemsize == 0 or count * dtype.itemsize > bytes_left:
        raise ValueError(f"promises an array of type {dtype} and shape {shape}, which is not in the file")
    array = np.empty(count, dtype)
    view = memoryview(array.view(np.uint8).data) if count else memoryview(b"")
    while len(view):
        if not (got := file.readinto(view)):
            raise ValueError("is torn")
        view = view[got:]
    return array.reshape(shape, order="F" if fortran else "C")


def _described(file: Any) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read (shape, whether in column-major order, type) of an array from its header. Raises ValueError."""
    try:
        if np.lib.format.read_magic(file) != (1, 0):
            raise ValueError("is an array in another version of NumPy's format than runs write")
        return np.lib.format.read_array_header_1_0(file)
    except (SyntaxError, TypeError, RecursionError, MemoryError, ValueError) as error:
        raise ValueError(f"has a header that cannot be read ({' '.join(str(error).split())[:100]})") from None


def text(arrays: Iterator[np.ndarray]) -> str:
    """Take the next array, which must be one text."""
    array = next(arrays, np.zeros(0))
    if array.dtype.kind != "U" or array.shape:
        raise ValueError("does not begin with a text")
    return str(array)


class _Careful(io.BufferedReader):
    """A file that limits the bytes of one read: a damaged .npz may claim an endless list of files."""

    most = MOST_LIST

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or size < 0:
            size = os.fstat(self.fileno()).st_size - self.tell()
        if size > self.most:
            raise zipfile.BadZipFile("its list of files is too long")
        return super().read(size)


def of_npz(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Read all arrays of an .npz file, each once, and at most as many bytes as the file can contain."""
    with reading.opened(path, "NumPy file") as raw:
        try:
            with _Careful(raw) as file, zipfile.ZipFile(file) as archive:  # type: ignore[arg-type]
                return _arrays(archive, file, os.fstat(raw.fileno()).st_size)
        except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, OverflowError) as error:
            raise ValueError(f"is torn or no .npz file ({error})") from None


def write_npz(
    path: str | os.PathLike[str], arrays: Mapping[str, Any], root: str | os.PathLike[str] | None = None
) -> Path:
    """Write arrays to an .npz file. It is complete or does not appear, and the same arrays give the same bytes."""
    with durable.placed(path, root) as beside, beside.open("xb") as file:
        np.savez(file, **arrays)
    return Path(path)


def _arrays(archive: zipfile.ZipFile, file: _Careful, size: int) -> dict[str, np.ndarray]:
    members = archive.infolist()
    if len(members) > MOST_ARRAYS:
        raise ValueError(f"has {len(members):,} arrays")
    if any(member.compress_type != zipfile.ZIP_STORED for member in members):
        raise ValueError("is compressed, which no result is")
    stored = all(member.file_size == member.compress_size for member in members)
    if not stored or sum(member.file_size for member in members) > size:
        raise ValueError("promises more bytes than it has")
    file.most = max(size, MOST_LIST)
    arrays = {}
    for member in members:
        with archive.open(member) as stream:
            arrays[member.filename.removesuffix(".npy")] = read(stream, member.file_size)
            if stream.read(1):  # zipfile compares the checksum at the end
                raise ValueError(f"{member.filename} is longer than its array")
    return arrays
