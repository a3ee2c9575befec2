# SPDX-License-Identifier: Apache-2.0
"""The snippets of the pages on metrics and sweeps run as they stand, and so do the examples of sweeps, with fewer members."""

import random

import pytest

import lgvi_warp as lw
from lgvi_warp.criteria.success import success_of
from lgvi_warp.robustness.sweeps.file import arguments_of_file
from lgvi_warp.robustness.sweeps.setup import setup_of
from tests.conftest import ROOT
from tests.support.pages import blocks

pytestmark = pytest.mark.kernel

SCENE = ROOT / "examples" / "scenes" / "remus_100_autopilot.toml"
METRICS, GUIDE = "docs/controllers/metrics.md", "docs/guide/is_my_controller_robust.md"


@pytest.mark.slow
@pytest.mark.parametrize("page", [METRICS, GUIDE])
def test_python(page, monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {}
    for text in blocks(page, "python"):
        exec(text, names)
    assert "found" in names or names["metric"].unit == "rad"


def test_toml(tmp_path):
    text, rare = blocks(GUIDE, "toml")
    (tmp_path / "sweep.toml").write_text(text)
    (tmp_path / "remus_100_autopilot.toml").write_text(SCENE.read_text())
    arguments = arguments_of_file(tmp_path / "sweep.toml")
    assert [case["name"] for case in arguments["cases"]] == ["pid", "stiff"]
    assert arguments["t1"] == 60.0
    (tmp_path / "rare.toml").write_text(f'scene = "remus_100_autopilot.toml"\n{rare}')
    asked = arguments_of_file(tmp_path / "rare.toml")
    setup = setup_of(asked["scene"], asked["cases"], None, None, 4, 0, None, (), {}, asked["rare"])
    assert [case.rare for case in setup.cases] == [True, False]
    (text,) = blocks(METRICS, "toml")
    (tmp_path / "scene.toml").write_text(SCENE.read_text() + text)
    assert lw.Scene.load(tmp_path / "scene.toml").run.statistics[0].key == "settling_time depth"


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted((ROOT / "examples" / "sweeps").glob("*.toml")), ids=lambda path: path.stem)
def test_examples(path):
    arguments = arguments_of_file(path)
    found = lw.sweep(**{**arguments, "members": 8})
    assert not any(row["refused"] for row in found.rows())
    assert len(str(found)) > 100


@pytest.mark.slow
def test_mutated_files_are_refused_in_words(tmp_path):
    """Lines dropped, keys misspelt and values replaced: a sweep, or a SceneError, and nothing else."""
    rng = random.Random(1)
    junk = ["1", "-1", '"x"', "[]", "{}", "true", "nan", "inf", "[[1]]", '""', "{ a = 1 }", '["a", "b"]', "2020-01-01"]
    path = ROOT / "examples" / "sweeps" / "heading_laws.toml"
    lines = path.read_text().replace("../scenes", str(SCENE.parent)).splitlines()
    refused = 0
    for _ in range(400):
        mutated = list(lines)
        for _ in range(rng.choice([1, 1, 2])):
            i, how = rng.randrange(len(mutated)), rng.random()
            if how < 0.3:
                del mutated[i]
            elif how < 0.9 and "=" in mutated[i]:
                mutated[i] = mutated[i].split("=")[0] + "= " + rng.choice(junk)
            else:
                mutated[i] = mutated[i].replace("e", "q", 1)
        (tmp_path / "sweep.toml").write_text("\n".join(mutated))
        try:
            arguments = arguments_of_file(tmp_path / "sweep.toml")
            about = {
                name: arguments.pop(name, None) for name in ("cases", "grid", "vary", "members", "seed", "sampling")
            }
            success = arguments.pop("success", None)
            setup = setup_of(arguments["scene"], metrics=arguments.get("metrics", ()), settings={}, **about)
            success_of(success, tuple(setup.metrics))
            for case, point in setup.cells:
                setup.fleet(case, point)
        except lw.SceneError:
            refused += 1
    assert 100 < refused < 400
