# SPDX-License-Identifier: Apache-2.0
"""Scene and sweep files that come with the package; "example:NAME" stands for the path of one of them."""

from __future__ import annotations

import os
import re
from pathlib import Path

from lgvi_warp.common.errors import SceneError, closest
from lgvi_warp.common.reading import file_text
from lgvi_warp.common.sentences import capital

PREFIX = "example:"
# Folders of such files.
_FOLDERS = ("", "scenes", "sweeps", "validation")


def example_files() -> dict[str, Path]:
    """Path of each file by name; a wheel has them in the package, a clone of the repository next to it."""
    package = Path(__file__).parents[1]
    home = next(place for place in (package / "examples", package.parent / "examples") if place.is_dir())
    return {path.stem: path for part in _FOLDERS for path in sorted((home / part).glob("*.toml"))}


def example_title(path: Path) -> str:
    """The first comment of a file, without the reference to a page."""
    comment = re.search(r"# *(.*?)(?:: docs/.*|\.)?$", file_text(path, "scene file"), re.MULTILINE)
    return comment[1] if comment else ""


def located(path: str | os.PathLike[str], folder: Path | None = None) -> str | os.PathLike[str]:
    """The path itself, below `folder` if given; for "example:NAME", the path of the file that comes with the package."""
    name = os.fspath(path) if isinstance(path, str | os.PathLike) else ""
    if not isinstance(name, str) or not name.startswith(PREFIX):
        return path if folder is None else folder / path
    files, name = example_files(), name.removeprefix(PREFIX)
    if name not in files:
        raise SceneError([f"{PREFIX}{name} is not a known example. {capital(closest(name, files))}"])
    return files[name]
