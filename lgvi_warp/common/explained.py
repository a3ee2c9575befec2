# SPDX-License-Identifier: Apache-2.0
"""Methods whose raw errors name the argument that does not fit, where one does not: others stay as they are."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any, TypeVar

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import NothingToDraw, SceneError, refusal
from lgvi_warp.common.real_numbers import NotReal, is_whole, real_numbers

Kind = TypeVar("Kind", bound=type)
# Errors of Python and NumPy that an argument of another kind may lead to.
RAW = (TypeError, ValueError, LookupError, AttributeError, ArithmeticError, AssertionError, NotImplementedError)
# Where a function that is wrapped says so.
MARK = "_is_explained"


def explained(kind: Kind) -> Kind:
    """Let the public methods that a class defines name an argument that does not fit; nothing is checked before an error."""
    for name, value in list(vars(kind).items()):
        inner = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if name.startswith("_") or not inspect.isfunction(inner) or hasattr(inner, MARK):
            continue
        call = _explained(inner, not isinstance(value, staticmethod))
        setattr(kind, name, call if inner is value else type(value)(call))
    return kind


def _explained(function: Callable[..., Any], bound: bool = False) -> Callable[..., Any]:
    """The function, whose raw errors name an argument that does not fit; bound: the first argument is its object."""

    @functools.wraps(function)
    def call(*args: Any, **settings: Any) -> Any:
        try:
            return function(*args, **settings)
        except (SceneError, NothingToDraw):
            raise
        except RAW as error:
            if (fault := _misfit(function, bound, args, settings, error)) is None:
                raise
            raise fault from error

    setattr(call, MARK, True)
    return call


def _misfit(
    function: Callable[..., Any], bound: bool, args: tuple[Any, ...], settings: Mapping[str, Any], error: Exception
) -> SceneError | None:
    """A refusal of the first argument that is not what the function says that it takes, or lacks a key; None for none."""
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
        kinds = [_resolved(word.strip(), function) for word in _alternatives(words)]
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


def _alternatives(words: str) -> list[str]:
    """The parts of an annotation that "|" joins, outside of brackets."""
    return re.split(r"\|(?![^\[]*\])", words)


def _resolved(word: str, function: Callable[..., Any]) -> str:
    """A part of an annotation; what it stands for where it is the name of another annotation."""
    known = function.__globals__.get(word)
    return str(known) if known is not None and not isinstance(known, type) and known is not Any else word


def _fits(kind: str, value: Any) -> bool:
    """Whether a value may be of a kind, by the first word of an annotation."""
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
