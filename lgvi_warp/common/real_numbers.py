"""What a user gives for numbers, as an array of them: what is masked, labelled, or no real number is refused."""

from __future__ import annotations

from collections.abc import Iterator
from numbers import Real
from typing import Any

import numpy as np


class NotReal(ValueError):  # noqa: N818
    """A value that is no array of real numbers. what: is wrong with it; remedy: None for "give numbers"."""

    def __init__(self, what: str, remedy: str | None = None):
        super().__init__(what)
        self.what, self.remedy = what, remedy


def real_numbers(value: Any) -> np.ndarray:
    """A new float64 array of the same numbers, which may be NaN or infinite.

    Args:
        value: a number, lists of numbers, an array, or what NumPy makes an array of.

    Raises:
        NotReal: for texts, truth values, complex numbers and dates, alone or among numbers; for lists of different
            lengths; where a mask hides a number; and for a table whose columns have names, which would be lost.
    """
    for part in _parts(value):
        _check(part)
    if isinstance(value, np.ma.MaskedArray):
        value = value.data
    try:
        array = np.array(value)
        if array.dtype.kind == "O" and all(isinstance(one, Real) and not _is_word(one) for one in array.flat):
            return array.astype(np.float64)
        if array.dtype.kind in "iuf":
            return array.astype(np.float64)
    except (ValueError, TypeError, OverflowError, RuntimeError):
        pass
    raise NotReal("is not numeric")


def real_results(values: Any) -> np.ndarray:
    """What a user's function gave, as an array of numbers: NaN where it is masked; truth values stay as they are.

    Raises:
        NotReal: for complex numbers, texts, and what is no array.
    """
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
    """Whether a truth value or a text hides among numbers.

    [true, 1.0] would pass for [1.0, 1.0], and of one long text among many numbers NumPy makes as many long texts.
    """
    return any(_is_word(part) for part in _parts(value))


def column_names(value: Any) -> list[Any] | None:
    """Names of the columns of a table such as pandas.DataFrame or polars.DataFrame; None where it has none."""
    for name in ("column_names", "columns"):  # pyarrow's `columns` are the columns themselves
        names = getattr(value, name, None)
        if names is not None and not callable(names) and not isinstance(names, str):
            try:
                return list(names)
            except TypeError:
                continue
    return None


# NumPy's arrays have no more dimensions than that.
DEEPEST = 64


def _parts(value: Any, depth: int = 0) -> Iterator[Any]:
    """What lists within lists hold, a word for those that are too deep; the value itself where it is no list."""
    if depth > DEEPEST:
        yield "too deep"
    elif isinstance(value, list | tuple):
        for part in value:
            yield from _parts(part, depth + 1)
    else:
        yield value


def _is_word(part: Any) -> bool:
    """Whether it is a truth value, an array of them, or a text."""
    if isinstance(part, bool | np.bool_ | str | bytes):
        return True
    return isinstance(part, np.ndarray) and part.dtype.kind == "b"


def _check(part: Any) -> None:
    """Refuse what NumPy would take without a word."""
    if _is_word(part):
        raise NotReal("is not numeric")
    if isinstance(part, np.ma.MaskedArray) and np.ma.is_masked(part):
        raise NotReal(*_masked(part))
    names = column_names(part)
    if names is not None and names != list(range(len(names))):
        listed = ", ".join(map(str, names[:6])) + ", ..." * (len(names) > 6)
        what = f"is a table with names of columns ({listed}), which are not read here"
        raise NotReal(what, "give its numbers alone, in the order that is wanted: table[[...]].to_numpy()")


def _masked(part: np.ma.MaskedArray) -> tuple[str, str]:
    """(what is wrong, the remedy) with an array of which numbers are masked."""
    mask = np.ma.getmaskarray(part)
    if mask.dtype.names:
        return "has masked numbers", "leave out what is masked, or give numbers for it"
    if mask.ndim == 0:
        return "is masked: it has no number", "give a number for it, or leave it out"
    first = ", ".join(str(int(i)) for i in np.argwhere(mask)[0])
    what = f"has a mask that hides {int(mask.sum())} of {mask.size} numbers (the first: [{first}])"
    return what, "leave out what is masked, or give numbers for it: .filled(...)"
