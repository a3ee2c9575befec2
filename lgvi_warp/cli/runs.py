# SPDX-License-Identifier: Apache-2.0
"""The verbs run, predict and resume."""

from __future__ import annotations

import argparse
import importlib
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lgvi_warp.cli import documents
from lgvi_warp.cli.output import Part, print_faults, say, tell
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.report import report
from lgvi_warp.cli.settings import RUN, block_range, folder, load_scene, store_settings
from lgvi_warp.cli.signals import Ended
from lgvi_warp.cli.verb import EXECUTOR, FOLDER, OF, SCENE, WORKERS, add_shared, as_verb
from lgvi_warp.common.errors import Interrupted, MembersFailed, MissingExtra, SceneError
from lgvi_warp.common.files import place_of
from lgvi_warp.common.safe_files import inside

# File of a result in memory, and of an interrupted one where that file exists already.
RESULT, PART = "result.npz", "result_part.npz"


def run_arguments(verb: Any) -> None:
    """Add the arguments of the verb run."""
    add_shared(verb, "scene")
    fleet = verb.add_argument_group("scene and fleet")
    add_shared(fleet, "--duration --members --seed --set")
    fleet.add_argument("--start", metavar="DIR", type=Path,
                       help="continue the run in this folder, store or result.npz from its end")  # fmt: skip
    _how(verb.add_argument_group("method, step and precision"))
    _solves(verb.add_argument_group("solvers and checks"))
    files = verb.add_argument_group("files")
    add_shared(files, "--out --keep", out=FOLDER.format("runs/NAME, with the name of the scene file"))
    _stored(files)
    live = verb.add_argument_group("live view")
    live.add_argument("--live", action="store_true",
                      help="show members in the rerun viewer as they finish, and the whole run at its end")  # fmt: skip
    live.add_argument("--viewer", metavar="ADDRESS",
                      help="with --live: address of an open viewer (default: one on this machine, open or new)")  # fmt: skip
    machine = verb.add_argument_group("machine")
    add_shared(machine, EXECUTOR, threads=WORKERS)
    machine.add_argument("--width", metavar="W", type=int, help="vehicles per SIMD packet (default: from the CPU)")
    machine.add_argument("--device", metavar="D", help="device that runs kernels: cpu (default) is the only one")


def _how(group: Any) -> None:
    """Add the options of the method, the step and the precision of a run."""
    add_shared(
        group,
        "--method --step --dtype",
        method="rk4, rk8, rkw3, psi_s, psi_x ...: see `list methods` (default: the scene's, or chosen by its forces)",
        dtype="float64, float32, or float32_compensated, which stores numbers as sums of two float32",
    )
    add = group.add_argument
    add("--error", metavar="E", type=float,
        help="choose the cheapest method, step and precision for this error, and check it after the run")  # fmt: skip
    add("--of", help=f"quantity whose error --error limits (default: position [m]): {OF}")
    add(
        "--rtol",
        metavar="R",
        help="relative error of each step, together with --atol; rk5, rk5_ck and rk8 then choose their steps",
    )
    add("--atol", metavar="A", help="absolute error of each step, together with --rtol")


def _solves(group: Any) -> None:
    """Add the options of the solvers and checks of a run."""
    add = group.add_argument
    add("--solver", help="solver of the implicit rotation, equation (24): quartic, cayley, newton or moser_veselov")
    add("--iterations", metavar="N", help='iterations of every solve: a number, or "auto" (default: to convergence)')
    add("--tolerance", metavar="T", help="relative residual above which a solve has not converged")
    add("--checks", help="none, safe (default: a status for each member) or all (also warnings during the run)")
    add(
        "--on-failure",
        help="if a member fails: freeze (default) stops it, raise ends with exit code 1, substep divides its step",
    )


def _stored(group: Any) -> None:
    """Add the options of a run in a store."""
    add_shared(
        group,
        "--store --store-dtype",
        store="npz (default): write result.npz at the end of the run; zarr: write run.zarr block by block, for resume",
        store_dtype="float32 stores samples of a float64 run in single precision, at half the size",
    )
    group.add_argument("--blocks", metavar="A:B", help="with --store zarr: run only blocks A to B - 1, for the verb merge; "
                       "B may be beyond the last block")  # fmt: skip
    existing = group.add_mutually_exclusive_group()
    add_shared(existing, "--overwrite")
    existing.add_argument("--resume", action="store_true",
                          help="complete an existing run.zarr of the same run")  # fmt: skip


@as_verb("run", "run a scene's ensemble; write result.npz, fleet.png, fleet.rrd and a summary", run_arguments)
def run(
    chosen: argparse.Namespace, *, simulate: Part = None, finish: Callable[..., list[str]] = report,
    viewer: Part = None, live: Part = None, suggest: Part = None, verify: Part = None,
) -> int:  # fmt: skip
    """Run the verb run: simulate a scene's ensemble, write its files and print its summary."""
    begun = time.perf_counter()
    scene = load_scene(chosen)
    store, blocks = store_settings(chosen), block_range(chosen)
    address, out = live_address(scene, chosen, viewer), folder(chosen)
    if store is None:
        place_of(out / RESULT, out)
    else:
        inside(out, RUN)
    warm = import_in_background()
    from lgvi_warp.calls.solve import solve

    start = end_of_run(chosen)
    suggested = suggestion(scene, chosen, suggest)
    settings = suggested.settings if suggested else {}
    failures = []
    with progress_bar(chosen.quiet) as progress:
        try:
            result = (simulate or solve)(
                scene, threads=chosen.threads, width=chosen.width, progress=progress, store=store,
                executor=chosen.executor, scheduler=chosen.scheduler, blocks=blocks,
                on_block=live_view(scene, address, live), start=start, **settings,
            )  # fmt: skip
        except MembersFailed as error:
            result, failures = error.result, [str(error)]
        except Interrupted as error:
            raise Ended(rescued(error.result, out)) from error
    try:
        warm.join()
        checks = check_error(scene, result, suggested, chosen, verify) if suggested else []
        faults = finish(result, out, chosen, begun, failures + checks, address)
    except KeyboardInterrupt as error:
        if str(out / RESULT) in str(error):
            raise  # already saved
        raise Ended(rescued(result, out)) from error
    return 1 if print_faults(faults) or all_failed(result) else 0


def end_of_run(chosen: argparse.Namespace) -> Any:
    """Read the final states of the run in --start; None without --start."""
    if chosen.start is None:
        return None
    if chosen.error is not None:
        raise SceneError([f"--start {chosen.start} does not go with --error, which looks at whole runs. Give the step"])
    from lgvi_warp.results.result import Result
    from lgvi_warp.views.pages.report import run_in

    path = chosen.start
    held = (Result.load(path), path) if path.suffix == ".npz" else run_in(path)
    if held is None:
        raise SceneError([f"--start {path} holds no run. Give a folder that lgvi-warp run wrote"])
    if held[0].end is None:
        raise SceneError([f"--start {path} has no final states. Run it again with the samples of all members"])
    return held[0].final


def live_address(scene: Any, chosen: argparse.Namespace, viewer: Part = None) -> str | None:
    """Find the address of the viewer of --live, before anything runs; None without --live."""
    if not chosen.live:
        if chosen.viewer is not None:
            raise SceneError([f"--viewer {chosen.viewer} has no effect without --live. Add --live"])
        return None
    if not (isinstance(scene.run.keep, str) and scene.run.keep == "all"):
        raise SceneError(["--live shows members as they are done, and the run keeps none. Add --keep all"])
    from lgvi_warp.views.recording.viewer import opened

    try:
        address: str = (viewer or opened)(chosen.viewer)
        return address
    except MissingExtra as error:
        raise SceneError([str(error)]) from None


def live_view(scene: Any, address: str | None, live: Part = None) -> Callable[[Any], None] | None:
    """Open the recording of --live at the address of a viewer; return the function that receives finished members."""
    if address is None:
        return None
    from lgvi_warp.views.recording.live import live as view

    take: Callable[[Any], None] = (live or view)(scene, address).add
    return take


def rescued(result: Any, out: Path) -> str:
    """Save the members that an interrupted run finished, without pictures."""
    if result.store is not None:
        return f"the run is finished: its pictures are made by lgvi-warp resume {result.store.parent}"
    # Keep an existing result of another run.
    path = next(path for path in (out / RESULT, out / PART) if path.name == PART or not path.exists())
    n, total = result.members, result.provenance["ensemble"]["members"]
    finished = f"the run is finished: its {n:,} members are"
    members = f"the first {n:,} of {total:,} members are" if n < total else finished
    try:
        place_of(path, out)
        result.save(path)
    except (OSError, SceneError) as error:
        return f"{members} lost: {path}: {getattr(error, 'strerror', None) or error}"
    return f"{members} saved in {path}" + ("; a run with --store zarr can go on where it stopped" if n < total else "")


def all_failed(result: Any) -> bool:
    """Tell whether every member failed."""
    from lgvi_warp.common.status import failed

    return bool(failed(result.status).all())


def suggestion(scene: Any, chosen: argparse.Namespace, suggest: Part = None) -> Any:
    """Choose method, step and precision for --error, and print them; None without --error."""
    if chosen.error is None:
        if chosen.of is not None:
            raise SceneError([f"--of {chosen.of} has no effect without --error. Add --error 1e-3"])
        return None
    if not (isinstance(scene.run.keep, str) and scene.run.keep == "all") or scene.run.until is not None:
        fault = 'is checked on samples of all members. Give run.keep="all", no run.until'
        raise SceneError([f"--error {chosen.error:g} {fault}"])
    for name in ("step", "dtype"):
        if getattr(chosen, name) is not None:
            text = f"--{name} {getattr(chosen, name)} is what --error chooses"
            raise SceneError([f"{text}. Leave out --{name} or --error"])
    from lgvi_warp.accuracy import suggest as study

    settings = {"methods": [chosen.method] if chosen.method else None, "threads": chosen.threads}
    with progress_bar(chosen.quiet) as progress:
        choose = suggest or study.suggest
        suggested = choose(scene, chosen.error, chosen.of or "position", progress=progress, **settings)
    say(chosen, str(suggested))
    return suggested


def check_error(scene: Any, result: Any, suggested: Any, chosen: argparse.Namespace, verify: Part = None) -> list[str]:
    """Print the error of a run, measured on some members at half its step."""
    from lgvi_warp.accuracy.suggest import verified
    from lgvi_warp.scene.ensemble import Ensemble

    error, members = (verify or verified)(Ensemble.from_scene(scene), result, suggested)
    measured = f"error of {suggested.of} {error:.1e} {suggested.unit}, asked {suggested.error:g}"
    text = f"{measured} ({members} members again at half the step, those with the largest errors among them)"
    if not error <= suggested.error:
        return [f"{text}: missed. Ask for a smaller one"]
    say(chosen, f"checked     {text}")
    return []


def import_in_background(load: Callable[[str], Any] = importlib.import_module) -> threading.Thread:
    """Load the plotting libraries in a thread while kernels run; kernels release the interpreter's lock."""

    def load_all() -> None:
        for name in ("matplotlib.figure", "matplotlib.backends.backend_agg", "rerun", "rerun.blueprint"):
            try:
                load(name)
            except ImportError:
                return  # the view that needs it reports it, with the remedy

    thread = threading.Thread(target=load_all, name="imports", daemon=True)
    thread.start()
    return thread


def resume_arguments(verb: Any) -> None:
    """Add the arguments of the verb resume."""
    add_shared(verb, f"dir {EXECUTOR}", threads=WORKERS)
    verb.add_argument("--force", action="store_true", help="resume even on another machine or with other versions")


@as_verb("resume", "complete an interrupted run, and repair its damaged blocks", resume_arguments)
def resume(chosen: argparse.Namespace, *, simulate: Part = None, finish: Callable[..., list[str]] = report) -> int:
    """Run the verb resume: complete an interrupted stored run, and repair damaged blocks.

    Returns: The exit code: 1 if a file or every member failed, otherwise 0.
    """
    from lgvi_warp.calls.resume import resume as go_on

    begun = time.perf_counter()
    failures = []
    with progress_bar(chosen.quiet) as progress:
        try:
            result = (simulate or go_on)(
                chosen.dir, executor=chosen.executor, threads=chosen.threads, scheduler=chosen.scheduler,
                progress=progress, force=chosen.force,
            )  # fmt: skip
        except MembersFailed as error:
            result, failures = error.result, [str(error)]
    assert result.store is not None
    faults = finish(result, result.store.parent, chosen, begun, failures)
    return 1 if print_faults(faults) or all_failed(result) else 0


def predict_arguments(verb: Any) -> None:
    """Add the arguments of the verb predict."""
    names = f"{SCENE} --method --step --dtype --keep --threads --store --store-dtype"
    add_shared(verb, names, out=FOLDER.format("runs/NAME, with the name of the scene file"))


@as_verb(
    "predict",
    "predict time, memory and disk space of a run, from a short trial on this machine",
    predict_arguments,
    reads=True,
    aliases=("plan",),
)
def predict(chosen: argparse.Namespace, *, study: Part = None) -> int:
    """Run the verb predict: predict time, memory and disk space of a run."""
    from lgvi_warp.calls import predict as prediction

    scene = load_scene(chosen)
    with progress_bar(chosen.quiet, "measuring"):
        predicted = (study or prediction.predict)(scene, threads=chosen.threads, store=store_settings(chosen))
    tell(chosen, lambda: documents.of_prediction(predicted), lambda: str(predicted))
    return 0
