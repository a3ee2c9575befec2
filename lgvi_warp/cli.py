"""The command lgvi-warp."""

from __future__ import annotations

import argparse
import gc
import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from lgvi_warp.errors import MembersFailed, SceneError

# Command-line option -> key of the scene file that it replaces.
OPTIONS = {
    "method": "run.method",
    "step": "run.step",
    "duration": "run.duration",
    "dtype": "run.dtype",
    "solver": "run.solver",
    "iterations": "run.iterations",
    "tolerance": "run.tolerance",
    "rtol": "run.rtol",
    "atol": "run.atol",
    "checks": "run.checks",
    "on_failure": "run.on_failure",
    "keep": "run.keep",
    "members": "ensemble.members",
    "seed": "ensemble.seed",
}

OF = "position, attitude, velocity, angular_velocity or energy"

EPILOG = """examples:
  lgvi-warp run examples/paper.toml --out runs/paper
  lgvi-warp run examples/paper.toml --members 20000 --dtype float32 --set vehicle.mass=120
  lgvi-warp run examples/paper.toml --error 1e-3
  lgvi-warp run examples/paper.toml --members 1000000 --store zarr --out runs/large
  lgvi-warp resume runs/large
  lgvi-warp tradeoff examples/paper.toml --out runs/tradeoff
  lgvi-warp sensitivity examples/paper.toml --of "position[2]" --out runs/sensitivity
  lgvi-warp stability examples/paper.toml --out runs/stability
  lgvi-warp info
"""


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    top = argparse.ArgumentParser(
        prog="lgvi-warp",
        description="Simulate many underwater vehicles at once with a Lie group variational integrator.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = top.add_subparsers(dest="verb", required=True, metavar="VERB")
    run = verbs.add_parser("run", help="run a scene's ensemble: result.npz, fleet.png, fleet.rrd and a summary")
    _add_scene(run, "runs/NAME of the scene")
    run.add_argument(
        "--error",
        metavar="E",
        type=float,
        help="choose the cheapest method, step and precision that keep this error, and check it after the run",
    )
    run.add_argument("--of", help=f"what --error is of (default: position [m]); {OF}")
    run.add_argument("--method", help="psi_s, psi_1, psi, phi, phi_adjoint, or a composition such as kl6(psi_s)")
    run.add_argument("--step", metavar="S", help="time step [s]")
    run.add_argument("--dtype", help="float64, float32, or float32_compensated: sums of two float32")
    run.add_argument("--solver", help="of equation (24): quartic, cayley, newton or moser_veselov")
    run.add_argument(
        "--iterations", metavar="N", help='of every solve: a number, or "auto" (default: to the tolerance)'
    )
    run.add_argument("--tolerance", metavar="T", help="relative residual above which a solve is not converged")
    run.add_argument("--rtol", metavar="R", help="with --atol, rk5 and rk8 choose their steps for this relative error")
    run.add_argument("--atol", metavar="A", help="and for this absolute one")
    run.add_argument(
        "--checks", help="none, safe (statuses, default) or all (warnings of what arises on the way as well)"
    )
    run.add_argument(
        "--on-failure", help="freeze a member that fails (default), raise: exit code 1, or substep: divide its step"
    )
    run.add_argument(
        "--keep", help="samples of members to keep: all, none or failed (statistics are those of the scene)"
    )
    run.add_argument("--width", metavar="W", type=int, help="vehicles per SIMD packet (default: from the CPU)")
    _add_executor(run)
    run.add_argument(
        "--store",
        choices=["npz", "zarr"],
        default="npz",
        help="result.npz when the run ends (default), or run.zarr block by block, which resume can go on with",
    )
    run.add_argument("--store-dtype", metavar="D", help="float32: store the samples of a float64 run so")
    run.add_argument("--blocks", metavar="A:B", help="with --store zarr: run only these blocks, to be merged later")
    there = run.add_mutually_exclusive_group()
    there.add_argument("--overwrite", action="store_true", help="replace a run.zarr that is there")
    there.add_argument("--resume", action="store_true", help="go on with a run.zarr that is there, if it is this run")
    _add_plan(verbs)
    _add_store_verbs(verbs)
    trade = verbs.add_parser(
        "tradeoff", help="speed against accuracy of every method, step and precision: tradeoff.json, .csv and .png"
    )
    _add_scene(trade, "runs/NAME_tradeoff")
    trade.add_argument("--methods", metavar="A,B", help="names, such as psi_s,kl8(psi_x) (default: all that fit)")
    trade.add_argument("--of", default="position", help=f"what errors are of (default: position); {OF}")
    trade.add_argument(
        "--seconds",
        metavar="S",
        type=float,
        default=45.0,
        help="about how long to measure (default 45)",
    )
    _add_sensitivity(verbs)
    _add_stability(verbs)
    info = verbs.add_parser(
        "info", help="what a run's folder holds; without one, the machine, versions, the core's peak"
    )
    info.add_argument("dir", metavar="DIR", type=Path, nargs="?", help="a store, or a folder with one")
    info.set_defaults(scene=None)
    bench = verbs.add_parser("bench", help="speed of the kernel on this machine, beside the core's peak")
    bench.add_argument("--members", type=int, default=4096, help="vehicles (default 4096)")
    bench.add_argument("--steps", type=int, default=1000, help="steps (default 1000)")
    return top


def _add_sensitivity(verbs: Any) -> None:
    """lgvi-warp sensitivity and its arguments."""
    verb = verbs.add_parser(
        "sensitivity",
        help="what of that which varies matters: Sobol indices or Morris screening; .txt, .csv, .json, .png",
    )
    verb.add_argument("scene", metavar="SCENE", help="scene file (TOML) with [ensemble.vary]")
    verb.add_argument("--of", metavar="Q", action="append", help='quantity of interest: "position[2]" (the default), '
                      '"norm(velocity)", "max(energy)" ...; may be given several times')  # fmt: skip
    verb.add_argument("--out", metavar="DIR", type=Path, help="folder for the files (default: runs/NAME_sensitivity)")
    verb.add_argument("--analysis", choices=("sobol", "morris"), default="sobol", help="default sobol")
    verb.add_argument("--samples", metavar="N", type=int, help="groups of the design (default: sobol 256, morris 64)")
    verb.add_argument(
        "--first-order", action="store_true", help="sobol without pairs of factors: about half the members"
    )
    verb.add_argument("--failed", choices=("refuse", "drop"), default="refuse",
                      help="what to do about groups with a failed member (default refuse)")  # fmt: skip
    verb.add_argument("--method", help="integration method, as of run")
    verb.add_argument("--step", metavar="S", help="time step [s]")
    verb.add_argument("--dtype", help="float64, float32, or float32_compensated")
    verb.add_argument("--duration", metavar="S", help="end of the run [s]")
    verb.add_argument("--seed", metavar="N", help="seed of the design")
    verb.add_argument("--threads", metavar="N", type=int, help="threads (default: all cores)")
    verb.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="replace a key of the scene file")
    verb.add_argument("--quiet", action="store_true", help="no progress and no table")


def _add_stability(verbs: Any) -> None:
    """The arguments of lgvi-warp stability."""
    verb = verbs.add_parser(
        "stability",
        help="where methods are accurate, bounded, flagged or fail, over two parameters: .json, .csv and .png",
    )
    _add_scene(verb, "runs/NAME_stability", ensemble=False)
    verb.add_argument(
        "--grid",
        choices=("omega", "mass", "drag", "all"),
        help="step against angular velocity (default), added-mass ratio or drag number, or all three",
    )
    axis = "NAME or NAME=LOW:HIGH[:linear], such as"
    verb.add_argument("--x", metavar="AXIS", help=f"instead of --grid: {axis} h=0.01:3")
    verb.add_argument("--y", metavar="AXIS", help=f"instead of --grid: {axis} angular_velocity, vehicle.mass=50:500")
    verb.add_argument("--methods", metavar="A,B", help="names, such as psi_s,kl8(psi_x) (default: psi,psi_s,psi_x,rk4)")
    verb.add_argument("--points", metavar="N", type=int, default=24, help="cells along each axis (default 24)")
    verb.add_argument("--error", metavar="E", type=float, default=1e-2, help="an accurate cell's bound (default 0.01)")
    verb.add_argument("--of", default="attitude", help=f"what --error is of (default: attitude); {OF}")


def _add_executor(verb: argparse.ArgumentParser) -> None:
    """Where blocks run."""
    verb.add_argument("--threads", metavar="N", type=int, help="threads, processes or workers (default: all cores)")
    verb.add_argument("--executor", default="threads", help="threads (default), processes or dask")
    verb.add_argument("--scheduler", metavar="ADDRESS", help="of Dask; without one, a cluster on this machine")


def _add_plan(verbs: Any) -> None:
    """The verb plan."""
    plan = verbs.add_parser(
        "plan", help="time, memory and disk that a run would take, from a small one on this machine"
    )
    _add_scene(plan, "runs/NAME of the scene")
    plan.add_argument("--method", help="as for run")
    plan.add_argument("--step", metavar="S", help="time step [s]")
    plan.add_argument("--dtype", help="as for run")
    plan.add_argument("--threads", metavar="N", type=int, help="threads (default: all cores)")
    plan.add_argument("--store", choices=["npz", "zarr"], default="npz", help="as for run")
    plan.add_argument("--store-dtype", metavar="D", help="as for run")


def _add_store_verbs(verbs: Any) -> None:
    """The verbs that work on a store."""
    resume = verbs.add_parser("resume", help="go on with a run that was stopped, and mend what is damaged of it")
    resume.add_argument("dir", metavar="DIR", type=Path, help="a store, or a folder with one")
    _add_executor(resume)
    resume.add_argument("--force", action="store_true", help="even on another machine or with other versions")
    resume.add_argument("--quiet", action="store_true", help="no progress and no summary")
    merge = verbs.add_parser("merge", help="put runs of some blocks each (run --blocks) together")
    merge.add_argument("dirs", metavar="DIR", type=Path, nargs="+", help="stores, or folders with one each")
    merge.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder for the whole run")
    merge.add_argument("--overwrite", action="store_true", help="replace a run.zarr that is there")
    merge.add_argument("--quiet", action="store_true", help="no summary")
    export = verbs.add_parser("export", help="write a run as one NetCDF or Parquet file")
    export.add_argument("dir", metavar="DIR", type=Path, help="a store, or a folder with one")
    export.add_argument("--to", required=True, help="netcdf or parquet")
    export.add_argument("--out", metavar="FILE", type=Path, help="the file (default: beside the store)")


def _add_scene(verb: argparse.ArgumentParser, folder: str, ensemble: bool = True) -> None:
    """The arguments of a verb that runs a scene."""
    verb.add_argument("scene", metavar="SCENE", help="scene file (TOML)")
    verb.add_argument(
        "--out", metavar="DIR", type=Path, help=f"folder for the files, replaced if they exist (default: {folder})"
    )
    verb.add_argument("--duration", metavar="S", help="end of the run [s]")
    if ensemble:
        verb.add_argument("--members", metavar="N", help="number of vehicles")
    verb.add_argument("--seed", metavar="N", help="seed of what varies")
    verb.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="replace a key of the scene file")
    verb.add_argument("--quiet", action="store_true", help="no progress and no summary")


def main(arguments: list[str] | None = None) -> int:
    """Run the command. Returns the exit code: 0, 1 for a run that failed, 2 for a scene or argument that is refused."""
    chosen = parser().parse_args(arguments)
    try:
        return VERBS[chosen.verb](chosen)
    except SceneError as error:
        print(f"lgvi-warp: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"lgvi-warp: {error.filename or ''}: {error.strerror or error}", file=sys.stderr)
        return 1
    except MemoryError as error:
        print(f"lgvi-warp: {error or 'out of memory'}; run fewer members or keep fewer samples", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        kept = chosen.verb == "resume" or getattr(chosen, "store", None) == "zarr"
        text = "finished blocks are kept: go on with lgvi-warp resume" if kept else "nothing was written"
        print(f"lgvi-warp: interrupted; {text}", file=sys.stderr)
        return 130


def overrides(chosen: argparse.Namespace) -> dict[str, Any]:
    """What the command line replaces of the scene file. Raises SceneError for a --set without a value."""
    changes: dict[str, Any] = {}
    for name, key in OPTIONS.items():
        value = getattr(chosen, name, None)
        if value is not None:
            changes[key] = value
    for text in chosen.set:
        key, equals, value = text.partition("=")
        if not equals:
            raise SceneError([f"--set {text}: has no value; write --set vehicle.mass=120"])
        changes[key.strip()] = value.strip()
    return changes


def run(chosen: argparse.Namespace) -> int:
    """lgvi-warp run."""
    from lgvi_warp.scene import Scene

    begun = time.perf_counter()
    scene = Scene.load(chosen.scene, overrides(chosen))
    out: Path = chosen.out or Path("runs") / Path(chosen.scene).stem
    store, only = store_settings(chosen, out), block_range(chosen)
    out.mkdir(parents=True, exist_ok=True)
    warm = _import_in_background()
    from lgvi_warp.solving import solve

    suggested = suggestion(scene, chosen)
    progress = None if chosen.quiet else Progress(sys.stderr)
    settings = suggested.settings if suggested else {}
    failures = []
    try:
        result = solve(
            scene, threads=chosen.threads, width=chosen.width, progress=progress, store=store, executor=chosen.executor,
            scheduler=chosen.scheduler, only=only, **settings,
        )  # fmt: skip
    except MembersFailed as error:
        result, failures = error.result, [str(error)]
    if progress:
        progress.close()
    warm.join()
    faults = report(result, out, chosen.quiet, begun) + failures
    if suggested:
        faults += check_error(scene, result, suggested, chosen.quiet)
    for fault in faults:
        print(f"lgvi-warp: {fault}", file=sys.stderr)
    return 1 if faults or (result.status != 0).all() else 0


def store_settings(chosen: argparse.Namespace, out: Path) -> Any:
    """The store that the arguments ask for, None without one. Raises SceneError."""
    if chosen.store == "npz":
        names = ("store_dtype", "blocks", "overwrite", "resume")
        given = [f"--{name.replace('_', '-')}" for name in names if getattr(chosen, name)]
        if given:
            raise SceneError([f"{' and '.join(given)}: is for runs in a store; add --store zarr, or leave it out"])
        return None
    from lgvi_warp.store import Store

    existing = "overwrite" if chosen.overwrite else "resume" if chosen.resume else "refuse"
    return Store(out / "run.zarr", chosen.store_dtype, existing=existing)


def block_range(chosen: argparse.Namespace) -> range | None:
    """The blocks of --blocks A:B. Raises SceneError."""
    if chosen.blocks is None:
        return None
    first, colon, stop = chosen.blocks.partition(":")
    if not (colon and first.isdigit() and stop.isdigit()):
        raise SceneError(
            [f"--blocks {chosen.blocks}: is no range of blocks; write --blocks 0:100 for the first hundred"]
        )
    return range(int(first), int(stop))


def report(result: Any, out: Path, quiet: bool, begun: float) -> list[str]:
    """Write the files of a finished run, print its summary, and return what failed."""
    if result.store is not None and not complete(result):
        if not quiet:
            print(f"members     {result.members:,} of a run in parts, in {result.store}; next: lgvi-warp merge")
        return []
    drawn = shown_members(result)
    files, faults = write(result, drawn, out)
    if not quiet:
        print(summary(result, drawn, files, time.perf_counter() - begun))
    return faults


def complete(result: Any) -> bool:
    """Whether a store holds the whole run."""
    from lgvi_warp.store import Folder

    return Folder(result.store).complete


# Plots and drift are of so many numbers at most, of the first members: a store may be larger than the memory.
MOST_DRAWN = 30_000_000


def shown_members(result: Any) -> Any:
    """The result, or of a large one in a store its first members, in memory; without samples, those kept, or None."""
    if not result.samples:
        return result.kept
    if result.store is None:
        return result
    from lgvi_warp.stored import chosen

    most = max(1, MOST_DRAWN // (18 * len(result.time)))
    return chosen(result, range(min(most, result.members)))


def suggestion(scene: Any, chosen: argparse.Namespace) -> Any:
    """What --error asks for, said; None without it. Raises SceneError."""
    if chosen.error is None:
        if chosen.of is not None:
            raise SceneError([f"--of {chosen.of}: says what --error is of, which is missing; add --error 1e-3"])
        return None
    if not (isinstance(scene.run.keep, str) and scene.run.keep == "all") or scene.run.until is not None:
        raise SceneError(
            [f'--error {chosen.error:g}: is checked on samples of all members; give run.keep="all", no run.until']
        )
    for name in ("step", "dtype"):
        if getattr(chosen, name) is not None:
            text = f"--{name} {getattr(chosen, name)}: is what --error chooses"
            raise SceneError([f"{text}; leave out --{name} or --error"])
    from lgvi_warp.suggestion import suggest

    progress = None if chosen.quiet else Progress(sys.stderr)
    methods = [chosen.method] if chosen.method else None
    of = chosen.of or "position"
    found = suggest(scene, chosen.error, of, methods=methods, threads=chosen.threads, progress=progress)
    if progress:
        progress.close()
        print(found, flush=True)
    return found


def check_error(scene: Any, result: Any, suggested: Any, quiet: bool) -> list[str]:
    """Say what error the run has, by some members at half its step; a fault where it is above what was asked."""
    from lgvi_warp.ensemble import Ensemble
    from lgvi_warp.suggestion import verified

    found, members = verified(Ensemble.from_scene(scene), result, suggested)
    text = (
        f"error of {suggested.of} {found:.1e} {suggested.unit}, asked {suggested.error:g} ({members} members again at "
    )
    text += "half the step, those with the largest errors among them)"
    if not found <= suggested.error:
        return [f"{text}: missed; ask for a smaller one"]
    if not quiet:
        print(f"checked     {text}")
    return []


def tradeoff(chosen: argparse.Namespace) -> int:
    """lgvi-warp tradeoff."""
    from lgvi_warp.scene import Scene

    scene = Scene.load(chosen.scene, overrides(chosen))
    out: Path = chosen.out or Path("runs") / f"{Path(chosen.scene).stem}_tradeoff"
    out.mkdir(parents=True, exist_ok=True)
    methods = None if chosen.methods is None else [name.strip() for name in chosen.methods.split(",")]
    from lgvi_warp.sinks.plots import plot_tradeoff
    from lgvi_warp.tradeoffs import report_text
    from lgvi_warp.tradeoffs import tradeoff as measure

    progress = None if chosen.quiet else Progress(sys.stderr)
    found = measure(scene, of=chosen.of, methods=methods, seconds=chosen.seconds, progress=progress)
    if progress:
        progress.close()
    files, faults = found.save(out), []
    try:
        files.append(plot_tradeoff(found, out / "tradeoff.png"))
    except (ImportError, ValueError) as error:
        faults.append(f"{out / 'tradeoff.png'} was not written: {error}")
    if not chosen.quiet:
        print(report_text(found))
        print("\n".join(["", *(f"file        {path}" for path in files)]))
    for fault in faults:
        print(f"lgvi-warp: {fault}", file=sys.stderr)
    return 1 if faults else 0


def sensitivity(chosen: argparse.Namespace) -> int:
    """lgvi-warp sensitivity."""
    from lgvi_warp import uq
    from lgvi_warp.scene import Scene
    from lgvi_warp.sinks.sensitivity import plot_sensitivity

    scene = Scene.load(chosen.scene, overrides(chosen))
    out: Path = chosen.out or Path("runs") / f"{Path(chosen.scene).stem}_sensitivity"
    out.mkdir(parents=True, exist_ok=True)
    progress = None if chosen.quiet else Progress(sys.stderr)
    settings: dict[str, Any] = {"failed": chosen.failed, "threads": chosen.threads, "progress": progress}
    of, asked = chosen.of or ["position[2]"], {} if chosen.samples is None else {"samples": chosen.samples}
    try:
        if chosen.analysis == "morris":
            found: uq.Indices = uq.morris(scene, of, **asked, **settings)
        else:
            first = chosen.first_order
            asked = {"samples": 256} | asked
            found = uq.sobol(scene, of, second_order=not first, **asked, **settings)
    except (uq.FailedMembers, ImportError) as error:
        print(f"lgvi-warp: {error}", file=sys.stderr)
        return 1
    finally:
        if progress:
            progress.close()
    files, faults = found.save(out), []
    try:
        files.append(plot_sensitivity(found, out / "sensitivity.png"))
    except (ImportError, ValueError) as error:
        faults.append(f"{out / 'sensitivity.png'} was not written: {error}")
    if not chosen.quiet:
        print("\n".join([str(found), "", *(f"file        {path}" for path in files)]))
    for fault in faults:
        print(f"lgvi-warp: {fault}", file=sys.stderr)
    return 1 if faults else 0


def stability(chosen: argparse.Namespace) -> int:
    """lgvi-warp stability."""
    from lgvi_warp.scene import Scene

    if chosen.grid is not None and (chosen.x is not None or chosen.y is not None):
        raise SceneError(
            [f"--grid {chosen.grid}: says the axes that --x and --y say; leave out --grid, or both of them"]
        )
    changes = overrides(chosen)
    scene = Scene.load(chosen.scene, changes)
    # Of the random directions: all that the scene's ensemble has to say here.
    seed = scene.ensemble_settings.seed if scene.ensemble_settings else 0
    out: Path = chosen.out or Path("runs") / f"{Path(chosen.scene).stem}_stability"
    out.mkdir(parents=True, exist_ok=True)
    from lgvi_warp.sinks.plots import plot_stability
    from lgvi_warp.stability import GRIDS, report_text, stability_map

    maps = {"stability": (chosen.x or "h", chosen.y or "angular_velocity")}
    if chosen.grid:
        names = GRIDS if chosen.grid == "all" else (chosen.grid,)
        maps = {f"stability_{name}": GRIDS[name] for name in names}
    methods = None if chosen.methods is None else [name.strip() for name in chosen.methods.split(",")]
    t1 = scene.run.duration if chosen.duration is not None else None
    progress = None if chosen.quiet else Progress(sys.stderr)
    files, faults, texts = [], [], []
    for i, (name, (x, y)) in enumerate(maps.items()):
        found = stability_map(
            scene, x, y, methods, points=chosen.points, t1=t1, error=chosen.error, of=chosen.of, seed=seed,
            progress=_part_of(progress, i, len(maps)),
        )  # fmt: skip
        files += found.save(out, name)
        texts.append(report_text(found))
        try:
            files.append(plot_stability(found, out / f"{name}.png"))
        except (ImportError, ValueError) as error:
            faults.append(f"{out / f'{name}.png'} was not written: {error}")
    if progress:
        progress.close()
    if not chosen.quiet:
        print("\n\n".join(texts))
        print("\n".join(["", *(f"file        {path}" for path in files)]))
    for fault in faults:
        print(f"lgvi-warp: {fault}", file=sys.stderr)
    return 1 if faults else 0


def _part_of(progress: Progress | None, i: int, n: int) -> Callable[[float], None] | None:
    """Progress of the whole from that of its part i of n."""
    return progress and (lambda part: progress((i + part) / n))


def _import_in_background() -> threading.Thread:
    """Load the plotting libraries while the kernels run, which leave the interpreter free."""

    def load() -> None:
        import importlib

        for name in ("matplotlib.figure", "matplotlib.backends.backend_agg", "rerun", "rerun.blueprint"):
            try:
                importlib.import_module(name)
            except ImportError:
                return  # whoever needs it says so, and how to get it

    thread = threading.Thread(target=load, name="imports", daemon=True)
    thread.start()
    return thread


def write(result: Any, drawn: Any, out: Path) -> tuple[list[Path], list[str]]:
    """Write result.npz, fleet.png, fleet.rrd and statistics.png side by side: what there is of them.

    drawn: the members of the pictures, None without. A result in a store is written already. Returns the files, and a text
    for each that failed.
    """
    from concurrent.futures import ThreadPoolExecutor

    from lgvi_warp.sinks.plots import drawable, plot, plot_statistics
    from lgvi_warp.sinks.rerun import log_rerun

    files: list[Path] = [result.store] if result.store else []
    faults: list[str] = []
    writers: dict[str, Callable[[Path], Path]] = {} if result.store else {"result.npz": result.save}
    if drawn is not None:
        writers |= {"fleet.png": lambda path: plot(drawn, path), "fleet.rrd": lambda path: log_rerun(drawn, path)}
    if drawable(result):
        writers["statistics.png"] = lambda path: plot_statistics(result, path)
    if not writers:
        return files, faults
    with ThreadPoolExecutor(len(writers)) as pool:
        jobs = {out / name: pool.submit(writer, out / name) for name, writer in writers.items()}
    for path, job in jobs.items():
        try:
            files.append(job.result())
        except (OSError, ImportError, ValueError) as error:
            faults.append(f"{path} was not written: {error}")
    return files, faults


def summary(result: Any, drawn: Any, files: list[Path], seconds: float) -> str:
    """The run in a few lines."""
    from lgvi_warp import invariants
    from lgvi_warp.statistics.table import table
    from lgvi_warp.status import Status

    settings = result.provenance
    steps = settings["steps"]
    lines = [
        *(f"note        {message}" for message in result.messages),
        f"members     {result.members:,}, {settings['method']['name']}, {settings['dtype']}, "
        f"step {settings['step']:g} s, {steps:,} steps",
        *_speed(result, seconds),
        "status      " + ", ".join(f"{name} {number:,}" for name, number in result.status.counts().items()),
    ]
    if result.samples:
        drift = invariants.drift(drawn)
        whose = "all members" if drawn.members == result.members else f"the first {drawn.members:,} members"
        lines.append(
            f"drift       energy {drift['energy']:.2g} J, horizontal momentum {drift['horizontal_momentum']:.2g} N s, "
            f"vertical angular momentum {drift['vertical_angular_momentum']:.2g} N m s (largest of {whose})"
        )
    elif result.kept is not None:
        lines.append(f"kept        {result.kept.members:,} members' samples, run again")
    for code in Status:
        failed = (result.status == code).nonzero()[0]
        if code and len(failed):
            first = int(failed[0])
            lines.append(
                f"  {code.name.lower()}: {code.text} (first: member {first} at {result.failure_time[first]:g} s)"
            )
    lines += _warning_lines(result)
    if result.substeps.any():
        divided = result.substeps > 0
        lines.append(
            f"substeps    {int(result.substeps.sum()):,} steps of {int(divided.sum()):,} members were divided: those paths "
            "are not symplectic"
        )
    if result.statistics:
        lines.append(f"statistics  at {result.time[-1]:g} s, with intervals")
        lines += [f"  {line}" for line in table(result.statistics)]
    lines += [f"file        {path} ({size_of(path) / 1e6:.1f} MB)" for path in files]
    return "\n".join(lines)


def _warning_lines(result: Any) -> list[str]:
    """Members by warning, and of each warning what it says and who had it first as the most serious one."""
    from lgvi_warp.status import Warnings

    counts = result.warnings.counts()
    if not counts:
        return []
    lines = ["warnings    " + ", ".join(f"{name} {number:,}" for name, number in counts.items())]
    worst = result.warnings.worst()
    for one in Warnings:
        members = (worst == one).nonzero()[0]
        if len(members):
            first = int(members[result.warning_time[members].argmin()])
            value = f"{one.value_name} = {result.warning_value[first]:.4g}"
            when = f"first: member {first} at {result.warning_time[first]:g} s, {value}"
            lines.append(f"  {str(one.name).lower()}: {one.text} ({when})")
    return lines


def _speed(result: Any, seconds: float) -> list[str]:
    """The summary's line on speed; none for a run that went on, of which not all was made now."""
    if not result.run_seconds:
        return []
    rate = result.members * result.provenance["steps"] / result.run_seconds
    return [
        f"speed       {rate:.3g} vehicle-steps per second ({result.run_seconds:.2f} s; kernel loaded in "
        f"{result.compile_seconds:.2f} s; {seconds:.2f} s in all)"
    ]


def size_of(path: Path) -> int:
    """Bytes of a file, or of all in a folder."""
    return (
        path.stat().st_size if path.is_file() else sum(one.stat().st_size for one in path.rglob("*") if one.is_file())
    )


class Progress:
    """Fraction done and time left, on a terminal in place, elsewhere a line now and then."""

    def __init__(self, stream: TextIO):
        self._stream, self._start, self._last = stream, time.perf_counter(), 0.0
        self._terminal = stream.isatty()
        self._interval = 0.1 if self._terminal else 10.0
        self._lock, self._shown = threading.Lock(), False

    def __call__(self, fraction: float) -> None:
        """Take note of the fraction of the work that is done."""
        now = time.perf_counter() - self._start
        with self._lock:
            if now - self._last < self._interval:
                return
            self._last, self._shown = now, True
            text = f"{fraction:6.1%}, {now * (1.0 / fraction - 1.0):.0f} s left"
            self._stream.write(f"\r{text}   " if self._terminal else f"{text}\n")
            self._stream.flush()

    def close(self) -> None:
        """Leave the terminal's line clean."""
        if self._terminal and self._shown:
            self._stream.write("\r" + " " * 40 + "\r")
            self._stream.flush()


def info(chosen: argparse.Namespace) -> int:
    """lgvi-warp info."""
    if chosen.dir is not None:
        return info_of_run(chosen.dir)
    from lgvi_warp import machine

    described, memory = machine.describe(), machine.memory_bytes()
    print(f"cpu         {described['cpu']}, {described['simd']}, {described['threads']} threads")
    if memory:
        print(f"memory      {memory / 2**30:.1f} GiB")
    print("versions    " + ", ".join(f"{name} {version}" for name, version in machine.versions().items()))
    for dtype in ("float64", "float32"):
        peak = machine.fma_peak(dtype)
        print(
            f"{dtype}     {machine.default_width(dtype)} vehicles per packet; one core's peak {peak / 1e9:.1f} GFMA/s"
        )
    return 0


def info_of_run(path: Path) -> int:
    """What a store holds. Returns 0 if it is complete and whole, else 1."""
    from lgvi_warp.resuming import state

    found = state(path)
    own = found["provenance"]
    print(f"run         {found['path']} ({found['bytes'] / 1e6:.1f} MB), lgvi-warp {own['versions']['lgvi-warp']}")
    print(f"members     {found['members']:,}, {own['method']['name']}, {own['dtype']}, step {own['step']:g} s, "
          f"{own['steps']:,} steps")  # fmt: skip
    print(f"samples     {found['samples']} times of {', '.join(found['fields']) or 'nothing'}")
    if found["keepers"]:
        print(f"parts       {', '.join(found['keepers'])} of each block")
    print(f"blocks      {found['finished']} of {found['blocks']} finished; "
          + ("complete" if found["complete"] else f"not complete: lgvi-warp resume {path}"))  # fmt: skip
    for text in found["damage"]:
        print(f"damage      {text}")
    return 0 if found["complete"] else 1


def resume(chosen: argparse.Namespace) -> int:
    """lgvi-warp resume."""
    from lgvi_warp.resuming import resume as go_on

    begun = time.perf_counter()
    progress = None if chosen.quiet else Progress(sys.stderr)
    failures = []
    try:
        result = go_on(
            chosen.dir, executor=chosen.executor, threads=chosen.threads, scheduler=chosen.scheduler, progress=progress,
            force=chosen.force,
        )  # fmt: skip
    except MembersFailed as error:
        result, failures = error.result, [str(error)]
    if progress:
        progress.close()
    assert result.store is not None
    faults = report(result, result.store.parent, chosen.quiet, begun) + failures
    for fault in faults:
        print(f"lgvi-warp: {fault}", file=sys.stderr)
    return 1 if faults else 0


def merge(chosen: argparse.Namespace) -> int:
    """lgvi-warp merge."""
    from lgvi_warp.resuming import merge as put_together

    folder = put_together(chosen.dirs, chosen.out, chosen.overwrite)
    left = len(folder.unfinished())
    if left:
        print(f"lgvi-warp: {folder.path}: {left} blocks are in none of the folders; lgvi-warp resume {folder.path} runs them",
              file=sys.stderr)  # fmt: skip
    elif not chosen.quiet:
        print(f"file        {folder.path} ({size_of(folder.path) / 1e6:.1f} MB), complete")
    return 1 if left else 0


def export(chosen: argparse.Namespace) -> int:
    """lgvi-warp export."""
    from lgvi_warp.exporting import export as write_as

    path = write_as(chosen.dir, chosen.to, chosen.out)
    print(f"file        {path} ({size_of(path) / 1e6:.1f} MB)")
    return 0


def plan(chosen: argparse.Namespace) -> int:
    """lgvi-warp plan."""
    from lgvi_warp.prediction import predict
    from lgvi_warp.scene import Scene

    scene = Scene.load(chosen.scene, overrides(chosen))
    out: Path = chosen.out or Path("runs") / Path(chosen.scene).stem
    store = None
    if chosen.store == "zarr":
        from lgvi_warp.store import Store

        store = Store(out / "run.zarr", chosen.store_dtype)
    print(predict(scene, threads=chosen.threads, store=store))
    return 0


def bench(chosen: argparse.Namespace) -> int:
    """lgvi-warp bench."""
    from lgvi_warp.speed import measure

    for line in measure(chosen.members, chosen.steps):
        print(line, flush=True)
    return 0


VERBS: dict[str, Callable[[argparse.Namespace], int]] = {
    "run": run,
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


if __name__ == "__main__":
    entry()
