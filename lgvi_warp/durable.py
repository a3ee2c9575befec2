"""Files that outlive a crash: written whole, synced, and put into their place by a rename."""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import socket
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

UNFINISHED = ".part"


def checksum(data: Any, before: int = 0) -> int:
    """CRC-32C of bytes or a contiguous array, as zarr's crc32c codec has it, after data that had the checksum `before`."""
    import google_crc32c

    view = memoryview(data)
    # The extension takes an array, and no memoryview.
    return int(google_crc32c.extend(before, np.frombuffer(view, np.uint8))) if view.nbytes else before


@functools.cache
def _syncs() -> ThreadPoolExecutor:
    """Threads that wait for the disk."""
    return ThreadPoolExecutor(16, thread_name_prefix="lgvi_warp_sync")


def sync_file(names: tuple[Path, Path]) -> None:
    """Wait until a file is on the disk: where it lies, and what it will be called."""
    beside, target = names
    descriptor = os.open(beside, os.O_RDONLY)
    try:
        with named(target):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_folder(folder: Path) -> None:
    """Wait until the names in a folder are on the disk; a system that cannot sync folders is left alone."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(PermissionError):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


class Files:
    """Files that come into being together: `write` each, then `finish` all.

    Until then they lie beside their places under another name, so that what was there stays whole.
    """

    def __init__(self, root: Path):
        self._root, self._waiting = root, list[tuple[Path, Path]]()
        self._mark = f".{socket.gethostname()}-{os.getpid()}{UNFINISHED}"
        self.sums: dict[str, list[int]] = {}

    def write(self, key: str, data: Any, *, checked: bool = False) -> None:
        """Write a file below the root, and note its size and checksum; checked: with the data's own checksum at its end."""
        target = self._root / key
        beside = target.with_name(target.name + self._mark)
        self._waiting.append((beside, target))
        view = memoryview(data).cast("B")
        crc = checksum(view)
        tail = crc.to_bytes(4, "little") if checked else b""
        with named(target), beside.open("wb", buffering=0) as file:
            write_all(file, view)
            write_all(file, memoryview(tail))
        self.sums[key] = [len(view) + len(tail), checksum(tail, crc)]

    def finish(self) -> None:
        """Sync the files, put them in their places, and sync their folders."""
        # Syncs that run side by side share the file system's commits.
        list(_syncs().map(sync_file, self._waiting))
        for beside, target in self._waiting:
            beside.replace(target)
        list(_syncs().map(sync_folder, sorted({target.parent for _, target in self._waiting})))
        self._waiting.clear()

    def drop(self) -> None:
        """Take back what is not finished."""
        for beside, _ in self._waiting:
            beside.unlink(missing_ok=True)
        self._waiting.clear()


def write_all(file: Any, view: memoryview) -> None:
    """Write every byte: the system may take fewer at a time, and says so only by their number."""
    while len(view):
        written = file.write(view)
        if not written:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        view = view[written:]


@contextlib.contextmanager
def named(path: Path) -> Iterator[None]:
    """An OSError from inside names this file."""
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        raise


def write_whole(path: Path, data: bytes) -> None:
    """One file, durable."""
    files = Files(path.parent)
    try:
        files.write(path.name, data)
        files.finish()
    except BaseException:
        files.drop()
        raise


def fault(root: Path, key: str, size: int, crc: int) -> str | None:
    """What is wrong with a file: "is missing", "is torn" or "has changed"; None if nothing is."""
    path = root / key
    try:
        if path.stat().st_size != size:
            return "is torn"
        return None if checksum(path.read_bytes()) == crc else "has changed"
    except FileNotFoundError:
        return "is missing"


def remove_unfinished(folders: Iterable[Path]) -> None:
    """Remove what writers that were killed left behind."""
    for folder in folders:
        for path in folder.glob(f"*{UNFINISHED}"):
            path.unlink(missing_ok=True)


@contextlib.contextmanager
def locked(path: Path, wait: bool = False) -> Iterator[bool]:
    """Hold a folder or file for this process alone; False if another has it. True where a system knows no locks."""
    try:
        import fcntl
    except ImportError:
        yield True
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            yield False
            return
        except OSError:  # a file system without locks
            pass
        yield True
    finally:
        os.close(descriptor)
