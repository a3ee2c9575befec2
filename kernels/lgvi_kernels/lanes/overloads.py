# SPDX-License-Identifier: Apache-2.0
"""Functions of lanes, declared for a width and a type when a kernel asks for these first.

A run takes one width and one type of twelve; Warp would need longer to declare the functions of all than to be imported.
A function is a `family` at first, which other modules import. What `for_each_type` decorates is called with each width and
type that is asked for, and adds to each family an overload, with `func` or `func_native` in place of those of Warp.

Warp's hash of a kernel knows a function by all its overloads. So that a kernel has the same hash whatever else was declared
in its process, a family stands there for the text of the files in this folder, and its overloads do not count.
"""

import hashlib
import sys
import threading
from pathlib import Path

import warp as wp

_TEXTS = [path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py"))]
_DIGEST = hashlib.sha256(b"".join(_TEXTS)).hexdigest()

_lock = threading.RLock()
_types, _declarers = [], []


def family(name, meaning):
    """A Warp function without overloads, but one that no call with arguments means; meaning: what its overloads do."""

    def stub(): ...

    stub.__name__ = stub.__qualname__ = name
    stub.__doc__ = meaning
    return wp.func_native(f"// {_DIGEST}")(stub)


def func(function):
    """Add a function in Warp's Python to the family of its name; a decorator."""
    return _added(function, wp.func(function))


def func_native(snippet):
    """Add a function in C++ to the family of its name; a decorator, known to Warp by its name."""
    return lambda function: _added(function, wp.func_native(snippet)(function))


def _added(function, overload):
    """The family of a function's name, with one more overload."""
    whole = vars(sys.modules[function.__module__])[function.__name__]
    overload.generic_parent = whole
    whole.add_overload(overload)
    return whole


def for_each_type(declare):
    """Call declare(width, real) once for each width and type that is asked for; a decorator."""
    with _lock:
        _declarers.append(declare)
        for width, real in _types:
            declare(width, real)
    return declare


def ask_for(width, real):
    """Declare the functions of this width and type, if this is the first time."""
    with _lock:
        if (width, real) not in _types:
            _types.append((width, real))
            for declare in _declarers:
                declare(width, real)
