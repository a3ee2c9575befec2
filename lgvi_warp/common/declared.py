# SPDX-License-Identifier: Apache-2.0
"""Fields of settings that say what they hold: a unit and bounds, known words, or a condition. `read` reads them all.

Where None is the default of a field, None is not read. The fields of a term that vary by member are declared by `number`.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.real_numbers import is_whole

REQUIRED: Any = dataclasses.MISSING
# Notes what is wrong with the value of a key. Returns what the value means, or None after a fault.
Reader = Callable[[Faults, str, Any], Any]


def declared(reader: Reader, default: Any, unit: str = "") -> Any:
    """Declare a field by the function that reads it."""
    return dataclasses.field(default=default, metadata={"reader": reader, "unit_read": unit})


def real(unit: str, default: Any = REQUIRED, least: float = -np.inf) -> Any:
    """Declare one finite number."""
    return declared(lambda faults, key, value: faults.number(key, value, unit, least), default, unit)


def positive(unit: str, default: Any = REQUIRED) -> Any:
    """Declare one finite number above 0."""
    return declared(lambda faults, key, value: faults.positive(key, value, unit), default, unit)


def array(shape: tuple[int, ...], unit: str, default: Any = REQUIRED) -> Any:
    """Declare finite numbers of a shape."""
    return declared(lambda faults, key, value: faults.finite(key, value, shape, unit), default, unit)


def symmetric(size: int, unit: str, default: Any = REQUIRED) -> Any:
    """Declare a symmetric matrix, or the diagonal of a diagonal one."""
    return declared(lambda faults, key, value: faults.symmetric(key, value, unit, size), default, unit)


def word(known: Iterable[Any], default: Any = REQUIRED) -> Any:
    """Declare one of the words that are known."""
    return declared(lambda faults, key, value: value if faults.choice(key, value, known) else None, default)


def checked(good: Callable[[Any], bool], problem: str, remedy: str, default: Any = REQUIRED) -> Any:
    """Declare a value that a condition lets through, and what a fault says of any other."""

    def reader(faults: Faults, key: str, value: Any) -> Any:
        if good(value):
            return value
        return faults.add(key, value, problem, remedy)

    return declared(reader, default)


def text(problem: str, remedy: str, default: Any = REQUIRED) -> Any:
    """Declare a text."""
    return checked(lambda value: isinstance(value, str), problem, remedy, default)


def whole(least: int, problem: str, remedy: str, default: Any = REQUIRED) -> Any:
    """Declare a whole number, of Python or of NumPy."""
    return checked(lambda value: is_whole(value, least), problem, remedy, default)


def flag(default: bool) -> Any:
    """Declare a truth value."""
    return checked(lambda value: isinstance(value, bool), "is neither true nor false", "give one of them", default)


@functools.cache
def _declared_fields(kind: Any) -> dict[str, tuple[Reader, bool]]:
    """Of each declared field of a class, in order, its reader and whether None is not read."""
    fields = (item for item in dataclasses.fields(kind) if "reader" in item.metadata)
    return {item.name: (item.metadata["reader"], item.default is None) for item in fields}


def read(settings: Any, faults: Faults, *names: str) -> dict[str, Any]:
    """Read declared fields of an object, and note what is wrong.

    names: Those to read; all of them by default.
    Returns: What was read, by name: None after a fault, and for None where that is the default.
    """
    fields = _declared_fields(type(settings))
    values = {}
    for name in names or fields:
        reader, optional = fields[name]
        value = getattr(settings, name)
        values[name] = None if value is None and optional else reader(faults, name, value)
    return values


def units(kind: Any) -> dict[str, str]:
    """The units of a class's declared fields, by name."""
    return {item.name: item.metadata["unit_read"] for item in dataclasses.fields(kind) if "reader" in item.metadata}
