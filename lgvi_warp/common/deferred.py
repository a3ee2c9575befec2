# SPDX-License-Identifier: Apache-2.0
"""Fields of a dataclass whose values are made at their first use."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Deferred:
    """A field of a dataclass that holds a value, or a function without arguments that makes the value at its first use."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            # What dataclasses understand: the field has no default.
            raise AttributeError(self._name)
        value = vars(instance)[self._name]
        if callable(value):
            value = vars(instance)[self._name] = value()
        return value

    def __set__(self, instance: Any, value: Any) -> None:
        vars(instance)[self._name] = value


class Once:
    """A function without arguments that runs once; later calls return its value. It can be pickled if its value can."""

    def __init__(self, function: Callable[[], Any]):
        self._function, self._values = function, list[Any]()

    def __call__(self) -> Any:
        if not self._values:
            self._values.append(self._function())
        return self._values[0]
