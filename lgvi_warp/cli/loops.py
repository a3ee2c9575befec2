# SPDX-License-Identifier: Apache-2.0
"""The verbs margins, worst-case and trim."""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lgvi_warp.cli.output import Part, print_faults, tell
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.settings import folder, load_scene
from lgvi_warp.cli.studies import finish
from lgvi_warp.cli.verb import FOLDER, add_shared, as_verb
from lgvi_warp.cli.writing import Written
from lgvi_warp.common.errors import Faults

METHOD = "integration method, as of run"


def margins_arguments(verb: Any) -> None:
    """Add the arguments of the verb margins."""
    add = verb.add_argument
    add_shared(verb, "scene", scene="scene file (TOML) with [controller]; its members are those of [ensemble]")
    add("--loop", metavar="KEY", help="key of the law, such as heading_pid (default: all laws together)")
    add("--of", action="append", choices=("gain", "delay", "disk", "peak"), help="what the loop is to bear (default: gain and "
        "delay); may be given several times")  # fmt: skip
    add("--by", action="append", choices=("eigenvalues", "runs"), help="how it is found (default: eigenvalues); may be "
        "given several times")  # fmt: skip
    add("--skew", metavar="S", type=float, default=0.0, help="skew of the disk, from -1 to 1 (default 0)")
    add("--to", metavar="NAME", action="append", help="number of the motion to which peaks are wanted, as position[2]; may be "
        "given several times")  # fmt: skip
    add("--about", metavar="S", type=float, default=60.0, help="time after which loops are looked at [s] (default 60)")
    add(
        "--settle",
        metavar="S",
        type=float,
        default=1200.0,
        help="longest time until they are steady [s] (default 1200)",
    )
    add("--seconds", metavar="S", type=float, default=240.0, help="length of the runs [s] (default 240)")
    add("--tilt", metavar="A", type=float, default=1e-3, help="angle by which runs begin aside [rad] (default 0.001)")
    add("--most", metavar="F", type=float, default=100.0, help="largest factor, and one over the least (default 100)")
    add("--longest", metavar="S", type=float, default=10.0, help="longest delay that is added [s] (default 10)")
    add_shared(
        verb, "--out --method --step --members --seed --set", out=FOLDER.format("runs/NAME_margins"), method=METHOD
    )


@as_verb(
    "margins",
    "how much gain, delay or both the loop of each member bears; margins.json, .csv and .png",
    margins_arguments,
)
def margins(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
    """Run the verb margins: how far the loop of each member is from the edge.

    Returns: The exit code: 1 if members failed or a file was not written, otherwise 0.
    """
    from lgvi_warp import plots
    from lgvi_warp.robustness.linear.loops import FAILED
    from lgvi_warp.robustness.linear.margins import margins as bearable

    scene = load_scene(chosen)
    out = folder(chosen, "_margins")
    names = ("about", "settle", "seconds", "tilt", "most", "longest", "skew")
    numbers = {name: getattr(chosen, name) for name in names}
    with progress_bar(chosen.quiet, "running"):
        found = (study or bearable)(
            scene, chosen.loop, tuple(dict.fromkeys(chosen.of or ("gain", "delay"))),
            by=tuple(dict.fromkeys(chosen.by or ("eigenvalues",))), to=tuple(chosen.to or ()), **numbers,
        )  # fmt: skip
    with progress_bar(chosen.quiet, "writing"):
        written = Written(found.save(out))
        written.draw(draw or plots.margins, found, out / "margins.png")
    code = finish(written, chosen, {"margins": found.to_dict()}, str(found))
    failed = found.reasons.get(FAILED, 0)
    return 1 if print_faults([f"{failed:,} of {found.members:,} members failed"] if failed else []) else code


def worst_case_arguments(verb: Any) -> None:
    """Add the arguments of the verb worst-case."""
    add = verb.add_argument
    add_shared(verb, "scene", scene="scene file (TOML); numbers that are not searched are its own")
    add("--of", metavar="Q", required=True, help='what is to be worst: "max(depth)", "norm(position)", or a metric, '
        '"overshoot depth"')  # fmt: skip
    add("--within", metavar="NAME=LOW:HIGH", action="append", required=True, help="bounds of a number of the scene, as "
        "vehicle.buoyancy=297:302, or with :log to search by the logarithm; may be given several times")  # fmt: skip
    add("--worst", choices=("largest", "smallest"), default="largest", help="which is the worst (default largest)")
    add("--budget", metavar="N", type=int, default=20_000, help="members that may be run (default 20000)")
    add("--restarts", metavar="N", type=int, default=3, help="evolutions, each from other places (default 3)")
    add("--seed", metavar="N", type=int, default=0, help="seed of the search (default 0)")
    add_shared(
        verb,
        "--out --method --step --dtype --duration --threads --set",
        out=FOLDER.format("runs/NAME_worst_case"),
        method=METHOD,
        dtype="float64, float32, or float32_compensated",
    )


@as_verb(
    "worst-case",
    "search numbers within bounds for the member whose quantity is worst; worst_case.json and .csv",
    worst_case_arguments,
)
def worst_case(chosen: argparse.Namespace, *, study: Part = None) -> int:
    """Run the verb worst-case: search the worst member within bounds.

    Returns: The exit code: 1 if a file was not written, otherwise 0; a member that fails is an answer.
    """
    from lgvi_warp.robustness.search.worst_case import worst_case as search

    faults = Faults()
    within = {name: ends for text in chosen.within for name, ends in _bounds(faults, text)}
    faults.raise_if_any()
    # --seed is that of the search, and not of what the scene draws.
    seed, chosen.seed = chosen.seed, None
    scene = load_scene(chosen)
    out = folder(chosen, "_worst_case")
    with progress_bar(chosen.quiet) as progress:
        found = (study or search)(
            scene, within, chosen.of, worst=chosen.worst, budget=chosen.budget, restarts=chosen.restarts, seed=seed,
            threads=chosen.threads, progress=progress,
        )  # fmt: skip
    with progress_bar(chosen.quiet, "writing"):
        written = Written(found.save(out))
    again = f"again       {run_again(chosen, out / 'worst_case.csv')}"
    return finish(written, chosen, {"worst_case": found.to_dict()}, f"{found}\n{again}")


def _bounds(faults: Faults, text: str) -> list[tuple[str, tuple[Any, ...]]]:
    """Bounds of a number as the command has them, NAME=LOW:HIGH or NAME=LOW:HIGH:log; none where they are at fault."""
    name, _, ends = text.partition("=")
    low, *rest = ends.split(":")
    try:
        if name and len(rest) in (1, 2) and rest[1:] in ([], ["log"]):
            return [(name.strip(), (float(low), float(rest[0]), *rest[1:]))]
    except ValueError:
        pass
    faults.add("--within", text, "names no bounds", "give vehicle.buoyancy=297:302, or heading_pid.kp=0.5:5:log")
    return []


def run_again(chosen: argparse.Namespace, table: Path) -> str:
    """The command that runs the member of a table again, with the settings of the arguments."""
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


def trim_arguments(verb: Any) -> None:
    """Add the arguments of the verb trim."""
    add = verb.add_argument
    add_shared(verb, "scene")
    add("--speed", metavar="V", type=float, help="speed over ground [m/s] (default: it is free)")
    add("--free", metavar="NAME", action="append", help="what may be chosen: roll, pitch, drift, speed, thrusters, "
        '"thrusters[0]" (default: all); may be given several times')  # fmt: skip
    add("--fixed", metavar="NAME=VALUE", action="append", default=[], help="the value of what is not free, as pitch=0.1; "
        "without one it is 0; may be given several times")  # fmt: skip
    add_shared(verb, "--method --step --set", method=METHOD)


@as_verb(
    "trim",
    "the steady motion of a vehicle, straight and level, and the commands that hold it",
    trim_arguments,
    reads=True,
)
def trim(chosen: argparse.Namespace, *, study: Part = None) -> int:
    """Run the verb trim: find a steady motion.

    Returns: The exit code, 0.
    """
    from lgvi_warp.robustness.linear.trim import trim as steady

    faults = Faults()
    fixed = dict(pair for text in chosen.fixed for pair in _value(faults, text))
    faults.raise_if_any()
    scene = load_scene(chosen)
    with progress_bar(chosen.quiet):
        found = (study or steady)(scene, chosen.speed, free=chosen.free, fixed=fixed)
    tell(chosen, found.to_dict, lambda: f"{found}\n\n{_section(found.start.to_dict())}")
    return 0


def _value(faults: Faults, text: str) -> list[tuple[str, float]]:
    """A value as the command has it, NAME=VALUE; none where it is at fault."""
    name, _, value = text.partition("=")
    try:
        if name:
            return [(name.strip(), float(value))]
    except ValueError:
        pass
    faults.add("--fixed", text, "is no value", "give pitch=0.1")
    return []


def _section(start: dict[str, Sequence[Any]]) -> str:
    """The section [start] of a scene file."""
    return "\n".join(["[start]", *(f"{name} = {value}" for name, value in start.items())])
