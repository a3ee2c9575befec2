# SPDX-License-Identifier: Apache-2.0
"""A verb of the command: its function, its name, its help and its arguments."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lgvi_warp.common.errors import SceneError

OF = 'position, attitude, velocity, angular_velocity, energy, depth, speed, euler, "position[2]", "norm(velocity)" ...'


def scene_path(text: str) -> str:
    """Find the scene or sweep file that an argument names; output files are named after it."""
    from lgvi_warp.scene.examples import located

    try:
        return os.fspath(located(text))
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


# Arguments that several verbs have.
SHARED: dict[str, dict[str, Any]] = {
    "scene": {"metavar": "SCENE", "type": scene_path, "help": "scene file (TOML), or example:NAME (see `example`)"},
    "dir": {"metavar": "DIR", "type": Path, "help": "a store, or a folder that contains a store"},
    "--out": {"metavar": "DIR", "type": Path},
    "--duration": {"metavar": "S", "help": "end of the run [s]"},
    "--members": {"metavar": "N", "help": "number of vehicles"},
    "--seed": {"metavar": "N", "help": "seed of the random draws"},
    "--set": {
        "metavar": "NAME=VALUE",
        "action": "append",
        "default": [],
        "help": "replace a key of the scene file, or a number in it: run.step, heading_pid.kp, current.velocity[0]",
    },
    "--method": {"help": "as for the verb run"},
    "--methods": {"metavar": "A,B", "type": lambda text: [name.strip() for name in text.split(",")]},
    "--step": {"metavar": "S", "help": "time step [s]"},
    "--dtype": {"help": "as for the verb run"},
    "--keep": {"help": "members whose samples are kept: all (default), none, failed, or indices such as 3,17"},
    "--threads": {"metavar": "N", "type": int, "help": "threads (default: all cores, or one for few members)"},
    "--executor": {"default": "threads", "help": "run blocks by threads (default), processes or dask"},
    "--scheduler": {"metavar": "ADDRESS", "help": "address of Dask's scheduler (default: a cluster on this machine)"},
    "--store": {"choices": ["npz", "zarr"], "default": "npz", "help": "as for the verb run"},
    "--store-dtype": {"metavar": "D", "help": "as for the verb run"},
    "--overwrite": {"action": "store_true", "help": "replace an existing run.zarr"},
}
# Arguments of the verbs that write files about a scene's ensemble.
SCENE = "scene --out --duration --members --seed --set"
EXECUTOR = "--threads --executor --scheduler"
WORKERS = "number of threads, processes or workers (default: all cores, or one thread for few members)"
FOLDER = "folder for the files; existing files are replaced (default: {})"

# Options of every verb, which may stand before it too -> what they are without being given.
COMMON: dict[tuple[str, ...], dict[str, Any]] = {
    ("-q", "--quiet"): {"action": "store_true", "help": "print only errors and the --json document"},
    ("-v", "--verbose"): {"action": "store_true", "help": "also print the run's settings, and the place of an error"},
    ("--json",): {"action": "store_true", "help": "print results as one JSON document (docs/reference/json.md)"},
    ("--color",): {
        "choices": ("auto", "always", "never"),
        "help": "colors: auto (default: on a terminal, unless NO_COLOR is set), always or never",
    },
}


@dataclass(frozen=True)
class Verb:
    """A verb: a function of its arguments that returns the exit code, and its one-line help.

    arguments: Function that adds its arguments to a parser. reads: whether it writes no files. aliases: its other names.
    """

    call: Callable[[argparse.Namespace], int]
    name: str
    help: str
    arguments: Callable[[Any], None]
    reads: bool
    aliases: tuple[str, ...]

    def __call__(self, chosen: argparse.Namespace) -> int:
        """Run the verb; return the exit code."""
        return self.call(chosen)

    def add(self, verbs: Any) -> None:
        """Add the parser of the verb to the parsers of all verbs, with its help as the description."""
        text = self.help[0].upper() + self.help[1:] + "."
        parser = verbs.add_parser(self.name, help=self.help, description=text, aliases=self.aliases, allow_abbrev=False)
        parser.verbs = verbs.choices
        self.arguments(parser)


def without(parser: Any) -> None:
    """Add no arguments, for a verb without arguments."""


def as_verb(
    name: str, help: str, arguments: Callable[[Any], None] = without, reads: bool = False, aliases: tuple[str, ...] = ()
) -> Callable[[Callable[[argparse.Namespace], int]], Verb]:
    """Decorator that makes a function a verb; `arguments.VERBS` lists all verbs."""
    return lambda call: Verb(call, name, help, arguments, reads, aliases)


def add_shared(verb: Any, names: str, **helps: str) -> None:
    """Add shared arguments to a verb; helps: help texts of this verb by argument name without dashes."""
    for name in names.split():
        own_help = helps.get(name.strip("-").replace("-", "_"))
        verb.add_argument(name, **SHARED[name] | ({"help": own_help} if own_help else {}))
