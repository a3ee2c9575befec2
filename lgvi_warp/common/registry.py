# SPDX-License-Identifier: Apache-2.0
"""Tables of classes by the word that a scene file gives them. Each class adds itself when it is made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from importlib import import_module
from pkgutil import walk_packages
from types import ModuleType
from typing import Any


class Kinds(MutableMapping[str, Any]):
    """Classes by their word. Those of a package are imported when their word is looked up: a scene names few of them.

    modules: modules of the package, and the words of the classes that each defines. They come first in lists. For a word
        that is not among them all modules are imported.
    """

    def __init__(self, package: str, modules: Mapping[str, Sequence[str]]):
        self.package = package
        self.homes = {word: f"{package}.{module}" for module, words in modules.items() for word in words}
        self._classes, self._all = dict[str, Any](), False

    def _import(self, word: object = None) -> None:
        """Import the module of a word; without one, or of another word, all modules."""
        if isinstance(word, str) and word in self.homes:
            import_module(self.homes[word])
        elif not self._all:
            self._all = True
            load_modules(import_module(self.package))

    def __getitem__(self, word: str) -> Any:
        if word not in self._classes:
            self._import(word)
        return self._classes[word]

    def __setitem__(self, word: str, kind: Any) -> None:
        self._classes[word] = kind

    def __delitem__(self, word: str) -> None:
        del self._classes[word]

    def __contains__(self, word: object) -> bool:
        if word not in self.homes and word not in self._classes:
            self._import(word)
        return word in self.homes or word in self._classes

    def __iter__(self) -> Iterator[str]:
        self._import()
        return iter(self.homes | self._classes)

    def __len__(self) -> int:
        self._import()
        return len(self.homes | self._classes)


def add(known: MutableMapping[str, Any], kind: type, attribute: str = "type") -> bool:
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
