"""The command itself: a verb is run, and what it raises becomes a line and an exit code."""

from __future__ import annotations

import argparse
import gc
import os
import sys
from collections.abc import Callable

from lgvi_warp.cli.arguments import parser
from lgvi_warp.cli.check import check
from lgvi_warp.cli.machine import bench, info
from lgvi_warp.cli.runs import plan, resume, run
from lgvi_warp.cli.settings import RUN, out_of
from lgvi_warp.cli.stores import export, merge
from lgvi_warp.cli.studies import sensitivity, stability, tradeoff
from lgvi_warp.errors import SceneError

VERBS: dict[str, Callable[[argparse.Namespace], int]] = {
    "run": run,
    "check": check,
    "resume": resume,
    "plan": plan,
    "merge": merge,
    "export": export,
    "tradeoff": tradeoff,
    "sensitivity": sensitivity,
    "stability": stability,
    "info": info,
    "bench": bench,
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command. Returns its exit code, see arguments.EPILOG."""
    chosen = parser().parse_args(arguments)
    try:
        return VERBS[chosen.verb](chosen)
    except SceneError as error:
        print(f"lgvi-warp: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print(f"lgvi-warp: {where}{error.strerror or error}", file=sys.stderr)
        return 1
    except MemoryError as error:
        print(f"lgvi-warp: {error or 'out of memory'}; run fewer members or keep fewer samples", file=sys.stderr)
        return 1
    except KeyboardInterrupt as interrupt:
        print(f"lgvi-warp: interrupted; {str(interrupt) or left(chosen)}", file=sys.stderr)
        return 130


def left(chosen: argparse.Namespace) -> str:
    """What an interrupted verb leaves."""
    if chosen.verb in ("info", "check", "plan", "bench"):
        return "nothing was to be written"
    there = chosen.dir if chosen.verb == "resume" else None
    if chosen.verb == "run" and chosen.store == "zarr" and (out_of(chosen) / RUN).exists():
        there = out_of(chosen)
    if there is None:
        return "nothing was written"
    return f"finished blocks are kept: go on with lgvi-warp resume {there}"


def entry() -> None:
    """The console script: `main`, for a process that ends here.

    Half a second is saved: no search for reference cycles among the modules' objects while they load, and none of the
    libraries' taking-down at the end, when every file is closed already.
    """
    gc.disable()
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
