# SPDX-License-Identifier: Apache-2.0
"""Every fenced snippet of README and docs is run by a test: here, or in the file that the table names."""

import shutil
import tomllib

import matplotlib
import numpy as np
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT
from tests.support.pages import FENCE, blocks, snippets

matplotlib.use("Agg")
DOCS = ROOT / "docs"
# A test -> the pages whose snippets it runs. The pages of terms and those below are run here.
OF_TESTS = {
    "house/test_readme.py": "README.md docs/guide/methods.md",
    "house/test_docs.py":
        "docs/controllers/README.md docs/controllers/actuators.md docs/controllers/allocation.md "
        "docs/controllers/callback.md docs/controllers/metrics.md docs/controllers/signals.md "
        "docs/guide/events.md docs/guide/failed_members.md docs/guide/many_calls.md docs/guide/sampling.md "
        "docs/guide/sensitivity.md docs/guide/statistics.md docs/guide/vehicles.md",
    "control/test_bad_sensors.py": "docs/controllers/faults.md docs/controllers/sensors.md",
    "control/test_gym.py": "docs/controllers/gym.md",
    "control/test_own_loop.py": "docs/controllers/bring_your_own_loop.md docs/controllers/learn_depth_keeping.md",
    "control/test_navigation.py": "docs/controllers/navigation.md",
    "studies/test_derivatives.py": "docs/guide/derivatives.md",
    "studies/test_estimating.py": "docs/guide/least_cost.md",
    "studies/test_margins.py": "docs/controllers/margins.md docs/guide/worst_case.md",
    "laws/test_current_from_data.py": "docs/guide/ocean_data.md",
    "unit/ocean/test_floor_data.py": "docs/guide/sea_floor.md",
    "house/test_develop_pages.py":
        "docs/develop/add_a_method.md docs/develop/add_a_sampling.md docs/develop/add_a_statistic.md",
    "house/test_gallery.py": "docs/gallery.md",
    "studies/test_rare_event.py": "docs/guide/rare_events.md",
    "studies/test_sweep_pages.py": "docs/guide/is_my_controller_robust.md",
    "house/test_wheel.py": "docs/start/tutorial.md",
}  # fmt: skip
ELSEWHERE = {page: test for test, pages in OF_TESTS.items() for page in pages.split()}
TERMS = [f"docs/guide/terms/{path.name}" for path in sorted((DOCS / "guide" / "terms").glob("[a-z]*.md"))]
PARTS = ["docs/controllers/guidance.md", "docs/controllers/laws.md"]
OF_A_RESULT = ["docs/guide/pictures.md", "docs/guide/recordings.md"]
SCRIPT_NAMES = (
    "assimilation choose_method_and_step compare_with_your_simulator current energy_used exports geodetic_places going_on "
    "named_vehicles notebooks resume tangents your_vehicle"
)
SCRIPTS = [f"docs/guide/{name}.md" for name in SCRIPT_NAMES.split()]


def test_each_page_with_code_has_its_test():
    pages = [ROOT / "README.md", *(page for page in DOCS.rglob("*.md") if page.parent.name != "built")]
    # Equations are no code: test_theory.py has these.
    with_code = {
        str(page.relative_to(ROOT))
        for page in pages
        if any(found[1] != "math" for found in FENCE.finditer(page.read_text()))
    }
    run_here = {*TERMS, *PARTS, *OF_A_RESULT, *SCRIPTS}
    assert with_code - {"docs/guide/terms/README.md"} == ELSEWHERE.keys() | run_here
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
    assert len(found) >= 4
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


@pytest.mark.slow
@pytest.mark.parametrize("page", SCRIPTS)
def test_a_script_prints_what_its_page_says(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").mkdir()
    shutil.copy(ROOT / "examples" / "paper.toml", tmp_path / "examples")
    ((_, code, expected),) = snippets(page, "python")
    exec(code, {"__name__": "__main__"})
    assert capsys.readouterr().out == expected


@pytest.mark.slow
def test_pictures_and_recordings_of_a_result(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = []
    monkeypatch.setattr(lw, "show", lambda *arguments, **named: shown.append(arguments))
    record, streamed = lw.record, []
    # A viewer that is open is not there: what would go to it is noted.
    monkeypatch.setattr(lw, "record", lambda *a, to=None, **k: streamed.append(to) if to else record(*a, **k))
    fleet = lw.Ensemble(scene, 20, seed=1, vary={"start.angular_velocity": lw.distributions.Normal(std=0.1)})
    names = {"lw": lw, "fleet": fleet, "result": lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=0.5))}
    names |= {"a": names["result"], "b": names["result"]}
    for page in OF_A_RESULT:
        for code in blocks(page, "python"):
            exec(code, names)
    written = {path.name for path in tmp_path.iterdir()}
    assert {"speed.pdf", "fleet.svg", "fleet.rrd", "both.rrd"} <= written
    assert len(shown) == len(streamed) == 1
