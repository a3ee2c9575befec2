"""Files that outlive a crash: written whole, synced, and put into their place by a rename."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import functools
import os
import threading
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import safe_files, scratch
from lgvi_warp.common.scratch import UNFINISHED

# A file at least so large goes to the disk as soon as it is written: the disk has work while others are made.
EARLY_BYTES = 200_000
# Syncs side by side, and large files that may wait for theirs: enough for any disk, few enough for the system's memory.
SYNCS, MOST_WAITING = 16, 32


def checksum(data: Any, before: int = 0) -> int:
    """CRC-32C of bytes or a contiguous array, as zarr's crc32c codec has it, after data that had the checksum `before`."""
    import google_crc32c

    view = memoryview(data)
    # The extension takes an array, and no memoryview.
    return int(google_crc32c.extend(before, np.frombuffer(view, np.uint8))) if view.nbytes else before


@functools.cache
def _syncs() -> ThreadPoolExecutor:
    """Threads that wait for the disk."""
    return ThreadPoolExecutor(SYNCS, thread_name_prefix="lgvi_warp_sync")


_room = threading.BoundedSemaphore(MOST_WAITING)


def _renew() -> None:
    """In a child after a fork, where none of the threads lives on."""
    global _room
    _syncs.cache_clear()
    _room = threading.BoundedSemaphore(MOST_WAITING)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew)


def sync_file(beside: Path, target: Path) -> None:
    """Wait until a file is on the disk: where it lies, and what it will be called."""
    descriptor = os.open(beside, os.O_RDONLY)
    try:
        with named(target):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _begun(descriptor: int, target: Path) -> Future[None]:
    """The sync of an open file, begun; waits where too many are on their way."""
    _room.acquire()
    return _syncs().submit(_sync_early, os.dup(descriptor), target)


def _sync_early(descriptor: int, target: Path) -> None:
    try:
        with named(target):
            os.fsync(descriptor)
    finally:
        _room.release()
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
        self._root = root
        # Where each lies, what it will be called, and its sync if that has begun.
        self._waiting: list[tuple[Path, Path, Future[None] | None]] = []
        self.sums: dict[str, list[int]] = {}

    def write(self, key: str, data: Any, *, checked: bool = False) -> None:
        """Write a file below the root, and note its size and checksum; checked: with the data's own checksum at its end.

        Waits where many large files have not reached the disk yet. Raises SceneError where a link stands in its way.
        """
        target = self._root / key
        beside = scratch.beside(target)
        view = memoryview(data).cast("B")
        crc = checksum(view)
        tail = crc.to_bytes(4, "little") if checked else b""
        with named(target), safe_files.created(self._root, beside) as file:
            self._waiting.append((beside, target, None))
            write_all(file, view)
            write_all(file, memoryview(tail))
            if len(view) >= EARLY_BYTES:
                self._waiting[-1] = (beside, target, _begun(file.fileno(), target))
        self.sums[key] = [len(view) + len(tail), checksum(tail, crc)]

    def sync(self) -> None:
        """Begin to sync what is not on its way yet."""
        self._waiting = [
            (beside, target, sync or _syncs().submit(sync_file, beside, target))
            for beside, target, sync in self._waiting
        ]

    def place(self) -> set[Path]:
        """Wait for the syncs and put the files in their places. Returns their folders, which are not synced."""
        for _, _, sync in self._waiting:
            assert sync is not None
            sync.result()
        for beside, target, _ in self._waiting:
            safe_files.rename(self._root, beside, target)
        folders = {target.parent for _, target, _ in self._waiting}
        self._waiting.clear()
        return folders

    def finish(self) -> None:
        """Sync the files, put them in their places, and sync their folders."""
        (error,) = finish_together([self])
        if error is not None:
            raise error

    def drop(self) -> None:
        """Take back what is not finished."""
        for beside, _, _ in self._waiting:
            beside.unlink(missing_ok=True)
        self._waiting.clear()


def finish_together(several: Sequence[Files]) -> list[OSError | None]:
    """Finish all of them, each folder synced once. Returns what went wrong with each, which is not in its place then."""
    # Syncs that run side by side share the file system's commits.
    for one in several:
        one.sync()
    errors: list[OSError | None] = []
    folders = set[Path]()
    for one in several:
        try:
            folders |= one.place()
            errors.append(None)
        except OSError as error:
            errors.append(error)
    try:
        list(_syncs().map(sync_folder, sorted(folders)))
    except OSError as error:
        return [found or error for found in errors]
    return errors


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
    try:
        with safe_files.opened(root, key) as file:
            if os.fstat(file.fileno()).st_size != size:
                return "is torn"
            return None if checksum(file.read(size)) == crc else "has changed"
    except FileNotFoundError:
        return "is missing"


def remove_unfinished(folders: Iterable[Path]) -> None:
    """Remove what writers that were killed left behind, of folders that one writer at a time may change."""
    for folder in folders:
        for path in folder.glob(f"*{UNFINISHED}"):
            if scratch.is_unfinished(path.name) and not path.is_dir():
                path.unlink(missing_ok=True)


@contextlib.contextmanager
def placed(path: str | os.PathLike[str]) -> Iterator[Path]:
    """The name to write a file under: at the end it is made durable and put in its place; after an error it is removed.

    What lay there before stays whole until then. Files of other writers of it that were killed are removed.
    """
    target = Path(path)
    scratch.sweep(target)
    beside = scratch.beside(target)
    try:
        yield beside
        sync_file(beside, target)
        with named(target):
            beside.replace(target)
        sync_folder(target.parent)
    finally:
        beside.unlink(missing_ok=True)


def put_folder(beside: Path, target: Path) -> None:
    """Put a folder in the place of another, which is removed, or of none. A crash leaves one of the two there, whole."""
    old = beside
    if not target.exists():
        beside.replace(target)
    elif not _exchanged(beside, target):
        # Two steps where the system has no exchange: a crash between them is mended by `restored`.
        old = scratch.beside(target, scratch.OLD)
        target.replace(old)
        beside.replace(target)
    sync_folder(target.parent)
    scratch.remove_folder(old)


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange two folders in one step; False where the system cannot."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError, TypeError):
        return False
    here, exchange = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    return bool(rename(here, os.fsencode(one), here, os.fsencode(other), exchange) == 0)


def restored(target: Path) -> None:
    """Put a folder back that a writer was killed while it replaced it, and nothing has its place."""
    old = [path for path in scratch.left_behind(target) if path.suffix == scratch.OLD and not path.is_symlink()]
    if len(old) == 1 and not target.exists():
        old[0].replace(target)
        sync_folder(target.parent)


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
        try:
            yield True
        finally:
            # A child that was forked meanwhile holds the same lock: to close it here alone would not release it.
            with contextlib.suppress(OSError):
                fcntl.flock(descriptor, fcntl.LOCK_UN)
    finally:
        os.close(descriptor)
