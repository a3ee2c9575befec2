# SPDX-License-Identifier: Apache-2.0
"""Durations of the phases of a kernel's first use."""

from typing import NamedTuple


class Phases(NamedTuple):
    """Wall time until a kernel is ready [s].

    Attributes:
        source: its C++ is written (for a kernel of the cache: its hash); processes that compile the same one are waited for.
        clang: Clang compiles it; 0 for a kernel of the cache.
        load: its code is linked, and checked or put into the cache.
    """

    source: float = 0.0
    clang: float = 0.0
    load: float = 0.0

    def __str__(self) -> str:
        return f"source {self.source:.2f} s, Clang {self.clang:.2f} s, load {self.load:.2f} s"
