# SPDX-License-Identifier: Apache-2.0
"""Extensions: the folders of `lgvi_warp.extensions`, and installed packages with an entry point of this group.

The core imports no extension by name. An extension is a module with a table `HOLDS`: {table: {word: place}}. A place is
".module", ".module:name" or, for a file, "file.toml", relative to the extension's own folder. Other modules of an
extension are imported when one of its words is looked up.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Iterator
from importlib import import_module, resources
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

GROUP = "lgvi_warp.extensions"


@functools.cache
def built_in() -> tuple[ModuleType, ...]:
    """The extensions of this package, in alphabetical order: its folders, for every kind of installation."""
    spec = find_spec(GROUP)
    places = spec.submodule_search_locations if spec else None
    return tuple(import_module(f"{GROUP}.{found.name}") for found in iter_modules(places or ()) if found.ispkg)


@functools.cache
def installed() -> tuple[ModuleType, ...]:
    """The extensions of other packages. If one cannot be imported, a warning is given and it is left out."""
    from importlib.metadata import entry_points  # loads slowly

    modules = []
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        try:
            modules.append(import_module(point.module))
        except Exception as error:
            problem = f"cannot be imported ({type(error).__name__}: {error})"
            warnings.warn(f"extension {point.name}: {problem}. Reinstall or remove its package.", stacklevel=2)
    return tuple(modules)


def _holders(table: str) -> Iterator[tuple[ModuleType, dict[str, str]]]:
    """Each extension with its part of a table, built-in ones first; an extension may have no table during its import."""
    for extensions in (built_in, installed):
        for module in extensions():
            yield module, getattr(module, "HOLDS", {}).get(table, {})


def words(table: str) -> list[str]:
    """List the words of all extensions in a table."""
    return list(dict.fromkeys(word for _, held in _holders(table) for word in held))


def holder(table: str, word: str) -> tuple[ModuleType, str] | None:
    """Find the first extension that has a word in a table, and the place of the word; None if no extension has it."""
    return next(((module, held[word]) for module, held in _holders(table) if word in held), None)


def load(table: str, word: str) -> Any:
    """Import the module, or its object, for a word of an extension; None if no extension has the word."""
    found = holder(table, word)
    if found is None:
        return None
    module, name = found[1].partition(":")[::2]
    home = import_module(module, found[0].__name__)
    return getattr(home, name) if name else home


def file(table: str, word: str) -> Path | None:
    """Path of the file for a word of an extension; None if no extension has the word."""
    found = holder(table, word)
    return None if found is None else Path(str(resources.files(found[0].__name__) / found[1]))
