# SPDX-License-Identifier: Apache-2.0
"""Answers of studies are saved, read back to the bit, and shown in a report."""

import dataclasses
import html
import json

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli.folders import contents
from tests.support.refusals import refused, says

BALL = lw.Scene.named("sphere")
RUN = {"method": "psi_s", "h": 0.1}


def tuned():
    return lw.studies.Tuned(
        {"heading_pid.kp": 3.0}, {"heading_pid.kp": 1.0}, 0.1, np.inf, 0.3, "depth", "mean", 4, 16, ("heading_pid.kp",),
        np.array([0.1, np.inf]), 96,
    )  # fmt: skip


def steady():
    method = lw.Method("psi_s", tolerance=1e-11)
    start = lw.Start(position=[1.0, 2.0, 3.0], velocity=[0.5, 0.0, 0.1])
    return lw.linear.Trim(start, {"thrusters": np.array([0.25, -0.5])}, {"pitch": 0.1, "thrusters[0]": 0.25}, {"roll": 0.0},
                          np.full(6, 1e-13), method, 0.02)  # fmt: skip


def assimilated():
    fleet = lw.Ensemble(BALL, 8, 0, {"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
    depths = lw.studies.Series("depth", [0.2, 0.4], [0.1, np.pi], 0.5)
    return lw.assimilate(fleet, depths, ["vehicle.buoyancy"], filter="enkf", **RUN)


def estimated():
    return lw.estimate(lw.Ensemble(BALL, 1, 0, {"start.position[2]": lw.distributions.Normal(std=1.0)}), "mean depth", 0.1,
                       t1=0.2, **RUN)  # fmt: skip


MADE = {"tune_gains": tuned, "trim": steady, "assimilate": assimilated, "estimate": estimated}


@pytest.mark.ci
@pytest.mark.parametrize("name", MADE)
def test_an_answer_is_saved_read_and_reported(name, tmp_path):
    found = MADE[name]()
    assert found.study == name
    files = found.save(tmp_path)
    assert files[:2] == [tmp_path / f"{name}.json", tmp_path / f"{name}.csv"]
    again = type(found).load(files[0])
    assert again.to_json() == type(found).load(tmp_path).to_json() == found.to_json()
    assert str(again) == str(found)
    for item in dataclasses.fields(found):
        if item.name not in ("final", "provenance", "settings", "start"):
            np.testing.assert_equal(getattr(again, item.name), getattr(found, item.name))
    assert len(files[1].read_text().splitlines()) == 1 + len(list(found.rows()))
    (held,) = contents(tmp_path)
    assert type(held.load()) is type(found)
    page = lw.report(tmp_path, tmp_path / "report.html").read_text()
    assert f"<p>{html.escape(found.answer)}</p>" in page
    assert page.count(html.escape(found.answer)) == 1
    says(page, "Settings of the study", name.replace("_", " ").capitalize())
    if name == "estimate":
        says(page, "recipe", "estimator", str(found.recipe["seed"]))


@pytest.mark.ci
def test_a_run_goes_on_from_an_assimilation_that_was_read(tmp_path):
    """The end is kept to the bit, with what actuators and controllers remember."""
    found = assimilated()
    found.save(tmp_path)
    again = lw.studies.Assimilated.load(tmp_path / "assimilate.json")
    for name, rows in found.final.to_arrays().items():
        np.testing.assert_array_equal(again.final.to_arrays()[name], rows)
    run = lw.prepare(BALL, ["vehicle.buoyancy"], of="depth", t1=1.0, **RUN)
    depths = [run.states(each.final, parameters=each.parameters) for each in (found, again)]
    np.testing.assert_array_equal(*depths)


def test_infinite_costs_are_read_back(tmp_path):
    """JSON has no infinity: of costs it is a member that fails; without fresh members there is none."""
    without = dataclasses.replace(tuned(), fresh=0, fresh_cost=np.nan, fresh_before=np.nan, cost=np.inf)
    without.save(tmp_path)
    again = lw.studies.Tuned.load(tmp_path / "tune_gains.json")
    np.testing.assert_equal(dataclasses.astuple(again), dataclasses.astuple(without))


@pytest.mark.ci
def test_a_damaged_array_is_refused(tmp_path):
    found = assimilated()
    (file, *_) = found.save(tmp_path)
    content = json.loads(file.read_text())
    content["final"]["arrays"]["final.status"]["dtype"] = "object"
    file.write_text(json.dumps(content))
    says(refused(lw.studies.Assimilated.load, file), "assimilate.json", "is damaged, or of another version")


FALLING = """
vehicle = { mass = 2.0, inertia = [1.0, 1.0, 1.0], buoyancy = 19.6133 }
start = { velocity = [0.0, 0.0, 0.5] }
run = { method = "psi_x", step = 0.1, duration = 2.0 }
"""


@pytest.mark.ci
@pytest.mark.parametrize(("verb", "words"), [
    # A neutral body moves on: the depth is v t.
    ("run", "The member ends ok at 2 s."),
    ("derivatives --of depth --by start.velocity[2]", "depth changes by 2 m (+- "),
    ("worst-case --of depth --within start.velocity[2]=0.1:0.7 --budget 64",
     "The largest depth found is 1.4 m at start.velocity[2] 0.7 m/s (its upper bound), in "),
])  # fmt: skip
def test_the_last_line_of_the_command_is_the_answer(verb, words, tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(FALLING)
    name, *options = verb.split()
    given = [name, str(tmp_path / "scene.toml"), *options, "--out", str(tmp_path / "out")]
    assert cli.main(given) == 0
    line = capsys.readouterr().out.splitlines()[-1]
    assert line.startswith(words)
    assert name != "derivatives" or line.endswith(" per m/s of start.velocity[2].")
    assert cli.main([*given, "--json", "-q"]) == 0
    document = json.loads(capsys.readouterr().out)
    held = document if name == "run" else document["content"][name.replace("-", "_")]
    assert held["answer"].partition(" (+- ")[0] == line.partition(" (+- ")[0]
