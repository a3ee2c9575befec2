# SPDX-License-Identifier: Apache-2.0
"""Export of a run of any size to one file for another program, part by part."""

from __future__ import annotations

import contextlib
import errno
import functools
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lgvi_warp.common import extensions
from lgvi_warp.common import files as durable
from lgvi_warp.common.arguments import file_path, flag, path_of
from lgvi_warp.common.errors import MissingExtra, SceneError, install, refusal
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.safe_files import inside
from lgvi_warp.results.result import Result
from lgvi_warp.scene.examples import PREFIX
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.start import Environment
from lgvi_warp.store.exporting import tables, trajectories, whole_store
from lgvi_warp.store.exporting.tracks import Report, plane_of, recorded, tracks_of
from lgvi_warp.store.folder import Folder
from lgvi_warp.store.open import folder_of, open_run
from lgvi_warp.store.state import state

# All of a store, by a word, and the ending of its file.
FORMATS = {"netcdf": ".nc", "parquet": ".parquet"}
# Members, by the ending of the file; extensions have more.
WRITERS: dict[str, Callable[..., None]] = {
    ".csv": tables.csv,
    ".parquet": tables.parquet,
    ".nc": trajectories.netcdf,
}

# The table of extensions whose words are endings of files that are made of scenes.
OF_SCENES = "scene_exporters"


@shows_progress
def export(
    run: Any,
    to: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    members: slice | Sequence[int] | None = None,
    origin: Sequence[float] | None = None,
    start: str | None = None,
    inputs: str | None = None,
    overwrite: bool = False,
    progress: Callable[[float], None] | bool | None = None,
) -> Path:
    """Export a run, some of its members, or a scene to a file for other programs; the file extension selects the format.

    ".csv" and ".parquet": a table with one row per member and sample time, or one row per member if there are no samples.
    ".nc": NetCDF-4 with trajectories in the CF conventions. ".geojson" and ".kml": tracks on a map. ".mcap": odometry and
    transforms in the axes of ROS. docs/guide/exports.md lists columns, names, units and axes. A footprint is exported as
    its regions, to ".geojson" or ".kml". A scene is exported to ".fmu": its vehicle as a functional mock-up unit.

    Args:
        run: A result, a result.npz, a store, a folder with one result.npz or store, or the result of
            `lw.studies.footprint`. For ".fmu" a scene, or a scene file.
        to: Path of the new file; or a format, "netcdf" (all arrays of a store unchanged) or "parquet", with the path of
            the file in `out`.
        out: Path of the new file if `to` is "netcdf" or "parquet"; by default next to the run.
        members: Indices, a slice or a mask of the members; by default all members whose samples were kept. Maps and
            MCAP take at most 1,000 members.
        origin: Latitude and longitude of the axes' origin [deg]; by default the origin of the run's environment, if set.
        start: Date and time at t = 0, as "2026-06-01T00:00:00Z"; by default the start of the run's environment.
        inputs: Inputs of an ".fmu": "commands" (default) of the actuators, in place of the scene's control laws; or
            "set_points" of the controller, which is then part of the unit.
        overwrite: Whether to replace an existing file; by default the export is refused.
        progress: Function that is called with the finished fraction, or True to show it; by default nothing is shown.

    Returns:
        Path of the file.

    Raises:
        SceneError: If the run is incomplete, damaged or without data that the format needs, the file exists, or a
            library is missing.
        OSError: If the file cannot be written.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, store="run.zarr")
        >>> print(lw.export("run.zarr", to="run.csv"))
        run.csv
        >>> print(lw.export(result, to="first.geojson", members=[0], origin=[63.44, 10.40]))
        first.geojson
    """
    word = to if isinstance(to, str) and to in FORMATS else None
    ending = FORMATS[word] if word else _ending(to)
    if word is None and out is not None:
        raise refusal("out", out, f"is given beside the file {os.fspath(to)!r}", "keep one of them")
    chosen = {"members": members, "origin": origin, "start": start}
    of_scene = _of_scene(run, ending, inputs, chosen)
    if word == "netcdf" and (extra := [name for name, value in chosen.items() if value is not None]):
        raise refusal(extra[0], chosen[extra[0]], "is given for all that a store holds", "give a file: to='run.nc'")
    replaces = flag("overwrite", overwrite)
    of_regions = _regions(run, ending, chosen) if getattr(run, "study", "") == "footprint" else None
    directly = of_regions or of_scene
    source = _source(run) if directly is None else Source(lambda: run)
    beside = source.path if word and out is None else None
    target = _beside(source, ending) if word and out is None else file_path("to", to if out is None else out)
    root = None if beside is None else beside.parent
    durable.place_of(target, root)
    if not replaces and os.path.lexists(target):
        raise SceneError([f"{target} is there already. Give overwrite=True (--overwrite), or another name"])
    if source.folder is not None:
        check_whole(source.folder)
    if directly is not None:
        write = directly
    elif word == "netcdf":
        write = _whole_store(source)
    else:
        write = _some_members(source.result(), ending, members, _where(origin, start))
    target.parent.mkdir(parents=True, exist_ok=True)
    with fault_of_library(str(word or target.name), target), durable.placed(target, root) as unfinished:
        write(unfinished, callback(progress) or _nothing)
    return target


@dataclass(frozen=True)
class Source:
    """The exported run: its result, its store if it has one, and the path next to which an exported file is written."""

    result: Callable[[], Result]
    folder: Folder | None = None
    path: Path | None = None


def _source(run: Any) -> Source:
    """Find the run that the argument names."""
    if isinstance(run, Result):
        folder = None if run.store is None else Folder(run.store)
        return Source(lambda: run, folder, run.store)
    path = path_of("run", run)
    file = path if path.suffix == ".npz" else _only_result(path)
    if file is not None:
        return Source(lambda: Result.load(file), None, file)
    folder = Folder(folder_of(path))
    if not folder.complete:
        raise SceneError([f"{folder.path} is not complete. Go on with `lgvi-warp resume {folder.path.parent}` first"])
    return Source(lambda: open_run(folder.path), folder, folder.path)


def _only_result(path: Path) -> Path | None:
    """Find the only result.npz of a folder; None if the folder has no result, or has a store."""
    if path.suffix == ".zarr" or not path.is_dir() or any(path.glob("*.zarr")):
        return None
    files = sorted(path.glob("result*.npz"))
    if len(files) > 1:
        raise SceneError([f"{path} holds {len(files)} results. Name one: {', '.join(map(str, files[:5]))}"])
    # A folder from elsewhere could otherwise lead to any file of the user.
    return inside(path, files[0].name) if files else None


def _ending(to: Any) -> str:
    """Return the file's extension in lower case; refuse an unknown one."""
    ending = Path(to).suffix.lower() if isinstance(to, str | os.PathLike) else ""
    if ending not in (known := [*WRITERS, *extensions.words("exporters"), *extensions.words(OF_SCENES)]):
        remedy = f"give a name that ends in {', '.join(known)}, or a word of {', '.join(FORMATS)}"
        raise refusal("to", to, "is not a file of a known kind", remedy)
    return ending


def _beside(source: Source, ending: str) -> Path:
    """Path of the exported file next to the run."""
    if source.path is None:
        raise refusal("out", None, "is missing, and the run is in memory", "give the file")
    return source.path.with_suffix(ending)


def _where(origin: Any, start: Any) -> Environment | None:
    """Environment with the given origin and start; None if neither is given."""
    if origin is None and start is None:
        return None
    try:
        return Environment(origin=origin, start=start)
    except SceneError as error:
        # The user gave arguments of this function, not keys of a scene.
        faults = (fault.removeprefix("environment.") for fault in error.faults)
        raise SceneError(faults) from None


def _environment_of(result: Result, given: Environment | None) -> Environment:
    """Environment of the run, in which a given origin or start replaces the run's own."""
    origin, start = (recorded(result.provenance, "scene", "environment", name) for name in ("origin", "start"))
    own = Environment(origin=origin, start=start)
    if given is None:
        return own
    origin = own.origin if given.origin is None else given.origin
    return Environment(origin=origin, start=own.start if given.start is None else given.start)


Write = Callable[[Path, Report], None]


def _whole_store(source: Source) -> Write:
    """Make the function that writes a whole store."""
    folder = source.folder
    if folder is None:
        raise refusal("to", "netcdf", "is all that a store holds, and the run is in none", "give a file: to='run.nc'")
    return functools.partial(whole_store.netcdf, folder)


def _some_members(result: Result, ending: str, members: Any, given: Environment | None) -> Write:
    """Make the function that writes members of a run into a file with this extension."""
    tracks = tracks_of(result, members, _environment_of(result, given))
    if ending in WRITERS:
        return functools.partial(WRITERS[ending], tracks)
    exporter = extensions.load("exporters", ending)
    # Files that programs read whole.
    most = getattr(exporter, "MOST_MEMBERS", tracks.count)
    if members is None and tracks.count > most:
        problem = f"are {tracks.count:,}, more than the {most:,} that a {ending} file of all members may have"
        raise refusal("members", None, problem, "choose some: members=range(100) (--members 0:100)")
    return functools.partial(exporter.write, tracks)


def _of_scene(run: Any, ending: str, inputs: Any, arguments: dict[str, Any]) -> Write | None:
    """Make the function that writes a scene into a file with this extension; None for a run."""
    name = os.fspath(run) if isinstance(run, str | os.PathLike) else ""
    named = name.lower().endswith(".toml") or name.startswith(PREFIX)
    made_of_scenes = ending in extensions.words(OF_SCENES)
    if not (made_of_scenes or named or isinstance(run, Scene)):
        if inputs is not None:
            raise refusal("inputs", inputs, "is given for a run", "leave it out; a .fmu of a scene has inputs")
        return None
    if not made_of_scenes:
        remedy = "run it first, and export the run; or name a file that ends in .fmu"
        raise refusal("run", name or "a Scene", f"is a scene, of which no {ending} file can be made", remedy)
    if not (named or isinstance(run, Scene)):
        problem = f"is no scene, of which a {ending} file is made: one vehicle with the scene's own numbers"
        raise refusal(
            "run", name or type(run).__name__, problem, "give a lw.Scene or a scene file, and no run or ensemble"
        )
    for key, value in arguments.items():
        if value is not None:
            raise refusal(key, value, f"is given for a {ending} file", "leave it out")
    scene = run if isinstance(run, Scene) else Scene.load(run)
    try:
        write: Write = extensions.load(OF_SCENES, ending).scene_writer(scene, "commands" if inputs is None else inputs)
    except MissingExtra as error:
        raise SceneError([f"to = {ending!r}: {error}"]) from error
    return write


def _regions(footprint: Any, ending: str, arguments: dict[str, Any]) -> Write:
    """Make the function that writes the regions of a footprint into a file with this extension."""
    exporter: Any = None if ending in WRITERS else extensions.load("exporters", ending)
    if not hasattr(exporter, "write_regions"):
        raise refusal(
            "to", ending, "holds no regions", "give a file .geojson or .kml; its save(folder) writes JSON and CSV"
        )
    for name in ("members", "start"):
        if arguments[name] is not None:
            raise refusal(name, arguments[name], "is given for a footprint, which is of all members", "leave it out")
    environment = _where(arguments["origin"] or footprint.origin, None) or Environment()
    return functools.partial(exporter.write_regions, footprint, plane_of(environment, "a map"))


def _nothing(fraction: float) -> None:
    """Show no progress."""


@contextlib.contextmanager
def fault_of_library(to: str, target: Path) -> Iterator[None]:
    """Complete errors of a format's library: name the file and a remedy."""
    try:
        yield
    except MissingExtra as error:
        raise SceneError([f"to = {to!r}: {error}"]) from error
    except ImportError as error:
        raise SceneError([f"to = {to!r}: {error}. Install it: {install('export')}"]) from error
    except (OSError, RuntimeError) as error:
        # Neither library names the file, and netCDF4 hides the system's error.
        reason = getattr(error, "strerror", None) or f"was not written ({error}); is the disk full?"
        raise OSError(getattr(error, "errno", None) or errno.EIO, reason, str(target)) from error


def check_whole(folder: Folder) -> None:
    """Check that every file is unchanged since it was written: a missing chunk would be exported as NaN."""
    content = state(folder.path)
    if not content["complete"]:
        unfinished = content["blocks"] - content["finished"]
        damage = content["damage"][:5] or [f"{unfinished} blocks are not marked as finished"]
        raise SceneError(f"{folder.path}: {text}. `lgvi-warp resume {folder.path}` mends it" for text in damage)
