# SPDX-License-Identifier: Apache-2.0
"""The report's page without a run: its heading, the scene as it was written, pictures that suit it, and what it cannot do."""

import csv
import dataclasses
import json
import re
import sys
import time
from html import unescape

import numpy as np
import pytest
from PIL import Image

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.results.varied import varied
from lgvi_warp.views.pages.run_again import how_to_run_again, shortened
from lgvi_warp.views.plots.inputs import inputs_by_outcome
from tests.conftest import ROOT
from tests.unit.views import test_recording

TEXT = """# A heavy REMUS, as ballasted in May.
[vehicle]
name = "remus_100"       # of the package
buoyancy = 285.0         # N
[[events]]
type = "floor"
depth = 16.0
[[events]]
type = "surface"
depth = 4.0
[run]
method = "psi_s"
step = 0.01
duration = 1.0
"""
AUTOPILOT = ROOT / "examples" / "scenes" / "remus_100_autopilot.toml"


def fleet(*arguments, **named):
    """A run of the recordings' fleet, with a machine."""
    result = test_recording.fleet(*arguments, **named)
    machine = {"machine": {"cpu": "a processor", "threads": 2}}
    return dataclasses.replace(result, provenance=dict(result.provenance) | machine)


def of_file(tmp_path, text=TEXT, overrides=None):
    """A run of a scene file."""
    path = tmp_path / "dive.toml"
    path.write_text(text)
    scene = lw.Scene.load(path, overrides)
    result = fleet(scene=scene)
    result = with_ensemble(result, lw.Ensemble.from_scene(scene))
    return dataclasses.replace(result, provenance=dict(result.provenance) | {"source": dict(scene.source)})


def with_ensemble(result, ensemble):
    """A run of an ensemble."""
    return dataclasses.replace(result, provenance=dict(result.provenance) | {"ensemble": ensemble.to_dict()})


def page_of(result, tmp_path):
    """The text of a report."""
    return lw.report(result, tmp_path / "report.html").read_text(encoding="utf-8")


def last_pre(text):
    """The last preformatted text of a page: the scene."""
    return unescape(re.findall("<pre>(.*?)</pre>", text, re.DOTALL)[-1])


def test_the_scene_is_as_the_user_wrote_it(tmp_path):
    text = page_of(of_file(tmp_path, overrides={"vehicle.buoyancy": "286.0", "ensemble.members": "3"}), tmp_path)
    assert last_pre(text) == TEXT
    assert "<title>dive: remus_100</title>" in text
    assert "<h1>dive: remus_100</h1>" in text
    assert "lgvi-warp run dive.toml --set vehicle.buoyancy=286.0 --set ensemble.members=3</pre>" in text
    assert time.strftime("%Y-%m-%d") in text


def test_settings_that_a_script_gave_are_in_the_command(tmp_path):
    result = of_file(tmp_path)
    told = dict(result.provenance) | {"step": 0.02, "steps": 500, "dtype": "float32", "method": {"name": "rk4"}}
    command, *_ = how_to_run_again(told)
    assert command == "lgvi-warp run dive.toml --method rk4 --step 0.02 --duration 10 --dtype float32"
    assert how_to_run_again(result.provenance)[0] == "lgvi-warp run dive.toml"
    stepped = {"name": "rk5", "rtol": 1e-9, "atol": 1e-8}
    told = dict(result.provenance) | {"method": stepped, "checks": "all", "on_failure": "substep"}
    wanted = "--method rk5 --rtol 1e-09 --atol 1e-08 --checks all --on-failure substep"
    assert how_to_run_again(told)[0] == f"lgvi-warp run dive.toml {wanted}"


@pytest.mark.parametrize(
    "tail", ["", '[ensemble]\nmembers = 9\n[ensemble.vary]\n"vehicle.buoyancy" = { normal = { std = 1.0 } }\n']
)
@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_an_ensemble_of_python_is_in_the_scene_that_runs_it_again(tmp_path, tail, sampling):
    overrides = {"ensemble.members": "3", "vehicle.buoyancy": "286.0"}
    result = of_file(tmp_path, TEXT + tail, overrides)
    scene = lw.Scene.load(tmp_path / "dive.toml", overrides)
    vary = {
        "start.angular_velocity": lw.distributions.Normal(std=2.0),
        "vehicle.buoyancy": lw.distributions.Uniform(low=280.0, high=290.0),
    }
    drawn = lw.Ensemble(scene, members=4, seed=7, vary=vary, sampling=sampling).subset([1, 3])
    command, said, text = how_to_run_again(with_ensemble(result, drawn).provenance)
    assert command == "lgvi-warp run dive.toml --set vehicle.buoyancy=286.0"
    assert "given in Python" in said
    assert "# A heavy REMUS, as ballasted in May." in text
    (tmp_path / "dive.toml").write_text(text)
    loaded = lw.Ensemble.from_scene(lw.Scene.load(tmp_path / "dive.toml", {"vehicle.buoyancy": "286.0"}))
    ours, theirs = (ensemble.select(0, 2) for ensemble in (drawn, loaded))
    np.testing.assert_array_equal(ours.angular_velocity, theirs.angular_velocity)
    np.testing.assert_array_equal(ours.parameters["vehicle.buoyancy"], theirs.parameters["vehicle.buoyancy"])
    # The scene's own ensemble is no such one.
    command, said, text = how_to_run_again(with_ensemble(result, lw.Ensemble.from_scene(scene)).provenance)
    assert text == TEXT + tail
    assert "--set ensemble.members=3" in command
    assert "Python" not in said


def test_numbers_of_python_are_in_no_file(tmp_path):
    result = of_file(tmp_path)
    scene = lw.Scene.load(tmp_path / "dive.toml")
    given = lw.Ensemble.from_states(
        scene, np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), np.ones((2, 3))
    )
    command, said, text = how_to_run_again(with_ensemble(result, given).provenance)
    assert command is None
    assert "run the script again" in said
    assert text == TEXT


@pytest.mark.ci
def test_a_scene_of_no_file_names_its_vehicle(tmp_path):
    import tomllib

    scene = lw.Scene.named(
        "remus_100", vehicle={"buoyancy": 285.0}, terms=[{"type": "current", "velocity": [0.1, 0.0, 0.0]}]
    )
    short = shortened(scene.to_dict())
    assert short["vehicle"] == {"name": "remus_100", "buoyancy": 285.0}
    assert len(short["terms"]) == 1
    page = page_of(with_ensemble(fleet(scene=scene), lw.Ensemble.from_scene(scene)), tmp_path)
    assert lw.Scene.from_dict(tomllib.loads(last_pre(page))).to_dict() == scene.to_dict()
    # Where the vehicle's own terms are not there, its numbers are written out.
    bare = dataclasses.replace(scene, terms=())
    assert shortened(bare.to_dict()) == bare.to_dict()
    nameless = lw.Scene(lw.Vehicle(mass=1.0, inertia=(1.0, 1.0, 1.0)))
    assert shortened(nameless.to_dict()) == nameless.to_dict()
    assert "<h1>Run</h1>" in page_of(fleet(scene=nameless), tmp_path)


def test_what_a_file_says_is_text(tmp_path):
    result = of_file(tmp_path, TEXT + "# </pre><script>alert(1)</script>\n")
    result.provenance["source"]["file"] = "<b>;rm -rf.toml"
    text = page_of(result, tmp_path)
    assert "<script>" not in text
    assert "<b>" not in text
    assert "lgvi-warp run '<b>;rm -rf.toml'" in unescape(text)


@pytest.mark.ci
@pytest.mark.parametrize("source", [{}, {"text": 3}, {"text": None, "file": "a"}])
def test_without_a_text_of_a_file_its_tables_are_told(tmp_path, source):
    result = of_file(tmp_path)
    result.provenance["source"] = source
    assert "[vehicle]" in last_pre(page_of(result, tmp_path))


@pytest.mark.ci
def test_pictures_suit_the_run(tmp_path):
    """One outcome: the summary. Two, and inputs that vary: the inputs as well. No samples: the shares."""
    ends = fleet(400)
    rng = np.random.default_rng(7)
    buoyancy = np.where(np.asarray(ends.status) == lw.Status.SURFACE, 280.0, 300.0) + rng.normal(size=ends.members)
    drawn = dict(ends.parameters) | {"vehicle.buoyancy": buoyancy,
                                     "vehicle.weight": 299.0 + rng.normal(size=ends.members)}  # fmt: skip
    varies = dataclasses.replace(ends, parameters=drawn)
    assert page_of(varies, tmp_path).count("<svg") == 2  # their speeds at the start vary too
    assert page_of(dataclasses.replace(varies, samples={}), tmp_path).count("<svg") == 2
    calm = fleet(9, 5, scene=lw.Scene.named("remus_100"))
    calm = dataclasses.replace(calm, status=0 * calm.status, failure_time=np.nan * calm.failure_time)
    assert page_of(calm, tmp_path).count("<svg") == 1
    axes = inputs_by_outcome(varies)
    assert axes.get_xlabel().startswith("vehicle.buoyancy: explains ")
    marks = {one.get_label(): len(one.get_offsets()) for one in axes.collections}
    counts = ends.status.counts()
    assert marks == {f"{name} ({number})": number for name, number in counts.items()}
    assert "vehicle.buoyancy" in varied(varies)
    assert "vehicle.center_of_buoyancy" not in varied(varies)


def test_faults_are_told(tmp_path):
    result = fleet(scene=lw.Scene.load(AUTOPILOT))
    assert "fault stuck_rudder: control_fins[0] times 0 plus 0.1, from 40 s" in page_of(result, tmp_path)


def sweep_in(folder):
    """Files of a sweep, in short."""
    (folder / "sweep.json").write_text(json.dumps({"members": 20, "cells": [1, 2]}))
    (folder / "summary.md").write_text("# Sweep\nlqr passes <95 %> of 20\n")
    with (folder / "table.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["case", "success"], ["pid", "0.5"], ["lqr", "0.95"]])
    (folder / "success.png").write_bytes(b"\x89PNG")


def test_a_page_of_a_sweep_has_its_pictures_after_its_date_in_their_order(tmp_path):
    sweep_in(tmp_path)
    for name in ("a", "causes", "metrics", "success"):
        Image.new("RGB", (4, 4)).save(tmp_path / f"{name}.png")
    text = page_of(tmp_path, tmp_path)
    assert text.count("<img") == 4
    for told in ("lqr passes &lt;95 %&gt; of 20", "<td>lqr</td><td>0.95</td>", "&quot;members&quot;: 20",
                 f"<h1>Sweep of {tmp_path.name}</h1>"):  # fmt: skip
        assert told in text
    words = [f"Sweep of {time.strftime('%Y-%m-%d')}", "<h2>Success</h2>", "<h2>Metrics</h2>", "<h2>Causes</h2>",
             "<h2>A</h2>"]  # fmt: skip
    places = [text.index(word) for word in words]
    assert places == sorted(places)


def test_a_folder_of_several_has_all_of_them(tmp_path):
    fleet(9, 5).save(tmp_path / "result.npz")
    sweep_in(tmp_path)
    for name in ("stability_mass", "stability_omega", "sensitivity"):
        (tmp_path / f"{name}.json").write_text('{"seed": 3}')
        (tmp_path / f"{name}.csv").write_text(f"method,cells\npsi,{name}\n")
        (tmp_path / f"{name}.png").write_bytes(b"\x89PNG")
    (tmp_path / "fleet.png").write_bytes(b"an old picture of the run, which is drawn anew")
    text = page_of(tmp_path, tmp_path)
    for name in ("stability_mass", "stability_omega", "sensitivity"):
        assert f"<td>{name}</td>" in text
        assert f'<img alt="{name}"' in text
    assert "<h1>remus_100</h1>" in text
    assert 'alt="fleet"' not in text
    assert "<td>lqr</td>" in text
    assert text.count("<svg") == 2


@pytest.mark.parametrize("damage", ["{", "[1]", "3"])
def test_a_damaged_study_is_told_in_a_line(tmp_path, damage, capsys):
    (tmp_path / "tradeoff.json").write_text(damage)
    assert cli.main(["report", str(tmp_path)]) == 2
    assert "tradeoff.json is damaged" in capsys.readouterr().err
    assert not (tmp_path / "report.html").exists()


WITHOUT = {
    "report": lambda folder: ["report", str(folder)],
    "plot": lambda folder: ["plot", str(folder)],
    "view": lambda folder: ["view", str(folder), "--out", str(folder / "a.rrd")],
    "run --live": lambda folder: ["run", str(ROOT / "examples" / "paper.toml"), "--live", "--out", str(folder / "run")],
    "sensitivity": lambda folder: ["sensitivity", str(ROOT / "examples" / "paper.toml"), "--out", str(folder / "s"),
                                   "--of", "depth", "--analysis", "morris", "--samples", "4", "--duration", "0.1"],
}  # fmt: skip


@pytest.mark.parametrize("verb", [*[verb for verb in WITHOUT if verb != "sensitivity"],
                                  pytest.param("sensitivity", marks=pytest.mark.kernel)])  # fmt: skip
def test_a_plain_install_ends_in_a_line_and_one_exit_code(verb, tmp_path, monkeypatch, capsys):
    """Libraries of extras are not there: what a verb cannot do without is named with its extra."""
    fleet(9, 5).save(tmp_path / "result.npz")
    for name in (
        "matplotlib",
        "matplotlib.figure",
        "tomlkit",
        "rerun",
        "SALib",
        "SALib.sample",
        "SALib.analyze.morris",
    ):
        monkeypatch.setitem(sys.modules, name, None)
    assert cli.main(WITHOUT[verb](tmp_path)) == 2
    said = capsys.readouterr()
    remedy = r"lgvi-warp: .* need .*: .*pip install '.*\[\w+\]'\n"
    assert re.fullmatch(remedy, said.err.rpartition("\r")[2]), said.err
    assert "Traceback" not in said.err
    assert not (tmp_path / "report.html").exists()
