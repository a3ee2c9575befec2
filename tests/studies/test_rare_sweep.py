# SPDX-License-Identifier: Apache-2.0
"""Rare failures of a sweep's cases: closed forms, pairs, files that a resumed sweep finds, and what has none."""

import dataclasses
import json
import pickle

import numpy as np
import pytest
from scipy.special import ndtr

import lgvi_warp as lw
from lgvi_warp.cli.command import main
from lgvi_warp.distributions import Normal
from lgvi_warp.views.plots.sweep_pictures import pictures
from tests.support.json_page import differing
from tests.support.refusals import says

pytestmark = pytest.mark.kernel

# A body without weight that turns by a moment: its place stays as at the start, its way off north is that of the start, and
# the sea floor is met where it starts below it. The compass is noisy, which changes nothing of this.
SCENE = """
events = [{ type = "floor", depth = 4.0 }]
[vehicle]
mass = 50.0
inertia = [4.0, 5.0, 6.0]
buoyancy = 490.3325
[[terms]]
type = "control_wrench"
limit = [0.0, 0.0, 0.0, 0.0, 0.0, 4.0]
[[terms]]
type = "drag"
linear = [0.0, 0.0, 0.0, 2.0, 2.0, 2.0]
[controller]
period = 0.1
sensors = [{ type = "sensor", name = "compass", of = "heading", noise = 0.02 }]
guidance = [{ type = "set_point", position = [0.0, 0.0, 0.0], heading = 1.0 }]
laws = [{ type = "heading_pid", kp = 3.0, ki = 0.1, kd = 4.0, integral_limit = 10.0 }]
[run]
method = "psi_x"
step = 0.1
duration = 0.5
"""
SPREAD, BOUND, FLOOR = 0.8, 3.6, 4.0
VARY = {"start.position[0]": Normal(std=SPREAD), "start.position[2]": Normal(std=SPREAD)}
# The same metric and events in all sweeps of this file, so that they share kernels.
METRICS = [lw.metrics.MaxError("north", name="way")]
OF_FLOOR = ndtr(-FLOOR / SPREAD)
NEAR = 2.0 * ndtr(-BOUND / SPREAD) + OF_FLOOR
# As far off to one side.
OFF = 0.2
FAR = ndtr(-(BOUND - OFF) / SPREAD) + ndtr(-(BOUND + OFF) / SPREAD) + OF_FLOOR
ASIDE = {"guidance": [{"type": "set_point", "position": [OFF, 0.0, 0.0], "heading": 1.0}]}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(SCENE)
    return lw.Scene.load(path)


CASES = [{"name": "near", "rare": True}, {"name": "aside", "replace": ASIDE, "rare": {"relative_error": 0.12}},
         {"name": "unasked", "set": {"heading_pid.kp": 4.0}}]  # fmt: skip


def swept(scene, **more):
    arguments = {"cases": CASES, "vary": VARY, "members": 20, "seed": 3, "metrics": METRICS,
                 "success": {"way": {"below": BOUND}}, "threads": 1}  # fmt: skip
    return lw.sweep(scene, **{**arguments, **more})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("sweep")


@pytest.fixture(scope="module")
def answer(scene, folder):
    return swept(scene, out=folder)


@pytest.mark.slow
def test_rare_failures_are_those_of_the_normal_law(answer):
    for case, p in (("near", NEAR), ("aside", FAR)):
        rare = answer.rare(case)
        assert abs(rare.probability / p - 1.0) < 3.0 * rare.relative_error
        assert rare.event == "way 3.6 or more or not ok"
        way, floor, of_any, of_all = rare.by_condition.items()
        assert [way[0], floor[0], of_any[0], of_all[0]] == ["way 3.6 or more", "floor", "any", "all"]
        # An interval of 95 % misses for one seed in 20; three standard errors for one in 370.
        error = np.log(way[1].upper / way[1].lower) / (2.0 * 1.96)
        assert abs(np.log(way[1].probability / (p - OF_FLOOR))) < 3.0 * error
        assert floor[1].lower <= OF_FLOOR <= floor[1].upper
        assert of_all[1].lower <= (p - OF_FLOOR) * OF_FLOOR <= of_all[1].upper
        # All of them fail, by one of the two ways.
        x, z = (rare.failing.own_values()[f"start.position[{i}]"] for i in (0, 2))
        middle = OFF * (case == "aside")
        assert ((np.abs(x - middle) >= BOUND) | (z >= FLOOR)).all()
    assert (rare.failing.own_values()["start.position[2]"] >= FLOOR).any()


@pytest.mark.ci
def test_rare_failures_run_where_the_cells_do(scene, answer):
    class Counting:
        def __init__(self):
            self.members = 0

        def run(self, work, blocks, advanced):
            for block in blocks:
                self.members += block.count
                yield block, work(block)

    counting = Counting()
    again = swept(scene, cases=CASES[:1], executor=counting).rare("near")
    assert again.probability == answer.rare("near").probability
    assert counting.members >= again.members["the scene's own"] > 10_000


def test_cases_are_compared_by_the_same_failing_members(answer):
    (row,) = answer.compare_rare("near", "aside")
    assert row.ratio.paired
    # An interval of 95 % misses the ratio for one seed in 20; three standard errors for one in 370.
    error = np.log(row.ratio.upper / row.ratio.lower) / (2.0 * 1.96)
    assert abs(np.log(row.ratio.value / (FAR / NEAR))) < 3.0 * error
    assert row.real
    # Two answers to 10 and 12 % would leave it between ends 1.96 times 2 times 16 % apart.
    assert np.log(row.ratio.upper / row.ratio.lower) < 0.8 * 2.0 * 1.96 * np.hypot(0.1, 0.12)
    (back,) = answer.compare_rare("aside", "near")
    assert back.ratio.value == pytest.approx(1.0 / row.ratio.value)
    assert answer.compare_rare("near", "unasked") == []


def test_the_sweep_tells_of_them(answer):
    near, aside, unasked = answer.rows()
    assert near["rare"] == answer.rare("near").probability
    assert near["rare lower"] < near["rare"] < near["rare upper"]
    assert aside["rare members"] > 10_000
    assert "rare" not in unasked
    assert answer.table["rare"].shape == (3,)
    assert np.isnan(answer.table["rare"].values[2])
    text = str(answer)
    says(text, "## Rare failures", "- near: fails with probability", "- aside: fails ", "times as often as near", "not")
    assert "- unasked: fails with" not in text
    with pytest.raises(lw.SceneError, match=r"did not ask for its rare failure. Give the case rare = true"):
        answer.rare("unasked")
    assert pickle.loads(pickle.dumps(answer.rare("near"))).probability == near["rare"]


@pytest.mark.ci
def test_files_of_rare_failures_are_found_again(scene, folder, answer, tmp_path):
    pytest.importorskip("matplotlib")
    names = {path.name for path in answer.save(folder)}
    assert {"rare.csv", "rare_comparison.csv"} <= names
    kept = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in (folder / "rare").iterdir()}
    assert len(kept) == 2
    first = {name: (folder / name).read_bytes() for name in names}
    again = swept(scene, out=folder)
    again.save(folder)
    assert {name: (folder / name).read_bytes() for name in names} == first
    assert {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in (folder / "rare").iterdir()} == kept
    # Files hold no times, which differ from run to run.
    assert np.isnan([again.rare("near").seconds, again.rare("near").plain_seconds]).all()
    timed = {name: getattr(answer.rare("near"), name) for name in ("seconds", "plain_seconds")}
    assert str(dataclasses.replace(again.rare("near"), **timed)) == str(answer.rare("near"))
    np.testing.assert_array_equal(again.rare("near").draws, answer.rare("near").draws)
    rare = json.loads((folder / "sweep.json").read_text())["cells"][0]["rare"]
    assert rare["probability"] == answer.rare("near").probability
    # What is torn is run again, and comes to the same.
    torn = next(iter(kept))
    torn.write_bytes(torn.read_bytes()[:-50])
    assert swept(scene, out=folder).rare("near").probability == rare["probability"]
    assert torn.read_bytes() == kept[torn][1]
    drawn = pictures(answer)["rare.png"](answer, tmp_path / "rare.png")
    assert drawn[0].get_xscale() == "log"
    assert (tmp_path / "rare.png").stat().st_size > 5_000


@pytest.mark.ci
def test_absent_nothing_is_told(scene):
    plain = swept(scene, cases=[{"name": "near"}, {"name": "aside", "replace": ASIDE, "rare": False}], rare=None)
    assert plain.rares is None
    assert plain.compare_rare("near", "aside") == []
    assert "Rare" not in str(plain)
    assert not any(name.startswith("rare") for row in plain.rows() for name in row)
    assert "rare.png" not in pictures(plain)


@pytest.mark.ci
def test_one_member_and_the_same_case_twice(scene):
    cases = [{"name": "one"}, {"name": "two"}, {"name": "not", "rare": False}]
    alone = swept(scene, cases=cases, members=1, rare={"relative_error": 0.3})
    (row,) = alone.compare_rare("one", "two")
    assert row.ratio.value == 1.0
    assert row.ratio.lower < 1.0 < row.ratio.upper
    assert not row.real
    assert alone.rare("one").probability == alone.rare("two").probability
    assert "rare" not in alone.rows()[2]


@pytest.mark.ci
def test_what_always_or_never_fails_is_told_and_the_others_go_on(scene):
    """The bounds of success are one for all: cases are here and there by what they want."""
    far = {"guidance": [{"type": "set_point", "position": [100.0, 0.0, 0.0], "heading": 1.0}]}
    deep = [{"type": "floor", "depth": 1000.0}]
    cases = [{"name": "near"}, {"name": "always", "replace": far},
             {"name": "never", "replace": {"events": deep}, "set": {"start.position": [0.0, 0.0, 0.0]}},
             {"name": "unknown", "set": {"heading_pid.kq": 1.0}}]  # fmt: skip
    some = swept(scene, cases=cases, rare={"relative_error": 0.3})
    assert some.rare("near").probability == pytest.approx(NEAR, rel=1.0)
    rows = some.rows()
    assert "happens for each of" in rows[1]["rare refused"]
    # The compass alone is left to vary, and decides nothing.
    assert "has the same value for most members" in rows[2]["rare refused"]
    assert rows[1]["success"] == 0.0
    assert "rare refused" not in rows[3]
    assert some.compare_rare("near", "always") == []
    says(str(some), "- always: none: ", "- never: none: ")
    with pytest.raises(lw.SceneError, match="happens for each of"):
        some.rare("always")


@pytest.mark.slow
def test_success_by_events_alone_and_by_nothing(scene):
    by_floor = swept(scene, cases=[{"name": "near"}], success=None, rare={"relative_error": 0.3})
    rare = by_floor.rare("near")
    assert abs(rare.probability / OF_FLOOR - 1.0) < 3.0 * rare.relative_error
    assert rare.event == "not ok"
    free = swept(scene, cases=[{"name": "near", "replace": {"events": []}}], success=None, rare=True)
    assert "nothing says how near one is" in free.rows()[0]["rare refused"]


@pytest.mark.parametrize(("more", "words"), [
    ({"rare": 1.0}, "rare = 1.0 is neither true nor a table"),
    ({"rare": {"error": 0.1}}, "rare.error = 0.1 is an unknown key. Did you mean 'relative_error'?"),
    ({"cases": [{"name": "a", "rare": "yes"}]}, "case 'a': rare = 'yes'"),
    ({"cases": [{"name": "a", "rare": {"relative_error": 3.0, "most": 5}}]}, "case 'a': rare.relative_error = 3.0"),
])  # fmt: skip
def test_what_is_asked_wrongly_gets_one_sentence(scene, more, words):
    with pytest.raises(lw.SceneError) as error:
        swept(scene, **more)
    assert words in str(error.value)


@pytest.mark.ci
def test_the_command(tmp_path, capsys):
    text = """
scene = "scene.toml"
members = 20
seed = 3
rare = { relative_error = 0.3 }
[vary]
"start.position[0]" = { normal = { std = 0.8 } }
"start.position[2]" = { normal = { std = 0.8 } }
[[cases]]
name = "near"
[[cases]]
name = "unasked"
rare = false
[[metrics]]
type = "max_error"
of = "north"
name = "way"
[success]
way = { below = 3.6 }
"""
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "sweep.toml").write_text(text)
    out, given = tmp_path / "out", ["sweep", str(tmp_path / "sweep.toml"), "--threads", "1"]
    assert main([*given, "--plan"]) == 0
    assert "rare        1 rare failures beside it" in capsys.readouterr().out
    assert main([*given, "--out", str(out), "--json", "-q"]) == 0
    assert differing(json.loads(capsys.readouterr().out), "sweep") == []
    assert {"rare.csv", "rare_comparison.csv", "rare.png"} <= {path.name for path in out.iterdir()}
    # What nobody fails has no rare failure, and that was asked for.
    (tmp_path / "sweep.toml").write_text(text.replace("below = 3.6", "below = 1e9").replace("0.8", "0.01"))
    assert main([*given, "--out", str(out)]) == 1
    says(capsys.readouterr().out, "- near: none: ", "it never happens, or is rarer than about 1e-15")
