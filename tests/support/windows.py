# SPDX-License-Identifier: Apache-2.0
"""Removal of what Windows lacks from this process: a plugin of pytest (-p tests.support.windows).

No locks of files, no descriptors of folders, no O_NOFOLLOW, no statvfs, no SIGHUP, no set_blocking (Python 3.11), no fork; a
descriptor that is only read is not synced; a file that is open is neither replaced nor removed. It is an imitation: what else
differs shows on Windows alone.
"""

import contextlib
import ctypes
import errno
import multiprocessing
import os
import shutil
import signal
import subprocess  # noqa: F401  (before the system loses what it is made of)
import sys
import tempfile
from collections import namedtuple

with contextlib.suppress(ImportError):  # it has a part for each system, chosen when it is loaded
    import psutil  # noqa: F401

OPEN_FILES = "/proc/self/fd"
MISSING = ("O_NOFOLLOW", "O_DIRECTORY", "O_NONBLOCK", "O_CLOEXEC", "statvfs", "set_blocking", "register_at_fork", "fork",
           "sched_getaffinity", "posix_fallocate", "sysconf", "mkfifo")  # fmt: skip

real_open, real_fsync, real_listdir, real_replace, real_unlink = os.open, os.fsync, os.listdir, os.replace, os.unlink
real_set_blocking, real_set_wakeup, real_statvfs, real_library = (
    os.set_blocking, signal.set_wakeup_fd, os.statvfs, ctypes.CDLL,
)  # fmt: skip
WRITES, TEMPORARY = os.O_WRONLY | os.O_RDWR, tempfile.gettempdir()


def opened(path, flags, mode=0o777, *, dir_fd=None):
    """Folders are not opened, and nothing is opened relative to one."""
    if dir_fd is not None:
        raise NotImplementedError("dir_fd unavailable on this platform")
    if os.path.isdir(path):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    return real_open(path, flags, mode)


def synced(descriptor):
    """Only what is open for writing is synced."""
    with open(f"/proc/self/fdinfo/{descriptor}", encoding="ascii") as info:
        flags = next(int(line.split()[1], 8) for line in info if line.startswith("flags:"))
    if not flags & WRITES:
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    real_fsync(descriptor)


def listed(path="."):
    if isinstance(path, int):
        raise TypeError("listdir: path should be string, bytes, os.PathLike or None, not int")
    return real_listdir(path)


def refuse_open(path):
    """Raise PermissionError for a file that this process has open, and for a folder with such a file."""
    real = os.path.realpath(path)
    for name in real_listdir(OPEN_FILES):
        try:
            there = os.readlink(f"{OPEN_FILES}/{name}")
        except OSError:
            continue
        if there == real or there.startswith(f"{real}{os.sep}"):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


def replaced(source, target, *, src_dir_fd=None, dst_dir_fd=None):
    assert src_dir_fd is dst_dir_fd is None
    refuse_open(source)
    if os.path.lexists(target):
        refuse_open(target)
    real_replace(source, target)


def unlinked(path, *, dir_fd=None):
    assert dir_fd is None
    if os.path.dirname(path) != TEMPORARY:  # a temporary file is removed by Windows itself when it is closed
        refuse_open(path)
    real_unlink(path)


def set_wakeup(descriptor, **more):
    """A pipe that blocks is taken."""
    if descriptor != -1:
        real_set_blocking(descriptor, False)
    return real_set_wakeup(descriptor, **more)


def loaded(name, *arguments, **more):
    if name is None:
        raise TypeError("bad argument type for built-in operation")
    return real_library(name, *arguments, **more)


def imitate():
    """Take away what Windows has not."""
    sys.modules["fcntl"] = None
    os.supports_dir_fd = set()
    os.open, os.fsync, os.listdir, os.replace, os.rename, os.unlink, os.remove = (
        opened, synced, listed, replaced, replaced, unlinked, unlinked,
    )  # fmt: skip
    os.O_BINARY = 0
    signal.set_wakeup_fd = set_wakeup
    shutil._use_fd_functions = False
    usage = namedtuple("usage", "total used free")

    def disk_usage(path):
        found = real_statvfs(path)
        return usage(*(found.f_frsize * blocks for blocks in (found.f_blocks, 0, found.f_bavail)))

    shutil.disk_usage = disk_usage
    ctypes.CDLL = loaded
    multiprocessing.set_start_method("spawn", force=True)
    for name in MISSING:
        if hasattr(os, name):
            delattr(os, name)
    for name in ("SIGHUP", "SIGALRM", "SIGKILL"):
        delattr(signal, name)


imitate()
