# SPDX-License-Identifier: Apache-2.0
"""The pictures of the pages beside the gallery's: what each is made of, and how: `make pictures`, or with ONLY="waypoints".

A picture carries the hash of what made it, so that a stale one is found in any clone.
"""

from __future__ import annotations

import ast
import hashlib
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.append(str(DOCS))

from site_parts import tutorial  # noqa: E402

LGVI = (sys.executable, "-m", "lgvi_warp")
VALIDATION = (sys.executable, "-m", "benchmarks", "table", "validation", "--kept")
KEPT = (sys.executable, "-m", "benchmarks", "table", "fronts", "--kept")
BARS = (sys.executable, "-m", "benchmarks", "table", "bars", "--kept")


class Made(NamedTuple):
    """How a picture is made.

    Attributes:
        sources: Files whose text made it: a script or a scene, measured rows, and the code that drew it; of a page its code.
        command: Words of the command; "{}" stands for a folder that it writes into.
        file: The picture's name in that folder; empty where the command puts it into its place itself.
    """

    sources: tuple[str, ...]
    command: tuple[str, ...]
    file: str = ""


def room(name: str) -> tuple[str, ...]:
    """The files of a room of the package that draws, by its name in lgvi_warp/views."""
    return tuple(path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "lgvi_warp/views" / name).glob("*.py")))


def sources_of(script: Path) -> tuple[str, ...]:
    """The code that draws an example's picture: the example, and the package's where it draws by that."""
    return (script.relative_to(ROOT).as_posix(), *(room("plots") if "lw.plots." in script.read_text() else ()))


def of_script(script: str, *options: str) -> Made:
    """A picture that an example writes where it is told to."""
    return Made(sources_of(ROOT / script), (sys.executable, script, *options, "{}/picture.png"), "picture.png")


def of_example(script: str, file: str) -> Made:
    """A picture that an example writes into the folder where it runs."""
    inside = "import os, runpy, sys; os.chdir(sys.argv[2]); runpy.run_path(sys.argv[1], run_name='__main__')"
    return Made(sources_of(ROOT / script), (sys.executable, "-c", inside, str(ROOT / script), "{}"), file)


def of_page(page: str, file: str) -> Made:
    """A picture that the code of a page draws."""
    inside = (
        "import os, sys; sys.path.append('docs'); from site_parts.pictures import code_of; "
        "code = code_of(open(sys.argv[1]).read()); os.chdir(sys.argv[2]); exec(code)"
    )
    return Made((page, *room("plots")), (sys.executable, "-c", inside, page, "{}"), file)


def of_comparison(name: str) -> Made:
    """The picture of a comparison with a published experiment or code, drawn from its rows."""
    drawn_by = (
        f"benchmarks/rows/validation_{name}.json",
        f"benchmarks/validation/{name}.py",
        "benchmarks/validated.py",
    )
    scenes = tuple(
        path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "examples/validation").glob(f"{name}*.*"))
    )
    return Made((*drawn_by, *scenes), (*VALIDATION, name))


CODE = re.compile(r"^```\w+\n([\s\S]*?)^```|^    \$ (.*)$", re.MULTILINE)
COMPARISONS = sorted(path.stem for path in (ROOT / "benchmarks/validation").glob("[a-z]*.py"))


def of_vehicle(name: str) -> Made:
    """The picture of a vehicle of the package that turns and rights itself."""
    sources = (VEHICLES, f"lgvi_warp/vehicles/{name}.toml")
    return Made(sources, (sys.executable, VEHICLES, name, "{}/picture.png"), "picture.png")


VEHICLES = "benchmarks/named_vehicles.py"
FRONTS = "benchmarks/fronts_picture.py"
LEARNT = "examples/controllers/learn_depth_keeping.py"
STABILITY = (*LGVI, "stability", "examples/paper.toml", "--grid", "all", "--seed", "1", "--out", "{}")
TUTORIAL = ("docs/start/tutorial.md", "docs/site_parts/tutorial.py", *room("plots"))
TYPED = (sys.executable, "docs/site_parts/tutorial.py", "{}")
SWEEP = "examples/sweeps/depth_gain_map.toml"
MADE = {
    "controllers/dead_thruster.png": of_script("examples/controllers/dead_thruster.py"),
    "controllers/depth_in_waves.png": of_script("examples/controllers/depth_in_waves.py"),
    "controllers/depth_keeping.png": of_script("examples/controllers/depth_keeping.py"),
    "controllers/learning.png": of_script("examples/controllers/train_a_policy.py", "1.5"),
    "controllers/learn_depth_keeping.png": Made(
        (LEARNT, "examples/controllers/ppo.py"), (sys.executable, LEARNT, "200000", "{}/picture.png"), "picture.png"
    ),
    "controllers/lost_bottom.png": of_script("examples/controllers/lost_bottom.py"),
    "controllers/saturated_thrusters.png": of_script("examples/controllers/saturated_thrusters.py"),
    "controllers/loiter_and_dock.png": of_script("examples/controllers/loiter_and_dock.py"),
    "controllers/predictive_depth.png": of_script("examples/controllers/predictive_depth.py"),
    "controllers/waypoints.png": of_script("examples/controllers/waypoints.py"),
    "guide/at_the_surface.png": of_script("examples/laws/at_the_surface.py"),
    "guide/beside_others.png": Made(("benchmarks/rows/bars.json", "benchmarks/bars_picture.py"), BARS),
    "guide/depth_gain_map.png": Made((SWEEP, *room("plots")), (*LGVI, "sweep", SWEEP, "--out", "{}"), "success.png"),
    "guide/forecast_sea.png": of_script("examples/laws/forecast_sea.py"),
    "guide/footprint.png": of_page("docs/guide/footprint.md", "footprint.png"),
    "guide/glider_by_its_battery.png": of_script("examples/laws/glider_by_its_battery.py"),
    "guide/glider_in_an_eddy.png": of_script("examples/studies/glider_in_an_eddy.py"),
    **{f"guide/named_{name}.png": of_vehicle(name) for name in ("lauv", "eca_a9", "girona_500", "rexrov", "dsrv")},
    "guide/where_to_search.png": of_example("examples/where_to_search.py", "where_to_search.png"),
    "guide/glider_survey.png": of_script("examples/studies/glider_survey.py"),
    "guide/survey_how_far_off.png": of_script("examples/studies/survey_how_far_off.py"),
    "guide/survey_in_a_seaway.png": of_script("examples/studies/survey_in_a_seaway.py"),
    "guide/land_on_a_slope.png": of_script("examples/laws/land_on_a_slope.py"),
    "guide/rescue_vehicle.png": of_script("examples/laws/rescue_vehicle.py"),
    "guide/tune_worst_5_percent.png": of_script("examples/sweeps/tune_worst_5_percent.py"),
    **{
        f"guide/stability_{name}.png": Made(("examples/paper.toml", *room("plots")), STABILITY, f"stability_{name}.png")
        for name in ("omega", "mass", "drag")
    },
    **{
        f"guide/accuracy_{name}.png": Made((f"benchmarks/rows/fronts_{name}.json", FRONTS), (*KEPT, name))
        for name in ("paper", "remus", "light", "short")
    },
    **{f"start/{name}": Made(TUTORIAL, TYPED, name) for name in tutorial.WRITTEN.values()},
    **{f"validation/{name}.png": of_comparison(name) for name in COMPARISONS},
}


def code_of(page: str) -> str:
    """The fenced code of a page, and its commands."""
    return "\n".join(fenced or typed for fenced, typed in CODE.findall(page))


def code_of_python(text: str) -> str:
    """The lines of a module without imports, docstrings, comments and blank lines: what can change a picture."""
    left_out: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        is_docstring = (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        )
        if is_docstring or isinstance(node, ast.Import | ast.ImportFrom):
            left_out.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    rows = [row for number, row in enumerate(text.splitlines(), 1) if number not in left_out]
    return "\n".join(row for row in rows if row.strip() and not row.lstrip().startswith("#"))


def digest(*paths: Path) -> str:
    """The hash of what counts in source files; line ends do not."""
    readers = {".md": code_of, ".py": code_of_python}
    texts = [readers.get(path.suffix, str)(path.read_text()) for path in paths]
    return hashlib.sha256("\n".join("\n".join(text.splitlines()) for text in texts).encode()).hexdigest()


def made_of(name: str) -> str:
    """The hash of what makes a picture, by its name below docs/."""
    return digest(*(ROOT / source for source in MADE[name].sources))


def made_of_script(script: Path) -> str:
    """The hash of what draws an example's picture."""
    return digest(*(ROOT / source for source in sources_of(script)))


def keep(source: Path, target: Path, **texts: str) -> None:
    """Put a picture into its place, with few colours and with where it comes from.

    Args:
        source: The picture that was drawn.
        target: Its place.
        texts: What it says of itself: "script", the hash of what made it, and more.
    """
    from PIL import Image, PngImagePlugin

    notes = PngImagePlugin.PngInfo()
    for key, text in texts.items():
        notes.add_itxt(key, text)
    with Image.open(source) as picture:
        small = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    small.save(target, optimize=True, pnginfo=notes)


def notes(picture: Path) -> dict[str, str]:
    """What a picture says of itself."""
    from PIL import Image

    with Image.open(picture) as opened:
        return dict(opened.text)


def main(chosen: list[str]) -> None:
    """Draw the pictures, all or those whose names are given; what one command draws together is run once."""
    commands: dict[tuple[str, ...], list[str]] = {}
    for name, made in MADE.items():
        if not chosen or Path(name).stem in chosen:
            commands.setdefault(made.command, []).append(name)
    for command, names in commands.items():
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([word.format(folder) for word in command], cwd=ROOT, check=True)
            for name in names:
                if MADE[name].file:
                    keep(Path(folder) / MADE[name].file, DOCS / name, script=made_of(name))
                print(name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
