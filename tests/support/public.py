# SPDX-License-Identifier: Apache-2.0
"""Public names as tests go through them: by door, and by their own name."""

import inspect

import lgvi_warp as lw

DOORS = {name: getattr(lw, name) for name in lw.__all__ if inspect.ismodule(getattr(lw, name))}
# Doors of which a page lists the whole; their names may be those of others.
WHOLE = ("gym", "notation", "plots", "uq")
# {path behind lw: thing} of the root and of the other doors.
PATHS = {name: getattr(lw, name) for name in lw.__all__ if name not in DOORS} | {
    f"{door}.{name}": getattr(module, name)
    for door, module in DOORS.items()
    if door not in WHOLE
    for name in module.__all__
}
NAMED = {path.rpartition(".")[2]: thing for path, thing in PATHS.items()}
