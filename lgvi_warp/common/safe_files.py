"""Files below a folder that may be somebody else's: no link is followed, and only plain files are opened.

Each folder on the way is opened in the one above it, so that a link that is put there meanwhile is not followed either.
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

# A JSON file of a store is a few kilobytes; one with millions of indices has some tens of megabytes.
MOST_JSON = 64_000_000
BY_DESCRIPTOR = os.open in os.supports_dir_fd and os.rename in os.supports_dir_fd and hasattr(os, "O_NOFOLLOW")
_PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
_FOLDER = getattr(os, "O_DIRECTORY", 0) | os.O_RDONLY | _PLAIN


def refused(path: Path, what: str) -> SceneError:
    """A file that a store never holds."""
    remedy = "take it away, and what it leads to is left alone" if what == "is a link" else "take it away"
    return SceneError([f"{path}: {what}, where a store has plain files and folders only; {remedy}"])


def kind(mode: int) -> str:
    """What a file is that is not a plain one."""
    return "is a link" if stat.S_ISLNK(mode) else "is a folder" if stat.S_ISDIR(mode) else "is a device, pipe or socket"


@contextlib.contextmanager
def folder(root: Path, inner: Path) -> Iterator[int | None]:
    """A descriptor of a folder below the root, which itself may be a link; None where a system has none for folders.

    Raises SceneError where a link is on the way, OSError.
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
    """A folder within an open one, which is closed. Raises SceneError for a link."""
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
    """A plain file below the root, for reading. Raises SceneError for links, pipes and devices, FileNotFoundError, OSError."""
    path = root / key
    with folder(root, path.parent) as inside:
        where: Any = path if inside is None else path.name
        # A device is not even opened: that alone may do something.
        _check_file(os.stat(where, dir_fd=inside, follow_symlinks=False).st_mode, path)
        try:
            descriptor = os.open(where, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _PLAIN, dir_fd=inside)
        except OSError as error:
            error.filename = str(path)
            raise
    with open(descriptor, "rb", buffering=0) as file:
        _check_file(os.fstat(descriptor).st_mode, path)
        yield file


def _check_file(mode: int, path: Path) -> None:
    if not stat.S_ISREG(mode):
        raise refused(path, kind(mode))


def read(root: Path, key: str, most: int) -> bytes:
    """A plain file below the root, of so many bytes at most. Raises SceneError, FileNotFoundError, OSError."""
    with opened(root, key) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most:
            raise SceneError([f"{root / key}: has {size:,} bytes, where {most:,} are the most; it is no file of a run"])
        return file.read(size)


def read_json(root: Path, key: str) -> Any:
    """A JSON file below the root. Raises ValueError where it is none, SceneError, OSError."""
    return parsed(read(root, key, MOST_JSON))


def parsed(text: str | bytes) -> Any:
    """JSON as Python's objects. Raises ValueError where it is none, or nested too deep."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("is nested too deep") from None


@contextlib.contextmanager
def created(root: Path, path: Path) -> Iterator[BinaryIO]:
    """A new file below the root, for writing. Raises SceneError where a folder on the way is a link, OSError."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _PLAIN
    with folder(root, path.parent) as inside:
        where = path if inside is None else path.name
        file = open(path, "wb", buffering=0, opener=lambda *_: os.open(where, flags, 0o666, dir_fd=inside))  # noqa: SIM115
    with file:
        yield file


def rename(root: Path, path: Path, target: Path) -> None:
    """Rename a file within its folder below the root; a link that has the target's name is replaced, not followed."""
    with folder(root, path.parent) as inside:
        if inside is None:
            path.replace(target)
        else:
            os.replace(path.name, target.name, src_dir_fd=inside, dst_dir_fd=inside)


# Folders within folders: a run has two of them, one with kept members four.
MOST_DEEP = 8


def entries(root: Path, below: str = "") -> Iterator[tuple[str, os.DirEntry[str]]]:
    """All that lies below the root, with its name from there; links are not followed. SceneError if too deep."""
    if below.count("/") > MOST_DEEP:
        raise SceneError([f"{root / below}: is deeper than the folders of a run are; take it away"])
    with os.scandir(root / below) as found:
        for entry in sorted(found, key=lambda one: one.name):
            name = f"{below}{entry.name}"
            yield name, entry
            if entry.is_dir(follow_symlinks=False):
                yield from entries(root, f"{name}/")


def names(root: Path, key: str) -> set[str]:
    """Names in a folder below the root, none of one that is not there. Raises SceneError where it is a link."""
    try:
        with folder(root, root / key) as inside:
            return set(os.listdir(root / key if inside is None else inside))
    except FileNotFoundError:
        return set()


def size_below(root: Path) -> int:
    """Bytes of all plain files below a folder."""
    plain = (one for _, one in entries(root) if one.is_file(follow_symlinks=False))
    return sum(one.stat(follow_symlinks=False).st_size for one in plain)


def refuse_links(root: Path) -> None:
    """Raise SceneError where a link, device or pipe lies below the root."""
    for name, entry in entries(root):
        if not entry.is_dir(follow_symlinks=False):
            _check_file(entry.stat(follow_symlinks=False).st_mode, root / name)
