# SPDX-License-Identifier: Apache-2.0
"""Tables of classes by their word in scene files. Each class adds itself when it is defined.

Words that the core does not know are looked up in extensions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from importlib import import_module
from pkgutil import walk_packages
from types import ModuleType
from typing import Any


class Kinds(MutableMapping[str, Any]):
    """Classes by their word. A module of the package is imported when its word is looked up: a scene uses few of them.

    modules: modules of the package, and the words of the classes that each defines. They come first in lists. For a
        word that neither these modules nor extensions have, all modules are imported.
    package: package of the modules; "" for a table without such modules.
    table: name of this table in an extension's `HOLDS`; default "": extensions cannot add to the table.
    """

    def __init__(self, package: str, modules: Mapping[str, Sequence[str]], table: str = ""):
        self.package, self.table = package, table
        self.homes = {word: f"{package}.{module}" for module, words in modules.items() for word in words}
        self.loaded, self._all = dict[str, Any](), not package

    def _import(self, word: object) -> None:
        """Import the module of a word; if no module is known for it, all modules."""
        if not isinstance(word, str) or word in self.loaded:
            return
        if word in self.homes:
            import_module(self.homes[word])
        elif not (self.table and _extensions().load(self.table, word)):
            self._import_all()

    def _import_all(self) -> None:
        """Import all modules of the package."""
        if not self._all:
            self._all = True
            load_modules(import_module(self.package))

    def __getitem__(self, word: str) -> Any:
        self._import(word)
        return self.loaded[word]

    def __setitem__(self, word: str, kind: Any) -> None:
        self.loaded[word] = kind

    def __delitem__(self, word: str) -> None:
        del self.loaded[word]

    def __contains__(self, word: object) -> bool:
        if word not in self.homes:
            self._import(word)
        return word in self.homes or word in self.loaded

    def __iter__(self) -> Iterator[str]:
        self._import_all()
        others = _extensions().words(self.table) if self.table else ()
        return iter(self.homes | self.loaded | dict.fromkeys(others))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def setdefault(self, word: str, kind: Any = None) -> Any:
        # A class of the core is looked up nowhere else: while the core is imported no extension is.
        if kind.__module__.startswith(f"{self.package}."):
            return self.loaded.setdefault(word, kind)
        return super().setdefault(word, kind)


def _extensions() -> ModuleType:
    """Lookup of words in extensions, loaded for a word that the core does not know."""
    return import_module("lgvi_warp.common.extensions")


def add(known: MutableMapping[str, Any], kind: type, attribute: str = "type") -> bool:
    """Register a class by its word, unless another class has that word.

    A class of the same module and name replaces the former one: it is the same class, defined again in a notebook.
    """
    word = vars(kind).get(attribute)
    if not word:
        return False
    former = known.setdefault(word, kind)
    if (former.__module__, former.__qualname__) == (kind.__module__, kind.__qualname__):
        known[word] = kind
    return known[word] is kind


def load_modules(package: ModuleType) -> None:
    """Import every module of a package and of its subpackages, so that all its classes are registered."""
    for module in walk_packages(package.__path__, f"{package.__name__}."):
        import_module(module.name)
