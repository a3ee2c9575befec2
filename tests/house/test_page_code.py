# SPDX-License-Identifier: Apache-2.0
"""Every page's Python runs as printed, block by block, in a fresh interpreter; each other snippet is run by a test.

The quick suite looks at names: each is bound on the page before it is used, and those of the package exist.
"""

import inspect
import os
import subprocess
import sys
import tomllib

import numpy as np
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT
from tests.support.pages import FENCE, blocks, chains, missing_names, reader, snippets

DOCS = ROOT / "docs"
# A test -> the pages whose snippets it runs. The pages of terms and those below are run here.
OF_TESTS = {
    "house/test_readme.py": "README.md docs/guide/methods.md",
    "house/test_docs.py":
        "docs/controllers/README.md docs/controllers/actuators.md docs/controllers/allocation.md "
        "docs/controllers/callback.md docs/controllers/metrics.md docs/controllers/signals.md docs/guide/distributions.md "
        "docs/guide/events.md docs/guide/failed_members.md docs/guide/many_calls.md docs/guide/sampling.md "
        "docs/guide/sensitivity.md docs/guide/statistics.md docs/guide/vehicles.md",
    "control/test_bad_sensors.py": "docs/controllers/faults.md docs/controllers/sensors.md",
    "extensions/learning/test_gym.py": "docs/controllers/gym.md",
    "control/test_own_loop.py": "docs/controllers/bring_your_own_loop.md docs/controllers/learn_depth_keeping.md",
    "extensions/navigation/test_navigation.py": "docs/controllers/navigation.md",
    "studies/test_derivatives.py": "docs/guide/derivatives.md",
    "studies/test_estimating.py": "docs/guide/least_cost.md",
    "studies/test_margins.py": "docs/controllers/margins.md docs/guide/worst_case.md",
    "extensions/ocean/test_current_from_data.py": "docs/guide/ocean_data.md",
    "extensions/ocean/test_floor_data.py": "docs/guide/sea_floor.md",
    "house/test_develop_pages.py":
        "docs/develop/add_a_method.md docs/develop/add_a_sampling.md docs/develop/add_a_statistic.md",
    "house/test_gallery.py": "docs/gallery.md",
    "studies/test_navigation_budget.py": "docs/guide/how_far_off.md",
    "studies/test_rare_event.py": "docs/guide/rare_events.md",
    "studies/test_sweep_pages.py": "docs/guide/is_my_controller_robust.md",
    "house/test_wheel.py": "docs/start/tutorial.md",
}  # fmt: skip
ELSEWHERE = {page: test for test, pages in OF_TESTS.items() for page in pages.split()}
TERMS = [f"docs/guide/terms/{path.name}" for path in sorted((DOCS / "guide" / "terms").glob("[a-z]*.md"))]
PARTS = [f"docs/controllers/{name}.md" for name in ("guidance", "circles_and_docks", "laws", "other_laws")]
SCRIPT_NAMES = (
    "assimilation choose_method_and_step compare_with_your_simulator current energy_used exports footprint geodetic_places "
    "going_on named_vehicles notebooks resume tangents your_vehicle"
)
SCRIPTS = [f"docs/guide/{name}.md" for name in SCRIPT_NAMES.split()]
PYTHON = sorted(
    str(page.relative_to(ROOT)) for page in [ROOT / "README.md", *DOCS.rglob("*.md")] if "```python" in page.read_text()
)
# Pages that read a file of the reader's own, open a window or need a library of an extra, and the test that runs them.
NOT_ALONE = {
    "docs/gallery.md": "house/test_gallery.py",  # each snippet is a file
    "docs/start/tutorial.md": "house/test_wheel.py",  # dive.toml, which the page has the reader write
    "docs/guide/vehicles.md": "house/test_docs.py",  # model.sdf
    "docs/guide/sea_floor.md": "extensions/ocean/test_floor_data.py",  # gebco.nc
    "docs/guide/recordings.md": "house/test_page_code.py",  # a viewer
    "docs/controllers/learn_depth_keeping.md": "control/test_own_loop.py",  # stable_baselines3
}


def test_each_page_with_code_has_its_test():
    pages = [ROOT / "README.md", *(page for page in DOCS.rglob("*.md") if page.parent.name != "built")]
    # Equations are no code: test_theory.py has these.
    with_code = {
        str(page.relative_to(ROOT))
        for page in pages
        if any(found[1] != "math" for found in FENCE.finditer(page.read_text()))
    }
    run_here = {*TERMS, *PARTS, *SCRIPTS, *PYTHON}
    assert with_code - {"docs/guide/terms/README.md"} == ELSEWHERE.keys() | run_here
    assert NOT_ALONE.keys() <= set(PYTHON)
    for page, test in ELSEWHERE.items():
        text = (ROOT / "tests" / test).read_text().replace("glob", "")
        assert page.rpartition("/")[2].partition(".")[0] in text, page


@pytest.mark.parametrize("page", TERMS)
def test_tables_of_terms_are_parts_of_scenes(page):
    body = {"mass": 123.8, "inertia": [5.0, 6.0, 7.0]}
    found = [tomllib.loads(code) for code in blocks(page, "toml")]
    assert found
    for tables in found:
        scene = lw.Scene.from_dict(tables | {"vehicle": body | tables.get("vehicle", {})})
        assert [term.type for term in scene.terms] == [term["type"] for term in tables.get("terms", ())]


@pytest.mark.parametrize("page", PARTS)
def test_parts_of_controllers_fit_a_vehicle(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shapes = {"weights_0": (4, 2), "biases_0": (4,), "weights_1": (1, 4), "biases_1": (1,)}
    np.savez("policy.npz", **{name: np.zeros(shape) for name, shape in shapes.items()})
    found = [tomllib.loads(code)["controller"] for code in blocks(page, "toml")]
    assert len(found) >= 2
    everything = {"type": "set_point", "heading": 0.0, "speed": 0.5, "position": [0.0, 0.0, 5.0]}
    held = {"type": "heading_pid", "kp": 1.0}
    for parts in found:
        controller = {
            "period": 0.1,
            "sensors": [{"type": "altimeter"}],
            "guidance": [everything],
            "laws": [held],
        } | parts
        floor = {"type": "floor", "depth": 40.0}
        scene = lw.Scene.from_dict({"vehicle": {"name": "bluerov2_heavy"}, "controller": controller, "events": [floor]})
        for section, tables in parts.items():
            assert [part.type for part in getattr(scene.controller, section)] == [table["type"] for table in tables]
        assert lw.Scene.from_dict(scene.to_dict()).to_dict() == scene.to_dict()


@pytest.mark.parametrize("page", PYTHON)
def test_python_of_a_page_has_its_names(page):
    codes = blocks(page, "python")
    own = {"docs/gallery.md": "__file__"}.get(page)
    assert {number: names for number, names in missing_names(codes).items() if names != {own}} == {}
    for names in (chain for code in codes for chain in chains(code)):
        value = lw
        for name in names:
            assert hasattr(value, name), f"lw.{'.'.join(names)}"
            value = getattr(value, name)
            if not inspect.ismodule(value):
                break


def run_alone(page, folder):
    """Output of a page's blocks, run in order in a fresh interpreter in a folder that has the examples."""
    parts = [
        f"exec(compile({code!r}, '{page}, block {i}', 'exec'), names)" for i, code in enumerate(blocks(page, "python"))
    ]
    (folder / "page.py").write_text("\n".join(["names = {'__name__': '__main__'}", *parts]))
    environment = {**os.environ, "MPLBACKEND": "Agg", "PYTHONPATH": str(ROOT)}
    ran = subprocess.run([sys.executable, "page.py"], cwd=folder, env=environment, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr[-2000:]
    return ran.stdout


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PYTHON if page not in NOT_ALONE])
def test_python_of_a_page_runs_alone(page, tmp_path):
    printed = run_alone(page, reader(tmp_path))
    if page in SCRIPTS:
        ((_, _, expected),) = snippets(page, "python")
        assert printed == expected


def test_names_that_a_page_lacks_are_found():
    assert missing_names(["x = a\nfor i in x: print(i)", "def f(y): return y + x + z"]) == {0: {"a"}, 1: {"z"}}
    assert ["distributions", "Normal"] in chains("lw.distributions.Normal(std=other.lw)")


@pytest.mark.slow
def test_recordings_but_for_a_viewer(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = []
    monkeypatch.setattr(lw, "show", lambda *arguments, **named: shown.append(arguments))
    record, streamed = lw.record, []
    # A viewer that is open is not there: what would go to it is noted.
    monkeypatch.setattr(lw, "record", lambda *a, to=None, **k: streamed.append(to) if to else record(*a, **k))
    names = {}
    for code in blocks("docs/guide/recordings.md", "python"):
        exec(code, names)
    assert {"fleet.rrd", "both.rrd"} <= {path.name for path in tmp_path.iterdir()}
    assert len(shown) == len(streamed) == 1
