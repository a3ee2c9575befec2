# SPDX-License-Identifier: Apache-2.0
"""Tables as numbers of a scene: what is refused, what files hold, what varies, and which numbers may be tables."""

import contextlib

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.control import HeadingPID, PoseSMC, PseudoInverse, SetPoint, StateFeedback
from lgvi_warp.scene.schema import schema
from tests.support.json_schema import faults
from tests.support.refusals import says

KP = {"over": "speed", "at": [0.5, 1.0, 2.0], "values": [24.0, 9.0, 3.0]}
FINS = {"to": "control_fins", "speed": "measured", "least_speed": 0.4}


@contextlib.contextmanager
def refuses(*words):
    """What is refused with a message that has these words."""
    with pytest.raises(lw.SceneError) as caught:
        yield
    says(str(caught.value), *words)


def scene(law, allocation=None, **more):
    parts = {"guidance": [SetPoint(heading=0.5)], "laws": [law], "allocation": [allocation] if allocation else []}
    return lw.Scene.named("remus_100", controller=lw.Controller(period=0.1, **parts, **more))


@pytest.mark.parametrize(("kp", "words"), [
    (KP | {"over": "sped"}, ["heading_pid.kp.over = 'sped' is not known. Did you mean 'speed'?"]),
    (KP | {"at": [0.5, 1.0, 1.0]}, ["heading_pid.kp.at", "are not two or more rising numbers. Sort them", "m/s"]),
    (KP | {"at": [1.0], "values": [3.0]}, ["heading_pid.kp.at", "two or more"]),
    (KP | {"values": [3.0, 2.0]}, ["heading_pid.kp = [3.0, 2.0] has shape (2,). Give numbers of shape (3,)"]),
    (KP | {"more": 1}, ["heading_pid.kp.more = 1 is an unknown key. Known: over, at, values"]),
    ({}, ["3 faults", "heading_pid.kp.at = '' is missing", "heading_pid.kp.values = '' is missing"]),
])  # fmt: skip
def test_a_table_that_is_none_is_refused_with_the_key_and_a_remedy(kp, words):
    with refuses(*words):
        HeadingPID(kp=kp)


def test_what_cannot_be_a_table_is_refused():
    with refuses("state_feedback.K", "cannot be a table"):
        StateFeedback(K={"over": "speed", "at": [0.0, 1.0], "values": np.zeros((2, 6, 12))})
    with refuses("heading_pid.integral_limit", "is out of bounds"):
        HeadingPID(kp=1.0, integral_limit=KP | {"values": [1.0, -1.0, 2.0]})


def test_a_table_over_the_altitude_needs_one_altimeter():
    law = HeadingPID(kp=KP | {"over": "altitude"})
    with refuses("controller.heading_pid.kp.over = 'altitude' needs one altimeter, and the controller has 0. Give one"):
        scene(law)


def test_scenes_and_files_keep_tables_and_the_measured_speed():
    here = scene(HeadingPID(kp=KP, kd=2.0), PseudoInverse(**FINS))
    content = here.to_dict()
    assert content["controller"]["laws"][0]["kp"] == KP
    assert content["controller"]["allocation"] == [{"type": "pseudo_inverse"} | FINS]
    assert lw.Scene.from_dict(content).to_dict() == content
    assert faults(content, schema()) == []
    content["controller"]["laws"][0]["kp"] = KP | {"over": "time"}
    assert faults(content, schema()) != []


def test_values_at_nodes_are_numbers_of_the_scene():
    here = scene(HeadingPID(kp=KP, kd=2.0), PseudoInverse(**FINS))
    numbers = here.parameters()
    np.testing.assert_array_equal(numbers["heading_pid.kp"], KP["values"])
    assert "pseudo_inverse.speed" not in numbers
    assert numbers["pseudo_inverse.least_speed"] == 0.4
    changed = here.with_numbers({"heading_pid.kp[1]": 7.0, "pseudo_inverse.least_speed": 0.5}).to_dict()["controller"]
    assert changed["laws"][0]["kp"] == KP | {"values": [24.0, 7.0, 3.0]}
    assert changed["allocation"][0] == {"type": "pseudo_inverse"} | FINS | {"least_speed": 0.5}
    # A number takes the place of the table.
    assert here.with_numbers({"heading_pid.kp": 5.0}).to_dict()["controller"]["laws"][0]["kp"] == 5.0
    fleet = lw.Ensemble(here, 8, vary={"heading_pid.kp[0]": lw.distributions.Uniform(20.0, 28.0)})
    drawn = fleet.parameters(0, 8)["heading_pid.kp"]
    assert drawn.shape == (8, 3)
    assert np.ptp(drawn[:, 0]) > 1.0
    assert np.ptp(drawn[:, 1]) == 0.0


def test_vectors_may_be_tables_and_keep_their_python_names():
    three = dict.fromkeys(("boundary", "k_sigma", "k_d", "lambda_r", "boundary_r", "k_sigma_r", "k_d_r"), [1.0] * 3)
    law = PoseSMC(lambda_={"over": "depth", "at": [0.0, 9.0], "values": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]}, **three)
    assert law.parameters()["lambda"].shape == (2, 3)
    assert law.with_fields({"boundary": [2.0] * 3}).to_dict()["lambda"] == law.to_dict()["lambda"]


@pytest.mark.parametrize(("given", "words"), [
    ({"speed": "measured"}, "pseudo_inverse.least_speed = '' is missing. Give the least speed [m/s]"),
    ({"least_speed": 0.4}, 'pseudo_inverse.least_speed = 0.4 is not used. Give speed = "measured", or leave it out'),
    ({"speed": "mesured"}, "pseudo_inverse.speed"),
])  # fmt: skip
def test_the_measured_speed_needs_its_least_one(given, words):
    with refuses(words):
        PseudoInverse(to="control_fins", **given)


def test_thrusters_are_not_judged_at_the_measured_speed():
    allocation = PseudoInverse(to="thrusters", speed="measured", least_speed=0.4)
    with refuses("pseudo_inverse.speed = 'measured' needs fins", "and that of thrusters does not. Leave speed out"):
        lw.Scene.named("bluerov2_heavy", controller=lw.Controller(
            period=0.1, guidance=[SetPoint(heading=0.5)], laws=[HeadingPID(kp=1.0)], allocation=[allocation]))  # fmt: skip
