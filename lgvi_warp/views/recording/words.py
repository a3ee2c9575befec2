# SPDX-License-Identifier: Apache-2.0
"""The texts of a recording: a summary of ten lines, and the provenance."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from lgvi_warp.common import summaries
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.views.choice import of_members
from lgvi_warp.views.drawn import Drawn
from lgvi_warp.views.recording.hull import shape_of
from lgvi_warp.views.recording.world import WorldBox, chosen_member, floors_of, reliefs_of

# Versions that are among the ten lines, which have room for few words; the provenance has all.
TOLD = ("lgvi-warp", "warp-lang", "rerun")


def log_words(recording: Any, runs: list[Drawn], box: WorldBox, scales: list[int]) -> None:
    """Log the summary of the runs, and their provenance."""
    import rerun as rr

    for run, scale in zip(runs, scales, strict=True):
        provenance = f"```json\n{json.dumps(run.result.provenance, indent=2)}\n```"
        rows = [f"| {key} | {text} |" for key, text in lines(run, box, scale).items()]
        texts = {"summary": "\n".join(["| | |", "|---|---|", *rows]), "provenance": provenance}
        for name, text in texts.items():
            document = rr.TextDocument(text, media_type="text/markdown")
            recording.log(run.path(f"run/{name}"), document, static=True, strict=True)


def lines(run: Drawn, box: WorldBox, scale: int) -> dict[str, str]:
    """Describe a run in ten lines: what it is, how its members ended, and what is drawn."""
    import rerun as rr

    result, settings = run.result, run.result.provenance
    counts = ", ".join(f"{name} {number:,}" for name, number in result.status.counts().items())
    few = len(run.choice.members) < result.members
    drawn = f"{len(run.choice.members):,} of {result.members:,} drawn" if few else f"{result.members:,}, all drawn"
    single = run.source.members == 1
    if run.source is not result:
        bands = f", curves of the {run.source.members:,} whose samples were kept"
    elif len(run.choice.ranked) < result.members:
        bands = f", quantiles of {of_members(len(run.choice.ranked), result.members)}"
    else:
        bands = ", all in the curves"
    versions = settings.get("versions", {}) | {"rerun": rr.__version__}
    method = settings["method"]["name"]
    times = f"{run.time[0]:g} to {run.time[-1]:g} s, {len(run.time)} of {len(result.time)} samples drawn"
    if len(result.time) < 3:
        times += "; for the motion between them give SaveAt(every=...), or save_every in [run]"
    _, source = shape_of(settings["scene"], run.few.parameters)
    size = f"{source}, drawn " + (f"{scale} times their size" if scale > 1 else "at their size")
    member = int(run.members[chosen_member(run)])
    seed = settings.get("ensemble", {}).get("seed", "none")
    return {
        "members": drawn + ("" if single else bands),
        "outcome": counts,
        "method": f"{method}, step {settings['step']:g} s, {settings['dtype']}",
        "time": times,
        "seed": f"{seed}",
        "water": water_text(run, box),
        "energy": energy_text(run),
        "hulls": size,
        "arrows": f"forces on member {member}" + ("" if single else "; ellipsoid: 95 % of those under way"),
        "versions": ", ".join(f"{name} {versions[name]}" for name in TOLD if name in versions),
    }


def water_text(run: Drawn, box: WorldBox) -> str:
    """Say where the water ends, and whether members leave it."""
    kinds = {event["type"] for event in run.result.provenance["scene"].get("events", ())}
    floors = [f"{depth:g}" for depth in floors_of(run)]
    reliefs = [relief.depth for relief in reliefs_of(run, box.low, box.high)]
    floors += [f"{depth.min():.3g} to {depth.max():.3g}" for depth in reliefs]
    floor = f"floor at {' and '.join(floors)} m" if floors else "no floor"
    grid = f"grid of {box.grid:g} m"
    if "surface" in kinds:
        return f"surface and {floor}; {grid}"
    if not run.above:
        return f"no event at the surface, {floor}; {grid}"
    many = of_members(run.above, run.source.members)
    return f"unbounded water: {many} pass{'es' * (run.source.members == 1)} above depth 0"


def energy_text(run: Drawn) -> str:
    """Say how well energy is conserved, or which forces do work."""
    few = run.few
    if not set(FIELDS) <= set(few.samples):
        return "not known: not all of the motion was kept"
    drift = invariants.drift(few)["energy"]
    if np.isnan(drift):
        return "not known: every member drawn failed"
    if "energy" in invariants.conserved(few):
        return f"drift {drift:.2g} J, the largest of the members drawn"
    return f"not conserved: {summaries.listed(invariants.at_work(few), most=2)} do work"
