# SPDX-License-Identifier: Apache-2.0
"""Durations of the phases at a kernel's first use."""

from typing import NamedTuple


class Phases(NamedTuple):
    """Wall time until a kernel is ready [s].

    Attributes:
        source: to write its C++, or to compute its hash if it is cached, and to wait for processes that compile it too.
        clang: to compile it by Clang; 0 if it is cached.
        load: to link its code, and to check it or save it in the cache.
    """

    source: float = 0.0
    clang: float = 0.0
    load: float = 0.0

    def __str__(self) -> str:
        return f"source {self.source:.2f} s, Clang {self.clang:.2f} s, load {self.load:.2f} s"
