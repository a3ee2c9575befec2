# SPDX-License-Identifier: Apache-2.0
"""The verbs merge, export and report."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lgvi_warp.cli.output import Part, print_faults, tell
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.report import file_line
from lgvi_warp.cli.verb import add_shared, as_verb
from lgvi_warp.cli.view import indices
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.files import place_of


def merge_arguments(verb: Any) -> None:
    """Add the arguments of the verb merge."""
    verb.add_argument(
        "dirs", metavar="DIR", type=Path, nargs="+", help="stores from run --blocks, or folders that contain them"
    )
    verb.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder for the whole run")
    add_shared(verb, "--overwrite")


@as_verb("merge", "merge stores with parts of a run (run --blocks) into one run", merge_arguments)
def merge(chosen: argparse.Namespace, *, join: Part = None) -> int:
    """Run the verb merge: merge stores with parts of a run.

    Returns: The exit code: 0 if the merged run is complete, otherwise 1.
    """
    from lgvi_warp.calls.merge import merge as put_together

    with progress_bar(chosen.quiet, "writing"):
        folder = (join or put_together)(chosen.dirs, chosen.out, chosen.overwrite)
    missing_blocks = 0 if folder.complete else len(folder.unfinished())
    document = {"file": folder.path, "complete": folder.complete, "blocks": len(folder.runs), "missing": missing_blocks}
    tell(chosen, lambda: document, lambda: f"{file_line(folder.path)}" + (", complete" if folder.complete else ""))
    if not folder.complete:
        of_all = f"{missing_blocks} of {len(folder.runs)} blocks"
        missing = f"{of_all} are in none of the folders. lgvi-warp resume {folder.path} runs them"
        kept = f"the members that it keeps are missing. lgvi-warp resume {folder.path} runs them, or says why not"
        print_faults([f"{folder.path}: {missing if missing_blocks else kept}"])
    return 0 if folder.complete else 1


def export_arguments(verb: Any) -> None:
    """Add the arguments of the verb export."""
    add_shared(
        verb,
        "dir",
        dir="a store, a result.npz, a folder with one store or result.npz, the footprint.json of a run, or a scene file",
    )
    verb.add_argument(
        "--to",
        metavar="FILE",
        required=True,
        help="file name ending in .csv, .parquet, .nc, .geojson, .kml or .mcap; for a scene in .fmu; or the word netcdf or "
        "parquet for the whole store",
    )
    verb.add_argument("--out", metavar="FILE", type=Path,
                      help="with --to netcdf or --to parquet: the file (default: next to the run)")  # fmt: skip
    verb.add_argument(
        "--members", metavar="LIST", help="members to export, as 3,17 or 0:100 (default: all members with kept samples)"
    )
    verb.add_argument("--origin", metavar="LAT,LON", help="origin of the axes [deg] (default: from the scene)")
    verb.add_argument(
        "--start", metavar="DATE", help="date and time at t = 0, as 2026-06-01T00:00:00Z (default: from the scene)"
    )
    verb.add_argument(
        "--inputs", choices=("commands", "set_points"), help="inputs of a .fmu (default: commands of the actuators)"
    )
    verb.add_argument("--overwrite", action="store_true", help="replace an existing file")


@as_verb("export", "export a run to a table, NetCDF, a map or MCAP, or a scene to an FMU",
         export_arguments)  # fmt: skip
def export(chosen: argparse.Namespace, *, write: Part = None) -> int:
    """Run the verb export: write a run, members of it, or a scene to a file for another program."""
    from lgvi_warp.store.export import export as write_as

    settings = {"members": _members(chosen.members), "origin": _origin(chosen.origin), "start": chosen.start,
                "inputs": chosen.inputs, "overwrite": chosen.overwrite}  # fmt: skip
    run = chosen.dir
    if run.suffix == ".json":
        from lgvi_warp.uncertainty.footprint.answer import Footprint

        run = Footprint.load(run)
    with progress_bar(chosen.quiet, "writing") as progress:
        path = (write or write_as)(run, chosen.to, chosen.out, **settings, progress=progress)
    tell(chosen, lambda: {"file": path, "bytes": path.stat().st_size}, lambda: file_line(path))
    return 0


def _members(text: str | None) -> slice | list[int] | None:
    """Read the members of --members: "3,17" or "0:100"."""
    if text is None or ":" not in text:
        return indices(text)
    words = [word.strip() for word in text.split(":")]
    if len(words) > 3 or not all(word.isdigit() for word in words if word) or words[2:] in ([""], ["0"]):
        raise SceneError([f"--members {text} is not a list of members. Write --members 3,17 or --members 0:100"])
    return slice(*(int(word) if word else None for word in words))


def _origin(text: str | None) -> list[float] | None:
    """Read the latitude and longitude of --origin."""
    if text is None:
        return None
    try:
        latitude, longitude = map(float, text.split(","))
    except ValueError:
        raise SceneError([f"--origin {text} is not a place. Write --origin=63.44,10.40"]) from None
    return [latitude, longitude]


def report_arguments(verb: Any) -> None:
    """Add the arguments of the verb report."""
    verb.add_argument("dir", metavar="DIR", type=Path,
                      help="folder written by run, tradeoff, stability, sensitivity or sweep")  # fmt: skip
    verb.add_argument("--out", metavar="FILE", type=Path,
                      help="the file; an existing one is replaced (default: DIR/report.html)")  # fmt: skip
    verb.add_argument("--open", action="store_true", help="open the file in the browser")


@as_verb("report", "write one HTML file about a run or studies: report.html", report_arguments)
def report(chosen: argparse.Namespace, *, write: Part = None, browse: Part = None) -> int:
    """Run the verb report: write one HTML file about a run or a study."""
    import webbrowser

    from lgvi_warp.views.pages.report import report as write_report

    if chosen.out is None:
        place_of(chosen.dir / "report.html", chosen.dir)
    with progress_bar(chosen.quiet, "drawing"):
        path = (write or write_report)(chosen.dir, chosen.out or chosen.dir / "report.html")
    tell(chosen, lambda: {"file": path, "bytes": path.stat().st_size}, lambda: file_line(path))
    if chosen.open:
        (browse or webbrowser.open)(path.resolve().as_uri())
    return 0
