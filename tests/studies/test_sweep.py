# SPDX-License-Identifier: Apache-2.0
"""Sweeps: common random numbers, closed answers, stops and files, worst members to the bit, what is asked wrongly."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.cli.command import main
from lgvi_warp.common.status import failed
from lgvi_warp.distributions import Choice, Normal, Uniform
from lgvi_warp.runs.settle import make_plan
from tests.support.json_page import differing

pytestmark = pytest.mark.kernel

MEMBERS = 300
METRICS = ["overshoot heading", lw.metrics.MaxError("north", name="way"), lw.metrics.RMSError("heading"),
           lw.metrics.SteadyStateError("heading")]  # fmt: skip
CASES = [{"name": "soft"}, {"name": "stiff", "set": {"heading_pid.kp": 8.0}},
         {"name": "unknown", "set": {"heading_pid.kq": 1.0}}]  # fmt: skip
GRID = {"controller.delay": [0.02, 0.04]}
# The same in all sweeps of this file, so that they share one kernel.
SUCCESS = {"way": {"below": 1.0}}


# A body that turns by a moment, and has no force ahead: its way off north is as at the start.
SCENE = """
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
delay = 0.02
sensors = [{ type = "sensor", name = "compass", of = "heading", noise = 0.02 }]
guidance = [{ type = "set_point", position = [0.0, 0.0, 0.0], heading = 1.0 }]
laws = [{ type = "heading_pid", kp = 3.0, ki = 0.1, kd = 4.0, integral_limit = 10.0 }]
[run]
method = "psi_x"
step = 0.02
duration = 8.0
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(SCENE)
    return lw.Scene.load(path)


VARY = {"start.position[0]": Normal(std=0.8), "vehicle.mass": Uniform(low=45.0, high=55.0),
        "heading_pid.kp": Uniform(low=2.0, high=4.0)}  # fmt: skip


def swept(scene, out=None, **more):
    arguments = {"cases": CASES, "grid": GRID, "vary": VARY, "members": MEMBERS, "seed": 3, "metrics": METRICS,
                 "success": SUCCESS}  # fmt: skip
    return lw.sweep(scene, out=out, **{**arguments, **more})


@pytest.fixture(scope="module")
def found(scene):
    return swept(scene)


@pytest.mark.ci
def test_a_case_that_is_refused_is_noted_and_the_others_go_on(found):
    rows = found.rows()
    assert [row["case"] for row in rows] == [name for name in ("soft", "stiff", "unknown") for _ in range(2)]
    assert [bool(row["refused"]) for row in rows] == [False] * 4 + [True] * 2
    assert "Did you mean 'heading_pid.kp'" in rows[4]["refused"]
    assert "refused" in str(found)
    assert found.table["success"].shape == (3, 2)
    assert np.isnan(found.table["success"].values[2]).all()
    with pytest.raises(lw.SceneError, match="was refused"):
        found.success("unknown", {"controller.delay": 0.02})


@pytest.mark.ci
def test_members_are_the_same_in_all_cells_bit_by_bit(found, scene):
    cells = [cell for cell in found.cells if not found.record(cell).refused]
    inputs = [found.inputs(cell) for cell in cells]
    for name in ("start.position[0]", "vehicle.mass"):
        assert all(values[name].tobytes() == inputs[0][name].tobytes() for values in inputs)
    assert [cell.fixed for cell in cells] == [(), (), ("heading_pid.kp",), ("heading_pid.kp",)]
    # What the compass shows at the first tick, before the loop has acted, has the same noise in every case.
    save = lw.SaveAt(every=4.0, fields=("attitude", "measured_heading"))
    first = [found.again(cell.case.name, [0, 7, 299], cell.point, save).measured_heading[0] for cell in cells]
    assert all(heading.tobytes() == first[0].tobytes() for heading in first)
    assert len(np.unique(first[0])) == 3
    # The members are those of a run by itself, of any number of them.
    alone = lw.Ensemble(scene, 20, 3, VARY)
    assert alone.parameters(0, 20)["vehicle.mass"].tobytes() == inputs[0]["vehicle.mass"][:20].tobytes()


def test_cells_that_differ_in_numbers_share_a_kernel(found):
    soft, late, stiff = (found.cells[i].fleet for i in (0, 1, 2))
    signals = ("attitude", "position", "reference_heading", "reference_position")
    kernels = [make_plan(fleet, save=lw.SaveAt(fields=signals)).kernel.advance for fleet in (soft, stiff)]
    assert kernels[0] is kernels[1]
    assert late is not None


def test_success_is_that_of_the_normal_distribution(found):
    # The way off north is as at the start: within 1 m with 0.8 m of standard deviation.
    expected = stats.norm.cdf(1.0 / 0.8) - stats.norm.cdf(-1.0 / 0.8)
    x = found.inputs(found.cells[0])["start.position[0]"]
    for cell in found.cells[:4]:
        value, lower, upper = found.success(cell.case.name, cell.point)
        assert value == np.mean(np.abs(x) < 1.0)
        assert lower < expected < upper
        assert (lower, upper) == pytest.approx(
            tuple(stats.binomtest(int(value * 300 + 0.5), 300).proportion_ci(0.95, "wilson"))
        )
    assert sorted(found.members("soft", True, {"controller.delay": 0.02})) == np.flatnonzero(np.abs(x) >= 1.0).tolist()


def test_causes_are_what_decides(found):
    at = {"controller.delay": 0.02}
    rows = found.causes("soft", at)
    # Success is a function of the start alone: a band of it, which no slope shows. 13 bins, of which two are mixed.
    assert rows[0]["input"] == "start.position[0]"
    assert rows[0]["share"] > 0.8
    assert rows[0]["p"] < 1e-9
    assert all(row["p"] > 0.01 and row["share"] < 0.1 for row in rows[1:])
    gain = found.causes("soft", at, of="rms heading")[0]
    x, y = found.inputs(found.cells[0])["heading_pid.kp"], found.values("soft", "rms heading", at)
    assert gain["input"] == "heading_pid.kp"
    assert np.sign(gain["slope"]) == np.sign(np.corrcoef(x, y)[0, 1])
    assert "start.position[0] (explains" in str(found)


def test_the_worst_corner_is_the_one_known(found):
    x = found.inputs(found.cells[0])["start.position[0]"]
    worst = found.worst(3, by="way", case="stiff")
    assert {row["member"] for row in worst[:2]} == {int(np.argmax(np.abs(x)))}
    assert worst[0]["way"] == np.abs(x).max()
    assert worst[0]["start.position[0]"] == x[np.argmax(np.abs(x))]


@pytest.mark.ci
def test_the_worst_again_alone_have_their_bits(found, scene):
    at = {"controller.delay": 0.04}
    rows = found.worst(5, by="rms heading", case="stiff")
    members = sorted({row["member"] for row in rows})
    save = lw.SaveAt(every=0.1, fields=("position", "attitude", "reference_heading", "reference_position"))
    again = found.again("stiff", members, at, save)
    whole = lw.solve(found.cell("stiff", at).fleet, save=save)
    for name in save.fields:
        assert again.samples[name].tobytes() == np.ascontiguousarray(whole.samples[name][:, members]).tobytes()
    way = np.abs(again.position[..., 0]).max(axis=0)
    assert way.tobytes() == found.values("stiff", "way", at)[members].tobytes()


def test_a_comparison_sees_what_common_members_show(found):
    rows = {row.of: row for row in found.compare("soft", "stiff", {"controller.delay": 0.02})}
    same = rows["success"]
    assert (same.difference.value, same.only) == (0.0, (0, 0))
    assert not same.real
    assert same.p == 1.0
    assert rows["way"].difference[:3] == (0.0, 0.0, 0.0)
    assert not rows["way"].real
    x, y = (found.values(case, "rms heading", {"controller.delay": 0.02}) for case in ("soft", "stiff"))
    expected = stats.ttest_rel(y, x)
    assert rows["rms heading"].difference.p == pytest.approx(expected.pvalue, rel=1e-9)
    assert rows["rms heading"].real


def files_of(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()
    }


@pytest.mark.ci
def test_a_sweep_that_was_stopped_goes_on_with_the_same_bytes(scene, tmp_path, found):
    class StopError(Exception):
        pass

    def stop(share):
        if share > 0.4:
            raise StopError

    with pytest.raises(StopError):
        swept(scene, tmp_path / "stopped", progress=stop)
    kept = files_of(tmp_path / "stopped")
    assert 1 <= len(kept) < 4
    shares = []
    swept(scene, tmp_path / "stopped", progress=shares.append).save(tmp_path / "stopped")
    swept(scene, tmp_path / "whole", threads=1).save(tmp_path / "whole")
    one, other = files_of(tmp_path / "stopped"), files_of(tmp_path / "whole")
    assert one == other
    assert kept.items() <= one.items()
    assert shares[-1] == 1.0
    assert {
        "table.csv",
        "sweep.json",
        "worst.csv",
        "comparison.csv",
        "ranking.csv",
        "causes.csv",
        "summary.md",
    } <= one.keys()
    assert json.loads(one["sweep.json"])["ensemble"]["members"] == MEMBERS
    # A record that is torn, and one whose numbers changed, run again.
    torn = next((tmp_path / "whole" / "cells").iterdir())
    torn.write_bytes(torn.read_bytes()[:-100])
    swept(scene, tmp_path / "whole")
    assert files_of(tmp_path / "whole") == other
    more = swept(scene, tmp_path / "whole", cases=[*CASES, {"name": "third", "set": {"heading_pid.kd": 5.0}}])
    assert len(list((tmp_path / "whole" / "cells").iterdir())) == 6
    assert len(more.cells) == 8
    assert more.values("soft", "rms heading", {"controller.delay": 0.02}).tobytes() == found.values(
        "soft", "rms heading", {"controller.delay": 0.02}).tobytes()  # fmt: skip


@pytest.mark.ci
def test_a_metric_of_what_a_case_does_not_want_refuses_the_case(scene):
    level = {"guidance": [{"type": "set_point", "depth": 0.0, "heading": 1.0}]}
    mixed = swept(scene, grid=None, members=4, cases=[{"name": "place"}, {"name": "level", "replace": level}])
    place, refused = mixed.rows()
    assert not place["refused"]
    assert "metrics = 'way' is of the north, and no guidance of the scene wants a position" in refused["refused"]
    with pytest.raises(lw.SceneError, match="no guidance of the scene wants a position"):
        lw.worst_case(mixed.cells[1].fleet, {"vehicle.mass": (45.0, 55.0)}, "iae north", budget=64)


@pytest.mark.ci
def test_members_that_fail_do_not_pass_and_come_first(scene):
    bad = swept(scene, grid=None, cases=None, vary={**VARY, "start.velocity[0]": Choice([0.0, 1e307], [0.9, 0.1])})
    record = bad.record(bad.cells[0])
    lost = failed(record.status)
    assert 0 < lost.sum() < MEMBERS
    assert not bad.passed(bad.cells[0])[lost].any()
    worst, ends = bad.worst(2), record.numbers["time_to_failure"]
    assert all(lost[row["member"]] for row in worst)
    assert [row["time_to_failure"] for row in worst] == sorted(ends)[:2]
    assert min(ends) < 8.0
    (row,) = bad.rows()
    assert row["failed"] == row["way missing"] == lost.sum()


@pytest.mark.ci
def test_the_command_writes_everything(scene, tmp_path, capsys):
    text = """
scene = "scene.toml"
members = 40
[run]
duration = 4.0
[vary]
"heading_pid.kp" = { uniform = { low = 2.0, high = 4.0 } }
"start.position[0]" = { normal = { std = 0.8 } }
"vehicle.mass" = { uniform = { low = 45.0, high = 55.0 } }
[[cases]]
name = "pid"
[[cases]]
name = "stiff"
set = { "heading_pid.kp" = 8.0 }
[grid]
"controller.delay" = [0.02, 0.04]
[[metrics]]
type = "overshoot"
of = "heading"
[[metrics]]
type = "max_error"
of = "position"
[success]
"overshoot heading" = { below = 0.05 }
[compare]
baseline = "stiff"
"""
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "sweep.toml").write_text(text)
    assert main(["sweep", str(tmp_path / "sweep.toml"), "--plan"]) == 0
    assert "cells       4: 2 cases at 2 points" in capsys.readouterr().out
    out = tmp_path / "out"
    assert main(["sweep", str(tmp_path / "sweep.toml"), "--out", str(out), "--record", "2", "--seed", "4"]) == 0
    names = {path.name for path in out.iterdir()}
    assert {
        "table.csv",
        "sweep.json",
        "worst.csv",
        "success.png",
        "metrics.png",
        "differences.png",
        "causes.png",
        "responses.png",
        "summary.md",
    } <= names
    assert any(name.startswith("worst_") and name.endswith(".rrd") for name in names)
    assert json.loads((out / "sweep.json").read_text())["baseline"] == "stiff"
    # For programs: the same cells again, the folder, and the plan.
    capsys.readouterr()
    for name, code, given in (
        ("sweep", 0, ["sweep", str(tmp_path / "sweep.toml"), "--out", str(out), "--seed", "4"]),
        ("info of a folder", 0, ["info", str(out)]),
        ("sweep with plan", 0, ["sweep", str(tmp_path / "sweep.toml"), "--plan"]),
    ):
        assert main([*given, "--json", "-q"]) == code
        assert differing(json.loads(capsys.readouterr().out), name) == []
    assert main(["info", str(out)]) == 0
    assert "# Sweep" in capsys.readouterr().out
    assert main(["plot", str(out)]) == 0
    assert "by the same lgvi-warp sweep" in capsys.readouterr().err
    (tmp_path / "sweep.toml").write_text(text.replace('overshoot heading" = { below', 'overshot heading" = { below'))
    assert main(["sweep", str(tmp_path / "sweep.toml"), "--out", str(out)]) == 2
    assert "Did you mean 'overshoot heading'" in capsys.readouterr().err


@pytest.mark.parametrize(("more", "text"), [
    ({"success": {"overshot": {"below": 1.0}}}, "is not a metric of this sweep"),
    ({"success": {"way": {"under": 1.0}}}, "is not a condition"), ({"success": {"status": "fine"}}, "success.status"),
    ({"metrics": ["overshoot headin"]}, "Did you mean 'heading'"), ({"cases": [{"set": {}}]}, "has no name"),
    ({"grid": {"controller.delay": []}}, "not a list of values"), ({"baseline": "hard"}, "baseline"),
    ({"interval": "wald"}, "interval"),
    ({"keep": "all"}, "is what a sweep decides"),
])  # fmt: skip
def test_what_is_asked_wrongly_gets_one_sentence(scene, more, text):
    with pytest.raises(lw.SceneError, match=text):
        swept(scene, **more)


@pytest.mark.slow
def test_a_command_that_is_killed_goes_on_with_the_same_bytes(tmp_path):
    text = """
scene = "scene.toml"
members = 20000
[vary]
"start.position[0]" = { normal = { std = 0.8 } }
[grid]
"heading_pid.ki" = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3]
[[metrics]]
type = "rms"
of = "heading"
"""
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "sweep.toml").write_text(text)
    command = [sys.executable, "-m", "lgvi_warp.cli", "sweep", str(tmp_path / "sweep.toml"), "--quiet", "--out"]
    process = subprocess.Popen([*command, str(tmp_path / "killed")])
    cells = tmp_path / "killed" / "cells"
    while process.poll() is None and not (cells.is_dir() and any(cells.glob("*.npz"))):
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    done = {path.name for path in cells.glob("*.npz")}
    assert 0 < len(done) < 6
    before = {name: (cells / name).stat().st_mtime_ns for name in done}
    for name in ("killed", "whole"):
        subprocess.run([*command, str(tmp_path / name)], check=True)
    assert before == {name: (cells / name).stat().st_mtime_ns for name in done}
    drawn = {name: {path: data for path, data in files_of(tmp_path / name).items() if not path.endswith(".png")}
             for name in ("killed", "whole")}  # fmt: skip
    assert drawn["killed"] == drawn["whole"]
    assert len(drawn["whole"]) == 6 + 7


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings", [{"threads": 1}, {"threads": 3}, {"executor": "processes", "threads": 2}, {"width": 4}]
)
def test_executors_and_threads_change_no_bit(scene, found, settings):
    again = swept(scene, cases=CASES[:1], members=MEMBERS, **settings)
    for metric in found.metrics:
        at = {"controller.delay": 0.04}
        same = again.values("soft", metric, at).tobytes() == found.values("soft", metric, at).tobytes()
        # Another width is another kernel: the same to round-off.
        assert same or ("width" in settings and np.allclose(
            again.values("soft", metric, at), found.values("soft", metric, at), rtol=1e-9, atol=1e-9))  # fmt: skip
