# SPDX-License-Identifier: Apache-2.0
"""Files in a folder of unknown origin: no link out of it is followed, and only plain files are opened.

A store contains no links at all: each folder of a path is opened relative to its parent, so that a link that is placed
there during the access is not followed either.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.sentences import capital, sentences

# Most bytes of a JSON file: a store's has a few kilobytes, with millions of indices some tens of megabytes; and most tables
# and lists within each other: a scene has up to 24, which a study's file holds in some more.
MOST_JSON, MOST_NESTED = 64_000_000, 64
BY_DESCRIPTOR = os.open in os.supports_dir_fd and os.rename in os.supports_dir_fd and hasattr(os, "O_NOFOLLOW")
_PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
_FOLDER = getattr(os, "O_DIRECTORY", 0) | os.O_RDONLY | _PLAIN


def refused(path: Path, problem: str) -> SceneError:
    """Make the error for a kind of file that a store never contains."""
    remedy = "take it away, and what it leads to is left alone" if problem == "is a link" else "take it away"
    return SceneError([sentences(path, f"{problem}, where a run has plain files and folders only", remedy)])


KINDS = {
    stat.S_IFLNK: "is a link",
    stat.S_IFDIR: "is a folder",
    stat.S_IFIFO: "is a named pipe",
    stat.S_IFCHR: "is a device",
    stat.S_IFBLK: "is a device",
    stat.S_IFSOCK: "is a socket",
}


def kind(mode: int) -> str:
    """Name the kind of a file that is not a plain file."""
    return "" if stat.S_ISREG(mode) else KINDS.get(stat.S_IFMT(mode), "is not a plain file")


def inside(root: str | os.PathLike[str], name: str | os.PathLike[str]) -> Path:
    """Resolve a file in a folder with its links, whether it exists or not; a file outside the folder is refused."""
    home, path = (Path(os.path.realpath(place)) for place in (root, Path(root) / name))
    if not path.is_relative_to(home):
        remedy = "put a copy in its place, or name that file yourself"
        raise SceneError([f"{Path(root) / name}: leads out of its folder, to {path}. {capital(remedy)}"])
    return path


@contextlib.contextmanager
def named(path: Path) -> Iterator[None]:
    """Add the name of this file to an OSError raised inside the `with` block."""
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        raise


@contextlib.contextmanager
def folder(root: Path, inner: Path) -> Iterator[int | None]:
    """Open a folder below a root, without following links; the root itself may be one.

    Yields: A file descriptor; None on a system without descriptors for folders.
    """
    steps = inner.relative_to(root).parts
    if not BY_DESCRIPTOR:
        for i in range(len(steps)):
            _check_folder(os.lstat(root.joinpath(*steps[: i + 1])).st_mode, root.joinpath(*steps[: i + 1]))
        yield None
        return
    descriptor = os.open(root, _FOLDER & ~getattr(os, "O_NOFOLLOW", 0))
    try:
        for i, step in enumerate(steps):
            descriptor = _entered(descriptor, step, root.joinpath(*steps[: i + 1]))
        yield descriptor
    finally:
        os.close(descriptor)


def _entered(descriptor: int, step: str, path: Path) -> int:
    """Open a folder within an open folder, and close the outer one. Raises SceneError for a link."""
    try:
        inner = os.open(step, _FOLDER, dir_fd=descriptor)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.ENOTDIR):
            _check_folder(os.stat(step, dir_fd=descriptor, follow_symlinks=False).st_mode, path)
        error.filename = str(path)
        raise
    os.close(descriptor)
    return inner


def _check_folder(mode: int, path: Path) -> None:
    if not stat.S_ISDIR(mode):
        raise refused(path, "is a plain file" if stat.S_ISREG(mode) else kind(mode))


@contextlib.contextmanager
def opened(root: Path, key: str) -> Iterator[BinaryIO]:
    """Open a plain file below a root for reading."""
    path = root / key
    with folder(root, path.parent) as inside:
        where: Any = path if inside is None else path.name
        # A device is not even opened, since that may have effects.
        _check_file(os.stat(where, dir_fd=inside, follow_symlinks=False).st_mode, path)
        with named(path):
            descriptor = os.open(where, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _PLAIN, dir_fd=inside)
    with open(descriptor, "rb", buffering=0) as file:
        _check_file(os.fstat(descriptor).st_mode, path)
        yield file


def _check_file(mode: int, path: Path) -> None:
    if not stat.S_ISREG(mode):
        raise refused(path, kind(mode))


def read(root: Path, key: str, most: int) -> bytes:
    """Read a plain file below a root, of at most this many bytes."""
    with opened(root, key) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most:
            raise SceneError(
                [f"{root / key} has {size:,} bytes, where {most:,} are the most. It is not a file of a run"]
            )
        return file.read(size)


def read_json(root: Path, key: str) -> Any:
    """Read a JSON file below a root."""
    return parsed(read(root, key, MOST_JSON))


def parsed(text: str | bytes) -> Any:
    """Parse JSON into Python's objects."""
    try:
        content = json.loads(text)
    except RecursionError:
        raise ValueError("is nested too deep") from None
    level = [content]
    for _ in range(MOST_NESTED):
        level = [value for value in level if isinstance(value, dict | list)]
        if not level:
            return content
        level = [item for value in level for item in (value.values() if isinstance(value, dict) else value)]
    raise ValueError("is nested too deep")


@contextlib.contextmanager
def created(root: Path, path: Path) -> Iterator[BinaryIO]:
    """Create a new file below a root for writing."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _PLAIN
    with folder(root, path.parent) as inside:
        where = path if inside is None else path.name
        file = open(path, "wb", buffering=0, opener=lambda *_: os.open(where, flags, 0o666, dir_fd=inside))  # noqa: SIM115
    with file:
        yield file


def rename(root: Path, path: Path, target: Path) -> None:
    """Rename a file within its folder below a root; an existing link of that name is replaced, not followed."""
    with folder(root, path.parent) as inside:
        if inside is None:
            path.replace(target)
        else:
            os.replace(path.name, target.name, src_dir_fd=inside, dst_dir_fd=inside)


# Most nested folders: a run has two levels, one with kept members four.
MOST_DEEP = 8


def entries(root: Path, below: str = "") -> Iterator[tuple[str, os.DirEntry[str]]]:
    """(path from the root, directory entry) of everything below a root, in order of names; links are not followed."""
    if below.count("/") > MOST_DEEP:
        raise SceneError([f"{root / below} lies deeper than the folders of a run do. Remove it"])
    with os.scandir(root / below) as listing:
        for entry in sorted(listing, key=lambda item: item.name):
            name = f"{below}{entry.name}"
            yield name, entry
            if entry.is_dir(follow_symlinks=False):
                yield from entries(root, f"{name}/")


def names(root: Path, key: str) -> set[str]:
    """List the names in a folder below a root."""
    try:
        with folder(root, root / key) as inside:
            return set(os.listdir(root / key if inside is None else inside))
    except FileNotFoundError:
        return set()


def size_below(root: Path) -> int:
    """Size of the plain files below a folder [bytes]."""
    plain = (entry for _, entry in entries(root) if entry.is_file(follow_symlinks=False))
    return sum(entry.stat(follow_symlinks=False).st_size for entry in plain)


def refuse_links(root: Path) -> None:
    """Refuse a folder that contains anything but plain files and folders."""
    for name, entry in entries(root):
        if not entry.is_dir(follow_symlinks=False):
            _check_file(entry.stat(follow_symlinks=False).st_mode, root / name)
