# SPDX-License-Identifier: Apache-2.0
"""The user's Python functions and classes that a run depends on, and their identities."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields
from types import MethodType
from typing import Any, NamedTuple

from lgvi_warp.common.identity import identity
from lgvi_warp.control.base import SECTIONS
from lgvi_warp.control.callback import Callback
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.values.quantity import Quantity


class Own(NamedTuple):
    """A function or a class of the user, and its version; None if the user gave no version."""

    function: Any
    version: Any


def functions_of(fleet: Ensemble | None, statistics: Iterable[Statistic] = ()) -> dict[str, Own]:
    """List the user's functions and classes that a run or statistics depend on; no table can hold them."""
    functions = {} if fleet is None else dict(_of_fleet(fleet))
    for i, statistic in enumerate(statistics):
        version = getattr(statistic, "version", None)
        place = f"statistics[{i}] {statistic.key}"
        functions |= {f"{place}{part}": Own(function, version) for part, function in _of_statistic(statistic)}
    return functions


def identities(functions: dict[str, Own]) -> dict[str, str]:
    """Return the identities of functions, by their place in the scene."""
    return {place: identity(*function) for place, function in functions.items()}


class ToldApart:
    """Names for functions within one call: an identity, and a number that distinguishes objects of the same identity."""

    def __init__(self) -> None:
        # By place in memory, with the function, so that no other one gets the place.
        self._names: dict[tuple[Any, ...], tuple[Own, tuple[str, int]]] = {}

    def name(self, own_function: Own) -> tuple[str, int]:
        """Return a function's identity when it was first seen, and its number among functions of the same identity."""
        function = own_function.function
        parts = (function.__self__, function.__func__) if isinstance(function, MethodType) else (function,)
        key = (*map(id, parts), own_function.version)
        if key not in self._names:
            text = identity(*own_function)
            number = sum(known == text for _, (known, _) in self._names.values())
            self._names[key] = own_function, (text, number)
        return self._names[key][1]


def _of_fleet(fleet: Ensemble) -> Iterator[tuple[str, Own]]:
    scene = fleet.scene
    lists: dict[str, Iterable[Any]] = {"terms": scene.terms, "events": scene.events}
    if scene.controller is not None:
        lists |= {name: getattr(scene.controller, name) for name in SECTIONS}
    for name, parts in lists.items():
        for part in parts:
            if isinstance(part, Callback):
                yield f"{name}.{part.key}", Own(part.function, part.version)
            if _is_own(type(part)):
                yield f"{name}.{part.key} class", Own(type(part), None)
    if _is_own(type(fleet.sampling)):
        yield "sampling class", Own(type(fleet.sampling), None)
    for key, law in fleet.vary.items():
        place = f"vary.{key if isinstance(key, str) else ', '.join(key)}"
        if law.own is not None:
            yield place, Own(law.own, None)
        if _is_own(type(law)):
            yield f"{place} class", Own(type(law), None)


def _of_statistic(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Functions in a statistic's arguments, by their place in it."""
    if isinstance(value, Statistic | Quantity):
        if _is_own(type(value)):
            yield f"{place} class", type(value)
        for field in fields(value):
            yield from _of_statistic(getattr(value, field.name), f"{place}.{field.name}")
    elif isinstance(value, list | tuple):
        for i, entry in enumerate(value):
            yield from _of_statistic(entry, f"{place}[{i}]")
    elif callable(value) and not str(getattr(value, "__module__", "")).startswith("lgvi_warp."):
        yield place, value


def _is_own(kind: type) -> bool:
    return not kind.__module__.startswith("lgvi_warp.")
