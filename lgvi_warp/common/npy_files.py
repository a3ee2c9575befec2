"""Arrays in the form of .npy, one after another in a file or each in an .npz, that may be somebody else's.

NumPy's own reader makes room for what a header promises before it looks whether the file has it; here the file's size says
how much there can be. Only numbers, truth values and texts are read: nothing is unpickled.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from lgvi_warp.common import safe_files

KINDS = "biufU"
# A list of files in an .npz, and how many there are: a result has some tens, with statistics some hundreds.
MOST_LIST, MOST_ARRAYS = 4_000_000, 20_000


@contextlib.contextmanager
def opened(root: Path, key: str) -> Iterator[Iterator[np.ndarray]]:
    """The arrays of a file below the root, in turn. Raises ValueError, SceneError, OSError."""
    with safe_files.opened(root, key) as raw:
        left = os.fstat(raw.fileno()).st_size
        with io.BufferedReader(raw) as file:  # type: ignore[type-var]
            yield _in_turn(file, left)


def _in_turn(file: BinaryIO, size: int) -> Iterator[np.ndarray]:
    while file.tell() < size:
        yield read(file, size - file.tell())


def read(file: Any, left: int) -> np.ndarray:
    """One array of a stream that has so many bytes left. Raises ValueError where it is none, or longer than that."""
    shape, fortran, dtype = _described(file)
    count = math.prod(shape)
    if dtype.kind not in KINDS or dtype.itemsize == 0 or count * dtype.itemsize > left:
        raise ValueError(f"promises an array of type {dtype} and shape {shape}, which is not in the file")
    array = np.empty(count, dtype)
    view = memoryview(array.view(np.uint8).data) if count else memoryview(b"")
    while len(view):
        if not (got := file.readinto(view)):
            raise ValueError("is torn")
        view = view[got:]
    return array.reshape(shape, order="F" if fortran else "C")


def _described(file: Any) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """(shape, whether columns come first, type) of an array, from its header. Raises ValueError."""
    try:
        if np.lib.format.read_magic(file) != (1, 0):
            raise ValueError("is no array of the version of NumPy's format that is written")
        return np.lib.format.read_array_header_1_0(file)
    except (SyntaxError, TypeError, RecursionError, MemoryError, ValueError) as error:
        raise ValueError(f"has a header that cannot be read ({' '.join(str(error).split())[:100]})") from None


def text(arrays: Iterator[np.ndarray]) -> str:
    """The next of several arrays, which is one text. Raises ValueError."""
    array = next(arrays, np.zeros(0))
    if array.dtype.kind != "U" or array.shape:
        raise ValueError("does not begin with a text")
    return str(array)


class _Careful(io.BufferedReader):
    """A file of which only so many bytes are read at once: a list of files in an .npz may be as long as that file."""

    most = MOST_LIST

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or size < 0:
            size = os.fstat(self.fileno()).st_size - self.tell()
        if size > self.most:
            raise zipfile.BadZipFile("its list of files is too long")
        return super().read(size)


def of_npz(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """All arrays of an .npz file, by name: stored as they are, each once, no more than the file has room for.

    Raises ValueError where it is no such file, or damaged, OSError.
    """
    with open(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb", buffering=0) as raw:
        found = os.fstat(raw.fileno())
        if not stat.S_ISREG(found.st_mode):
            raise ValueError(safe_files.kind(found.st_mode))
        try:
            with _Careful(raw) as file, zipfile.ZipFile(file) as archive:
                return _arrays(archive, file, found.st_size)
        except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, OverflowError) as error:
            raise ValueError(f"is torn or no .npz file ({error})") from None


def _arrays(archive: zipfile.ZipFile, file: _Careful, size: int) -> dict[str, np.ndarray]:
    members = archive.infolist()
    if len(members) > MOST_ARRAYS:
        raise ValueError(f"has {len(members):,} arrays")
    if any(one.compress_type != zipfile.ZIP_STORED for one in members):
        raise ValueError("is compressed, which no result is")
    if sum(one.file_size for one in members) > size or any(one.file_size != one.compress_size for one in members):
        raise ValueError("promises more bytes than it has")
    file.most = max(size, MOST_LIST)
    arrays = {}
    for one in members:
        with archive.open(one) as stream:
            arrays[one.filename.removesuffix(".npy")] = read(stream, one.file_size)
            if stream.read(1):  # to the end, where the checksum is compared
                raise ValueError(f"{one.filename} is longer than its array")
    return arrays
