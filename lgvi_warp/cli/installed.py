# SPDX-License-Identifier: Apache-2.0
"""Installed components besides the package: libraries of its extras, kernels in Warp's cache, the viewer."""

from __future__ import annotations

import contextlib
import os
import re
from importlib import metadata
from pathlib import Path
from typing import Any

# Extras for work on the package itself.
_OF_DEVELOPERS = {"all", "test", "docs", "arm", "dev"}


def missing_by_extra() -> dict[str, list[str]]:
    """Missing libraries of each extra; an empty list means that the extra is installed."""
    needed: dict[str, list[str]] = {}
    for line in metadata.requires("lgvi-warp") or ():
        if found := re.match(r"([\w.-]+)(?:\[([\w,-]+)\])?.*extra == ['\"]([\w-]+)['\"]", line):
            library, others, extra = found.groups()
            needed.setdefault(extra, []).extend([f"[{other}]" for other in others.split(",")] if others else [library])
    return {extra: _missing(extra, needed) for extra in needed if extra not in _OF_DEVELOPERS}


def _missing(extra: str, needed: dict[str, list[str]]) -> list[str]:
    """Missing libraries of one extra and of the extras that it includes."""
    missing: list[str] = []
    for name in needed.get(extra, ()):
        missing += _missing(name[1:-1], needed) if name.startswith("[") else [] if is_there(name) else [name]
    return missing


def is_there(library: str) -> bool:
    """Whether a library is installed, by its name for pip."""
    try:
        metadata.distribution(library)
    except metadata.PackageNotFoundError:
        return False
    return True


def kernel_cache() -> dict[str, Any]:
    """Folder of compiled kernels, and its size [bytes]."""
    import warp as wp

    from lgvi_warp.common.warp_setup import start

    start()
    path = Path(wp.config.kernel_cache_dir)
    size = 0
    for folder, _, names in os.walk(path):
        for name in names:
            with contextlib.suppress(OSError):  # a kernel that another process replaces
                size += (Path(folder) / name).stat().st_size
    return {"path": path, "bytes": size}


def viewer() -> Path | None:
    """Path of the viewer; None if it is not found."""
    from lgvi_warp.views.recording.viewer import program

    try:
        path = program()
    except ImportError:
        return None
    return path if path.is_file() else None
