# SPDX-License-Identifier: Apache-2.0
"""A disk that is slow, full or broken: the one place where tests stand between the program and the system's files."""

import contextlib
import errno
import os
from pathlib import Path
from unittest import mock

from lgvi_warp.common import scratch


def refused(number, *ends):
    """Behaviour of a disk that refuses files whose names end so: "created", "synced" and "named" as it is said in `ends`.

    Args:
        number: Number of the error, as errno.ENOSPC.
        ends: Pairs of what is refused and the end of the file's path.
    """

    def fault(what, path):
        if any(what == refused and str(path).endswith(end) for refused, end in ends):
            raise OSError(number, os.strerror(number))

    return fault


def full(*ends):
    """A disk without room for the files whose names end so."""
    return refused(errno.ENOSPC, *ends)


@contextlib.contextmanager
def files_of_at_most(size):
    """A system that lets no file of this process grow beyond so many bytes."""
    import resource  # not on Windows

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


class Disk:
    """In its context files are created, synced and renamed as the system does it, but for what `fault` does before each.

    Args:
        fault: Called with "created", "synced" or "named" and the path that a file or folder has in the end; it may wait, and
            raise OSError.

    Attributes:
        done: (what, path) of all that was done, in its order.
    """

    def __init__(self, fault=lambda what, path: None):
        self.fault, self.done = fault, []
        # Files and folders that were opened -> their paths.
        self._opened = {}

    def __enter__(self):
        own = {"open": self.open, "fsync": self.fsync, "replace": self.replace}
        self._system = {name: getattr(os, name) for name in own}
        self._patches = [mock.patch.object(os, name, call) for name, call in own.items()]
        for patch in self._patches:
            patch.start()
        return self

    def __exit__(self, *_):
        for patch in self._patches:
            patch.stop()

    def _do(self, what, path, call, *inputs, **named):
        path = path.with_name(path.name.split(f".{scratch.host()}-")[0])
        self.fault(what, path)
        result = self._system[call](*inputs, **named)
        self.done.append((what, path))
        return result

    def open(self, path, flags, mode=0o777, *, dir_fd=None):
        whole = self._whole(path, dir_fd)
        if flags & os.O_CREAT:
            descriptor = self._do("created", whole, "open", path, flags, mode, dir_fd=dir_fd)
        else:
            descriptor = self._system["open"](path, flags, mode, dir_fd=dir_fd)
        self._opened[identity(descriptor)] = whole
        return descriptor

    def fsync(self, descriptor):
        return self._do("synced", self._opened[identity(descriptor)], "fsync", descriptor)

    def replace(self, path, target, *, src_dir_fd=None, dst_dir_fd=None):
        where = {"src_dir_fd": src_dir_fd, "dst_dir_fd": dst_dir_fd}
        return self._do("named", self._whole(target, dst_dir_fd), "replace", path, target, **where)

    def _whole(self, path, folder):
        """The whole path of a name below an open folder."""
        return Path(os.fspath(path)) if folder is None else self._opened[identity(folder)] / path


def identity(descriptor):
    """Identity of an open file or folder, whatever its descriptor."""
    found = os.fstat(descriptor)
    return found.st_dev, found.st_ino
