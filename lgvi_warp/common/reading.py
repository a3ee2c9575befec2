# SPDX-License-Identifier: Apache-2.0
"""Read a file that a user names: regular files only, of bounded size, so that reading ends."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from lgvi_warp.common.errors import SceneError

# Largest size of each kind of file [bytes]. Scenes and coefficients (YAML, XML) are written by hand or by a script; parsers
# read one or two megabytes a second of TOML, and a tenth of that of YAML. A table may hold millions of numbers.
MOST_BYTES = {"scene file": 1 << 20, "YAML file": 128 << 10, "CSV file": 512 << 20}
MOST_OTHERS = 16 << 20
PATHS = {"scene file": "give the path of a TOML file", "CSV file": "give the path of a CSV file"}
OTHER_PATHS = "give the path of a file, or its text"

KINDS = (
    (stat.S_ISDIR, "is a folder"),
    (stat.S_ISFIFO, "is a named pipe"),
    (stat.S_ISCHR, "is a device"),
    (stat.S_ISBLK, "is a device"),
    (stat.S_ISSOCK, "is a socket"),
)


class UnreadableError(ValueError):
    """A file is not read.

    Args:
        what: What is wrong with it.
        remedy: How to mend it.
    """

    def __init__(self, what: str, remedy: str):
        super().__init__(f"{what}; {remedy}")
        self.what, self.remedy = what, remedy


def file_bytes(path: str | os.PathLike[str], kind: str) -> bytes:
    """Read all bytes of a regular file.

    Args:
        path: The file.
        kind: What it is, such as "scene file"; a file larger than such files may be is refused before it is read.

    Returns:
        The bytes.

    Raises:
        UnreadableError: It is no regular file, is too large, or the system refuses it.
    """
    remedy, most = PATHS.get(kind, OTHER_PATHS), MOST_BYTES.get(kind, MOST_OTHERS)
    try:
        # Checked before it is opened, since opening a device may have effects. Nothing here waits for a pipe's other end.
        _refuse(os.stat(path), kind)
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
        with os.fdopen(descriptor, "rb") as file:
            _refuse(os.fstat(descriptor), kind)
            content = file.read(most + 1)
    except (OSError, ValueError, TypeError, OverflowError) as error:
        if isinstance(error, UnreadableError):
            raise
        raise UnreadableError(str(getattr(error, "strerror", None) or error), remedy) from None
    if content is None or len(content) > most:
        raise UnreadableError("never ends", remedy)
    return content


def _refuse(found: os.stat_result, kind: str) -> None:
    """Raise UnreadableError for a file that is not regular, or too large."""
    for is_kind, problem in KINDS:
        if is_kind(found.st_mode):
            raise UnreadableError(problem, PATHS.get(kind, OTHER_PATHS))
    most = MOST_BYTES.get(kind, MOST_OTHERS)
    if found.st_size > most:
        problem = f"has {found.st_size / 1e6:,.1f} MB, more than the {most / 1e6:,.1f} MB that a {kind} may have"
        raise UnreadableError(problem, _smaller(kind))


def _smaller(kind: str) -> str:
    """The remedy for a file that is too large."""
    if kind == "CSV file":
        return "leave out columns or members, or give the numbers as arrays: lw.Table({name: array})"
    if kind == "scene file":
        return "give members' own numbers as a table (CSV), long schedules as arrays"
    return "give a shorter one"


def text_of(content: bytes) -> str:
    """Decode bytes in UTF-8, without a byte order mark.

    Args:
        content: The bytes of a file.

    Returns:
        The text.

    Raises:
        UnreadableError: They are no text in UTF-8.
    """
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise UnreadableError("is in UTF-16", "save it in UTF-8")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        problem = f"is no text in UTF-8: byte 0x{content[error.start]:02x} at {error.start:,}"
        raise UnreadableError(problem, "save it in UTF-8") from None


def file_text(path: str | os.PathLike[str], kind: str) -> str:
    """Read a text file in UTF-8.

    Args:
        path: The file.
        kind: What it is, such as "scene file".

    Returns:
        The text.

    Raises:
        SceneError: It cannot be read; the message has the reason and the remedy.
    """
    try:
        content = file_bytes(path, kind)
    except UnreadableError as error:
        raise SceneError([f"{kind} {_name(path)}: {error}"]) from None
    try:
        return text_of(content)
    except UnreadableError as error:
        raise SceneError([f"{kind} {_name(path)}: {error}, or {PATHS.get(kind, OTHER_PATHS)}"]) from None


def _name(path: str | os.PathLike[str]) -> str:
    """A path as a message shows it; the repr of anything else."""
    return str(path) if isinstance(path, str | Path) else repr(path)
