# SPDX-License-Identifier: Apache-2.0
"""The verbs tradeoff, sensitivity, stability and sweep."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lgvi_warp.cli import documents
from lgvi_warp.cli.folders import text_of
from lgvi_warp.cli.output import Part, print_faults, tell
from lgvi_warp.cli.progress import part_of, shown
from lgvi_warp.cli.report import file_line
from lgvi_warp.cli.settings import folder, load_scene, whole
from lgvi_warp.cli.signals import Ended
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


def tradeoff(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
    """Run the verb tradeoff: measure speed against accuracy of methods, steps and precisions.

    Returns: The exit code: 1 if a file failed or a method of --methods has no measurement, otherwise 0.
    """
    scene = load_scene(chosen)
    out = folder(chosen, "_tradeoff")
    from lgvi_warp.studies.tradeoff import tradeoff as measure
    from lgvi_warp.views.plots import plot_tradeoff

    with shown(chosen.quiet) as progress:
        measurements = (study or measure)(
            scene, of=chosen.of, methods=chosen.methods, seconds=chosen.seconds, progress=progress
        )
    with shown(chosen.quiet, "writing"):
        written = Written(measurements.save(out))
        written.draw(draw or plot_tradeoff, measurements, out / "tradeoff.png")
    code = finish(written, chosen, {"tradeoff": measurements.to_dict()}, text_of("tradeoff", measurements))
    missing = [f"--methods {name}: has no measurement: {why}" for name, why in measurements.missing.items()]
    return 1 if print_faults(missing) else code


def sensitivity(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
    """Run the verb sensitivity: find which of the varied parameters matter.

    Returns: The exit code: 1 if members, a file or a library failed, otherwise 0.
    """
    from lgvi_warp.studies import sensitivity as uq
    from lgvi_warp.views.plots import plot_sensitivity

    scene = load_scene(chosen)
    out = folder(chosen, "_sensitivity")
    samples = {"sobol": 256, "morris": 64}[chosen.analysis] if chosen.samples is None else chosen.samples
    options: dict[str, Any] = {}
    if chosen.analysis == "sobol":
        options = {
            "second_order": not chosen.first_order,
            "replicates": chosen.replicates,
            "groups": _groups(chosen.group),
        }
    try:
        with shown(chosen.quiet) as progress:
            indices: uq.Indices = (study or getattr(uq, chosen.analysis))(
                scene, chosen.of or ["position[2]"], samples=samples, failed=chosen.failed, threads=chosen.threads,
                progress=progress, **options,
            )  # fmt: skip
    except uq.FailedMembers as error:
        return len(print_faults([str(error)]))
    with shown(chosen.quiet, "writing"):
        written = Written(indices.save(out))
        written.draw(draw or plot_sensitivity, indices, out / "sensitivity.png")
    return finish(written, chosen, {"sensitivity": indices.to_dict()}, str(indices))


def _groups(given: Sequence[str]) -> dict[str, list[str]]:
    """Groups of factors as the command has them: "NAME=FACTOR,FACTOR". Raises SceneError."""
    groups = {}
    for text in given:
        name, _, members = text.partition("=")
        if not name or not members:
            raise refusal("--group", text, "names no factors", 'give "start=start.position,start.velocity"')
        groups[name] = members.split(",")
    return groups


def stability(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
    """Run the verb stability: map where methods are accurate, bounded, flagged or fail.

    Returns: The exit code: 1 if a file failed, otherwise 0. Raises Ended: interrupted after a map was finished.
    """
    if chosen.grid is not None and (chosen.x is not None or chosen.y is not None):
        raise SceneError(
            [f"--grid {chosen.grid}: names the same axes as --x and --y; leave out --grid, or both of them"]
        )
    scene = load_scene(chosen)
    # Seed of the random directions, the only setting of the scene's ensemble that is used here.
    seed = scene.ensemble_settings.seed if scene.ensemble_settings else 0
    out = folder(chosen, "_stability")
    from lgvi_warp.studies.stability.map import GRIDS, stability_map
    from lgvi_warp.views.plots import plot_stability

    maps = {"stability": (chosen.x or "h", chosen.y or "angular_velocity")}
    if chosen.grid:
        names = GRIDS if chosen.grid == "all" else (chosen.grid,)
        maps = {f"stability_{name}": GRIDS[name] for name in names}
    t1 = scene.run.duration if chosen.duration is not None else None
    written, regions_by_name = Written(), {}
    with shown(chosen.quiet) as progress:
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
            written.draw(draw or plot_stability, regions_by_name[name], out / f"{name}.png")
    text = "\n\n".join(text_of("stability", regions) for regions in regions_by_name.values())
    return finish(written, chosen, {name: regions.to_dict() for name, regions in regions_by_name.items()}, text)


def sweep(chosen: argparse.Namespace, *, study: Part = None, drawings: Part = None, plan: Part = None) -> int:
    """Run the verb sweep: cases of a closed loop on the same members, what holds and which is better.

    plan: From the setup and the threads to the text of --plan.
    Returns: The exit code: 1 if all cells were refused or a file failed, otherwise 0.
    """
    from lgvi_warp.studies.sweeps.file import arguments_of_file
    from lgvi_warp.studies.sweeps.setup import made, plan_text
    from lgvi_warp.studies.sweeps.sweep import sweep as run_sweep
    from lgvi_warp.views.plots.sweep_pictures import pictures

    arguments = arguments_of_file(chosen.scene)
    for name in ("members", "seed"):
        text = getattr(chosen, name)
        if text is not None:
            digits = whole(text)
            arguments[name] = int(digits) if digits.lstrip("+-").isdigit() else text
    if chosen.plan:
        about = {name: arguments.pop(name, None) for name in ("cases", "grid", "vary", "members", "seed", "sampling")}
        for name in ("success", "baseline", "confidence", "interval"):
            arguments.pop(name, None)
        closed_loop = {"scene": arguments.pop("scene"), "metrics": arguments.pop("metrics", ())}
        with shown(chosen.quiet, "measuring"):
            text = (plan or plan_text)(made(**closed_loop, **about, settings=arguments), chosen.threads)
        tell(chosen, lambda: {"plan": text.splitlines()}, lambda: text)
        return 0
    out = folder(chosen, "_sweep")
    executor = {"threads": chosen.threads, "executor": chosen.executor, "scheduler": chosen.scheduler}
    with shown(chosen.quiet) as progress:
        compared = (study or run_sweep)(**arguments, **executor, out=out, progress=progress)
    with shown(chosen.quiet, "writing"):
        written = Written(compared.save(out))
        for name, draw in (drawings or pictures)(compared).items():
            written.draw(draw, compared, out / name)
        if chosen.record:
            record_worst(compared, chosen.record, out, written)
    code = finish(written, chosen, {"sweep": file_json(out / "sweep.json")}, str(compared))
    return 1 if all(compared.record(cell).refused for cell in compared.cells) else code


def record_worst(found: Any, count: int, out: Path, written: Written, *, log: Part = None) -> None:
    """Run the worst members again, those of each cell together, and write a recording of them."""
    from lgvi_warp.views.recording.rerun import log_rerun

    write = log or log_rerun
    members: dict[int, list[int]] = {}
    for row in found.worst(count):
        at = {name: row[name] for name in found.setup.axes}
        members.setdefault(found.cell(row["case"], at).index, []).append(row["member"])
    for index, chosen in members.items():
        cell = found.cells[index]
        path = out / f"worst_{index:04d}.rrd"
        result = found.again(cell.case.name, sorted(chosen), cell.point)
        written.draw(lambda result, path: write(result, path) or path, result, path)
