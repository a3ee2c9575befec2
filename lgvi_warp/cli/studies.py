# SPDX-License-Identifier: Apache-2.0
"""The verbs tradeoff, estimate, sensitivity, stability and sweep."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lgvi_warp.cli import documents
from lgvi_warp.cli.folders import text_of
from lgvi_warp.cli.output import Part, print_faults, tell
from lgvi_warp.cli.progress import part_of, progress_bar
from lgvi_warp.cli.report import file_line
from lgvi_warp.cli.settings import folder, load_scene, whole_number_text
from lgvi_warp.cli.signals import Ended
from lgvi_warp.cli.verb import EXECUTOR, FOLDER, OF, SCENE, WORKERS, add_shared, as_verb
from lgvi_warp.cli.writing import Written
from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.common.reading import file_json


def finish(written: Written, chosen: argparse.Namespace, content: Mapping[str, Any], text: str) -> int:
    """Print a study's report, its files and its notes, and say what failed."""
    tell(
        chosen,
        lambda: {"content": content} | documents.of_files(written),
        lambda: "\n".join([text, "", *written.note_lines(), *map(file_line, written.files)]),
    )
    print_faults(written.empty)
    return 1 if print_faults(written.faults) else 0


def tradeoff_arguments(verb: Any) -> None:
    """Add the arguments of the verb tradeoff."""
    add_shared(verb, SCENE, out=FOLDER.format("runs/NAME_tradeoff"))
    add_shared(verb, "--methods", methods="names, such as psi_s,kl8(psi_x) (default: all that fit)")
    verb.add_argument("--of", default="position", help=f"what errors are of (default: position); {OF}")
    verb.add_argument("--seconds", metavar="S", type=float, default=45.0, help="processor time to measure (default 45)")


@as_verb(
    "tradeoff",
    "speed against accuracy of every method, step and precision: tradeoff.json, .csv and .png",
    tradeoff_arguments,
)
def tradeoff(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
    """Run the verb tradeoff: measure speed against accuracy of methods, steps and precisions.

    Returns: The exit code: 1 if a file failed or a method of --methods has no measurement, otherwise 0.
    """
    scene = load_scene(chosen)
    out = folder(chosen, "_tradeoff")
    from lgvi_warp import plots
    from lgvi_warp.accuracy.tradeoff import tradeoff as measure

    settings = {"of": chosen.of, "methods": chosen.methods, "seconds": chosen.seconds}
    with progress_bar(chosen.quiet) as progress:
        measurements = (study or measure)(scene, progress=progress, **settings)
    with progress_bar(chosen.quiet, "writing"):
        written = Written(measurements.save(out))
        written.draw(draw or plots.tradeoff, measurements, out / "tradeoff.png")
    code = finish(written, chosen, {"tradeoff": measurements.to_dict()}, text_of("tradeoff", measurements))
    missing = [f"--methods {name}: has no measurement: {why}" for name, why in measurements.missing.items()]
    return 1 if print_faults(missing) else code


def estimate_arguments(verb: Any) -> None:
    """Add the arguments of the verb estimate."""
    add = verb.add_argument
    add_shared(verb, "scene", scene="scene file (TOML) with [ensemble.vary]")
    add("--of", metavar="Q", required=True, help='what to estimate: "mean position[0]", "depth above 3", "outcome floor", '
        '"max(depth)", "itae depth" ...')  # fmt: skip
    add("--error", metavar="E", type=float, help="root mean square error asked for, in its unit")
    add("--relative-error", metavar="E", type=float, help="the same as a fraction of the statistic")
    add("--risk", metavar="R", help="a quantile's level, such as 0.95, or cvar:0.05 for the mean of the worst 5 %%, in "
        "place of the mean")  # fmt: skip
    add("--cheaper", metavar="KEY=VALUE", action="append", default=[], help="a number whose scene costs less and behaves "
        "alike, as controller.delay=0.0; may be given several times")  # fmt: skip
    add("--heavy-tail", action="store_true", help="tell a mean all the same whose variance seems to be infinite")
    add("--recipe", metavar="FILE", help="run the members of an answer again: its estimate.json")
    add(
        "--store",
        metavar="DIR",
        help="folder for the results of runs, with which the same command goes on after an interrupt",
    )
    add_shared(verb, "--out --duration --method --step --dtype --seed --threads --set", method="fixes the method",
               step="fixes the step [s]", dtype="fixes the precision", seed="seed of points and noise",
               out="folder for estimate.json, .csv and .txt, replaced if they exist (default: none is written)")  # fmt: skip


@as_verb(
    "estimate",
    "a mean, probability or quantile at the error asked for, for the least work",
    estimate_arguments,
    reads=True,
)
def estimate(chosen: argparse.Namespace, *, study: Part = None) -> int:
    """Run the verb estimate: a statistic at an error, for the least work.

    Returns: The exit code, 0.
    """
    recipe = None
    if chosen.recipe is not None:
        content = file_json(chosen.recipe)
        recipe = content.get("recipe", content) if isinstance(content, dict) else content
    risk, cheaper = _risk(chosen.risk), [_number_of(text) for text in chosen.cheaper]
    scene = load_scene(chosen)
    from lgvi_warp.uncertainty.estimating.estimate import estimate as answer

    # load_scene puts step, method and dtype into the scene: what is asked for by name is fixed.
    fixed: dict[str, Any] = {"method": scene.run.method if chosen.method is not None else None,
             "h": scene.run.step if chosen.step is not None else None,
             "dtype": scene.run.dtype if chosen.dtype is not None else None}  # fmt: skip
    with progress_bar(chosen.quiet) as progress:
        found = (study or answer)(
            scene, chosen.of, chosen.error, relative_error=chosen.relative_error, risk=risk, cheaper=cheaper,
            threads=chosen.threads, progress=progress, recipe=recipe, heavy_tail=chosen.heavy_tail,
            store=chosen.store, **fixed,
        )  # fmt: skip
    if chosen.out is not None:
        return finish(Written(found.save(folder(chosen))), chosen, {"estimate": found.to_dict()}, str(found))
    tell(chosen, found.to_dict, lambda: str(found))
    return 0


def _risk(text: str | None) -> Any:
    """A risk as the command has it. Raises SceneError."""
    if text is None or text == "mean":
        return "mean"
    from lgvi_warp.criteria.risk import CVaR

    kind, _, share = text.partition(":")
    try:
        return CVaR(float(share)) if kind == "cvar" else float(text)
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
        raise refusal("--risk", text, "is no risk", "give 0.95 or cvar:0.05") from error


def _number_of(text: str) -> dict[str, float]:
    """A number of a scene as the command has it: NAME=VALUE. Raises SceneError."""
    name, _, value = text.partition("=")
    try:
        return {name: float(value)}
    except ValueError as error:
        raise refusal("--cheaper", text, "is no number of a scene", 'give "controller.delay=0.0"') from error


def sensitivity_arguments(verb: Any) -> None:
    """Add the arguments of the verb sensitivity."""
    add = verb.add_argument
    add_shared(verb, "scene", scene="scene file (TOML) with [ensemble.vary]")
    add("--of", metavar="Q", action="append", help='quantity of interest: "position[2]" (the default), depth, speed, '
        '"norm(velocity)", "max(energy)" ...; may be given several times')  # fmt: skip
    add_shared(verb, "--out", out="folder for the files (default: runs/NAME_sensitivity)")
    add("--analysis", choices=("sobol", "morris"), default="sobol", help="default sobol")
    add("--samples", metavar="N", type=int, help="groups of the design (default: sobol 256, morris 64)")
    add("--first-order", action="store_true", help="sobol without pairs of factors: about half the members")
    add("--replicates", metavar="R", type=int, default=8, help="sobol: independent sequences, whose spread gives the "
        "intervals (default 8)")  # fmt: skip
    add("--group", metavar="NAME=FACTORS", action="append", default=[], help="sobol: factors to take for one, as "
        '"start=start.position,start.velocity"; may be given several times')  # fmt: skip
    add("--failed", choices=("refuse", "drop"), default="refuse",
        help="what to do about groups with a failed member (default refuse)")  # fmt: skip
    add_shared(
        verb,
        "--method --step --dtype --duration --seed --threads --set",
        method="integration method, as of run",
        dtype="float64, float32, or float32_compensated",
        seed="seed of the design",
    )


@as_verb(
    "sensitivity",
    "which of the varied parameters matter: Sobol indices or Morris screening; .txt, .csv, .json, .png",
    sensitivity_arguments,
)
def sensitivity(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
    """Run the verb sensitivity: find which of the varied parameters matter.

    Returns: The exit code: 1 if members, a file or a library failed, otherwise 0.
    """
    from lgvi_warp import plots, uq

    scene = load_scene(chosen)
    out = folder(chosen, "_sensitivity")
    samples = {"sobol": 256, "morris": 64}[chosen.analysis] if chosen.samples is None else chosen.samples
    options: dict[str, Any] = {}
    if chosen.analysis == "sobol":
        options = {"second_order": not chosen.first_order, "replicates": chosen.replicates}
        options["groups"] = _groups(chosen.group)
    try:
        with progress_bar(chosen.quiet) as progress:
            indices: uq.Indices = (study or getattr(uq, chosen.analysis))(
                scene, chosen.of or ["position[2]"], samples=samples, failed=chosen.failed, threads=chosen.threads,
                progress=progress, **options,
            )  # fmt: skip
    except uq.FailedMembers as error:
        return len(print_faults([str(error)]))
    with progress_bar(chosen.quiet, "writing"):
        written = Written(indices.save(out))
        written.draw(draw or plots.sensitivity, indices, out / "sensitivity.png")
    return finish(written, chosen, {"sensitivity": indices.to_dict()}, str(indices))


def _groups(texts: Sequence[str]) -> dict[str, list[str]]:
    """Groups of factors as the command has them: "NAME=FACTOR,FACTOR". Raises SceneError."""
    groups = {}
    for text in texts:
        name, _, members = text.partition("=")
        if not name or not members:
            raise refusal("--group", text, "names no factors", 'give "start=start.position,start.velocity"')
        groups[name] = members.split(",")
    return groups


def stability_arguments(verb: Any) -> None:
    """Add the arguments of the verb stability."""
    add = verb.add_argument
    add_shared(verb, "scene --out --duration --seed --set", out=FOLDER.format("runs/NAME_stability"))
    add(
        "--grid",
        choices=("omega", "mass", "drag", "all"),
        help="step against angular velocity (default), added-mass ratio or drag number, or all three",
    )
    axis = "NAME or NAME=LOW:HIGH[:linear], such as"
    add("--x", metavar="AXIS", help=f"instead of --grid: {axis} h=0.01:3")
    add("--y", metavar="AXIS", help=f"instead of --grid: {axis} angular_velocity, vehicle.mass=50:500")
    add_shared(verb, "--methods", methods="names, such as psi_s,kl8(psi_x) (default: psi,psi_s,psi_x,rk4)")
    add("--points", metavar="N", type=int, default=24, help="cells along each axis (default 24)")
    add("--error", metavar="E", type=float, default=1e-2, help="an accurate cell's bound (default 0.01)")
    add("--of", default="attitude", help=f"what --error is of (default: attitude); {OF}")


@as_verb(
    "stability",
    "where methods are accurate, bounded, flagged or fail, over two parameters: .json, .csv and .png",
    stability_arguments,
)
def stability(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
    """Run the verb stability: map where methods are accurate, bounded, flagged or fail.

    Returns: The exit code: 1 if a file failed, otherwise 0. Raises Ended: interrupted after a map was finished.
    """
    if chosen.grid is not None and (chosen.x is not None or chosen.y is not None):
        fault = "names the same axes as --x and --y; leave out --grid, or both of them"
        raise SceneError([f"--grid {chosen.grid}: {fault}"])
    scene = load_scene(chosen)
    # Seed of the random directions, the only setting of the scene's ensemble that is used here.
    seed = scene.ensemble_settings.seed if scene.ensemble_settings else 0
    out = folder(chosen, "_stability")
    from lgvi_warp import plots
    from lgvi_warp.accuracy.stability.map import GRIDS, stability_map

    maps = {"stability": (chosen.x or "h", chosen.y or "angular_velocity")}
    if chosen.grid:
        names = GRIDS if chosen.grid == "all" else (chosen.grid,)
        maps = {f"stability_{name}": GRIDS[name] for name in names}
    t1 = scene.run.duration if chosen.duration is not None else None
    written, regions_by_name = Written(), {}
    with progress_bar(chosen.quiet) as progress:
        for i, (name, (x, y)) in enumerate(maps.items()):
            try:
                regions_by_name[name] = (study or stability_map)(
                    scene, x, y, chosen.methods, points=chosen.points, t1=t1, error=chosen.error, of=chosen.of, seed=seed,
                    progress=part_of(progress, i, len(maps)),
                )  # fmt: skip
            except KeyboardInterrupt as error:
                if not written.files:
                    raise
                raise Ended(f"{i} of {len(maps)} maps are finished, in {out}") from error
            written.files += regions_by_name[name].save(out, name)
            written.draw(draw or plots.stability, regions_by_name[name], out / f"{name}.png")
    text = "\n\n".join(text_of("stability", regions) for regions in regions_by_name.values())
    return finish(written, chosen, {name: regions.to_dict() for name, regions in regions_by_name.items()}, text)


def sweep_arguments(verb: Any) -> None:
    """Add the arguments of the verb sweep."""
    add = verb.add_argument
    add("scene", metavar="SWEEP", help="sweep file (TOML)")
    add_shared(
        verb, "--out", out="folder for the files; what is finished there is not run again (default: runs/NAME_sweep)"
    )
    add("--plan", action="store_true", help="say what the sweep would take, and run nothing")
    add("--record", metavar="N", type=int, default=0, help="run the N worst members again into recordings (default 0)")
    add_shared(verb, "--members --seed")
    add_shared(verb, EXECUTOR, threads=WORKERS)


@as_verb(
    "sweep",
    "cases of a controller on the same members: what holds, which is better, the worst members; tables, pictures",
    sweep_arguments,
)
def sweep(chosen: argparse.Namespace, *, study: Part = None, drawings: Part = None, plan: Part = None) -> int:
    """Run the verb sweep: cases of a closed loop on the same members, what holds and which is better.

    plan: From the setup and the threads to the text of --plan.
    Returns: The exit code: 1 if all cells were refused, or all rare failures that were asked for, or a file failed, else 0.
    """
    from lgvi_warp.robustness.sweeps.file import arguments_of_file
    from lgvi_warp.robustness.sweeps.rare_output import rare_refused
    from lgvi_warp.robustness.sweeps.setup import plan_text, setup_of
    from lgvi_warp.robustness.sweeps.sweep import sweep as run_sweep
    from lgvi_warp.views.plots.sweep_pictures import pictures

    arguments = arguments_of_file(chosen.scene)
    for name in ("members", "seed"):
        text = getattr(chosen, name)
        if text is not None:
            digits = whole_number_text(text)
            arguments[name] = int(digits) if digits.lstrip("+-").isdigit() else text
    if chosen.plan:
        known = ("cases", "grid", "vary", "members", "seed", "sampling", "rare")
        about = {name: arguments.pop(name, None) for name in known}
        for name in ("success", "baseline", "confidence", "interval", "matters"):
            arguments.pop(name, None)
        closed_loop = {"scene": arguments.pop("scene"), "metrics": arguments.pop("metrics", ())}
        with progress_bar(chosen.quiet, "measuring"):
            text = (plan or plan_text)(setup_of(**closed_loop, **about, settings=arguments), chosen.threads)
        tell(chosen, lambda: {"plan": text.splitlines()}, lambda: text)
        return 0
    out = folder(chosen, "_sweep")
    executor = {"threads": chosen.threads, "executor": chosen.executor, "scheduler": chosen.scheduler}
    with progress_bar(chosen.quiet) as progress:
        compared = (study or run_sweep)(**arguments, **executor, out=out, progress=progress)
    with progress_bar(chosen.quiet, "writing"):
        written = Written(compared.save(out))
        for name, draw in (drawings or pictures)(compared).items():
            written.draw(draw, compared, out / name)
        if chosen.record:
            record_worst(compared, chosen.record, out, written)
    code = finish(written, chosen, {"sweep": file_json(out / "sweep.json")}, str(compared))
    nothing = all(compared.record(cell).refused for cell in compared.cells)
    return 1 if nothing or rare_refused(compared) else code


def record_worst(compared: Any, count: int, out: Path, written: Written, *, log: Part = None) -> None:
    """Run the worst members again, those of each cell together, and write a recording of them."""
    from lgvi_warp.views.recording.rerun import record

    write = log or record
    members: dict[int, list[int]] = {}
    for row in compared.worst(count):
        at = {name: row[name] for name in compared.setup.axes}
        members.setdefault(compared.cell(row["case"], at).index, []).append(row["member"])
    for index, chosen in members.items():
        cell = compared.cells[index]
        path = out / f"worst_{index:04d}.rrd"
        result = compared.again(cell.case.name, sorted(chosen), cell.point)
        written.draw(lambda result, path: write(result, path) or path, result, path)
