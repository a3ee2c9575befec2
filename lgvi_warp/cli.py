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

from lgvi_warp.errors import SceneError

# Command-line option -> key of the scene file that it replaces.
OPTIONS = {
    "method": "run.method",
    "step": "run.step",
    "duration": "run.duration",
    "dtype": "run.dtype",
    "members": "ensemble.members",
    "seed": "ensemble.seed",
}

EPILOG = """examples:
  lgvi-warp run examples/paper.toml --out runs/paper
  lgvi-warp run examples/paper.toml --members 20000 --dtype float32 --set vehicle.mass=120
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
    run.add_argument("scene", metavar="SCENE", help="scene file (TOML)")
    run.add_argument(
        "--out",
        metavar="DIR",
        type=Path,
        help="folder for the files, replaced if they exist (default: runs/NAME of the scene)",
    )
    run.add_argument("--method", help="psi_s, psi_1, psi, phi, phi_adjoint, or a composition such as kl6(psi_s)")
    run.add_argument("--step", metavar="S", help="time step [s]")
    run.add_argument("--duration", metavar="S", help="end of the run [s]")
    run.add_argument("--members", metavar="N", help="number of vehicles")
    run.add_argument("--seed", metavar="N", help="seed of what varies")
    run.add_argument("--dtype", help="float64, float32, or float32_compensated: sums of two float32")
    run.add_argument("--threads", metavar="N", type=int, help="threads (default: all cores)")
    run.add_argument("--width", metavar="W", type=int, help="vehicles per SIMD packet (default: from the CPU)")
    run.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="replace a key of the scene file")
    run.add_argument("--quiet", action="store_true", help="no progress and no summary")
    info = verbs.add_parser("info", help="machine, versions, SIMD width, threads and the core's peak")
    info.set_defaults(scene=None)
    bench = verbs.add_parser("bench", help="speed of the kernel on this machine, beside the core's peak")
    bench.add_argument("--members", type=int, default=4096, help="vehicles (default 4096)")
    bench.add_argument("--steps", type=int, default=1000, help="steps (default 1000)")
    return top


def main(arguments: list[str] | None = None) -> int:
    """Run the command. Returns the exit code: 0, 1 for a run that failed, 2 for a scene or argument that is refused."""
    chosen = parser().parse_args(arguments)
    try:
        return {"run": run, "info": info, "bench": bench}[chosen.verb](chosen)
    except SceneError as error:
        print(f"lgvi-warp: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"lgvi-warp: {error.filename or ''}: {error.strerror or error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("lgvi-warp: interrupted; nothing was written", file=sys.stderr)
        return 130


def overrides(chosen: argparse.Namespace) -> dict[str, Any]:
    """What the command line replaces of the scene file. Raises SceneError for a --set without a value."""
    changes: dict[str, Any] = {}
    for name, key in OPTIONS.items():
        value = getattr(chosen, name)
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

    progress = None if chosen.quiet else Progress(sys.stderr)
    result = solve(scene, threads=chosen.threads, width=chosen.width, progress=progress)
    if progress:
        progress.close()
    warm.join()
    files, faults = write(result, out)
    if not chosen.quiet:
        print(summary(result, files, time.perf_counter() - begun))
    for fault in faults:
        print(f"lgvi-warp: {fault}", file=sys.stderr)
    return 1 if faults or (result.status != 0).all() else 0


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
    """Write result.npz, fleet.png and fleet.rrd side by side. Returns the files, and a text for each that failed."""
    from concurrent.futures import ThreadPoolExecutor

    from lgvi_warp.sinks.plots import plot
    from lgvi_warp.sinks.rerun import log_rerun

    files, faults = [], []
    writers: dict[str, Callable[[Path], Path]] = {
        "result.npz": result.save,
        "fleet.png": lambda path: plot(result, path),
        "fleet.rrd": lambda path: log_rerun(result, path),
    }
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
    from lgvi_warp.status import Status

    settings = result.provenance
    steps = settings["steps"]
    rate = result.members * steps / result.run_seconds
    drift = invariants.drift(result)
    lines = [
        *(f"note        {message}" for message in result.messages),
        f"members     {result.members:,}, {settings['method']['name']}, {settings['dtype']}, "
        f"step {settings['step']:g} s, {steps:,} steps",
        f"speed       {rate:.3g} vehicle-steps per second ({result.run_seconds:.2f} s; kernel loaded in "
        f"{result.compile_seconds:.2f} s; {seconds:.2f} s in all)",
        "status      " + ", ".join(f"{name} {number:,}" for name, number in result.status.counts().items()),
        f"drift       energy {drift['energy']:.2g} J, horizontal momentum {drift['horizontal_momentum']:.2g} N s, "
        f"vertical angular momentum {drift['vertical_angular_momentum']:.2g} N m s (largest of all members)",
    ]
    for code in Status:
        failed = (result.status == code).nonzero()[0]
        if code and len(failed):
            first = int(failed[0])
            lines.append(
                f"  {code.name.lower()}: {code.text} (first: member {first} at {result.failure_time[first]:g} s)"
            )
    lines += [f"file        {path} ({path.stat().st_size / 1e6:.1f} MB)" for path in files]
    return "\n".join(lines)


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
