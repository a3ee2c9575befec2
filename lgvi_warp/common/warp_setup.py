# SPDX-License-Identifier: Apache-2.0
"""Start Warp without output on stdout or stderr."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import functools
import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import warp as wp
import warp._src.context as context

from lgvi_warp.common.sentences import capital


@contextlib.contextmanager
def _native_stderr_closed() -> Iterator[None]:
    """Discard the output of native code to file descriptor 2."""
    if sys.stderr is not None:
        sys.stderr.flush()
    try:
        stderr_copy = os.dup(2)
    except OSError:  # already closed
        yield
        return
    null_device = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null_device, 2)
        yield
    finally:
        os.dup2(stderr_copy, 2)
        os.close(stderr_copy)
        os.close(null_device)


def _has_cuda_driver() -> bool:
    for name in ("libcuda.so.1", "libcuda.so", "nvcuda.dll"):
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


# Held while Warp starts, builds or launches kernels: one thread at a time. A fork waits for it, so that Warp is idle in the
# child.
build_lock = threading.RLock()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=build_lock.acquire, after_in_parent=build_lock.release, after_in_child=build_lock.release
    )


def start() -> None:
    """Initialise Warp once, without its banner and its message that there is no GPU driver.

    A banner that the user enabled is shown. Native code writes the message to the file descriptor itself, at any log
    level of Warp, so it is discarded there.
    """
    # Two threads that redirect stderr at once would leave it closed.
    with build_lock:
        start_once()


@functools.cache
def start_once() -> None:
    """Initialise Warp on the first call; later calls do nothing."""
    if wp.config.log_level == wp.LOG_INFO:
        wp.config.log_level = wp.LOG_WARNING
    chosen = wp.config.kernel_cache_dir
    try:
        with contextlib.nullcontext() if _has_cuda_driver() else _native_stderr_closed():
            wp.init()
    except OSError as error:
        cache, wp.config.kernel_cache_dir = wp.config.kernel_cache_dir, chosen
        if error.errno is None or cache is None:
            raise  # an error of Warp's own libraries
        raise unusable(cache, error) from error


def unusable(cache: str | os.PathLike[str], error: OSError) -> OSError:
    """Explain an error of the kernel cache, with a remedy."""
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    problem = "has no room for a new kernel" if full else "cannot be written"
    remedy = f"{'make room, or ' if full else ''}set WARP_CACHE_PATH to another folder"
    return OSError(error.errno, f"the kernel cache {problem} ({error.strerror}). {capital(remedy)}", os.fspath(cache))


def header_folders() -> dict[int, Any]:
    """Temporary folders of Clang's precompiled headers."""
    return getattr(context.runtime, "_pch_dirs", {})


def header_folder() -> Path | None:
    """Folder of this thread's precompiled header; None if Warp stores it elsewhere."""
    folder = getattr(context.runtime, "get_clang_pch_dir", lambda: None)()
    return None if folder is None else Path(folder)


def end() -> None:
    """Remove the temporary folders, in a process that skips Python's own cleanup."""
    for folder in header_folders().values():
        folder.cleanup()
    header_folders().clear()


def _forget() -> None:
    """Forget the temporary folders in a child after a fork, since they belong to the parent."""
    for folder in header_folders().values():
        folder._finalizer.detach()
    header_folders().clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
