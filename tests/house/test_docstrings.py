# SPDX-License-Identifier: Apache-2.0
"""Every public method says what it does, or overrides one that does: ruff's D102 would ask it of overrides too."""

import importlib
import inspect
import pkgutil
import re
from types import ModuleType

import lgvi_warp
from tests.support.public import NAMED


def classes(module: ModuleType) -> list[type]:
    return [c for c in vars(module).values() if isinstance(c, type) and c.__module__ == module.__name__]


def silent(kind: type) -> list[str]:
    """Public methods and properties of a class that neither it nor any of its bases has a docstring for."""
    found = []
    for name, member in vars(kind).items():
        method = inspect.isroutine(member) or inspect.isdatadescriptor(member) or hasattr(member, "func")
        if name.startswith("_") or not method or name in vars(kind).get("__annotations__", {}):
            continue
        if not any(getattr(vars(base).get(name), "__doc__", None) for base in kind.__mro__):
            found.append(f"{kind.__module__}.{kind.__qualname__}.{name}")
    return found


class Spoken:
    def method(self):
        """Says something."""

    @property
    def number(self):
        return 1


class Heir(Spoken):
    def method(self):
        return 2

    @classmethod
    def make(cls):
        return cls()


def test_the_check_sees_properties_and_what_is_inherited():
    assert [name.rsplit(".", 1)[1] for name in silent(Spoken)] == ["number"]
    assert [name.rsplit(".", 1)[1] for name in silent(Heir)] == ["make"]


def test_every_public_method_has_a_docstring_or_inherits_one():
    names = [found.name for found in pkgutil.walk_packages(lgvi_warp.__path__, "lgvi_warp.")]
    modules = [importlib.import_module(name) for name in names if not name.rsplit(".", 1)[1].startswith("_")]
    assert len(modules) > 150
    public = [kind for module in modules for kind in classes(module) if not kind.__name__.startswith("_")]
    faults = [fault for kind in public for fault in silent(kind)]
    assert not faults, "\n".join(faults)


def test_public_docstrings_send_no_reader_to_what_is_not_public():
    sent = {
        (name, word)
        for name, thing in NAMED.items()
        for word in re.findall(r"(?:[Ss]ee|As in) `([A-Z]\w+)`", inspect.getdoc(thing) or "")
    }
    assert [(name, word) for name, word in sent if word not in NAMED] == []
