# SPDX-License-Identifier: Apache-2.0
"""Arguments of public functions, read whatever the user gave: each returns what is meant, or refuses it by name."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common.errors import NoSuchMembers, ragged, refusal
from lgvi_warp.common.real_numbers import holds_words, is_whole, plain, whole_remedy

# Members are counted below this.
MOST = 2**31
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
        raise refusal(
            key, value, f"is no whole number from {least} to {most:,}", whole_remedy(value, f"give one from {least}")
        )
    return int(value)


def items_of(value: Any) -> list[Any] | None:
    """Read a list, tuple, array, column, range or iterator as a list; None for a text, a mapping and what is no list."""
    if isinstance(value, str | bytes | Mapping):
        return None
    value = plain(value)
    try:
        return value.tolist() if isinstance(value, np.ndarray) and value.ndim else list(value)
    except TypeError:
        return None


def listed(key: str, value: Any, problem: str) -> list[Any]:
    """Read a list; one text alone stands for a list of it."""
    items = [str(value)] if isinstance(value, str) else items_of(value)
    if items is None:
        raise refusal(key, value, "is no list", f"give a list of {problem}")
    return items


def members_of(key: str, value: Any, count: int | None = None) -> np.ndarray:
    """Read which members are meant: their indices, int64 (m,), in the order given; one may come several times.

    Indices are whole numbers from 0. A mask has a truth value for each of `count` members; a slice is of these.
    Raises an error that is a SceneError and an IndexError, also where no member is named.
    """
    if isinstance(value, range) and len(value):
        ends = np.array([value[0], value[-1]], dtype=object)
        fit = ends.min() >= 0 and ends.max() < (MOST if count is None else count)
        chosen = np.arange(value.start, value.stop, value.step) if fit else ends
    elif isinstance(value, slice) and count is not None:
        try:
            chosen = np.arange(count)[value]
        except (TypeError, ValueError):
            raise _no_members(key, value, "is no slice of whole numbers", "give slice(first, stop, step)") from None
    else:
        chosen = _indices(key, plain(value), count)
    if not len(chosen):
        raise _no_members(key, value, "names no member", "name one or more")
    if chosen.min() < 0:
        raise _no_members(key, int(chosen.min()), "is negative", "count members from 0")
    if count is not None and chosen.max() >= count:
        text = f"is none of the {count:,} members"
        raise _no_members(key, int(chosen.max()), text, f"give indices from 0 to {count - 1}")
    return chosen


def _indices(key: str, value: Any, count: int | None) -> np.ndarray:
    """Read indices, or a mask, of members."""
    whose = "is no list of members", "give whole numbers from 0, a slice, or a mask with a truth value for each member"
    array = np.asarray(None if ragged(value) else value)
    if array.dtype.kind == "O" and array.ndim == 1 and all(is_whole(entry, -(2**63), 2**63 - 1) for entry in array):
        array = array.astype(np.int64)
    mixed = array.dtype.kind in "iu" and isinstance(value, list | tuple) and holds_words(value)
    fits = array.dtype.kind in "iub" or not array.size
    if (
        array.ndim != 1
        or mixed
        or not fits
        or np.ma.is_masked(value)
        or (array.dtype.kind == "u" and np.any(array >= 2**63))
    ):
        raise _no_members(key, value, *whose)
    if array.dtype.kind != "b":
        return array.astype(np.int64)
    if len(array) != count:
        members = "members whose number is not known yet" if count is None else f"{count:,} members"
        raise _no_members(key, value, f"is a mask of {len(array):,} for {members}", whose[1])
    return np.flatnonzero(array)


def _no_members(key: str, value: Any, problem: str, remedy: str) -> NoSuchMembers:
    return NoSuchMembers(refusal(key, value, problem, remedy).faults)


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
