# SPDX-License-Identifier: Apache-2.0
"""Files that survive a crash: written completely, synced, and moved to their place by a rename."""

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
from typing import Any, BinaryIO, TextIO

import numpy as np

from lgvi_warp.common import safe_files, scratch
from lgvi_warp.common.arguments import path_of
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.safe_files import named
from lgvi_warp.common.scratch import UNFINISHED
from lgvi_warp.common.sentences import sentences

# Files of at least this size are synced as soon as they are written, so that the disk works while others are made [bytes].
EARLY_BYTES = 200_000
# Most concurrent syncs, and most large files waiting for one: enough for any disk, few enough for the memory.
SYNCS, MOST_WAITING = 16, 32


def checksum(data: Any, before: int = 0) -> int:
    """CRC-32C checksum, as zarr's crc32c codec computes it."""
    import google_crc32c

    view = memoryview(data)
    # The extension takes an array, but no memoryview.
    return int(google_crc32c.extend(before, np.frombuffer(view, np.uint8))) if view.nbytes else before


@functools.cache
def syncs() -> ThreadPoolExecutor:
    """Thread pool for waits on the disk."""
    return ThreadPoolExecutor(SYNCS, thread_name_prefix="lgvi_warp_sync")


_room = threading.BoundedSemaphore(MOST_WAITING)


def _renew() -> None:
    """Reset the state in a child after a fork, where none of the threads exists."""
    global _room
    syncs.cache_clear()
    _room = threading.BoundedSemaphore(MOST_WAITING)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew)


def sync_file(beside: Path, target: Path) -> None:
    """Wait until a file's content is on the disk."""
    # Windows syncs only what is open for writing.
    descriptor = os.open(beside, os.O_RDWR)
    try:
        with named(target):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _begun(descriptor: int, target: Path) -> Future[None]:
    """Start to sync an open file; wait first if too many syncs are pending."""
    _room.acquire()
    return syncs().submit(_sync_early, os.dup(descriptor), target)


def _sync_early(descriptor: int, target: Path) -> None:
    try:
        with named(target):
            os.fsync(descriptor)
    finally:
        _room.release()
        os.close(descriptor)


def sync_folder(folder: Path) -> None:
    """Wait until the names in a folder are on the disk; do nothing if the system cannot sync folders."""
    with contextlib.suppress(PermissionError):  # Windows opens no folders
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


class Files:
    """Files that appear together: `write` each, then `finish` all. `sums`: [bytes, CRC-32C] by key of each written file.

    Before `finish` they have temporary names in the same folders, so that existing files stay intact.
    """

    def __init__(self, root: Path):
        self._root = root
        # Temporary path, later path, and the sync if it has begun.
        self._waiting: list[tuple[Path, Path, Future[None] | None]] = []
        self.sums: dict[str, list[int]] = {}

    def write(self, key: str, data: Any, *, checked: bool = False) -> None:
        """Write one file, and record its size and checksum; wait while too much data has not reached the disk."""
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
        """Start to sync the files whose sync has not started."""
        self._waiting = [
            (beside, target, sync or syncs().submit(sync_file, beside, target))
            for beside, target, sync in self._waiting
        ]

    def place(self) -> set[Path]:
        """Wait for the syncs, then rename the files to their places."""
        for _, _, sync in self._waiting:
            assert sync is not None
            sync.result()
        for beside, target, _ in self._waiting:
            safe_files.rename(self._root, beside, target)
        folders = {target.parent for _, target, _ in self._waiting}
        self._waiting.clear()
        return folders

    def finish(self) -> None:
        """Sync the files, move them to their places, and sync their folders."""
        (error,) = finish_together([self])
        if error is not None:
            raise error

    def drop(self) -> None:
        """Remove the unfinished files."""
        for beside, _, _ in self._waiting:
            beside.unlink(missing_ok=True)
        self._waiting.clear()


def finish_together(several: Sequence[Files]) -> list[OSError | None]:
    """Finish several sets of files, and sync each folder once; returns for each set None, or its error."""
    # Concurrent syncs share the file system's commits.
    for files in several:
        files.sync()
    errors: list[OSError | None] = []
    folders = set[Path]()
    for files in several:
        try:
            folders |= files.place()
            errors.append(None)
        except OSError as error:
            errors.append(error)
    try:
        list(syncs().map(sync_folder, sorted(folders)))
    except OSError as error:
        return [earlier or error for earlier in errors]
    return errors


def write_all(file: Any, view: memoryview) -> None:
    """Write every byte, even if the system takes only few at a time."""
    while len(view):
        written = file.write(view)
        if not written:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        view = view[written:]


def write_whole(path: Path, data: bytes) -> None:
    """Write one file durably: it is complete or does not appear."""
    files = Files(path.parent)
    try:
        files.write(path.name, data)
        files.finish()
    except BaseException:
        files.drop()
        raise


def fault(root: Path, key: str, size: int, crc: int) -> str | None:
    """Check a file by its size [bytes] and checksum: "is missing", "is torn" or "has changed"; None if it is intact."""
    try:
        with safe_files.opened(root, key) as file:
            if os.fstat(file.fileno()).st_size != size:
                return "is torn"
            return None if checksum(file.read(size)) == crc else "has changed"
    except FileNotFoundError:
        return "is missing"


def remove_unfinished(folders: Iterable[Path]) -> None:
    """Remove unfinished files of killed processes."""
    for folder in folders:
        for path in folder.glob(f"*{UNFINISHED}"):
            if scratch.is_unfinished(path.name) and not path.is_dir():
                path.unlink(missing_ok=True)


def place_of(path: str | os.PathLike[str], root: str | os.PathLike[str] | None = None) -> Path:
    """Find where a file is to be written: a link given by the user is followed, and only a plain file is replaced.

    root: Folder that it may not leave by a link, since its name is not the user's; default None, it may.
    """
    path = path_of("path", path)
    target = Path(os.path.realpath(path)) if root is None else safe_files.inside(root, path.absolute())
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        if problem := safe_files.kind(os.lstat(target).st_mode):
            raise SceneError([sentences(path, f"{problem}, which is not replaced", "give the name of a file")])
    return target


@contextlib.contextmanager
def placed(path: str | os.PathLike[str], root: str | os.PathLike[str] | None = None) -> Iterator[Path]:
    """Write a file under a temporary name, and move it to its place at the end of the `with` block.

    An existing file stays intact until then; after an error the new one is removed. Unfinished files of killed
    processes that wrote the same file are removed too. Every output file for a user is written by this function.

    root: Folder that it may not leave by a link, since its name is not the user's; default None, it may.
    """
    target = place_of(path, root)
    if not target.parent.is_dir():
        # By its own name: the error of the temporary file would tell that one's.
        raise FileNotFoundError(errno.ENOENT, "there is no such folder", os.fspath(Path(path).parent))
    scratch.sweep(target)
    beside = scratch.beside(target)
    try:
        yield beside
        sync_file(beside, target)
        with named(target):
            beside.replace(target)
        WRITTEN.note(target)
        sync_folder(target.parent)
    finally:
        beside.unlink(missing_ok=True)


def new_text_file(beside: Path) -> TextIO:
    """Open a new text file in UTF-8, such as the one of `placed`, to write it part by part."""
    return beside.open("x", encoding="utf-8", newline="\n")


def new_file(beside: Path) -> BinaryIO:
    """Open a new binary file, such as the one of `placed`, to write it part by part."""
    return beside.open("xb")


def write_text(path: str | os.PathLike[str], text: str, root: str | os.PathLike[str] | None = None) -> Path:
    """Write a text file in UTF-8; it is complete or does not appear."""
    with placed(path, root) as beside, new_text_file(beside) as file:
        file.write(text)
    return Path(path)


class PlacedFiles:
    """Number of files that this process has written, and the last of them, for the message of an ended process."""

    def __init__(self) -> None:
        self.count = 0
        self.last: Path | None = None
        self._lock = threading.Lock()

    def note(self, path: Path) -> None:
        """Count a file."""
        with self._lock:
            self.count, self.last = self.count + 1, path


WRITTEN = PlacedFiles()


def put_folder(beside: Path, target: Path) -> None:
    """Replace a folder by another; after a crash one of the two exists and is complete."""
    old = beside
    if not target.exists():
        beside.replace(target)
    elif not exchanged(beside, target):
        # Two steps where the system cannot exchange folders: `restored` mends a crash between them.
        old = scratch.beside(target, scratch.OLD)
        target.replace(old)
        beside.replace(target)
    sync_folder(target.parent)
    scratch.remove_folder(old)


def exchanged(first: Path, second: Path) -> bool:
    """Exchange two folders in one step."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError, TypeError):
        return False
    here, exchange = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    return bool(rename(here, os.fsencode(first), here, os.fsencode(second), exchange) == 0)


def restored(target: Path) -> None:
    """Restore a folder whose writer was killed while it replaced the folder."""
    old = [path for path in scratch.left_behind(target) if path.suffix == scratch.OLD and not path.is_symlink()]
    if len(old) == 1 and not target.exists():
        old[0].replace(target)
        sync_folder(target.parent)


@contextlib.contextmanager
def locked(path: Path, wait: bool = False) -> Iterator[bool]:
    """Lock a folder or file for this process alone."""
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
            # A child forked meanwhile holds the same lock: closing it here would not release it.
            with contextlib.suppress(OSError):
                fcntl.flock(descriptor, fcntl.LOCK_UN)
    finally:
        os.close(descriptor)
