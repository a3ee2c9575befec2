# SPDX-License-Identifier: Apache-2.0
"""Identity of a Python function: a hash of its behaviour, the same in every process and session."""

from __future__ import annotations

import dis
import functools
import hashlib
import os
import sys
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults

# What `identity` returns where nothing can be promised: no two such functions are taken for the same.
UNKNOWN = "unknown"
# Code that a function makes as it runs, or reads from outside, is not seen in it.
HIDDEN = {"eval", "exec", "globals", "__import__", "compile", "open", "input"}
# Libraries whose versions are compared elsewhere, as Python's is: what they hold is known by its name.
KNOWN = {"lgvi_warp", "lgvi_kernels", "warp", "numpy", "scipy"}
# What a class holds that is no part of what it does.
OF_CLASSES = {
    "__module__", "__doc__", "__dict__", "__weakref__", "__annotations__", "__annotate__", "__annotate_func__",
    "__annotations_cache__", "__firstlineno__", "__static_attributes__", "__type_params__", "__orig_bases__",
    "__parameters__", "__dataclass_fields__", "__dataclass_params__", "__match_args__", "_abc_impl",
}  # fmt: skip
DESCRIPTORS = (types.MethodDescriptorType, types.WrapperDescriptorType, types.GetSetDescriptorType,
               types.MemberDescriptorType, types.ClassMethodDescriptorType)  # fmt: skip
# Attributes by which compiled functions hold the Python function that they were made of.
MADE_OF = ("__wrapped__", "py_func", "func", "cls")


def identity(function: Any, version: Any = None) -> str:
    """Identify a function, class or object by a hash of its behaviour.

    The hash includes code, names, constants, defaults, closure values, the globals that the code names, and all objects
    that these refer to; arrays by their numbers. It does not include file names and line numbers.

    version: the user's own version of the object, used instead of a hash; default None.
    """
    if version is not None:
        return f"version {version}"
    try:
        return f"{sys.implementation.cache_tag} {_Reader().read(function)}"
    except (_NotToldError, RecursionError):
        return UNKNOWN


def check_version(faults: Faults, version: Any) -> None:
    """Add a fault for a version that is neither a text nor a number.

    version: the user's value; None for no version.
    """
    if version is not None and (isinstance(version, bool) or not isinstance(version, str | int | float)):
        faults.add("version", version, "is neither a text nor a number", 'give version="2"')


def comparable(first: str, second: str) -> bool:
    """Tell whether a difference between two identities can only mean that the functions differ."""
    return UNKNOWN not in (first, second) and first.partition(" ")[0] == second.partition(" ")[0]


class _NotToldError(Exception):
    """Raised for an object whose content cannot be read."""


class _Reader:
    """Hashes an object and all objects that it refers to. A repeated object is hashed as its number, so cycles end."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        # Objects by place in memory, kept so that no other one gets the place.
        self._met: dict[int, tuple[int, Any]] = {}
        # Modules that are being read.
        self._within = set[str]()

    def read(self, value: Any) -> str:
        """Return the hash of an object."""
        self._value(value)
        return self._hash.hexdigest()[:32]

    def _word(self, *words: Any) -> None:
        for word in words:
            data = word if isinstance(word, bytes) else str(word).encode("utf-8", "surrogatepass")
            self._hash.update(len(data).to_bytes(8, "little") + data)

    def _all(self, kind: str, values: Any) -> None:
        listed = list(values)
        self._word(kind, len(listed))
        for value in listed:
            self._value(value)

    def _value(self, value: Any) -> None:
        """Read any object."""
        kind = type(value)
        if kind in _PLAIN:
            self._word(kind.__name__, _PLAIN[kind](value))
        elif kind is tuple:
            self._all("tuple", value)
        elif kind in (set, frozenset):
            # The order of a set differs from process to process.
            self._word("set", *sorted(_Reader().read(item) for item in value))
        elif isinstance(value, types.CodeType):
            self._code(value)
        elif isinstance(value, np.ndarray | np.generic) and not isinstance(value, np.ma.MaskedArray):
            self._array(np.asarray(value))
        elif id(value) in self._met:
            self._word("again", self._met[id(value)][0])
        else:
            self._met[id(value)] = len(self._met), value
            self._object(value)

    def _object(self, value: Any) -> None:
        """Read an object at its first occurrence; it may refer to itself."""
        place = _place(value)
        if place is not None:
            self._word("known", *place)
            return
        for kinds, read in _READERS:
            if isinstance(value, kinds) and (kinds not in _EXACT or type(value) is kinds):
                read(self, value)
                return
        self._instance(value)

    def _array(self, array: np.ndarray) -> None:
        self._word("array", array.dtype.str if array.dtype.names is None else array.dtype.descr, array.shape)
        if array.dtype.hasobject:
            self._all("objects", array.ravel().tolist())
        else:
            self._word(np.ascontiguousarray(array).tobytes())

    def _code(self, code: types.CodeType) -> None:
        counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
        names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
        self._word("code", code.co_code, code.co_exceptiontable, *counts)
        self._all("names", names)
        self._all("constants", code.co_consts)

    def _function(self, function: types.FunctionType) -> None:
        code = function.__code__
        self._word("function")
        self._code(code)
        self._value(function.__defaults__)
        self._value(function.__kwdefaults__)
        self._value(function.__dict__)
        names, global_names, imported = _names(code)
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            try:
                content = cell.cell_contents
            except ValueError:  # it is not set yet
                self._word(name, "empty")
                continue
            self._named(name, content, names)
        for name in sorted(global_names):
            if name in function.__globals__:
                self._named(name, function.__globals__[name], names)
            elif name in HIDDEN:
                raise _NotToldError
        for name in sorted(imported):
            self._imported(name, names)

    def _named(self, name: str, value: Any, names: set[str]) -> None:
        """Read the object of a global name in a function; of a user's module, only the attributes that are used."""
        self._word(name)
        if isinstance(value, types.ModuleType):
            self._module(value, names)
        else:
            self._value(value)

    def _imported(self, name: str, names: set[str]) -> None:
        """Read a module that a function imports when it runs."""
        if name not in sys.modules:
            if name.partition(".")[0] not in sys.stdlib_module_names:
                raise _NotToldError
            self._word(name)
        else:
            self._module(sys.modules[name], names)

    def _module(self, module: types.ModuleType, names: set[str]) -> None:
        name = module.__name__
        self._word("module", name)
        if is_library(name):
            self._word(_edition(name))
            return
        if name in self._within:
            return
        self._within.add(name)
        for name in sorted(names & vars(module).keys()):
            self._named(name, vars(module)[name], names)
        self._within.remove(module.__name__)

    def _class(self, kind: type) -> None:
        self._word("class")
        self._all("bases", (type(kind), *kind.__bases__))
        for name, item in vars(kind).items():
            if name not in OF_CLASSES:
                self._word(name)
                self._value(item)

    def _instance(self, value: Any) -> None:
        """Read an object by its class and its content; an object of a library, by its pickled form."""
        kind = type(value)
        made_of = next((item for item in (getattr(value, name, None) for name in MADE_OF) if item is not None), None)
        if _place(kind) is not None and isinstance(made_of, types.FunctionType | type):
            self._word("made of")
            self._value(kind)
            self._value(made_of)
            return
        try:
            parts = value.__reduce_ex__(4)  # which refuses what holds more than Python sees
        except Exception as error:  # of any class, and so of any kind
            raise _NotToldError from error
        if _place(kind) is None:
            held = dict(getattr(value, "__dict__", {}))
            held |= {name: getattr(value, name) for name in _slots(kind) if hasattr(value, name)}
            inner = next((base for base in (dict, list, tuple, set, frozenset) if isinstance(value, base)), None)
            self._word("instance")
            self._value(kind)
            self._value(held)
            self._value(None if inner is None else inner(value))
            if kind.__reduce_ex__ is object.__reduce_ex__ and kind.__reduce__ is object.__reduce__:
                return
        self._word("reduced")
        # Entries of lists and tables come as iterators.
        self._all("parts", (list(part) if isinstance(part, Iterator) else part for part in parts)
                  if isinstance(parts, tuple) else (parts,))  # fmt: skip

    def _held_module(self, module: types.ModuleType) -> None:
        """Read a module that is not named in a function, so that its used attributes are unknown."""
        if not is_library(module.__name__):
            raise _NotToldError
        self._module(module, set())

    def _untold(self, value: Any) -> None:
        raise _NotToldError


def _number(value: float | complex) -> str:
    return f"{value.real.hex()} {value.imag.hex()}" if isinstance(value, complex) else value.hex()


def _names(code: types.CodeType) -> tuple[set[str], set[str], set[str]]:
    """Collect from code and nested code: all names, the global names among them, and the imported modules."""
    names, global_names, imported = set(code.co_names), set[str](), set[str]()
    for step in dis.get_instructions(code):
        if step.opname == "IMPORT_NAME":
            imported.add(step.argval)
        elif "GLOBAL" in step.opname or step.opname.endswith("_NAME"):
            global_names.add(step.argval)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            for collected, more in zip((names, global_names, imported), _names(constant), strict=True):
                collected |= more
    return names, global_names, imported


def _place(value: Any) -> tuple[str, str, str] | None:
    """Find an object in a library: (module, name, edition); None for a user's object, or one not found by its name."""
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if isinstance(value, np.ufunc):
        name = value.__name__
        owners = (owner for owner in ("numpy", "scipy.special") if getattr(sys.modules.get(owner), name, None) is value)
        module = next(owners, None)
    if not (isinstance(module, str) and isinstance(name, str) and is_library(module)):
        return None
    reached: Any = sys.modules.get(module)
    for part in name.split("."):
        reached = getattr(reached, part, None)
    return (module, name, _edition(module)) if reached is value else None


def is_library(module: str) -> bool:
    """Tell whether a module belongs to Python or to an installed package, so that its name and version identify it."""
    top = module.partition(".")[0]
    file = getattr(sys.modules.get(top), "__file__", None)
    if top in sys.stdlib_module_names:
        return file is None or Path(file).is_relative_to(Path(os.__file__).parent)
    return top in KNOWN or (file is not None and not {"site-packages", "dist-packages"}.isdisjoint(Path(file).parts))


@functools.cache
def _edition(module: str) -> str:
    """Version of a library and a hash of the module's file; "" for a library whose version is compared elsewhere."""
    top = module.partition(".")[0]
    if top in KNOWN or top in sys.stdlib_module_names:
        return ""
    file = getattr(sys.modules.get(module), "__file__", None)
    content = hashlib.sha256(Path(file).read_bytes()).hexdigest()[:16] if file and Path(file).is_file() else ""
    return f"{getattr(sys.modules.get(top), '__version__', '')} {content}"


def _slots(kind: type) -> list[str]:
    """Names of the slots of a class and of its base classes."""
    return [name for base in kind.__mro__ for name, item in vars(base).items()
            if isinstance(item, types.MemberDescriptorType) and _place(base) is None]  # fmt: skip


_PLAIN: dict[type, Callable[[Any], Any]] = {
    bool: str, int: hex, float: _number, complex: _number, str: str, bytes: bytes, type(None): str, type(...): str,
    type(NotImplemented): str, bytearray: bytes,
}  # fmt: skip

# Kinds of which an object is read as one of its own class where it is of one.
_EXACT = (list, dict)
# Readers of kinds of objects, the first one that fits.
_READERS: tuple[tuple[Any, Callable[[_Reader, Any], None]], ...] = (
    (list, lambda reader, value: reader._all("list", value)),
    (dict, lambda reader, value: reader._all("dict", (part for item in value.items() for part in item))),
    (types.FunctionType, _Reader._function),
    (types.MethodType, lambda reader, value: reader._all("method", (value.__func__, value.__self__))),
    (types.BuiltinFunctionType, lambda reader, value: reader._all("bound", (value.__name__, value.__self__))),
    (types.MethodWrapperType, lambda reader, value: reader._all("bound", (value.__name__, value.__self__))),
    (DESCRIPTORS, lambda reader, value: reader._word("descriptor", value.__name__)),
    (functools.partial, lambda reader, value: reader._all("partial", (
        type(value), value.func, value.args, value.keywords, value.__dict__))),
    (staticmethod | classmethod, lambda reader, value: reader._all(type(value).__name__, (value.__func__,))),
    (property, lambda reader, value: reader._all("property", (value.fget, value.fset, value.fdel))),
    (functools.cached_property, lambda reader, value: reader._all("cached", (value.func,))),
    (types.ModuleType, _Reader._held_module),
    (np.ufunc, _Reader._untold),
    (type, _Reader._class),
    (types.MappingProxyType, lambda reader, value: reader._value(dict(value))),
)  # fmt: skip
