# SPDX-License-Identifier: Apache-2.0
"""The verb derivatives."""

from __future__ import annotations

import argparse
from typing import Any

from lgvi_warp.cli.output import Part
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.settings import folder, load_scene
from lgvi_warp.cli.studies import finish
from lgvi_warp.cli.verb import FOLDER, add_shared, as_verb
from lgvi_warp.cli.writing import Written


def derivatives_arguments(verb: Any) -> None:
    """Add the arguments of the verb derivatives."""
    add = verb.add_argument
    add_shared(verb, "scene", scene="scene file (TOML)")
    add("--of", metavar="Q", action="append", required=True, help='what to differentiate: "position[2]", "max(depth)", "itae '
        'depth", "end_time floor" ...; may be given several times')  # fmt: skip
    add("--by", metavar="NAME", action="append", required=True, help="number of the scene, as vehicle.mass or "
        "start.position[2]; may be given several times")  # fmt: skip
    add("--smooth", action="store_true", help="readings of sensors are not rounded to their quantum")
    add("--fleet", action="store_true", help="of each member of [ensemble], in place of the scene alone")
    add_shared(
        verb,
        "--out --method --step --dtype --duration --seed --threads --set",
        out=FOLDER.format("runs/NAME_derivatives"),
        method="integration method, as of run",
        dtype="float64, float32, or float32_compensated",
        seed="seed of members and noise (default: that of the scene)",
    )


@as_verb(
    "derivatives",
    "how what a run gives changes with the numbers of its scene, with errors; derivatives.json and .csv",
    derivatives_arguments,
)
def derivatives(chosen: argparse.Namespace, *, study: Part = None) -> int:
    """Run the verb derivatives: differences of whole runs.

    Returns: The exit code: 1 if a file was not written, otherwise 0.
    """
    from lgvi_warp.scene.ensemble import Ensemble
    from lgvi_warp.uncertainty.derivatives.derivatives import derivatives as differences

    scene = load_scene(chosen)
    out = folder(chosen, "_derivatives")
    fleet = Ensemble.from_scene(scene) if chosen.fleet else scene
    with progress_bar(chosen.quiet) as progress:
        slopes = (study or differences)(
            fleet, chosen.of, chosen.by, smooth=chosen.smooth, threads=chosen.threads, progress=progress
        )
    with progress_bar(chosen.quiet, "writing"):
        written = Written(slopes.save(out))
    return finish(written, chosen, {"derivatives": slopes.to_dict()}, str(slopes))
