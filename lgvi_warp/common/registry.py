# SPDX-License-Identifier: Apache-2.0
"""Tables of classes by the word that a scene file gives them. Each class adds itself when it is made."""

from __future__ import annotations

from importlib import import_module
from pkgutil import walk_packages
from types import ModuleType
from typing import Any


def add(known: dict[str, Any], kind: type, attribute: str = "type") -> bool:
    """Make a class known by its word, unless another class has that word.

    A class of the same module and name replaces the former one: it is the same class, made again in a notebook.
    """
    word = vars(kind).get(attribute)
    if not word:
        return False
    former = known.setdefault(word, kind)
    if (former.__module__, former.__qualname__) == (kind.__module__, kind.__qualname__):
        known[word] = kind
    return known[word] is kind


def load_modules(package: ModuleType) -> None:
    """Import every module of a package and of its inner folders, so that all its classes are known."""
    for module in walk_packages(package.__path__, f"{package.__name__}."):
        import_module(module.name)
