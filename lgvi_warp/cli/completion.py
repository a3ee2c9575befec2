# SPDX-License-Identifier: Apache-2.0
"""The verb completion: print the script with which a shell completes the command."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lgvi_warp.cli.output import tell
from lgvi_warp.cli.verb import as_verb
from lgvi_warp.common.errors import MissingExtra
from lgvi_warp.common.status import CHECKS, ON_FAILURE

SHELLS = ("bash", "zsh", "fish", "tcsh", "powershell")


def values() -> dict[str, tuple[str, ...]]:
    """List the values of options whose values the scene checks, not the parser."""
    from lgvi_warp.common.machine import DTYPES
    from lgvi_warp.engine.executors import NAMES
    from lgvi_warp.methods import method
    from lgvi_warp.physics.fields import TABLE
    from lgvi_warp.scene.settings import DEVICES, KEEP
    from lgvi_warp.store.export import FORMATS
    from lgvi_warp.vehicles.fossen import vehicle_names

    # Compositions stand without the method that they are of: parentheses mean something to shells.
    methods = (*method.PROGRAMS, *method.TWO_PART, *method.GAUSS, *method.RUNGE_KUTTA, *method.COMPOSITIONS,
               *method.HALVES)  # fmt: skip
    return {
        "--method": methods, "--methods": methods, "--dtype": tuple(DTYPES), "--dtypes": tuple(DTYPES),
        "--store-dtype": ("float32", "float64"), "--solver": method.SOLVERS, "--iterations": ("auto",), "--checks": CHECKS,
        "--on-failure": ON_FAILURE, "--keep": KEEP, "--device": DEVICES, "--executor": NAMES, "--of": tuple(TABLE),
        "--to": tuple(FORMATS), "--vehicle": tuple(vehicle_names()),
    }  # fmt: skip


def completion_arguments(verb: Any) -> None:
    """Add the arguments of the verb completion."""
    verb.add_argument("shell", metavar="SHELL", choices=SHELLS, help="name of the shell: " + ", ".join(SHELLS))


@as_verb("completion", "print a script that lets a shell complete the command", completion_arguments, reads=True)
def completion(chosen: argparse.Namespace) -> int:
    """Run the verb completion: print a script for a shell."""
    try:
        import shtab
    except ModuleNotFoundError as error:
        raise MissingExtra("completions", "shtab", "shell") from error
    chosen.quiet = False
    add_values(chosen.parser, shtab.FILE)
    script = shtab.complete(chosen.parser, chosen.shell)
    tell(chosen, lambda: {"shell": chosen.shell, "script": script}, script.rstrip)
    return 0


def add_values(parser: Any, file: Any) -> None:
    """Add the values of options to a parser that is used only for completion, and `file` for options that take a path."""
    known = values()
    for action in (action for verb in parser.verbs.values() for action in verb._actions):
        if action.choices is None and action.nargs != 0:
            action.choices = known.get((action.option_strings or [""])[-1])
            if action.choices is None and (action.type is Path or not action.option_strings):
                action.complete = file
