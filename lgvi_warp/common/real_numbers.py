# SPDX-License-Identifier: Apache-2.0
"""Reader of a user's numbers as an array; masked, labelled and non-real values are refused."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Generator, Iterator
from numbers import Integral, Real
from typing import Any

import numpy as np

from lgvi_warp.common.sentences import sentences

# Most entries of a range or an iterator that is read: a longer range is left as it is, and an iterator may be endless.
MOST_ENTRIES = 10_000_000


class NotReal(ValueError):  # noqa: N818
    """Raised for a value that is not an array of real numbers; the default remedy is "give numbers"."""

    def __init__(self, problem: str, remedy: str | None = None):
        super().__init__(problem)
        self.what, self.remedy = problem, remedy


def real_numbers(value: Any) -> np.ndarray:
    """Read real numbers into a new float64 array of their shape; they may be NaN or infinite."""
    value = plain(value)
    if isinstance(value, range):
        raise NotReal(f"has more than {MOST_ENTRIES:,} entries")
    for leaf in _parts(value):
        _check(leaf)
    if isinstance(value, np.ma.MaskedArray):
        value = value.data
    try:
        array = np.array(value)
        if array.dtype.kind == "O" and all(isinstance(item, Real) and not _is_word(item) for item in array.flat):
            return array.astype(np.float64)
        if array.dtype.kind in "iuf":
            return array.astype(np.float64, copy=False)
    except (ValueError, TypeError, OverflowError, RuntimeError):
        pass
    raise NotReal("is not numeric")


def plain(value: Any) -> Any:
    """Read an iterator, a range and a data frame's column as a list or array, and NumPy's texts as texts.

    Any other value is returned unchanged. Keep the list from an iterator, since an iterator can be read only once.
    """
    if isinstance(value, np.str_):
        return str(value)
    if isinstance(value, range) and len(value) > MOST_ENTRIES:
        return value
    if isinstance(value, range | Iterator | Generator):
        items = [plain(item) for item in itertools.islice(value, MOST_ENTRIES + 1)]
        if len(items) > MOST_ENTRIES:
            raise NotReal(f"has more than {MOST_ENTRIES:,} entries")
        return items
    if isinstance(value, list | tuple):
        return type(value)(map(str, value)) if value and all(type(item) is np.str_ for item in value) else value
    if isinstance(value, np.ndarray):
        return value.tolist() if value.dtype.kind == "U" and value.ndim else value
    if isinstance(value, np.generic | type) or not (hasattr(value, "__array__") and hasattr(value, "__iter__")):
        return value
    # Names of columns, and of what xarray has along its dimensions, are for other readers.
    return value if column_names(value) is not None or hasattr(value, "coords") else plain(np.asarray(value))


def settle(settings: Any, *names: str) -> None:
    """Convert the values of a dataclass's fields, all or the named ones, by `plain`."""
    for name in names or [item.name for item in dataclasses.fields(settings) if item.init]:
        value = getattr(settings, name)
        read = plain(value)
        if read is not value:
            object.__setattr__(settings, name, read)


def settles_first(kind: type) -> None:
    """Decorator: a class converts the values of its fields before its own checks."""
    own = vars(kind).get("__post_init__")
    if own is not None:

        @functools.wraps(own)
        def post_init(settings: Any) -> None:
            settle(settings)
            own(settings)

        kind.__post_init__ = post_init  # type: ignore[attr-defined]


def answered(who: str, values: Any) -> np.ndarray:
    """Read control values from a user's function or agent; no value is omitted or converted silently.

    Returns: float64, in the shape of the values; a float64 array is returned itself.
    """
    if type(values) is np.ndarray and values.dtype.kind in "iuf":
        return values.astype(np.float64, copy=False)
    try:
        return real_numbers(values)
    except NotReal as error:
        raise ValueError(sentences(who, error.what, error.remedy or "give real numbers")) from None


def real_results(values: Any) -> np.ndarray:
    """Read the numbers that a user's function returned; masked ones become NaN."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        if values.dtype.kind not in "biuf":
            raise NotReal("gave no real numbers")
        return np.asarray(np.ma.filled(values.astype(np.float64), np.nan))
    try:
        array = np.asarray(values)
    except ValueError:
        raise NotReal("gave lists of different lengths") from None
    if array.dtype.kind not in "biuf":
        raise NotReal(f"gave {'complex' if array.dtype.kind == 'c' else 'no'} numbers")
    return array


def holds_words(value: Any) -> bool:
    """Tell whether there is a truth value or a text among numbers.

    NumPy would read [true, 1.0] as [1.0, 1.0], and one long text among many numbers as many long texts.
    """
    return any(_is_word(leaf) for leaf in _parts(value))


def is_whole(value: Any, least: int, most: float = math.inf) -> bool:
    """Tell whether a value is a whole number within bounds; truth values are not."""
    return isinstance(value, Integral) and not isinstance(value, bool) and least <= int(value) <= most


def whole_remedy(value: Any, remedy: str) -> str:
    """Suggest a whole number for a value that is none: 10000 for 1e4, which Python and TOML read as a float."""
    if isinstance(value, float | np.floating) and math.isfinite(value) and value == round(value):
        return f"write {round(value)}, since a number with a point or an exponent is not a whole number here"
    return remedy


def column_names(value: Any) -> list[Any] | None:
    """Column names of a table such as pandas.DataFrame or polars.DataFrame; None for a value without columns."""
    for name in ("column_names", "columns"):  # pyarrow's `columns` are the columns themselves
        names = getattr(value, name, None)
        if names is not None and not callable(names) and not isinstance(names, str):
            try:
                return list(names)
            except TypeError:
                continue
    return None


# Most dimensions of NumPy's arrays.
DEEPEST = 64


def _parts(value: Any, depth: int = 0) -> Iterator[Any]:
    """Items of nested lists, or a text for lists that are nested too deeply; the value itself if it is no list."""
    if depth > DEEPEST:
        yield "too deep"
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _parts(item, depth + 1)
    else:
        yield value


def _is_word(part: Any) -> bool:
    """Tell whether a value is a truth value, an array of them, or a text."""
    if isinstance(part, bool | np.bool_ | str | bytes):
        return True
    return isinstance(part, np.ndarray) and part.dtype.kind == "b"


def _check(part: Any) -> None:
    """Refuse a value that NumPy would convert silently."""
    if _is_word(part):
        raise NotReal("is not numeric")
    if isinstance(part, np.ma.MaskedArray) and np.ma.is_masked(part):
        raise NotReal(*_masked(part))
    names = column_names(part)
    if names is not None and names != list(range(len(names))):
        listed = ", ".join(map(str, names[:6])) + ", ..." * (len(names) > 6)
        problem = f"is a table with names of columns ({listed}), which are not read here"
        raise NotReal(problem, "give its numbers alone, in the order that is wanted: table[[...]].to_numpy()")


def _masked(part: np.ma.MaskedArray) -> tuple[str, str]:
    """Make (problem, remedy) for an array with masked numbers."""
    mask = np.ma.getmaskarray(part)
    if mask.dtype.names:
        return "has masked numbers", "leave out what is masked, or give numbers for it"
    if mask.ndim == 0:
        return "is masked: it has no number", "give a number for it, or leave it out"
    first = ", ".join(str(int(i)) for i in np.argwhere(mask)[0])
    problem = f"has a mask that hides {int(mask.sum())} of {mask.size} numbers (the first: [{first}])"
    return problem, "leave out what is masked, or give numbers for it: .filled(...)"
