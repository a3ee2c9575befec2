# SPDX-License-Identifier: Apache-2.0
"""Run one verb, and turn its errors into a line on stderr and an exit code."""

from __future__ import annotations

import argparse
import gc
import os
import sys
import traceback
from collections.abc import Callable, Mapping

from lgvi_warp.cli.arguments import READING, VERBS, parsed, parser
from lgvi_warp.cli.output import print_faults
from lgvi_warp.cli.settings import RUN, out_of
from lgvi_warp.cli.signals import Ended, Signals, Streams
from lgvi_warp.common.errors import MissingExtra, SceneError
from lgvi_warp.common.files import WRITTEN


def main(
    arguments: list[str] | None = None, *, verbs: Mapping[str, Callable[[argparse.Namespace], int]] = VERBS
) -> int:
    """Run the command.

    Args:
        arguments: Arguments of the command; default None: those of the process.
        verbs: Function of each verb by name; default: all verbs of the command.

    Returns:
        The exit code; arguments.EPILOG lists the codes.
    """
    with Streams() as streams:
        if not (sys.argv[1:] if arguments is None else arguments):
            parser().print_help()
            return 0
        chosen = parsed(arguments)
        streams.color(chosen.color)
        chosen.files_before = WRITTEN.count
        with Signals(lambda: left(chosen)) as signals:
            try:
                code = verbs[chosen.verb](chosen)
                sys.stdout.flush()
                return code
            except BaseException as error:
                return code_of(error, chosen, signals)


def code_of(error: BaseException, chosen: argparse.Namespace, signals: Signals) -> int:
    """Print on stderr why a verb ended."""
    # A library may turn an interrupt during its import into any exception.
    if isinstance(error, KeyboardInterrupt) or signals.number is not None:
        text, code = f"{signals.text}; {error if isinstance(error, Ended) else left(chosen)}", signals.exit_code
    elif isinstance(error, SceneError | MissingExtra):
        text, code = str(error), 2
    elif isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        text, code = f"{where}{error.strerror or error}", 1
    elif isinstance(error, MemoryError):
        text, code = f"{str(error) or 'out of memory'}. Run fewer members or keep fewer samples", 1
    else:
        raise error
    signals.said = True
    if chosen.verbose:
        traceback.print_exception(error)
    print_faults([text])
    return code


def left(chosen: argparse.Namespace) -> str:
    """Say which files an interrupted verb leaves."""
    if chosen.verb in READING:
        return "nothing was to be written"
    if chosen.verb == "sweep":
        return "finished cells are kept: the same command goes on" if not chosen.plan else "nothing was to be written"
    store = chosen.dir if chosen.verb == "resume" else None
    if chosen.verb == "run" and chosen.store == "zarr" and (out_of(chosen) / RUN).exists():
        store = out_of(chosen)
    if store is None:
        count = WRITTEN.count - getattr(chosen, "files_before", WRITTEN.count)
        if not count:
            return "nothing was written"
        return (
            f"{count} files were written, the last one {WRITTEN.last}" if count > 1 else f"{WRITTEN.last} was written"
        )
    return f"finished blocks are kept: go on with lgvi-warp resume {store}"


def entry(*, run: Callable[[], int] = main) -> None:
    """Run the command as the console script does, and end the process.

    Two measures save half a second: garbage collection is off while modules load, and at the end, when every file is
    closed, the libraries' cleanup is skipped.
    """
    gc.disable()
    # The recorder prints what it raises as errors as well, which are told of in one line.
    os.environ.setdefault("RUST_LOG", "off")
    for descriptor in range(3):  # a closed one would be given to the next file opened
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    try:
        code = run()
    except SystemExit as end:  # raised by the parser
        code = end.code if isinstance(end.code, int) else 0
    if warp_setup := sys.modules.get("lgvi_warp.common.warp_setup"):
        warp_setup.end()
    os._exit(code)
