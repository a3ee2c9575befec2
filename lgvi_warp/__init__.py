# SPDX-License-Identifier: Apache-2.0
"""lgvi_warp: many underwater vehicles at once, by a Lie group variational integrator in Warp kernels on CPU cores."""

import ast as _ast

__version__ = "0.1.0"

# The stub lists the public names, for editors and for this file. A name is imported when it is used first: NumPy, SciPy
# and Warp take longer to import than a script that only asks for help or a version may take.
_STUB = _ast.parse(__loader__.get_data(f"{__path__[0]}/__init__.pyi")).body

# {public name: (module, its name there)}
_PLACES = {
    _alias.asname or _alias.name: (_line.module, _alias.name)
    for _line in _STUB
    if isinstance(_line, _ast.ImportFrom)
    for _alias in _line.names
}

__all__ = sorted(_PLACES)


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module 'lgvi_warp' has no attribute {name!r}")
    module, name_there = _PLACES[name]
    # With a list of names, __import__ gives the module itself, and imports a name that is a module.
    value = getattr(__import__(module, fromlist=[name_there]), name_there)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
