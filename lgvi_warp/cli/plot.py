# SPDX-License-Identifier: Apache-2.0
"""The verb plot: draw the pictures of a folder again."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from lgvi_warp.cli import documents
from lgvi_warp.cli.folders import Content, contents
from lgvi_warp.cli.output import print_faults, tell
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.report import file_line, pictures, shown_members
from lgvi_warp.cli.settings import writable
from lgvi_warp.cli.verb import add_shared, as_verb
from lgvi_warp.cli.writing import Written


def plot_arguments(verb: Any) -> None:
    """Add the arguments of the verb plot."""
    verb.add_argument("dir", metavar="DIR", type=Path, help="a folder that run or a study wrote")
    add_shared(verb, "--out", out="folder for the pictures, replaced if they exist (default: DIR)")


@as_verb("plot", "draw the pictures of a folder again, from the numbers in it", plot_arguments)
def plot(chosen: argparse.Namespace) -> int:
    """Run the verb plot: draw the pictures of a run or of studies from their numbers."""
    held, written = contents(chosen.dir), Written()
    out = writable(chosen.out or (chosen.dir.parent if chosen.dir.suffix == ".zarr" else chosen.dir))
    with progress_bar(chosen.quiet, "drawing"):
        for content in held:
            _draw(content, written, out)
    for missing in written.missing.values():  # pictures are all that the verb is for
        raise missing
    tell(chosen, lambda: documents.of_files(written),
         lambda: "\n".join(map(file_line, written.files)))  # fmt: skip
    print_faults(written.empty)
    return 1 if print_faults(written.faults) else 0


def _draw(content: Content, written: Written, out: Path) -> None:
    """Draw the pictures of one content of a folder."""
    numbers: Any = content.load()
    if content.kind in ("store", "result"):
        with content.understood():
            for name, draw in pictures(numbers, shown_members(numbers)).items():
                written.take(out / name, partial(draw, out / name))
        return
    if content.kind == "sweep":
        remedy = "its pictures are drawn again by the same lgvi-warp sweep, which runs nothing twice"
        written.empty.append(f"{content.path}: {remedy}")
        return
    from lgvi_warp import plots

    if not hasattr(plots, content.kind):
        written.empty.append(f"{content.path}: has no picture; lgvi-warp info shows what it holds")
        return
    with content.understood():
        written.draw(getattr(plots, content.kind), numbers, out / content.path.with_suffix(".png").name)
