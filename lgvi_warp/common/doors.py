# SPDX-License-Identifier: Apache-2.0
"""Lookup of names in a public module (a door): a stub file lists them, and each is imported at its first use."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any


def names_in_stub(door: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Make the values that a public module assigns to `__all__`, `__getattr__` and `__dir__`.

    The import of NumPy, SciPy and Warp is too slow for a script that only prints help or a version. So no module is
    imported before its name is used. `dir` also lists classes of installed extensions (lgvi_warp.common.extensions).

    door: name of the public module; its stub has one line "from module import name as public_name" for each name.
    """
    module = sys.modules[door]
    stub = ast.parse(module.__loader__.get_data(f"{module.__file__}i"))  # type: ignore[union-attr]
    places = {
        alias.asname or alias.name: (str(line.module), alias.name)
        for line in stub.body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }

    table = f"lw.{door.partition('.')[2]}"

    def find(name: str) -> Any:
        if name not in places:
            from lgvi_warp.common.extensions import load
            from lgvi_warp.common.nearest import meant
            from lgvi_warp.common.sentences import capital

            # A class: what else is asked for is a module of a room, mostly.
            if name[:1].isupper() and (kind := load(table, name)) is not None:
                return kind
            # What asks for private names asks whether a module has them.
            near = "" if name.startswith("_") else behind_another(name, door) or meant(name, tuple(listed()))
            raise AttributeError(f"module {door!r} has no attribute {name!r}{'. ' * bool(near)}{capital(near)}")
        home, name_there = places[name]
        # What a door holds of itself is a module.
        value = import_module(f"{door}.{name}") if home == door else getattr(import_module(home), name_there)
        if isinstance(value, type):
            from lgvi_warp.common.near import near_keywords

            near_keywords(value)
        setattr(module, name, value)
        return value

    def listed() -> list[str]:
        from lgvi_warp.common.extensions import words

        return sorted({*places, *words(table)})

    return sorted(places), find, listed


def behind_another(name: str, door: str) -> str:
    """Suggest other public modules that have this name; "" if there is none, or this module has it."""
    package = door.partition(".")[0]
    top = import_module(package).__all__
    # Who asks for a module of a room is not looking for a door.
    others = () if find_spec(f"{package}.{name}") else (each for each in top if find_spec(f"{package}.{each}"))
    doors = dict.fromkeys([door, package, *(f"{package}.{each}" for each in others)])
    found = {
        other: known for other in doors for known in import_module(other).__all__ if known.casefold() == name.casefold()
    }
    places = [f"'{other.replace(package, 'lw', 1)}.{known}'" for other, known in found.items()]
    return "" if door in found or not places else f"did you mean {' or '.join(places)}?"
