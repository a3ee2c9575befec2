# SPDX-License-Identifier: Apache-2.0
"""Fields of settings that declare their allowed values; `read` checks them. For numbers that vary by member: `number`."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.real_numbers import is_whole, settle, whole_remedy


def declared(reader: Callable[..., Any], default: Any = dataclasses.MISSING, **arguments: Any) -> Any:
    """Declare a field by its reader, with additional arguments of the reader. If its default is None, None is not read.

    reader: Function that adds a fault for a wrong value of a key, and returns the converted value, as methods of `Faults`.
    """
    return dataclasses.field(default=default, metadata={"reader": reader, "arguments": arguments})


# real(9.81, unit="m/s2", least=0.0), array(None, shape=(3,), unit="m"), word("refuse", known=("refuse", "resume"))
real = functools.partial(declared, Faults.number)
positive = functools.partial(declared, Faults.positive)
array = functools.partial(declared, Faults.finite)
symmetric = functools.partial(declared, Faults.symmetric)
word = functools.partial(declared, Faults.choice)


def checked(good: Callable[[Any], bool], problem: str, remedy: str, default: Any = dataclasses.MISSING) -> Any:
    """Declare a value by a condition, and the fault of a value that does not meet it."""
    return declared(_check, default, good=good, problem=problem, remedy=remedy)


def _check(faults: Faults, key: str, value: Any, good: Callable[[Any], bool], problem: str, remedy: str) -> Any:
    return value if good(value) else faults.add(key, value, problem, remedy)


text = functools.partial(checked, lambda value: isinstance(value, str))
flag = functools.partial(
    checked, lambda value: isinstance(value, bool), "is neither true nor false", "give one of them"
)


def whole(least: int, problem: str, remedy: str, default: Any = dataclasses.MISSING) -> Any:
    """Declare a whole number, of Python or of NumPy."""
    return declared(_whole, default, least=least, problem=problem, remedy=remedy)


def _whole(faults: Faults, key: str, value: Any, least: int, problem: str, remedy: str) -> Any:
    return value if is_whole(value, least) else faults.add(key, value, problem, whole_remedy(value, remedy))


@functools.cache
def _declared_fields(kind: Any) -> dict[str, dataclasses.Field[Any]]:
    return {item.name: item for item in dataclasses.fields(kind) if "reader" in item.metadata}


def read(settings: Any, faults: Faults, *names: str) -> dict[str, Any]:
    """Read declared fields of an object, all or the named ones, and add faults; a field with a fault becomes None."""
    values, known = {}, _declared_fields(type(settings))  # type: ignore[arg-type]  # a class is hashable
    settle(settings, *names)
    for name in names or known:
        value, item = getattr(settings, name), known[name]
        skipped = value is None and item.default is None
        values[name] = None if skipped else item.metadata["reader"](faults, name, value, **item.metadata["arguments"])
    return values


Settings = TypeVar("Settings")


def from_table(kind: type[Settings], key: str, table: Any, example: str, **needed: str) -> Settings:
    """Build settings from a table of a scene file; needed: remedies by required key. Settings are returned unchanged."""
    if isinstance(table, kind):
        return table
    if not isinstance(table, Mapping):
        raise refusal(key, table, "is not a table", example)
    faults = Faults()
    faults.keys(key, table, [item.name for item in dataclasses.fields(kind) if item.init])  # type: ignore[arg-type]
    for name in (name for name in needed if name not in table):
        faults.add(f"{key}.{name}", "", "is missing", needed[name])
    faults.raise_if_any()
    return kind(**table)
