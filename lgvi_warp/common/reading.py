# SPDX-License-Identifier: Apache-2.0
"""Reader for any file of a user: only regular files of bounded size, so that reading ends.

A path that the user names may be a link. A file found in a folder is checked by `safe_files.inside` first.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from lgvi_warp.common import safe_files
from lgvi_warp.common.arguments import of_a_file, path_of
from lgvi_warp.common.errors import NothingToDraw, SceneError
from lgvi_warp.common.sentences import capital, sentences

# Largest size of each kind of file [bytes]. Scenes and coefficients (YAML, XML) are written by hand or by a script; parsers
# read one or two megabytes a second of TOML, and a tenth of that of YAML. A table may hold millions of numbers; arrays are
# read as long as the file is.
MOST_BYTES = {"scene file": 1 << 20, "YAML file": 128 << 10, "CSV file": 512 << 20, "JSON file": safe_files.MOST_JSON,
              "NumPy file": sys.maxsize, "data set": sys.maxsize}  # fmt: skip
MOST_OTHERS = 16 << 20
PATHS = {"scene file": "give the path of a TOML file", "CSV file": "give the path of a CSV file"}
OTHER_PATHS = "give the path of a file, or its text"


class UnreadableError(ValueError):
    """Raised if a file cannot be read."""

    def __init__(self, problem: str, remedy: str):
        super().__init__(f"{problem}. {capital(remedy)}")
        self.what, self.remedy = problem, remedy

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the parts of the message, so that another process can raise the same error."""
        return type(self), (self.what, self.remedy), vars(self)


@contextlib.contextmanager
def opened(path: str | os.PathLike[str], kind: str) -> Iterator[BinaryIO]:
    """Open a regular file for reading."""
    # Checked before it is opened, since opening a device may have effects. Nothing here waits for a pipe's other end.
    _refuse(os.stat(path), kind)
    flags = (getattr(os, name, 0) for name in ("O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))
    with open(os.open(path, os.O_RDONLY | sum(flags)), "rb", buffering=0) as file:
        _refuse(os.fstat(file.fileno()), kind)
        yield file


def file_bytes(path: str | os.PathLike[str], kind: str) -> bytes:
    """Read all bytes of a regular file."""
    remedy, most = PATHS.get(kind, OTHER_PATHS), MOST_BYTES.get(kind, MOST_OTHERS)
    try:
        with opened(path, kind) as file:
            content = _first(file, most + 1)
    except (OSError, ValueError, TypeError, OverflowError) as error:
        if isinstance(error, UnreadableError):
            raise
        raise UnreadableError(str(getattr(error, "strerror", None) or error), remedy) from None
    if len(content) > most:
        raise UnreadableError("never ends", remedy)
    return content


def _first(file: BinaryIO, most: int) -> bytes:
    """Read at most this many bytes of an open file."""
    with io.BufferedReader(file) as buffered:  # type: ignore[type-var]
        return buffered.read(most)


def _refuse(stat: os.stat_result, kind: str) -> None:
    """Raise UnreadableError for a file that is not regular, or too large."""
    if problem := safe_files.kind(stat.st_mode):
        raise UnreadableError(problem, PATHS.get(kind, OTHER_PATHS))
    most = MOST_BYTES.get(kind, MOST_OTHERS)
    if stat.st_size > most:
        problem = f"has {stat.st_size / 1e6:,.1f} MB, more than the {most / 1e6:,.1f} MB that a {kind} may have"
        raise UnreadableError(problem, _smaller(kind))


def _smaller(kind: str) -> str:
    """Remedy for a file that is too large."""
    if kind == "CSV file":
        return "leave out columns or members, or give the numbers as arrays: lw.designs.Table({name: array})"
    if kind == "scene file":
        return "give members' own numbers as a table (CSV), long schedules as arrays"
    return "give a shorter one"


def text_of(content: bytes) -> str:
    """Decode bytes in UTF-8, without a byte order mark."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise UnreadableError("is in UTF-16", "save it in UTF-8")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        problem = f"is not a text in UTF-8: byte 0x{content[error.start]:02x} at {error.start:,}"
        raise UnreadableError(problem, "save it in UTF-8") from None


def file_text(path: str | os.PathLike[str], kind: str) -> str:
    """Read a text file in UTF-8."""
    try:
        content = file_bytes(path, kind)
    except UnreadableError as error:
        raise SceneError([sentences(f"{kind} {_name(path)}", error.what, error.remedy)]) from None
    try:
        return text_of(content)
    except UnreadableError as error:
        remedy = f"{error.remedy}, or {PATHS.get(kind, OTHER_PATHS)}"
        raise SceneError([sentences(f"{kind} {_name(path)}", error.what, remedy)]) from None


def file_json(path: str | os.PathLike[str]) -> Any:
    """Read a JSON file."""
    with opened(path, "JSON file") as file:
        return safe_files.parsed(text_of(_first(file, safe_files.MOST_JSON)))


@contextlib.contextmanager
def corrupt_file_as_scene_error(path: str | os.PathLike[str], otherwise: str, remedy: str) -> Iterator[None]:
    """Turn errors caused by a file's content in the `with` block into a fault of the file."""
    name, before = str(path_of("path", path)), of_a_file.set(True)
    try:
        yield
    except NothingToDraw:
        raise
    except SceneError as error:
        raise error if all(name in text for text in error.faults) else error.prefixed(f"{name}: ") from error
    except UnreadableError as error:
        raise SceneError([sentences(name, error.what, remedy)]) from error
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise SceneError([f"{name} is damaged, or {otherwise}: {reason}. {capital(remedy)}"]) from error
    except MemoryError:
        raise SceneError([f"{name} does not fit into memory. Read it on a larger machine"]) from None
    finally:
        of_a_file.reset(before)


def _name(path: str | os.PathLike[str]) -> str:
    """Show a path in a message; the repr of anything else."""
    return str(path) if isinstance(path, str | Path) else repr(path)
