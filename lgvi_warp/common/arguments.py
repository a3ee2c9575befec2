# SPDX-License-Identifier: Apache-2.0
"""Readers of arguments of public functions: each converts any value from a user, or refuses it by name."""

from __future__ import annotations

import functools
import inspect
import os
import re
from collections.abc import Callable, Mapping, Set
from contextvars import ContextVar
from numbers import Real
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from lgvi_warp.common.errors import NoSuchMembers, NothingToDraw, SceneError, ragged, refusal
from lgvi_warp.common.real_numbers import NotReal, holds_words, is_whole, plain, real_numbers, whole_remedy

# Whether a file is read: what its content raises is a fault of the file, not of an argument.
of_a_file: ContextVar[bool] = ContextVar("of_a_file", default=False)
# Members are counted below this.
MOST = 2**31
# What a path of files can be given as.
PATH = "give a path, as text or pathlib.Path"


def of_kind(key: str, value: Any, attributes: str, problem: str, remedy: str) -> Any:
    """Check that an argument has the attributes that the function reads."""
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
        raise refusal(key, value, "is not a path", PATH)
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
            key, value, f"is not a whole number from {least} to {most:,}", whole_remedy(value, f"give one from {least}")
        )
    return int(value)


def items_of(value: Any) -> list[Any] | None:
    """Read a list, tuple, array, column, range or iterator as a list; None for a text, a mapping or anything else."""
    if isinstance(value, str | bytes | Mapping | Set):
        return None
    value = plain(value)
    if isinstance(value, range):
        return None
    try:
        return value.tolist() if isinstance(value, np.ndarray) and value.ndim else list(value)
    except TypeError:
        return None


def listed(key: str, value: Any, problem: str) -> list[Any]:
    """Read a list; a single text stands for a list of one text."""
    items = [str(value)] if isinstance(value, str) else items_of(value)
    if items is None:
        raise refusal(key, value, "is not a list", f"give a list of {problem}")
    return items


def members_of(key: str, value: Any, count: int | None = None) -> np.ndarray:
    """Read a selection of members as indices, int64 (m,), in the given order; an index may occur several times.

    Indices are whole numbers from 0. A mask has a truth value for each of `count` members; a slice selects among these.
    Raises an error that is a SceneError and an IndexError, also if no member is selected.
    """
    if isinstance(value, range) and len(value):
        ends = np.array([value[0], value[-1]], dtype=object)
        fit = ends.min() >= 0 and ends.max() < (MOST if count is None else count)
        chosen = np.arange(value.start, value.stop, value.step) if fit else ends
    elif isinstance(value, slice) and count is not None:
        try:
            chosen = np.arange(count)[value]
        except (TypeError, ValueError):
            raise _no_members(key, value, "is not a slice of whole numbers", "give slice(first, stop, step)") from None
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
    """Read indices or a mask of members."""
    whose = (
        "is not a list of members",
        "give whole numbers from 0, a slice, or a mask with a truth value for each member",
    )
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
        raise refusal(key, value, "is not a mapping", f"give a dict of {problem}")
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
    """Read a function, or None for no function."""
    if value is not None and not callable(value):
        raise refusal(key, value, "is not a function", "give a function, or leave it out")
    return value


def names_of(key: str, value: Any) -> list[str]:
    """Read a list of names; a single name stands for a list of one name."""
    names = listed(key, value, "names")
    for name in names:
        if not isinstance(name, str):
            raise refusal(key, name, "is not a name", "give a list of names")
    return names


def name_set(key: str, value: Any) -> set[str]:
    """Read names whose order does not matter, also from a set or the keys of a mapping."""
    return set(names_of(key, list(value) if isinstance(value, Set | Mapping) else value))


Kind = TypeVar("Kind", bound=type)
# Errors of Python and NumPy that an argument of another kind may lead to.
RAW = (TypeError, ValueError, LookupError, AttributeError, ArithmeticError, AssertionError, NotImplementedError)
# Where a function that is wrapped says so.
MARK = "_is_explained"


def explained(kind: Kind) -> Kind:
    """Make errors in a class's public methods name the wrong argument. Arguments are checked only after an error."""
    # Readers refuse earlier where a user's argument comes in. This stays for some ninety methods, most of them of terms and
    # statistics that others override, which take arrays by fields: without it 43 % of their odd calls end in raw errors.
    for name, value in list(vars(kind).items()):
        inner = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if name.startswith("_") or not inspect.isfunction(inner) or hasattr(inner, MARK):
            continue
        call = _explained(inner, not isinstance(value, staticmethod))
        setattr(kind, name, call if inner is value else type(value)(call))
    return kind


def _explained(function: Callable[..., Any], bound: bool = False) -> Callable[..., Any]:
    """Wrap a function so that its raw errors name the wrong argument; bound: the first argument is the object itself."""

    @functools.wraps(function)
    def call(*args: Any, **settings: Any) -> Any:
        try:
            return function(*args, **settings)
        except (SceneError, NothingToDraw):
            raise
        except RAW as error:
            if of_a_file.get() or (fault := _misfit(function, bound, args, settings, error)) is None:
                raise
            raise fault from error

    setattr(call, MARK, True)
    return call


def _misfit(
    function: Callable[..., Any], bound: bool, args: tuple[Any, ...], settings: Mapping[str, Any], error: Exception
) -> SceneError | None:
    """Refuse the first argument that does not fit its annotation, or lacks a key; None if all fit."""
    signature = inspect.signature(function)
    try:
        given = list(signature.bind(*args, **settings).arguments.items())
    except TypeError:
        return None
    for name, value in given[bound:]:
        parameter = signature.parameters[name]
        told = parameter.annotation
        words = told.__name__ if isinstance(told, type) else str(told)
        loose = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD) or told is parameter.empty
        if loose or value is parameter.default:
            continue
        kinds = [_resolved(word.strip(), function) for word in alternatives(words)]
        if not any(_fits(kind, value) for kind in kinds):
            what = " or ".join(_WORDS.get(re.split(r"\W", kind.removeprefix("np."))[0], kind) for kind in kinds)
            return refusal(name, value, f"is not {what}", f"give what {function.__qualname__} takes")
    key = error.args[0] if isinstance(error, KeyError) and error.args else None
    for name, value in given[bound:]:
        items = list(value) if isinstance(value, Mapping) else items_of(value)
        lacking = key is not None and items is not None and (isinstance(value, Mapping) or key in items)
        if items == [] or lacking:
            text = f"does not fit: {key} is not there" if items else "is empty"
            return refusal(name, value, text, f"give what {function.__qualname__} takes")
    return None


def alternatives(words: str) -> list[str]:
    """Split an annotation at each "|" outside of brackets."""
    return re.split(r"\|(?![^\[]*\])", words)


def _resolved(word: str, function: Callable[..., Any]) -> str:
    """Resolve a part of an annotation, if it is the name of another annotation."""
    known = function.__globals__.get(word)
    return str(known) if known is not None and not isinstance(known, type) and known is not Any else word


def _fits(kind: str, value: Any) -> bool:
    """Whether a value may be of a kind, given by the first word of an annotation."""
    word = re.split(r"[\[\]( ]", kind.removeprefix("np.").removeprefix("typing.").removeprefix("collections.abc."))[0]
    if word in ("Any", "object", "Self", "TypeVar", ""):
        return True
    if word in _TESTS:
        return _TESTS[word](kind, value)
    # A class of this package: no value of Python's or NumPy's own kinds is one.
    return type(value).__module__ not in ("builtins", "numpy", "numpy.ma", "numpy.ma.core")


def _is_array(kind: str, value: Any) -> bool:
    try:
        return real_numbers(value).ndim > 0
    except NotReal:
        return isinstance(value, np.ndarray) and value.dtype.kind == "b"


def _is_list(kind: str, value: Any) -> bool:
    items = items_of(value)
    texts = [isinstance(item, str) for item in items or ()]
    return items is not None and ("Any" in kind or (all(texts) if "str" in kind else not any(texts)))


def _is_number(kind: str, value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and bool(abs(value) < 1e300)  # type: ignore[operator]


_TESTS: dict[str, Callable[[str, Any], bool]] = {
    "None": lambda kind, value: value is None,
    "int": lambda kind, value: is_whole(value, -(2**63), 2**63 - 1),
    "float": _is_number,
    "str": lambda kind, value: isinstance(value, str) and value != "",
    "bool": lambda kind, value: isinstance(value, bool | np.bool_),
    "slice": lambda kind, value: isinstance(value, slice),
    "ndarray": _is_array,
    "os.PathLike": lambda kind, value: hasattr(value, "__fspath__"),
    "Path": lambda kind, value: hasattr(value, "__fspath__"),
    "Callable": lambda kind, value: callable(value),
} | dict.fromkeys(("Mapping", "dict", "MutableMapping"), lambda kind, value: isinstance(value, Mapping)) \
  | dict.fromkeys(("Sequence", "list", "tuple", "Iterable", "Iterator", "Collection"), _is_list)  # fmt: skip
_WORDS = {
    "int": "a whole number", "float": "a number", "str": "a text", "bool": "True or False", "ndarray": "an array of numbers",
    "Mapping": "a mapping", "dict": "a mapping", "Sequence": "a list", "list": "a list", "tuple": "a list",
    "Iterable": "a list", "Collection": "a list", "Callable": "a function", "os": "a path",
}  # fmt: skip
