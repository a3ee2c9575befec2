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
    run.add_argument("--threads", metavar="N", type=int, help="threads (default: all cores)")
    run.add_argument("--width", metavar="W", type=int, help="vehicles per SIMD packet (default: from the CPU)")
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
    info = verbs.add_parser("info", help="machine, versions, SIMD width, threads and the core's peak")
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
        verbs = {"run": run, "tradeoff": tradeoff, "sensitivity": sensitivity, "stability": stability}
        return (verbs | {"info": info, "bench": bench})[chosen.verb](chosen)
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
        print("lgvi-warp: interrupted; nothing was written", file=sys.stderr)
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
    out.mkdir(parents=True, exist_ok=True)
    warm = _import_in_background()
    from lgvi_warp.solving import solve

    suggested = suggestion(scene, chosen)
    progress = None if chosen.quiet else Progress(sys.stderr)
    settings = suggested.settings if suggested else {}
    failures = []
    try:
        result = solve(scene, threads=chosen.threads, width=chosen.width, progress=progress, **settings)
    except MembersFailed as error:
        result, failures = error.result, [str(error)]
    if progress:
        progress.close()
    warm.join()
    files, faults = write(result, out)
    faults += failures
    if not chosen.quiet:
        print(summary(result, files, time.perf_counter() - begun))
    if suggested:
        faults += check_error(scene, result, suggested, chosen.quiet)
    for fault in faults:
        print(f"lgvi-warp: {fault}", file=sys.stderr)
    return 1 if faults or (result.status != 0).all() else 0


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


def write(result: Any, out: Path) -> tuple[list[Path], list[str]]:
    """Write result.npz, fleet.png, fleet.rrd and statistics.png side by side: what there is of them.

    Returns the files, and a text for each that failed.
    """
    from concurrent.futures import ThreadPoolExecutor

    from lgvi_warp.sinks.plots import drawable, plot, plot_statistics
    from lgvi_warp.sinks.rerun import log_rerun

    files, faults = [], []
    writers: dict[str, Callable[[Path], Path]] = {"result.npz": result.save}
    shown = result if result.samples else result.kept
    if shown is not None:
        writers |= {"fleet.png": lambda path: plot(shown, path), "fleet.rrd": lambda path: log_rerun(shown, path)}
    if drawable(result):
        writers["statistics.png"] = lambda path: plot_statistics(result, path)
    with ThreadPoolExecutor(len(writers)) as pool:
        jobs = {out / name: pool.submit(writer, out / name) for name, writer in writers.items()}
    for path, job in jobs.items():
        try:
            files.append(job.result())
        except (OSError, ImportError, ValueError) as error:
            faults.append(f"{path} was not written: {error}")
    return files, faults


def summary(result: Any, files: list[Path], seconds: float) -> str:
    """The run in a few lines."""
    from lgvi_warp import invariants
    from lgvi_warp.statistics.table import table
    from lgvi_warp.status import Status

    settings = result.provenance
    steps = settings["steps"]
    rate = result.members * steps / result.run_seconds
    lines = [
        *(f"note        {message}" for message in result.messages),
        f"members     {result.members:,}, {settings['method']['name']}, {settings['dtype']}, "
        f"step {settings['step']:g} s, {steps:,} steps",
        f"speed       {rate:.3g} vehicle-steps per second ({result.run_seconds:.2f} s; kernel loaded in "
        f"{result.compile_seconds:.2f} s; {seconds:.2f} s in all)",
        "status      " + ", ".join(f"{name} {number:,}" for name, number in result.status.counts().items()),
    ]
    if result.samples:
        drift = invariants.drift(result)
        lines.append(
            f"drift       energy {drift['energy']:.2g} J, horizontal momentum {drift['horizontal_momentum']:.2g} N s, "
            f"vertical angular momentum {drift['vertical_angular_momentum']:.2g} N m s (largest of all members)"
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
    lines += [f"file        {path} ({path.stat().st_size / 1e6:.1f} MB)" for path in files]
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


def bench(chosen: argparse.Namespace) -> int:
    """lgvi-warp bench."""
    from lgvi_warp.speed import measure

    for line in measure(chosen.members, chosen.steps):
        print(line, flush=True)
    return 0


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
