# SPDX-License-Identifier: Apache-2.0
"""Public names as tests go through them: by door, and by their own name."""

import inspect

import lgvi_warp as lw


def things(door):
    """{name: thing} of a door, without those of extensions that are not there (tests/support/core_alone.py)."""
    found = {}
    for name in door.__all__:
        try:
            found[name] = getattr(door, name)
        except ModuleNotFoundError as error:
            if not str(error.name).startswith("lgvi_warp.extensions"):
                raise
    return found


DOORS = {name: thing for name, thing in things(lw).items() if inspect.ismodule(thing)}
# Doors of which a page lists the whole; their names may be those of others.
WHOLE = ("gym", "notation", "plots", "uq")
# {path behind lw: thing} of the root and of the other doors.
PATHS = {name: thing for name, thing in things(lw).items() if name not in DOORS} | {
    f"{door}.{name}": thing
    for door, module in DOORS.items()
    if door not in WHOLE
    for name, thing in things(module).items()
}
NAMED = {path.rpartition(".")[2]: thing for path, thing in PATHS.items()}
