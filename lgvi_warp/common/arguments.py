# SPDX-License-Identifier: Apache-2.0
"""Arguments of public functions, read whatever the user gave: each returns what is meant, or refuses it by name."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lgvi_warp.common.errors import refusal
from lgvi_warp.common.real_numbers import is_whole

# What a path of files can be given as.
PATH = "give a path, as text or pathlib.Path"


def of_kind(key: str, value: Any, attributes: str, problem: str, remedy: str) -> Any:
    """Read an object that the function looks into."""
    if isinstance(value, type) or not all(hasattr(value, name) for name in attributes.split()):
        raise refusal(key, value, f"is not {problem}", remedy)
    return value


def result_of(value: Any) -> Any:
    """Read the result of a run."""
    return of_kind(
        "result", value, "samples status provenance", "a Result", "give what lw.solve or lw.open_run returns"
    )


def path_of(key: str, value: Any) -> Path:
    """Read a path."""
    text = value if isinstance(value, str) else os.fspath(value) if isinstance(value, os.PathLike) else None
    if not isinstance(text, str):
        raise refusal(key, value, "is no path", PATH)
    if "\0" in text or not text:
        raise refusal(key, value, "holds a null character" if text else "is empty", PATH)
    try:
        os.fsencode(text)
    except UnicodeEncodeError:
        raise refusal(key, value, "holds a character that no name of a file can hold", PATH) from None
    return Path(text)


def file_path(key: str, value: Any) -> Path:
    """Read the path of a file that is to be written."""
    path = path_of(key, value)
    if not path.name:
        raise refusal(key, value, "names no file", "end it in the name of the file")
    return path


def whole_number(key: str, value: Any, least: int, most: int = 2**31 - 1) -> int:
    """Read a whole number."""
    if not is_whole(value, least, most):
        raise refusal(key, value, f"is no whole number from {least} to {most:,}", f"give one from {least}")
    return int(value)


def listed(key: str, value: Any, problem: str) -> list[Any]:
    """Read a list; one text alone stands for a list of it."""
    if isinstance(value, str):
        return [value]
    try:
        return list(value)
    except TypeError:
        raise refusal(key, value, "is no list", f"give a list of {problem}") from None


def mapping_of(key: str, value: Any, problem: str) -> Mapping[Any, Any]:
    """Read a mapping."""
    if not isinstance(value, Mapping):
        raise refusal(key, value, "is no mapping", f"give a dict of {problem}")
    return value


def ensemble_of(value: Any) -> Any:
    """Read an ensemble."""
    return of_kind("fleet", value, "scene members sampling", "an Ensemble", "give lw.Ensemble(scene, members)")


def flag(key: str, value: Any) -> bool:
    """Read a truth value."""
    try:
        if value == bool(value):  # 0 and 1 too, and NumPy's
            return bool(value)
    except (TypeError, ValueError):
        pass
    raise refusal(key, value, "is neither true nor false", "give True or False")


def function_of(key: str, value: Any) -> Any:
    """Read a function, or None for none."""
    if value is not None and not callable(value):
        raise refusal(key, value, "is no function", "give a function, or leave it out")
    return value


def names_of(key: str, value: Any) -> list[str]:
    """Read a list of names; one name alone stands for a list of it."""
    names = listed(key, value, "names")
    for name in names:
        if not isinstance(name, str):
            raise refusal(key, name, "is no name", "give a list of names")
    return names
