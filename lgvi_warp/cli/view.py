# SPDX-License-Identifier: Apache-2.0
"""The verb view: show an existing run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lgvi_warp.cli.folders import Content, contents
from lgvi_warp.cli.output import Part, print_faults, tell
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.report import file_line
from lgvi_warp.cli.verb import as_verb
from lgvi_warp.common.errors import NothingToDraw, SceneError
from lgvi_warp.common.files import place_of


def view_arguments(verb: Any) -> None:
    """Add the arguments of the verb view."""
    verb.add_argument("dir", metavar="DIR", type=Path, help="the folder of a run, a store, or a result.npz")
    verb.add_argument(
        "--members", metavar="LIST", help="members to draw, as 3,17 (default: 1,000 representative members)"
    )
    verb.add_argument("--out", metavar="FILE", type=Path, help="write the recording to this file, without a viewer")
    movie = "write an animation to this file (.webp, .gif, .png), without a viewer"
    verb.add_argument("--movie", metavar="FILE", type=Path, help=movie)


@as_verb("view", "open a run in the rerun viewer", view_arguments)
def view(chosen: argparse.Namespace, *, viewer: Part = None, log: Part = None) -> int:
    """Run the verb view: open a run in the rerun viewer, or write its recording."""
    members, content = indices(chosen.members), run_in(chosen.dir)
    files = [path for path in (chosen.out, chosen.movie) if path is not None]
    for path in files:
        place_of(path)  # before the run is read: a fault of the recording is none of the run
    result, notes = content.load(), []
    from lgvi_warp.views.recording import movie
    from lgvi_warp.views.recording.rerun import record, show

    try:
        with progress_bar(chosen.quiet, "drawing"), content.understood():
            if not files:
                (viewer or show)(result, members=members)
            if chosen.out is not None:
                (log or record)(result, chosen.out, members=members)
            if chosen.movie is not None and movie.write(result, chosen.movie, members=members) == "plot":
                notes.append(f"{chosen.movie} is drawn plainly, since the viewer cannot draw on this machine")
    except NothingToDraw as error:
        raise SceneError([str(error)]) from None
    tell(chosen, lambda: {"files": files}, lambda: "\n".join(map(file_line, files)))
    print_faults(notes)
    return 0


def run_in(path: Path) -> Content:
    """Find the run at a path."""
    held = [Content("result", path)] if path.suffix == ".npz" else contents(path)
    runs = [content for content in held if content.kind in ("result", "store")]
    if not runs:
        raise SceneError([f"{path} holds a study, and no run. Give the folder of a run"])
    return runs[-1]


def indices(text: str | None) -> list[int] | None:
    """Read the indices of members, as "3,17"; None without a text."""
    if text is None:
        return None
    words = [word.strip() for word in text.split(",")]
    if not all(word.isdigit() for word in words):
        raise SceneError([f"--members {text} is not a list of members. Write --members 3,17"])
    return [int(word) for word in words]
