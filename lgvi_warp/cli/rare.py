# SPDX-License-Identifier: Apache-2.0
"""The verb rare."""

from __future__ import annotations

import argparse
import inspect
from typing import Any

from lgvi_warp.cli.output import Part
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.settings import folder, load_scene
from lgvi_warp.cli.studies import finish
from lgvi_warp.cli.verb import FOLDER, add_shared, as_verb
from lgvi_warp.cli.writing import Written
from lgvi_warp.common.errors import refusal


def rare_arguments(verb: Any) -> None:
    """Add the arguments of the verb rare."""
    add = verb.add_argument
    add_shared(verb, "scene", scene="scene file (TOML) with [ensemble.vary] or noise")
    add("--when", metavar="EVENT", required=True, help='the event: "peak depth above 12", "max(position[2]) above 40", or '
        "the name of an event of the scene")  # fmt: skip
    add("--error", metavar="E", type=float, default=0.1, help="standard deviation of the probability's error, as a part of "
        "it (default 0.1)")  # fmt: skip
    add("--by", choices=("chains", "splitting"), default="chains", help="chains of members, or splitting in time, for a scene "
        "with noise (default chains)")  # fmt: skip
    add(
        "--looks",
        metavar="N",
        type=int,
        default=50,
        help="with splitting, into how many pieces the time is cut (default 50)",
    )
    add("--cheaper", metavar="A=X,B=Y", action="append", default=[], help="what differs in a setting that chains may use "
        "first, as h=0.1,dtype=float32,controller.delay=0; may be given several times")  # fmt: skip
    add("--failed", choices=("event", "refuse"), default="event", help="what a member that fails is (default event)")
    add("--most", metavar="N", type=int, default=1_000_000, help="members that may be run (default 1000000)")
    add(
        "--store",
        metavar="DIR",
        help="folder for the results of runs, with which the same command goes on after an interrupt",
    )
    add_shared(
        verb,
        "--out --method --step --dtype --duration --seed --threads --set",
        out=FOLDER.format("runs/NAME_rare"),
        method="integration method, as of run",
        dtype="float64, float32, or float32_compensated",
        seed="seed of all that is drawn (default: that of the scene)",
    )


@as_verb(
    "rare",
    "the probability of an event that plain sampling would hardly see, and the members that meet it; rare.json, .csv, .png",
    rare_arguments,
)
def rare(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
    """Run the verb rare: estimate a small probability.

    Returns: The exit code: 1 if members failed with --failed refuse, or a file was not written, otherwise 0.
    """
    from lgvi_warp import plots
    from lgvi_warp.uncertainty.rare.rare_event import rare_event

    scene = load_scene(chosen)
    _refuse_boundless(chosen.when, scene)
    cheaper = [_differing(text) for text in chosen.cheaper]
    out = folder(chosen, "_rare")
    seed = scene.ensemble_settings.seed if scene.ensemble_settings else 0
    with progress_bar(chosen.quiet) as progress:
        # Quiet, a terminal is shown nothing however long it takes.
        found = (study or (inspect.unwrap(rare_event) if chosen.quiet else rare_event))(
            scene, chosen.when, relative_error=chosen.error, by=chosen.by, cheaper=cheaper, looks=chosen.looks,
            failed=chosen.failed, most=chosen.most, seed=int(seed), threads=chosen.threads, progress=progress,
            store=chosen.store,
        )  # fmt: skip
    with progress_bar(chosen.quiet, "writing"):
        written = Written(found.save(out))
        written.draw(draw or plots.rare, found, out / "rare.png")
    return finish(written, chosen, {"rare": found.to_dict()}, str(found))


def _refuse_boundless(text: str, scene: Any) -> None:
    """Refuse words that are no event, before anything compiles, and a quantity without a bound. Raises SceneError."""
    from lgvi_warp.uncertainty.rare.event import condition_of, has_bound

    condition_of(text, scene)
    words = text.strip()
    if words not in {event.key for event in scene.events} and not has_bound(words):
        raise refusal("--when", text, "is a quantity without a bound", f'write "{words} above 12.0"')


def _differing(text: str) -> dict[str, Any]:
    """Changes of a cheaper setting, in the command's form: "h=0.1,dtype=float32". Raises SceneError."""
    differing: dict[str, Any] = {}
    for part in text.split(","):
        name, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not name or not value:
            raise refusal("--cheaper", text, "names no values", "write h=0.1,dtype=float32")
        try:
            differing[name] = float(value)
        except ValueError:
            differing[name] = value
    return differing
