# SPDX-License-Identifier: Apache-2.0
"""Show on stderr what a command does, and how far it is."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator

from lgvi_warp.common.progress import Progress


@contextlib.contextmanager
def progress_bar(
    quiet: bool, phase: str = "compiling", *, begin: Callable[..., Progress] | None = None
) -> Iterator[Progress | None]:
    """Show progress on stderr inside the `with` block, and clear its line afterwards.

    Args:
        quiet: Whether to show nothing.
        phase: What is done first; default "compiling".
        begin: What makes the progress of a stream and a phase; default None, `Progress`.

    Yields:
        The progress to call with fractions; None if quiet.
    """
    progress = None if quiet else (begin or Progress)(sys.stderr, phase)
    try:
        yield progress
    finally:
        if progress:
            progress.close()


def part_of(progress: Progress | None, i: int, n: int) -> Callable[[float], None] | None:
    """Turn the progress of one part into that of the whole.

    progress: Progress of the whole; None for none.
    Returns: A function of the part's fraction; None without a progress.
    """
    return progress and (lambda part: progress((i + part) / n))
