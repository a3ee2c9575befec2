# SPDX-License-Identifier: Apache-2.0
"""The pages bring_your_own_loop.md and learn_depth_keeping.md: signs as the table has them, snippets that run."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from benchmarks import foreign_remus as remus
from tests.support.pages import blocks, reader, snippets

OWN_LOOP, LEARNING = "docs/controllers/bring_your_own_loop.md", "docs/controllers/learn_depth_keeping.md"


@pytest.fixture(scope="module")
def turned():
    """Heading and pitch [rad] of a REMUS 100 after two seconds with its rudder, its stern planes, neither, at 0.1 rad."""
    scene = lw.Scene.named("remus_100", start={"velocity": [1.54, 0.0, 0.0]})
    angles = {}
    for name, command in (("none", [0.0, 0.0]), ("rudder", [0.1, 0.0]), ("planes", [0.0, 0.1])):
        result = lw.solve(scene.with_numbers({"control_fins.command": command}), h=0.02, t1=2.0, save=lw.SaveAt())
        R = result.attitude[-1, 0]
        angles[name] = np.array([np.arctan2(R[1, 0], R[0, 0]), -np.arcsin(R[2, 0])])
    return {name: angles[name] - angles["none"] for name in ("rudder", "planes")}


@pytest.mark.ci
def test_rudder_and_planes_turn_as_the_table_says(turned):
    assert turned["rudder"][0] < -0.01  # to port
    assert turned["planes"][1] < -0.01  # bow down


def test_those_of_the_other_simulator():
    """Its equations at the same speed: the rudder turns to starboard, the planes turn the bow down."""
    ahead = np.array([1.54, 0.0, 0.0, 0.0, 0.0, 0.0])
    still = remus.wrench(ahead, 1.54, 0.0, 0.0, 0.0)
    assert (remus.wrench(ahead, 1.54, 0.1, 0.0, 0.0) - still)[5] > 0.0
    assert (remus.wrench(ahead, 1.54, 0.0, 0.1, 0.0) - still)[4] < 0.0


def test_axes_of_ros():
    """(n, e, d) = (y, x, -z), (x, -y, -z) in the body, heading = pi/2 - yaw, and the pitch the other way."""
    world, body = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1, -1, -1])
    yaw, pitch, roll = 0.3, 0.2, -0.1
    theirs = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    ours = Rotation.from_matrix(world @ theirs.as_matrix() @ body)
    heading, our_pitch, our_roll = ours.as_euler("ZYX")
    assert np.allclose([heading, our_pitch, our_roll], [np.pi / 2.0 - yaw, -pitch, roll], rtol=0.0, atol=1e-14)
    # Rates about the body axes: of a turn that goes on in time.
    rates = np.array([0.1, -0.2, 0.3])
    later = Rotation.from_matrix(world @ (theirs * Rotation.from_rotvec(rates)).as_matrix() @ body)
    assert np.allclose((ours.inv() * later).as_rotvec(), rates * [1, -1, -1], rtol=0.0, atol=1e-14)


@pytest.mark.ci
def test_a_positive_moment_turns_to_starboard_and_depth_grows_downward():
    """One run: pushed down and turned by N, the vehicle sinks and its heading grows from north to east."""
    vehicle = lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0))
    push = lw.terms.Wrench(force=[0.0, 0.0, 5.0], torque=[0.0, 0.0, 1.0])
    result = lw.solve(lw.Scene(vehicle, terms=[push]), h=0.02, t1=1.0, save=lw.SaveAt())
    assert result.position[-1, 0, 2] > 0.1
    assert result.attitude[-1, 0, 1, 0] > 0.1  # the bow points east of north


@pytest.mark.slow
def test_the_script_prints_what_the_page_says(capsys):
    ((_, code, expected),) = snippets(OWN_LOOP, "python")
    exec(code, {"__name__": "__main__"})
    assert capsys.readouterr().out == expected


@pytest.mark.slow
def test_snippets_of_learning(tmp_path, monkeypatch):
    pytest.importorskip("stable_baselines3")
    monkeypatch.chdir(reader(tmp_path))
    environment, learner, policy = blocks(LEARNING, "python")
    exec(environment, names := {})
    exec(learner.replace("200_000", "4096"), names)
    assert names["learner"].num_timesteps == 4096
    exec(policy, names)
    mean, deviation, x = names["mean"], names["deviation"], np.random.default_rng(0).normal(size=4)
    with np.load("policy.npz") as file:
        seen = names["W"] @ ((x - mean) / deviation) + names["b"]
        assert np.allclose(file["weights_0"] @ x + file["biases_0"], seen, rtol=0.0, atol=1e-13)
