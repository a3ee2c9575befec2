# SPDX-License-Identifier: Apache-2.0
"""A lock for a file or folder: only one process writes to it at a time.

The lock is a lock of the system on an open file (flock), which always ends with the process. The file names its holder,
for the message to a refused process. Lock libraries keep the file, or do not name the holder.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import stat
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lgvi_warp.common import scratch
from lgvi_warp.common.errors import SceneError

# Errors of file systems without locks.
WITHOUT_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL}
KEYS = {"pid", "host", "since"}
# Descriptors of locks that this process holds.
_held: set[int] = set()


def _close_inherited() -> None:
    """Close inherited descriptors in a child after a fork, so that they do not outlive those of the holder."""
    for descriptor in _held:
        with contextlib.suppress(OSError):
            os.close(descriptor)
    _held.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_close_inherited)


def lock_file(target: Path) -> Path:
    """Path of the lock of a file or folder, the same for all paths that lead to it."""
    place = Path(os.path.realpath(target))
    return place.with_name(f".{place.name}.lock")


@contextlib.contextmanager
def write_lock(target: Path, wait: bool = False) -> Iterator[None]:
    """Keep other processes from writing to a file or folder inside the `with` block; its parent folder is made."""
    path = lock_file(target)
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, holder = _taken(path, target, wait), os.getpid()
    _held.add(descriptor)
    try:
        yield
    finally:
        if os.getpid() == holder:
            _held.discard(descriptor)
            _release(path, descriptor)


def writer_of(target: Path) -> str | None:
    """Name the process that writes to a file or folder, from its lock; None if there is none. This takes no lock."""
    try:
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        descriptor = os.open(lock_file(target), flags | getattr(os, "O_CLOEXEC", 0))
    except OSError:
        return None
    try:
        holder = _holder(descriptor) if stat.S_ISREG(os.fstat(descriptor).st_mode) else None
        if not holder or (holder["host"] == scratch.host() and not scratch.is_alive(int(holder["pid"]))):
            return None
        return _holder_text(descriptor).strip(" ()")
    except (OSError, ValueError, TypeError):
        return None
    finally:
        os.close(descriptor)


def _taken(path: Path, target: Path, wait: bool) -> int:
    """Open and lock the lock's file; return its descriptor. Raises SceneError."""
    while True:
        descriptor = _opened(path)
        try:
            if not _locked(descriptor, wait):
                text = f"{target}: another run is writing into it{_holder_text(descriptor)}. Wait for it, or end it"
                raise SceneError([text])
            # The previous holder may have removed the file that was opened here.
            if _is_still(path, descriptor):
                _write_holder(descriptor)
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _opened(path: Path) -> int:
    """Open the lock's file, and create it if missing. Raises SceneError if another file has its name."""
    try:
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        descriptor = os.open(path, flags | getattr(os, "O_CLOEXEC", 0), 0o666)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):
            raise _no_lock(path) from None
        raise
    if stat.S_ISREG(os.fstat(descriptor).st_mode) and _holder(descriptor) is not None:
        return descriptor
    os.close(descriptor)
    raise _no_lock(path)


def _no_lock(path: Path) -> SceneError:
    return SceneError([f"{path} is not a lock of lgvi-warp, but has its name. Move it away"])


def _locked(descriptor: int, wait: bool) -> bool:
    """Lock an open file; False if another process holds it. On systems without locks: whether that process has ended."""
    try:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except ImportError:
        return True
    except OSError as error:
        if error.errno not in WITHOUT_LOCKS:
            raise
        holder = _holder(descriptor) or {}
        return holder.get("host") != scratch.host() or not scratch.is_alive(int(holder["pid"]))
    return True


def _is_still(path: Path, descriptor: int) -> bool:
    """Tell whether the path still leads to the open file."""
    try:
        return os.path.samestat(os.lstat(path), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _holder(descriptor: int) -> dict[str, Any] | None:
    """Content of the lock's file, empty if it was just created; None if it is another kind of file."""
    os.lseek(descriptor, 0, os.SEEK_SET)
    text = os.read(descriptor, 1000)
    try:
        content = json.loads(text or b"{}")
    except ValueError:
        return None
    return content if isinstance(content, dict) and content.keys() in (KEYS, set()) else None


def _holder_text(descriptor: int) -> str:
    """Describe the holder in words."""
    for _ in range(10):
        holder = _holder(descriptor)
        if holder:
            return f" (process {holder['pid']} on {holder['host'].rpartition('-')[0]}, since {holder['since']})"
        time.sleep(0.01)
    return ""


def _write_holder(descriptor: int) -> None:
    """Write the holder into the file. On a full disk the lock works without it."""
    holder = {"pid": os.getpid(), "host": scratch.host(), "since": time.strftime("%Y-%m-%d %H:%M:%S")}
    with contextlib.suppress(OSError):
        os.ftruncate(descriptor, 0)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.write(descriptor, json.dumps(holder).encode())


def _release(path: Path, descriptor: int) -> None:
    """Remove the file while it is locked, so that no other lock is removed, then unlock it."""
    kept = False
    with contextlib.suppress(OSError):
        if kept := _is_still(path, descriptor):
            path.unlink()
            kept = False
    os.close(descriptor)
    if kept:  # Windows removes no file that is open
        with contextlib.suppress(OSError):
            path.unlink()
