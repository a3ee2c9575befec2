# SPDX-License-Identifier: Apache-2.0
"""The verbs list, new, schema, example and help: names, new scene files, and the format of scene files."""

from __future__ import annotations

import argparse
import inspect
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lgvi_warp.cli.output import tell
from lgvi_warp.cli.verb import as_verb
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.files import place_of, write_text
from lgvi_warp.common.reading import file_text
from lgvi_warp.scene.examples import PREFIX, example_files, example_title, located

# A scene to begin with; {} are filled by `new`.
NEW_SCENE = """# {title}
# lgvi-warp check {file} validates the file and flags implausible values; lgvi-warp run {file} runs it.
# SI units, angles in rad unless a key says degrees. Inertial axes: north, east, down; body axes: ahead, starboard, down.

[vehicle]
name = "{vehicle}"{pad}# lgvi-warp list vehicles; further keys replace its numbers, such as
# buoyancy = {buoyancy}{pad_buoyancy}# N, the weight of the displaced water

# [environment]
# water_density = 1025.0                 # kg/m3

[start]
position = [0.0, 0.0, 50.0]              # m: north, east, depth
euler_deg = [0.0, 0.0, 0.0]              # deg: roll, pitch, yaw
velocity = [1.0, 0.0, 0.0]               # m/s, body axes
angular_velocity = [0.0, 0.0, 0.0]       # rad/s, body axes

# Weight and buoyancy always act{terms}.
# An entry of the same type replaces one of these; lgvi-warp list terms lists all types.
# [[terms]]
# type = "current"
# velocity = [0.2, 0.0, 0.0]             # m/s: north, east, down

# Events that stop a vehicle: surface, floor, box or time.
[[events]]
type = "surface"
[[events]]
type = "floor"
depth = 100.0                            # m

# Number of vehicles, and the numbers that vary between them: any number of this file.
[ensemble]
members = 100
seed = 1
[ensemble.vary]
"start.angular_velocity" = {{ normal = {{ std = 0.01 }} }}
"vehicle.buoyancy" = {{ normal = {{ relative = 0.001 }} }}

[run]
duration = 60.0                          # s
step = 0.01                              # s
save_every = 0.5                         # s between samples
# method = "psi_x"                       # lgvi-warp list methods; default: chosen by the forces

# Statistics over the vehicles at each sample time, with confidence intervals.
[[run.statistics]]
type = "mean"
of = "depth"
"""
# Column of the comments.
COLUMN = 41


def new_arguments(verb: Any) -> None:
    """Add the arguments of the verb new."""
    verb.add_argument("scene", metavar="SCENE", type=Path, help="the new file")
    verb.add_argument("--vehicle", metavar="NAME", default="remus_100",
                      help="name of a vehicle from `list vehicles` (default remus_100)")  # fmt: skip


@as_verb("new", "write a scene file with comments as a starting point", new_arguments)
def new(chosen: argparse.Namespace) -> int:
    """Run the verb new: write a scene file with comments."""
    from lgvi_warp.vehicles.fossen import vehicle_tables

    content = vehicle_tables(chosen.vehicle)
    if os.path.lexists(place_of(chosen.scene)):
        raise SceneError([f"{chosen.scene} is there already. Give another name, or remove it"])
    types = [term["type"] for term in content.get("terms", ())]
    name, buoyancy = chosen.vehicle, f"{content['vehicle'].get('buoyancy', 0.0):g}"
    text = NEW_SCENE.format(
        title=content["source"]["title"], file=chosen.scene.name, vehicle=name,
        pad=" " * (COLUMN - len(f'name = "{name}"')), buoyancy=buoyancy,
        pad_buoyancy=" " * (COLUMN - len(f"# buoyancy = {buoyancy}")),
        terms=f", and of this vehicle: {', '.join(types)}" if types else "",
    )  # fmt: skip
    chosen.scene.parent.mkdir(parents=True, exist_ok=True)
    write_text(chosen.scene, text)
    tell(chosen, lambda: {"file": chosen.scene, "vehicle": name},
         lambda: f"file        {chosen.scene}\nnext        lgvi-warp check {chosen.scene}")  # fmt: skip
    return 0


def list_arguments(verb: Any) -> None:
    """Add the arguments of the verb list."""
    kinds = ("methods", "vehicles", "terms", "laws")
    verb.add_argument("of", metavar="WHAT", choices=kinds, help="methods, vehicles, terms or laws")


@as_verb("list", "list the names of methods, vehicles, terms, or laws of controllers", list_arguments, reads=True)
def list_names(chosen: argparse.Namespace) -> int:
    """Run the verb list: list the names of methods, vehicles, terms, or parts of a controller."""
    entries = {"methods": _methods, "vehicles": _vehicles, "terms": _terms, "laws": _laws}[chosen.of]()
    width = max(map(len, entries))
    tell(chosen, lambda: {"of": chosen.of, "names": [{"name": name, "text": text} for name, text in entries.items()]},
         lambda: "\n".join(f"{name:<{width}}  {text}" for name, text in entries.items()))  # fmt: skip
    return 0


def _methods() -> dict[str, str]:
    """Describe each method: its order and kind."""
    from lgvi_warp.methods import method as methods

    tables: dict[str, Iterable[str]] = {"splitting": methods.PROGRAMS, "two parts, for weight alone": methods.TWO_PART,
              "Gauss collocation": methods.GAUSS, "explicit": methods.RUNGE_KUTTA}  # fmt: skip
    kinds = {name: kind for kind, names in tables.items() for name in names}
    kinds |= {f"{name}(psi_x)": f"composition of {len(stages)} stages, of psi_x or another symmetric method of order 2"
              for name, (_, stages) in methods.COMPOSITIONS.items()}  # fmt: skip
    kinds |= {f"{name}(psi_x)": "composition of the halves of psi_x or another such method" for name in methods.HALVES}
    return {name: f"order {methods.Method(name).order}, {kind}" for name, kind in kinds.items()}


def _vehicles() -> dict[str, str]:
    """Describe each vehicle: its title, and a remark on unexpected effects of its numbers."""
    from lgvi_warp.vehicles.fossen import vehicle_names, vehicle_tables

    sources = {name: vehicle_tables(name)["source"] for name in vehicle_names()}
    return {name: "; ".join(of[key] for key in ("title", "remark") if key in of) for name, of in sources.items()}


def _terms() -> dict[str, str]:
    """Describe the type of each term."""
    from lgvi_warp.physics import terms

    implied = {term.type for term in terms.IMPLIED}
    return {word: _summary(kind) for word, kind in sorted(terms.TYPES.items()) if word not in implied}


def _laws() -> dict[str, str]:
    """Describe each part of a controller: its list in the scene file, and its function."""
    from lgvi_warp.control.base import SECTIONS
    from lgvi_warp.control.controller import Controller  # noqa: F401  (which makes every part known)

    sections = ("laws", *(section for section in SECTIONS if section != "laws"))
    kinds = ((section, word, kind) for section in sections for word, kind in sorted(SECTIONS[section].kinds.items()))
    return {word: f"{section}: {_summary(kind)}" for section, word, kind in kinds}


def _summary(kind: Any) -> str:
    """First line of a class's docstring."""
    return (inspect.getdoc(kind) or "").partition("\n")[0]


def example_arguments(verb: Any) -> None:
    """Add the arguments of the verb example."""
    verb.add_argument("name", metavar="NAME", nargs="?", help="the example to print (default: list all examples)")


@as_verb("example", "list the scene and sweep files of the package, or print one", example_arguments, reads=True)
def example(chosen: argparse.Namespace) -> int:
    """Run the verb example: list the files of the package, or print one unchanged."""
    if chosen.name is not None:
        text = file_text(located(f"{PREFIX}{chosen.name.removeprefix(PREFIX)}"), "scene file")
        if chosen.json:
            tell(chosen, lambda: {"name": chosen.name, "text": text}, str)
        else:
            print(text, end="")
        return 0
    titles = {name: example_title(path) for name, path in example_files().items()}
    width = max(map(len, titles))
    tell(chosen, lambda: {"names": [{"name": name, "text": title} for name, title in titles.items()]},
         lambda: "\n".join(f"{name:<{width}}  {title}" for name, title in titles.items()))  # fmt: skip
    return 0


@as_verb("schema", "print the JSON schema of scene files, for editors", reads=True)
def schema(chosen: argparse.Namespace) -> int:
    """Run the verb schema: print the JSON schema of scene files."""
    from lgvi_warp.scene.schema import schema as of_scenes

    print(json.dumps(of_scenes(), indent=1, allow_nan=False))
    return 0


def help_arguments(verb: Any) -> None:
    """Add the arguments of the verb help."""
    verb.add_argument(
        "of", metavar="VERB", nargs="?", choices=tuple(verb.verbs), help="name of a verb (default: list all verbs)"
    )


@as_verb("help", "print the options of a verb, or the list of verbs", help_arguments, reads=True)
def show_help(chosen: argparse.Namespace) -> int:
    """Run the verb help: print the options of a verb, or the list of verbs."""
    chosen.quiet = False
    text = (chosen.parser.verbs[chosen.of] if chosen.of else chosen.parser).format_help()
    tell(chosen, lambda: {"of": chosen.of, "text": text}, text.rstrip)
    return 0
