"""Start Warp without a word on stdout or stderr."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import sys
from collections.abc import Iterator

import warp as wp


@contextlib.contextmanager
def _native_stderr_closed() -> Iterator[None]:
    """Send what native code writes to file descriptor 2 nowhere."""
    if sys.stderr is not None:
        sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # it is closed already
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _has_cuda_driver() -> bool:
    for name in ("libcuda.so.1", "libcuda.so", "nvcuda.dll"):
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


@functools.cache
def start() -> None:
    """Initialise Warp once, quietly: no banner unless the user asked for one, no remark that there is no GPU driver.

    Warp's native code writes that remark to the file descriptor itself, whatever its log level, so it is caught there.
    """
    if wp.config.log_level == wp.LOG_INFO:
        wp.config.log_level = wp.LOG_WARNING
    if _has_cuda_driver():
        wp.init()
        return
    with _native_stderr_closed():
        wp.init()
