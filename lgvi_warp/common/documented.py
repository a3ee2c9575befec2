# SPDX-License-Identifier: Apache-2.0
"""Classes for which `dir()`, and so tab completion, lists only documented names."""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from abc import ABCMeta
from collections.abc import Iterable
from typing import Any

_SECTION = re.compile(r"^(?:Args|Attributes|Methods):\n((?:    .*\n|\n)*)", re.MULTILINE)
_OURS = __name__.partition(".")[0]


def documented_names(kind: type) -> set[str]:
    """Names in the sections Args, Attributes and Methods of a class's docstring."""
    text = inspect.cleandoc(kind.__doc__ or "") + "\n"
    return set(re.findall(r"^    (\w+):", "".join(_SECTION.findall(text)), re.MULTILINE))


class _Names(ABCMeta):
    """Metaclass for `dir()` of a class itself; derived from ABCMeta, so that a subclass may be abstract."""

    def __dir__(cls) -> list[str]:
        return _listed(cls, super().__dir__())


class Documented(metaclass=_Names):
    """Base class: `dir()` lists fields, documented names, and all names that a class outside the package defines.

    The other names are for authors of laws. A base class for authors, which has no word in scene files, also lists the
    names that its own base classes document.
    """

    def __dir__(self) -> list[str]:
        return _listed(type(self), super().__dir__())


def _listed(kind: Any, names: Iterable[str]) -> list[str]:
    if sys.flags.optimize > 1:  # python -OO removes docstrings
        return sorted(names)
    has_word = getattr(kind, "type", "") or getattr(kind, "kind", "")
    shown = {item.name for item in dataclasses.fields(kind) if item.init} if dataclasses.is_dataclass(kind) else set()
    shown = shown.union(*map(documented_names, [kind] if has_word else kind.__mro__[:-1]))
    shown = shown.union(*(vars(base) for base in kind.__mro__[:-1] if base.__module__.partition(".")[0] != _OURS))
    return sorted(name for name in names if name.startswith("_") or name in shown)
