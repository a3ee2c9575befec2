# SPDX-License-Identifier: Apache-2.0
"""The verbs that read a folder again: plot draws its pictures, footprint computes where the members of a run are."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from lgvi_warp.cli import documents
from lgvi_warp.cli.folders import Content, contents
from lgvi_warp.cli.from_function import FunctionOptions, finish
from lgvi_warp.cli.output import print_faults, tell
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.report import file_line, pictures, shown_members
from lgvi_warp.cli.settings import writable
from lgvi_warp.cli.verb import add_shared, as_verb
from lgvi_warp.cli.writing import Written
from lgvi_warp.common.errors import SceneError


def plot_arguments(verb: Any) -> None:
    """Add the arguments of the verb plot."""
    verb.add_argument("dir", metavar="DIR", type=Path, help="a folder written by run or a study")
    add_shared(verb, "--out", out="folder for the pictures; existing files are replaced (default: DIR)")


@as_verb("plot", "draw the pictures in a folder again, from its saved numbers", plot_arguments)
def plot(chosen: argparse.Namespace) -> int:
    """Run the verb plot: draw the pictures of a run or of studies from their numbers."""
    held, written = contents(chosen.dir), Written()
    out = _beside(chosen)
    with progress_bar(chosen.quiet, "drawing"):
        for content in held:
            _draw(content, written, out)
    for missing in written.missing.values():  # pictures are all that the verb is for
        raise missing
    tell(chosen, lambda: documents.of_files(written),
         lambda: "\n".join(map(file_line, written.files)))  # fmt: skip
    print_faults(written.empty)
    return 1 if print_faults(written.faults) else 0


def _beside(chosen: argparse.Namespace) -> Path:
    """Make the folder for the output of a verb that reads another folder."""
    return writable(chosen.out or (chosen.dir.parent if chosen.dir.suffix == ".zarr" else chosen.dir))


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
        written.empty.append(f"{content.path} has no picture. lgvi-warp info shows what it holds")
        return
    with content.understood():
        written.draw(getattr(plots, content.kind), numbers, out / content.path.with_suffix(".png").name)


FOOTPRINT = FunctionOptions(("uncertainty.footprint.footprint:footprint",), "")


def footprint_arguments(verb: Any) -> None:
    """Add the arguments of the verb footprint."""
    verb.add_argument("dir", metavar="DIR", type=Path, help="a folder written by run, or a store")
    add_shared(verb, "--out", out="folder for the files; existing files are replaced (default: DIR)")
    FOOTPRINT.add(verb)


@as_verb("footprint", FOOTPRINT.sentence, footprint_arguments)
def footprint(chosen: argparse.Namespace) -> int:
    """Run the verb footprint: where members are, as numbers, a picture, and a map if the origin is known."""
    runs = [content for content in contents(chosen.dir) if content.kind in ("store", "result")]
    if len(runs) != 1:
        raise SceneError([f"{chosen.dir} holds {len(runs) or 'no'} runs. Give the folder of one run, or its store"])
    from lgvi_warp import plots
    from lgvi_warp.store.export import export
    from lgvi_warp.uncertainty.footprint.footprint import footprint as footprint_of

    with progress_bar(chosen.quiet, "reading"):
        found = footprint_of(runs[0].load(), **FOOTPRINT.values_of(chosen, "footprint"))
    out = _beside(chosen)
    with progress_bar(chosen.quiet, "writing"):
        written = Written(found.save(out))
        written.draw(plots.footprint, found, out / "footprint.png")
        for name in ("footprint.geojson", "footprint.kml") if found.origin else ():
            written.take(out / name, partial(export, found, out / name, overwrite=True))
    return finish(written, chosen, {"footprint": found.to_dict()}, str(found))
