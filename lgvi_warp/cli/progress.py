# SPDX-License-Identifier: Apache-2.0
"""Show on stderr what a command is doing, and how far it has come."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator

from lgvi_warp.common.progress import Progress


@contextlib.contextmanager
def progress_bar(
    quiet: bool, phase: str = "compiling", *, begin: Callable[..., Progress] | None = None
) -> Iterator[Progress | None]:
    """Show progress on stderr inside the `with` block, unless quiet, and clear its line afterwards.

    begin: Function of a stream and a phase that makes the progress; default None: `Progress`.
    """
    progress = None if quiet else (begin or Progress)(sys.stderr, phase)
    try:
        yield progress
    finally:
        if progress:
            progress.close()


def part_of(progress: Progress | None, i: int, n: int) -> Callable[[float], None] | None:
    """Turn the progress of the whole work, if any, into the progress of its i-th part of n."""
    return progress and (lambda part: progress((i + part) / n))
