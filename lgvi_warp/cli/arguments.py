# SPDX-License-Identifier: Apache-2.0
"""The command's arguments, verb by verb."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from lgvi_warp import __version__
from lgvi_warp.common.errors import closest

OF = 'position, attitude, velocity, angular_velocity, energy, depth, speed, euler, "position[2]", "norm(velocity)" ...'


EPILOG = """examples:
  lgvi-warp new dive.toml --vehicle remus_100
  lgvi-warp check dive.toml
  lgvi-warp run examples/paper.toml --out runs/paper
  lgvi-warp run examples/paper.toml --members 20000 --dtype float32 --set vehicle.mass=120
  lgvi-warp run examples/paper.toml --error 1e-3
  lgvi-warp run examples/paper.toml --members 1000000 --store zarr --out runs/large
  lgvi-warp resume runs/large
  lgvi-warp view runs/paper
  lgvi-warp tradeoff examples/paper.toml --out runs/tradeoff
  lgvi-warp sensitivity examples/paper.toml --of "position[2]" --out runs/sensitivity
  lgvi-warp stability examples/paper.toml --out runs/stability
  lgvi-warp sweep examples/sweeps/heading_laws.toml --out runs/heading_laws
  lgvi-warp info runs/large
  lgvi-warp run examples/paper.toml --json -q

exit codes: 0 done; 1 members, files or the disk failed, or info or merge found a run that is not whole; 2 refused: a scene,
an argument, or what lies in a folder, or a library is missing that the verb needs; 130 interrupted, 143 by SIGTERM, 129 by
SIGHUP (a second one ends at once). Results go to stdout, progress and faults to stderr. The options of every verb: -q, -v,
--json, --color.
"""


# Arguments that several verbs have.
SHARED: dict[str, dict[str, Any]] = {
    "scene": {"metavar": "SCENE", "help": "scene file (TOML)"},
    "dir": {"metavar": "DIR", "type": Path, "help": "a store, or a folder with one"},
    "--out": {"metavar": "DIR", "type": Path},
    "--duration": {"metavar": "S", "help": "end of the run [s]"},
    "--members": {"metavar": "N", "help": "number of vehicles"},
    "--seed": {"metavar": "N", "help": "seed of what varies"},
    "--set": {"metavar": "KEY=VALUE", "action": "append", "default": [], "help": "replace a key of the scene file"},
    "--method": {"help": "as for run"},
    "--methods": {"metavar": "A,B", "type": lambda text: [name.strip() for name in text.split(",")]},
    "--step": {"metavar": "S", "help": "time step [s]"},
    "--dtype": {"help": "as for run"},
    "--keep": {
        "help": "samples of members to keep: all (default), none, failed, or indices 3,17 (statistics are those of the scene)"
    },
    "--threads": {"metavar": "N", "type": int, "help": "threads (default: all cores)"},
    "--executor": {"default": "threads", "help": "threads (default), processes or dask"},
    "--scheduler": {"metavar": "ADDRESS", "help": "of Dask; without one, a cluster on this machine"},
    "--store": {"choices": ["npz", "zarr"], "default": "npz", "help": "as for run"},
    "--store-dtype": {"metavar": "D", "help": "as for run"},
    "--overwrite": {"action": "store_true", "help": "replace a run.zarr that is there"},
}
# Arguments of the verbs that write files about a scene's ensemble.
SCENE = "scene --out --duration --members --seed --set"
EXECUTOR = "--threads --executor --scheduler"
WORKERS = "threads, processes or workers (default: all cores)"
FOLDER = "folder for the files, replaced if they exist (default: {})"
# Options of every verb, which may stand before it too -> what they are without being given.
COMMON: dict[tuple[str, ...], dict[str, Any]] = {
    ("-q", "--quiet"): {"action": "store_true", "help": "no progress and no results but those of --json: faults alone"},
    ("-v", "--verbose"): {"action": "store_true", "help": "also how it was run, and where an error came from"},
    ("--json",): {"action": "store_true", "help": "results as one JSON document (docs/reference/json.md)"},
    ("--color",): {
        "choices": ("auto", "always", "never"),
        "help": "colors: auto (default, on a terminal without NO_COLOR), always or never",
    },
}
DEFAULTS = {"quiet": False, "verbose": False, "json": False, "color": "auto"}


class Parser(argparse.ArgumentParser):
    """A parser whose errors suggest the nearest name.

    Attributes:
        verbs: Parser of each verb; none for that of a verb itself.
    """

    verbs: Mapping[str, Parser] = {}

    def error(self, message: str) -> NoReturn:
        """Print the usage and the fault, and end with exit code 2."""
        if wrong := re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message):
            names = re.findall(r"[\w-]+", wrong[2])
            message = f"{message[: wrong.start()]}{wrong[1]!r} is not known; {closest(wrong[1], names)}"
        super().error(message)


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Read the command's arguments; a fault, or a help that was asked for, ends the process.

    arguments: The arguments; default None, those of the process.
    """
    top = parser()
    chosen, unknown = top.parse_known_args(arguments)
    if unknown:
        verb = top.verbs[chosen.verb]
        options = re.findall(r"--[\w-]+", verb.format_help())
        wrong = [word for word in unknown if word.startswith("-")] or unknown
        texts = [f"{word!r} is not known" + (f"; {closest(word.partition('=')[0], options)}" if word[:1] == "-" else "")
                 for word in wrong]  # fmt: skip
        verb.error("; ".join(texts))
    return chosen


def _add_shared(verb: Any, names: str, **helps: str) -> None:
    """Add shared arguments to a verb; helps: name without dashes -> its help for this verb."""
    for name in names.split():
        own_help = helps.get(name.strip("-").replace("-", "_"))
        verb.add_argument(name, **SHARED[name] | ({"help": own_help} if own_help else {}))


def parser() -> Parser:
    """Make the parser of the command's arguments.

    Returns:
        A parser with one subparser for each verb.
    """
    top = Parser(
        prog="lgvi-warp",
        description="Simulate many underwater vehicles at once with a Lie group variational integrator.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"lgvi-warp {__version__}")
    verbs = top.add_subparsers(dest="verb", required=True, metavar="VERB")
    _add_run(verbs)
    _add_check(verbs)
    _add_predict(verbs)
    _add_store_verbs(verbs)
    _add_tradeoff(verbs)
    _add_sensitivity(verbs)
    _add_stability(verbs)
    _add_sweep(verbs)
    view = _verb(verbs, "view", help="look at a run in the rerun viewer")
    view.add_argument("dir", metavar="DIR", type=Path, help="the folder of a run, a store, or a result.npz")
    view.add_argument("--members", metavar="LIST", help="draw these members, as 3,17 (default: a fair choice of 1,000)")
    view.add_argument("--out", metavar="FILE", type=Path, help="write the recording there, and open no viewer")
    info = _verb(
        verbs,
        "info",
        help="say what is in a folder that a verb wrote; without one, the machine, versions, the core's peak",
    )
    info.add_argument("dir", nargs="?", metavar="DIR", type=Path, help="a folder that a verb wrote, or a store")
    info.set_defaults(scene=None)
    bench = _verb(verbs, "bench", help="speed of the kernel on this machine, beside the core's peak")
    bench.add_argument("--members", type=int, default=4096, help="vehicles (default 4096)")
    bench.add_argument("--steps", type=int, default=1000, help="steps (default 1000)")
    _add_warm(verbs)
    _verb(verbs, "tune", help="measure how many vehicles a packet should hold on this machine, for runs from now on")
    _add_lists(verbs)
    for verb in dict.fromkeys((top, *verbs.choices.values())):  # an old name has the same parser
        group = verb.add_argument_group("options of every verb")
        for names, settings in COMMON.items():
            group.add_argument(*names, default=argparse.SUPPRESS, **settings)
    top.verbs = verbs.choices
    top.set_defaults(**DEFAULTS)
    return top


def _verb(verbs: Any, name: str, help: str, **more: Any) -> Parser:
    """Add a verb, which says in its own help what it does too."""
    verb: Parser = verbs.add_parser(name, help=help, description=help[0].upper() + help[1:] + ".", **more)
    return verb


def _add_run(verbs: Any) -> None:
    """Add the verb run with its arguments, in groups."""
    run = _verb(verbs, "run", help="run a scene's ensemble: result.npz, fleet.png, fleet.rrd and a summary")
    _add_shared(run, "scene")
    what = run.add_argument_group("what runs")
    _add_shared(what, "--duration --members --seed --set")
    _add_how(run.add_argument_group("method, step and precision"))
    _add_solves(run.add_argument_group("solves and checks"))
    files = run.add_argument_group("files")
    _add_shared(files, "--out --keep", out=FOLDER.format("runs/NAME of the scene"))
    _add_stored(files)
    live = run.add_argument_group("a look while it runs")
    live.add_argument(
        "--live", action="store_true", help="show members in the rerun viewer as they are done, then the whole run"
    )
    live.add_argument(
        "--viewer",
        metavar="ADDRESS",
        help="with --live: a viewer that is open (default: one on this machine, or a new one)",
    )
    machine = run.add_argument_group("the machine")
    _add_shared(machine, EXECUTOR, threads=WORKERS)
    machine.add_argument("--width", metavar="W", type=int, help="vehicles per SIMD packet (default: from the CPU)")


def _add_how(group: Any) -> None:
    """Add what chooses the method, the step and the precision of a run."""
    _add_shared(
        group,
        "--method --step --dtype",
        method="rk4, rk8, rkw3, psi_s, psi_x ...: see list methods (default: the scene's, else chosen by what acts)",
        dtype="float64, float32, or float32_compensated: sums of two float32",
    )
    add = group.add_argument
    add(
        "--error",
        metavar="E",
        type=float,
        help="choose the cheapest method, step and precision that keep this error, and check it after the run",
    )
    add("--of", help=f"what --error is of (default: position [m]); {OF}")
    add("--rtol", metavar="R", help="with --atol, rk5 and rk8 choose their own steps: relative error of each")
    add("--atol", metavar="A", help="with --rtol: absolute error of each step")


def _add_solves(group: Any) -> None:
    """Add what is solved and checked in each step of a run."""
    add = group.add_argument
    add("--solver", help="of equation (24): quartic, cayley, newton or moser_veselov")
    add("--iterations", metavar="N", help='of every solve: a number, or "auto" (default: to the tolerance)')
    add("--tolerance", metavar="T", help="relative residual above which a solve is not converged")
    add("--checks", help="none, safe (statuses, default) or all (warnings of what arises on the way as well)")
    add("--on-failure", help="freeze a member that fails (default), raise: exit code 1, or substep: divide its step")


def _add_stored(group: Any) -> None:
    """Add what a run in a store takes."""
    _add_shared(
        group,
        "--store --store-dtype",
        store="result.npz when the run ends (default), or run.zarr block by block, which resume can go on with",
        store_dtype="float32: samples of a float64 run take half the room in the store",
    )
    group.add_argument(
        "--blocks",
        metavar="A:B",
        help="with --store zarr: run only these blocks, to be merged later (as many of them as there are)",
    )
    existing = group.add_mutually_exclusive_group()
    _add_shared(existing, "--overwrite")
    existing.add_argument(
        "--resume", action="store_true", help="go on with a run.zarr that is there, if it is this run"
    )


def _add_tradeoff(verbs: Any) -> None:
    """Add the verb tradeoff with its arguments."""
    verb = _verb(
        verbs,
        "tradeoff",
        help="speed against accuracy of every method, step and precision: tradeoff.json, .csv and .png",
    )
    _add_shared(verb, SCENE, out=FOLDER.format("runs/NAME_tradeoff"))
    _add_shared(verb, "--methods", methods="names, such as psi_s,kl8(psi_x) (default: all that fit)")
    verb.add_argument("--of", default="position", help=f"what errors are of (default: position); {OF}")
    verb.add_argument("--seconds", metavar="S", type=float, default=45.0, help="processor time to measure (default 45)")


def _add_sensitivity(verbs: Any) -> None:
    """Add the verb sensitivity with its arguments."""
    verb = _verb(
        verbs,
        "sensitivity",
        help="which of the varied parameters matter: Sobol indices or Morris screening; .txt, .csv, .json, .png",
    )
    add = verb.add_argument
    _add_shared(verb, "scene", scene="scene file (TOML) with [ensemble.vary]")
    add("--of", metavar="Q", action="append", help='quantity of interest: "position[2]" (the default), depth, speed, '
        '"norm(velocity)", "max(energy)" ...; may be given several times')  # fmt: skip
    _add_shared(verb, "--out", out="folder for the files (default: runs/NAME_sensitivity)")
    add("--analysis", choices=("sobol", "morris"), default="sobol", help="default sobol")
    add("--samples", metavar="N", type=int, help="groups of the design (default: sobol 256, morris 64)")
    add("--first-order", action="store_true", help="sobol without pairs of factors: about half the members")
    add("--replicates", metavar="R", type=int, default=8, help="sobol: independent sequences, whose spread gives the "
        "intervals (default 8)")  # fmt: skip
    add("--group", metavar="NAME=FACTORS", action="append", default=[], help="sobol: factors to take for one, as "
        '"start=start.position,start.velocity"; may be given several times')  # fmt: skip
    add("--failed", choices=("refuse", "drop"), default="refuse",
        help="what to do about groups with a failed member (default refuse)")  # fmt: skip
    _add_shared(
        verb,
        "--method --step --dtype --duration --seed --threads --set",
        method="integration method, as of run",
        dtype="float64, float32, or float32_compensated",
        seed="seed of the design",
    )


def _add_sweep(verbs: Any) -> None:
    """Add the verb sweep with its arguments."""
    verb = _verb(
        verbs,
        "sweep",
        help="cases of a controller on the same members: what holds, which is better, the worst members; tables, pictures",
    )
    add = verb.add_argument
    add("scene", metavar="SWEEP", help="sweep file (TOML)")
    _add_shared(
        verb, "--out", out="folder for the files; what is finished there is not run again (default: runs/NAME_sweep)"
    )
    add("--plan", action="store_true", help="say what the sweep would take, and run nothing")
    add("--record", metavar="N", type=int, default=0, help="run the N worst members again into recordings (default 0)")
    _add_shared(verb, "--members --seed")
    _add_shared(verb, EXECUTOR, threads=WORKERS)


def _add_stability(verbs: Any) -> None:
    """Add the verb stability with its arguments."""
    verb = _verb(
        verbs,
        "stability",
        help="where methods are accurate, bounded, flagged or fail, over two parameters: .json, .csv and .png",
    )
    add = verb.add_argument
    _add_shared(verb, "scene --out --duration --seed --set", out=FOLDER.format("runs/NAME_stability"))
    add(
        "--grid",
        choices=("omega", "mass", "drag", "all"),
        help="step against angular velocity (default), added-mass ratio or drag number, or all three",
    )
    axis = "NAME or NAME=LOW:HIGH[:linear], such as"
    add("--x", metavar="AXIS", help=f"instead of --grid: {axis} h=0.01:3")
    add("--y", metavar="AXIS", help=f"instead of --grid: {axis} angular_velocity, vehicle.mass=50:500")
    _add_shared(verb, "--methods", methods="names, such as psi_s,kl8(psi_x) (default: psi,psi_s,psi_x,rk4)")
    add("--points", metavar="N", type=int, default=24, help="cells along each axis (default 24)")
    add("--error", metavar="E", type=float, default=1e-2, help="an accurate cell's bound (default 0.01)")
    add("--of", default="attitude", help=f"what --error is of (default: attitude); {OF}")


def _add_check(verbs: Any) -> None:
    """Add the verb check with its arguments."""
    verb = _verb(verbs, "check", help="say whether a scene can run, and which of its numbers look wrong; nothing runs")
    _add_shared(verb, "scene --method --step --dtype --duration --members --seed --set")


def _add_warm(verbs: Any) -> None:
    """Add the verb warm with its arguments."""
    verb = _verb(verbs, "warm", help="compile the kernels of a scene ahead of its runs, several at a time")
    _add_shared(verb, "scene --methods", methods="names, such as psi_s,rk4 (default: the scene's)")
    names = SHARED["--methods"] | {"help": "float64, float32, float32_compensated (default: the scene's)"}
    verb.add_argument("--dtypes", **names)
    _add_shared(verb, "--step --duration --set --threads", threads="processes (default: all cores)")


def _add_predict(verbs: Any) -> None:
    """Add the verb predict with its arguments."""
    verb = _verb(
        verbs,
        "predict",
        aliases=["plan"],
        help="time, memory and disk that a run would take, from a small one on this machine",
    )
    names = f"{SCENE} --method --step --dtype --keep --threads --store --store-dtype"
    _add_shared(verb, names, out=FOLDER.format("runs/NAME of the scene"))


def _add_store_verbs(verbs: Any) -> None:
    """Add the verbs resume, merge and export with their arguments."""
    resume = _verb(verbs, "resume", help="go on with a run that was stopped, and mend what is damaged of it")
    _add_shared(resume, f"dir {EXECUTOR}", threads=WORKERS)
    resume.add_argument("--force", action="store_true", help="even on another machine or with other versions")
    merge = _verb(verbs, "merge", help="put runs of some blocks each (run --blocks) together")
    merge.add_argument("dirs", metavar="DIR", type=Path, nargs="+", help="stores, or folders with one each")
    merge.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder for the whole run")
    _add_shared(merge, "--overwrite")
    export = _verb(verbs, "export", help="write a run as one NetCDF or Parquet file")
    _add_shared(export, "dir")
    page = _verb(verbs, "report", help="write one HTML file about a run or studies: report.html")
    page.add_argument(
        "dir", metavar="DIR", type=Path, help="folder that run, tradeoff, stability, sensitivity or sweep wrote"
    )
    page.add_argument(
        "--out", metavar="FILE", type=Path, help="the file, replaced if it exists (default: DIR/report.html)"
    )
    page.add_argument("--open", action="store_true", help="show it in the browser")
    export.add_argument("--to", required=True, help="netcdf or parquet")
    export.add_argument(
        "--out", metavar="FILE", type=Path, help="the file, replaced if it exists (default: beside the store)"
    )


def _add_lists(verbs: Any) -> None:
    """Add the verbs new, list, schema, plot, completion and help with their arguments."""
    new = _verb(verbs, "new", help="write a scene file to begin with, with comments")
    new.add_argument("scene", metavar="SCENE", type=Path, help="the file, which must not be there yet")
    new.add_argument(
        "--vehicle", metavar="NAME", default="remus_100", help="as list vehicles has it (default remus_100)"
    )
    names = _verb(verbs, "list", help="names of methods, vehicles, terms, or laws of controllers")
    names.add_argument("of", metavar="WHAT", choices=("methods", "vehicles", "terms", "laws"),
                       help="methods, vehicles, terms or laws")  # fmt: skip
    _verb(verbs, "schema", help="print the JSON schema of scene files, for editors")
    plot = _verb(verbs, "plot", help="draw the pictures of a folder again, from the numbers in it")
    plot.add_argument("dir", metavar="DIR", type=Path, help="a folder that run or a study wrote")
    _add_shared(plot, "--out", out="folder for the pictures, replaced if they exist (default: DIR)")
    completion = _verb(verbs, "completion", help="print what completes the command in a shell")
    completion.add_argument("shell", metavar="SHELL", choices=("bash", "zsh", "fish"), help="bash, zsh or fish")
    helped = _verb(verbs, "help", help="print the options of a verb; without one, all verbs")
    helped.add_argument("of", metavar="VERB", nargs="?", choices=[*verbs.choices], help="a verb")
