# SPDX-License-Identifier: Apache-2.0
"""The command's verbs, and the parser of its arguments."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from typing import NoReturn

from lgvi_warp import __version__
from lgvi_warp.cli.check import check
from lgvi_warp.cli.completion import completion
from lgvi_warp.cli.from_function import RUN
from lgvi_warp.cli.lists import example, list_names, new, schema, show_help
from lgvi_warp.cli.machine import bench, info
from lgvi_warp.cli.plot import footprint, plot
from lgvi_warp.cli.runs import predict, resume, run
from lgvi_warp.cli.stores import export, merge, report
from lgvi_warp.cli.studies import (
    derivatives,
    estimate,
    margins,
    rare,
    sensitivity,
    stability,
    sweep,
    tradeoff,
    trim,
    tune_gains,
    worst_case,
)
from lgvi_warp.cli.verb import COMMON
from lgvi_warp.cli.view import view
from lgvi_warp.cli.warm import warm
from lgvi_warp.common.errors import closest
from lgvi_warp.common.near import ELSEWHERE
from lgvi_warp.common.sentences import capital

# In the order of the help.
_VERBS = (run, check, predict, resume, merge, export, report, tradeoff, estimate, sensitivity, stability, sweep, rare,
          derivatives, margins, worst_case, tune_gains, trim, footprint, view, info, bench, warm, new, example, list_names,
          schema, plot, completion, show_help)  # fmt: skip
VERBS: dict[str, Callable[[argparse.Namespace], int]] = {
    name: verb for verb in _VERBS for name in (verb.name, *verb.aliases)
}
# Verbs that write no files of the user's.
READING = tuple(name for verb in _VERBS if verb.reads for name in (verb.name, *verb.aliases))

EPILOG = """examples:
  lgvi-warp new dive.toml --vehicle remus_100
  lgvi-warp check dive.toml
  lgvi-warp run example:paper --out runs/paper
  lgvi-warp run example:paper --members 20000 --dtype float32 --set vehicle.mass=120
  lgvi-warp run example:paper --error 1e-3
  lgvi-warp run example:paper --members 1000000 --store zarr --out runs/large
  lgvi-warp resume runs/large
  lgvi-warp view runs/paper
  lgvi-warp tradeoff example:paper --out runs/tradeoff
  lgvi-warp estimate example:paper --of "mean position[0]" --error 1e-3
  lgvi-warp sensitivity example:paper --of "position[2]" --out runs/sensitivity
  lgvi-warp stability example:paper --out runs/stability
  lgvi-warp sweep example:heading_laws --out runs/heading_laws
  lgvi-warp rare example:paper --limit "position[2] above 690"
  lgvi-warp derivatives example:paper --of "position[0]" --by vehicle.mass --by "start.angular_velocity[0]"
  lgvi-warp margins dive.toml --loop heading_pid --of gain --of disk
  lgvi-warp worst-case dive.toml --of "max(depth)" --within vehicle.buoyancy=297:302
  lgvi-warp tune-gains dive.toml --over heading_pid.kp=0.1:10:log --minimise "iae heading"
  lgvi-warp trim dive.toml --speed 1.5
  lgvi-warp footprint runs/large --at floor
  lgvi-warp info runs/large
  lgvi-warp run example:paper --json -q

exit codes:
  0    done
  1    members, files or the disk failed; info or merge found an incomplete run
  2    refused: a scene, an argument or the content of a folder; or a library is missing
  130  interrupted (143 by SIGTERM, 129 by SIGHUP); a second signal ends the command at once

Results go to stdout, progress and errors to stderr. Every verb takes -q, -v, --json and --color.
"""

DEFAULTS = {"quiet": False, "verbose": False, "json": False, "color": "auto"}


class Parser(argparse.ArgumentParser):
    """A parser whose errors suggest the nearest name; verbs: the parser of each verb."""

    verbs: Mapping[str, Parser] = {}

    def error(self, message: str) -> NoReturn:
        """Print the usage and the fault, and end with exit code 2."""
        if wrong := re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message):
            names = re.findall(r"[\w-]+", wrong[2])
            message = f"{message[: wrong.start()]}{wrong[1]!r} is not known. {capital(closest(wrong[1], names))}"
        super().error(message)


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command's arguments, by default those of the process. A fault or --help ends the process."""
    top = parser()
    chosen, unknown = top.parse_known_args(arguments)
    if unknown:
        verb = top.verbs[chosen.verb]
        options = re.findall(r"--[\w-]+", verb.format_help())
        wrong = [word for word in unknown if word.startswith("-")] or unknown
        known = [
            f". {capital(_suggestion(word.partition('=')[0], options))}" if word[:1] == "-" else "" for word in wrong
        ]
        texts = [f"{word!r} is not known{remedy}" for word, remedy in zip(wrong, known, strict=True)]
        verb.error("; ".join(texts))
    chosen.parser = top
    return chosen


def _suggestion(word: str, options: Sequence[str]) -> str:
    """Suggest an option for an unknown one: by the name of an argument here or in other packages, or by similarity."""
    asked = word.strip("-").replace("-", "_").casefold()
    name = next((name for name, words in ELSEWHERE.items() if asked in (name, *words)), asked)
    option = f"--{RUN.get(name, name).replace('_', '-')}"
    return f"did you mean {option!r}?" if option in options else closest(word, options)


def parser() -> Parser:
    """Make the parser of the command's arguments.

    Returns:
        A parser with one subparser for each verb.
    """
    top = Parser(
        prog="lgvi-warp",
        description="Simulate many underwater vehicles at once with a Lie group variational integrator.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"lgvi-warp {__version__}")
    verbs = top.add_subparsers(dest="verb", required=True, metavar="VERB")
    for each in _VERBS:
        each.add(verbs)
    for verb in dict.fromkeys((top, *verbs.choices.values())):  # an old name has the same parser
        group = verb.add_argument_group("options of every verb")
        for names, settings in COMMON.items():
            group.add_argument(*names, default=argparse.SUPPRESS, **settings)
    top.verbs = verbs.choices
    top.set_defaults(**DEFAULTS)
    return top
