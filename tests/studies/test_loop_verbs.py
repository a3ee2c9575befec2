# SPDX-License-Identifier: Apache-2.0
"""The verbs margins, worst-case and trim on a body that turns its head: beside what is known in closed form, and Python."""

import json
import shlex

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli

pytestmark = pytest.mark.ci

MASS, INERTIA, KD, PERIOD, STEP, DRAG = 20.0, 11.0, 9.0, 0.1, 0.02, 40.0
# The error of a method of order two, in parts of a motion that linear drag slows: docs/guide/methods.md.
ORDER_TWO = 1.01 * (DRAG * STEP / MASS) ** 2 / 12.0
SCENE = f"""
[vehicle]
mass = {MASS}
inertia = [5.0, 8.0, {INERTIA}]
added_mass = [0.0, 0.0, 0.0]
buoyancy = 200.0
[environment]
gravity = 10.0
[[terms]]
type = "control_wrench"
[[terms]]
type = "drag"
linear = [{DRAG}, {DRAG}, {DRAG}, 0.0, 0.0, 0.0]
[controller]
period = {PERIOD}
guidance = [{{ type = "set_point", heading = 0.0 }}]
laws = [{{ type = "heading_pid", kp = 6.0, kd = {KD} }}]
[ensemble]
members = 3
seed = 5
vary = {{ "heading_pid.kp" = {{ uniform = {{ low = 4.0, high = 8.0 }} }} }}
[run]
method = "psi_s"
step = {STEP}
duration = 2.0
save_every = 0.1
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "head.toml"
    path.write_text(SCENE)
    return path


def document(inputs, capsys):
    """The document that a verb prints."""
    assert cli.main([*map(str, inputs), "--json", "-q"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_margins_are_those_of_the_sampled_loop(scene, tmp_path, capsys):
    """A double integrator with a held torque bears a factor of 2 J / (kd T), whatever kp is."""
    out = tmp_path / "margins"
    given = ["margins", scene, "--loop", "heading_pid", "--of", "gain", "--about", "5", "--seconds", "30", "--out", out]
    found = document(given, capsys)["content"]["margins"]
    assert found["why"] == [""] * 3
    np.testing.assert_allclose(found["eigenvalues"]["gain_upper"], 2.0 * INERTIA / (KD * PERIOD), rtol=2e-6)
    python = lw.linear.margins(lw.Scene.load(scene), "heading_pid", ("gain",), about=5.0, seconds=30.0)
    assert found == python.to_dict()
    assert lw.linear.Margins.load(out / "margins.json").to_dict() == found
    assert (out / "margins.png").stat().st_size > 10_000


def test_a_worst_case_can_be_run_again_by_its_command(scene, tmp_path, capsys):
    """A body that drifts with drag alone goes furthest where it is fastest, m v (1 - exp(-d t / m)) / d."""
    out = tmp_path / "worst"
    given = ["worst-case", scene, "--of", "max(position[0])", "--within", "start.velocity[0]=0.5:1.5", "--within",
             "heading_pid.kp=1:10:log", "--budget", "64", "--out", out]  # fmt: skip
    assert cli.main([*map(str, given), "-q", "--threads", "1"]) == 0
    worst = lw.studies.WorstCase.load(out / "worst_case.json")
    assert worst.parameters["start.velocity[0]"] == 1.5
    assert worst.at_bounds["start.velocity[0]"] == "high"
    exact = MASS * 1.5 * -np.expm1(-DRAG * 2.0 / MASS) / DRAG
    assert worst.value == pytest.approx(exact, rel=ORDER_TWO)
    assert cli.main([*map(str, given), "--threads", "1"]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("again ")]
    command = shlex.split(line.removeprefix("again "))
    assert command[0] == "lgvi-warp"
    assert cli.main([*command[1:], "--out", str(tmp_path / "again"), "-q"]) == 0
    result = lw.Result.load(tmp_path / "again" / "result.npz")
    assert result.position[:, 0, 0].max() == worst.value


def test_a_trim_is_held_by_the_force_of_the_drag(scene, capsys):
    found = document(["trim", scene, "--speed", "1.5", "--fixed", "pitch=0", "--fixed", "drift=0"], capsys)
    np.testing.assert_allclose(found["commands"]["control_wrench"], [1.5 * DRAG, 0, 0, 0, 0, 0], ORDER_TWO, 1e-6)
    # A step is half a push, drag for a period of its own, and half a push: a geometric sum says which force keeps the speed.
    slowed = np.exp(-DRAG * STEP / MASS)
    force = 1.5 * (1.0 - slowed) / (1.0 + slowed) * 2.0 * MASS / STEP
    assert found["commands"]["control_wrench"][0] == pytest.approx(force, rel=1e-10)
    np.testing.assert_allclose(found["start"]["velocity"], [1.5, 0.0, 0.0], atol=1e-9)
    assert np.abs(found["residual"]).max() < 1e-8
    assert (found["method"], found["step"]) == ("psi_s", STEP)
    assert cli.main(["trim", str(scene), "--speed", "1.5", "--free", "roll"]) == 2
    error = capsys.readouterr().err
    assert "has no steady motion with roll free" in error
