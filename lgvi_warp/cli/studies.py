# SPDX-License-Identifier: Apache-2.0
"""The verbs that study a scene; their options are the arguments of the functions that they call."""

from __future__ import annotations

import argparse
import json
import shlex
from pathlib import Path
from typing import Any

from lgvi_warp.cli.from_function import Form, FunctionOptions, as_study, finish
from lgvi_warp.cli.output import Part, tell
from lgvi_warp.cli.progress import part_of, progress_bar
from lgvi_warp.cli.settings import folder
from lgvi_warp.cli.signals import Ended
from lgvi_warp.cli.verb import FOLDER, add_shared, as_verb, scene_path
from lgvi_warp.cli.writing import Written
from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.common.reading import file_json


def _risk(text: str) -> Any:
    """Parse a risk option: mean, the level of a quantile, or cvar:0.05. Raises ValueError."""
    from lgvi_warp.criteria.risk import CVaR

    kind, _, share = text.partition(":")
    return text if text == "mean" else CVaR(float(share)) if kind == "cvar" else float(text)


def _recipe(path: str) -> Any:
    """Read the recipe in the file of an answer."""
    content = file_json(path)
    return content.get("recipe", content) if isinstance(content, dict) else content


RISK = Form("R", _risk, "is not a risk", "give mean, 0.95, or cvar:0.05")

RECIPE = Form("FILE", _recipe, remedy="give the estimate.json of an answer")


def _unmeasured(answer: Any) -> list[str]:
    """Faults of a trade-off: requested methods without a measurement."""
    return [f"--methods {name} has no measurement: {why}" for name, why in answer.missing.items()]


tradeoff = as_study("tradeoff", "accuracy.tradeoff:tradeoff", shared="--seed --set", picture=True, faults=_unmeasured)
estimate = as_study("estimate", "uncertainty.estimating.estimate:estimate", always=False,
                    forms={"risk": RISK, "recipe": RECIPE})  # fmt: skip
sensitivity = as_study("sensitivity", "uncertainty.sensitivity.analyses:sobol", "uncertainty.sensitivity.analyses:morris",
                       help="rank the varied parameters by Sobol indices, or screen them by Morris' method",
                       picture=True)  # fmt: skip


def _with_bound(chosen: argparse.Namespace, scene: Any, values: dict[str, Any]) -> Any:
    """Refuse a quantity without a bound as --limit: in Python it means "above 0", which a command's user rarely wants."""
    from lgvi_warp.uncertainty.rare.event import condition_of, has_bound

    words = values["limit"].strip()
    condition_of(words, scene)
    if words not in {event.key for event in scene.events} and not has_bound(words):
        raise refusal("--limit", words, "is a quantity without a bound", f'write "{words} above 12.0"')
    return scene


rare = as_study("rare", "uncertainty.rare.rare_event:rare_event", about=_with_bound, picture=True)


def _fleet_option(verb: Any) -> None:
    """Add --fleet."""
    verb.add_argument(
        "--fleet",
        action="store_true",
        help="compute derivatives for each member of [ensemble] (default: for the scene without variation)",
    )


def _fleet(chosen: argparse.Namespace, scene: Any, values: dict[str, Any]) -> Any:
    """The ensemble of the scene with --fleet, otherwise the scene."""
    from lgvi_warp.scene.ensemble import Ensemble

    return Ensemble.from_scene(scene) if chosen.fleet else scene


derivatives = as_study("derivatives", "uncertainty.derivatives.derivatives:derivatives", more=_fleet_option, about=_fleet,
                       shared="--members --set")  # fmt: skip


def _failed(answer: Any) -> list[str]:
    """Faults of margins: members that failed."""
    from lgvi_warp.robustness.linear.loops import FAILED

    failed = answer.reasons.get(FAILED, 0)
    return [f"{failed:,} of {answer.members:,} members failed"] if failed else []


margins = as_study("margins", "robustness.linear.margins:margins", shared="--members --seed --set", picture=True,
                   faults=_failed)  # fmt: skip


def run_again(chosen: argparse.Namespace, table: Path) -> str:
    """Command that runs the member of a table again, with the settings of the arguments."""
    # A path in a scene is relative to its file.
    member = {
        "sampling": f"{{table={{file={json.dumps(str(table.resolve()))}}}}}",
        "vary": "{}",
        "members": "1",
        "seed": "0",
    }
    changes = [*chosen.set, *(f"ensemble.{key}={value}" for key, value in member.items())]
    words = [word for change in changes for word in ("--set", change)]
    for name in ("method", "step", "dtype", "duration"):
        words += [f"--{name}", str(value)] if (value := getattr(chosen, name)) is not None else []
    return shlex.join(["lgvi-warp", "run", str(chosen.scene), *words])


worst_case = as_study(
    "worst-case", "robustness.search.worst_case:worst_case",
    above=lambda chosen, answer, out: f"again       {run_again(chosen, (out or Path()) / 'worst_case.csv')}",
)  # fmt: skip

tune_gains = as_study("tune-gains", "robustness.search.tune:tune_gains", shared="--members --set", forms={"risk": RISK})


def _start(chosen: argparse.Namespace, answer: Any, out: Path | None) -> str:
    """Write the section [start] of a scene file that begins in the steady motion."""
    return "\n".join(["[start]", *(f"{name} = {value}" for name, value in answer.start.to_dict().items()), ""])


trim = as_study("trim", "robustness.linear.trim:trim", always=False, above=_start)

STABILITY = FunctionOptions(("accuracy.stability.map:stability_map",))


def stability_arguments(verb: Any) -> None:
    """Add the arguments of the verb stability."""
    add_shared(verb, "scene --out", out=FOLDER.format("runs/NAME_stability"))
    names = ("omega", "mass", "drag", "all")
    verb.add_argument("--grid", choices=names, help="instead of --x and --y: step against angular velocity, added-mass ratio "
                      "or drag number, or all three maps")  # fmt: skip
    STABILITY.add(verb)


@as_verb("stability", STABILITY.sentence, stability_arguments)
def stability(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
    """Run the verb stability: map where methods are accurate, bounded, flagged or fail.

    Returns: The exit code: 1 if a file failed, otherwise 0. Raises Ended if interrupted after a map was finished.
    """
    if chosen.grid is not None and (chosen.x is not None or chosen.y is not None):
        fault = "names the same axes as --x and --y. Leave out --grid, or both of them"
        raise SceneError([f"--grid {chosen.grid} {fault}"])
    scene, stability_map, values = STABILITY.call_of(chosen)
    out = folder(chosen, "_stability")
    from lgvi_warp import plots
    from lgvi_warp.accuracy.stability.map import GRIDS

    maps: dict[str, dict[str, Any]] = {"stability": {}}
    if chosen.grid:
        names = GRIDS if chosen.grid == "all" else (chosen.grid,)
        maps = {f"stability_{name}": dict(zip("xy", GRIDS[name], strict=True)) for name in names}
    written, regions_by_name = Written(), {}
    with progress_bar(chosen.quiet) as progress:
        for i, (name, axes) in enumerate(maps.items()):
            try:
                part = part_of(progress, i, len(maps)) or False
                regions_by_name[name] = (study or stability_map)(scene, **axes, **values, progress=part)
            except KeyboardInterrupt as error:
                if not written.files:
                    raise
                raise Ended(f"{i} of {len(maps)} maps are finished, in {out}") from error
            written.files += regions_by_name[name].save(out, name)
            written.draw(draw or plots.stability, regions_by_name[name], out / f"{name}.png")
    text = "\n\n".join(map(str, regions_by_name.values()))
    return finish(written, chosen, {name: regions.to_dict() for name, regions in regions_by_name.items()}, text)


SWEEP = FunctionOptions(
    ("robustness.sweeps.sweep:sweep",), "", only=("members", "seed", "threads", "executor", "scheduler")
)


def sweep_arguments(verb: Any) -> None:
    """Add the arguments of the verb sweep."""
    verb.add_argument("scene", metavar="SWEEP", type=scene_path, help="sweep file (TOML), or example:NAME")
    add_shared(
        verb,
        "--out",
        out="folder for the files; cells that are finished in it are not run again (default: runs/NAME_sweep)",
    )
    SWEEP.add(verb)
    verb.add_argument("--plan", action="store_true", help="predict time and memory of the sweep without running it")
    verb.add_argument("--record", metavar="N", type=int, default=0, help="run the N worst members again and record them "
                      "(default 0)")  # fmt: skip


@as_verb("sweep", SWEEP.sentence, sweep_arguments)
def sweep(chosen: argparse.Namespace, *, study: Part = None, drawings: Part = None, plan: Part = None) -> int:
    """Run the verb sweep: run the cases of a closed loop on the same members, and compare them.

    plan: Function of the setup and the threads that returns the text of --plan.
    Returns: The exit code: 1 if all cells or all requested rare failures were refused, or a file failed; else 0.
    """
    from lgvi_warp.robustness.sweeps.file import arguments_of_file
    from lgvi_warp.robustness.sweeps.rare_output import rare_refused
    from lgvi_warp.robustness.sweeps.setup import plan_text, setup_of
    from lgvi_warp.robustness.sweeps.sweep import sweep as run_sweep
    from lgvi_warp.views.plots.sweep_pictures import pictures

    arguments = arguments_of_file(chosen.scene) | SWEEP.values_of(chosen, "sweep")
    if chosen.plan:
        threads = arguments.pop("threads", None)
        known = ("cases", "grid", "vary", "members", "seed", "sampling", "rare")
        about = {name: arguments.pop(name, None) for name in known}
        for name in ("success", "baseline", "confidence", "interval", "matters"):
            arguments.pop(name, None)
        closed_loop = {"scene": arguments.pop("scene"), "metrics": arguments.pop("metrics", ())}
        with progress_bar(chosen.quiet, "measuring"):
            text = (plan or plan_text)(setup_of(**closed_loop, **about, settings=arguments), threads)
        tell(chosen, lambda: {"plan": text.splitlines()}, lambda: text)
        return 0
    out = folder(chosen, "_sweep")
    with progress_bar(chosen.quiet) as progress:
        compared = (study or run_sweep)(**arguments, out=out, progress=progress)
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
    """Run the worst members again, cell by cell, and write a recording of each cell's members."""
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
