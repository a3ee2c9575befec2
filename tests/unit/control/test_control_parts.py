# SPDX-License-Identifier: Apache-2.0
"""Parts of a controller that are wrong: each says key, value and remedy. No kernel is needed."""

import dataclasses
import pickle
import re
import zipfile

import numpy as np
import pytest

import lgvi_warp as lw

ONE = dict(weights_0=np.ones((1, 1)), biases_0=np.zeros(1))
POINTS = [(0.0, 0.0, 1.0), (5.0, 0.0, 1.0)]
THREE = (1.0, 1.0, 1.0)


@pytest.mark.parametrize(("make", "output"), [
    (lambda: lw.control.Waypoints(points=POINTS[:1], speed=1.0, look_ahead=1.0, radius=1.0),
     "waypoints.points.*less than two"),
    (lambda: lw.control.Waypoints(points=[*POINTS, (5.0, 0.0, 9.0)], speed=1.0, look_ahead=1.0, radius=1.0),
     r"waypoints.points\[2\].*same place.*Leave it out"),
    (lambda: lw.control.Waypoints(points=POINTS, speed=1.0, look_ahead=0.0, radius=1.0),
     "waypoints.look_ahead.*not positive"),
    (lambda: lw.control.Waypoints(points=POINTS, speed=1.0, look_ahead=1.0, radius=1.0, method="lose"), "method.*los"),
    (lambda: lw.control.Trajectory(times=(0.0, 2.0, 1.0), positions=[THREE] * 3), "trajectory.times.*not rising"),
    (lambda: lw.control.Trajectory(times=(0.0, 2.0), positions=[THREE] * 3), "trajectory.positions.*Give 2 x 3 numbers"),
    (lambda: lw.control.Trajectory(times=(0.0,), positions=[THREE]), "trajectory.times.*less than two"),
    (lambda: lw.control.Trajectory(times=(0.0, 1e-200, 1.0), positions=[(0, 0, 0), (1, 0, 0), (2, 0, 0)]),
     "trajectory.positions.*change by more than 1e\\+15"),
    (lambda: lw.control.ReferenceModel(natural_frequency=THREE),
     "natural_frequency.*has 3 numbers.*2 numbers, of depth and heading"),
    (lambda: lw.control.ReferenceModel(natural_frequency=(1.0, 0.0)), "natural_frequency.*not positive"),
    (lambda: lw.control.HeadingSMC(lambda_=-1.0, boundary=0.1, k_sigma=1.0, nomoto_gain=1.0), r"heading_smc.lambda = -1"),
    (lambda: lw.control.PosePID(kp=THREE, kd=THREE, kr=THREE, kw=THREE, feedforward="restore"),
     "pose_pid.feedforward.*restoring"),
    (lambda: lw.control.PosePID(kp=THREE, kd=THREE, kr=THREE, kw=THREE, anti_windup="on"),
     "pose_pid.anti_windup = .*not known"),
    (lambda: lw.control.StateFeedback(K=np.ones((6, 11))), "state_feedback.K.*shape"),
])  # fmt: skip
def test_what_is_wrong_is_said(make, output):
    with pytest.raises(lw.SceneError, match=output):
        make()


def test_lambda_is_a_key_of_scenes_and_of_members():
    law = lw.control.HeadingSMC(lambda_=0.4, boundary=0.1, k_sigma=0.2, nomoto_gain=1.0)
    assert law.to_dict()["lambda"] == 0.4
    assert "lambda" in law.parameters()
    assert "lambda_" not in law.to_dict()
    controller = lw.Controller(period=0.1, guidance=[{"type": "set_point", "heading": 1.0}], laws=[law.to_dict()])
    assert controller.laws[0].lambda_ == 0.4
    with pytest.raises(lw.SceneError, match=r"lambda_.*unknown key.*lambda"):
        lw.Controller(period=0.1, guidance=controller.guidance, laws=[law.to_dict() | {"lambda_": 0.4}])


def test_a_law_says_what_it_needs_of_guidance():
    law = lw.control.PosePID(kp=THREE, kd=THREE, kr=THREE, kw=THREE)
    with pytest.raises(lw.SceneError, match=r"pose_pid.*needs a wanted position"):
        lw.Controller(period=0.1, guidance=[lw.control.SetPoint(depth=1.0, heading=0.0)], laws=[law])


def policy(tmp_path, arrays=ONE, **words):
    np.savez(tmp_path / "policy.npz", **arrays)
    return lw.control.Policy(**dict(file=tmp_path / "policy.npz", inputs=["depth_error"], outputs=["Z"]) | words)


@pytest.mark.parametrize(("arrays", "words", "output"), [
    (ONE, {"inputs": ["dept_error"]}, r"policy.inputs\[0\] = 'dept_error'.*depth_error"),
    (ONE, {"inputs": "depth"}, "policy.inputs.*not a list of names"),
    (ONE, {"inputs": ["velocity"]}, "policy.inputs.*are 3 numbers.*Name the 1 of"),
    (ONE, {"outputs": ["Z", "Z"]}, r"policy.outputs\[1\].*named twice"),
    (ONE, {"outputs": ["Z", "N"]}, "policy.outputs.*are 2 numbers"),
    (ONE, {"scale": (1.0, 2.0)}, "policy.scale.*Give 1"),
    (ONE, {"activation": "gelu"}, "policy.activation.*relu"),
    (ONE, {"checksum": 1}, "policy.checksum.*is not that of"),
    ({"weights_0": np.ones((1, 1))}, {}, "policy.file.*has weights_0. Save it by np.savez"),
    ({}, {}, "policy.file.*has no arrays"),
    (ONE | {"biases_0": np.zeros(2)}, {}, r"policy.file.*weights_0 of shape \(1, 1\)"),
    (ONE | dict(weights_1=np.ones((1, 2)), biases_1=np.zeros(1)), {}, r"policy.file.*weights_1.*Give \(n, 1\)"),
    (ONE | {"biases_0": np.array([np.nan])}, {}, "policy.file.*other than finite numbers"),
    (ONE | {"biases_0": np.array(["a"])}, {}, "policy.file.*other than finite numbers"),
])  # fmt: skip
def test_a_policy_that_does_not_fit(arrays, words, output, tmp_path):
    with pytest.raises(lw.SceneError, match=re.compile(output, re.S)):
        policy(tmp_path, arrays, **words)


def test_a_policy_knows_its_file_again(tmp_path):
    law = policy(tmp_path)
    told = law.to_dict()
    assert told["checksum"] == law.checksum
    assert lw.control.Policy(**{k: v for k, v in told.items() if k != "type"}).to_dict() == told
    with pytest.raises(lw.SceneError, match="checksum"):
        policy(tmp_path, ONE | {"biases_0": np.ones(1)}, checksum=law.checksum)


def test_no_file_of_a_stranger_runs_code(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (open, (str(tmp_path / "ran"), "w"))

    pickled = tmp_path / "policy.npz"
    np.savez(pickled, weights_0=np.array([Bomb()], dtype=object), biases_0=np.zeros(1))
    words = dict(file=pickled, inputs=["depth"], outputs=["Z"])
    with pytest.raises(lw.SceneError, match=r"policy.file"):
        lw.control.Policy(**words)
    pickled.write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(lw.SceneError, match=r"policy.file"):
        lw.control.Policy(**words)
    for other in (tmp_path, tmp_path / "missing.npz", 3, "\0"):
        with pytest.raises(lw.SceneError, match=r"policy.file"):
            lw.control.Policy(**words | {"file": other})
    np.savez_compressed(pickled, **ONE)
    with pytest.raises(lw.SceneError, match="compressed"):
        lw.control.Policy(**words)
    with zipfile.ZipFile(pickled, "w") as archive:
        archive.writestr(
            "weights_0.npy", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (10**12, 1), }"
        )
        archive.writestr("biases_0.npy", b"")
    with pytest.raises(lw.SceneError, match=r"policy.file"):
        lw.control.Policy(**words)
    assert not (tmp_path / "ran").exists()


def test_a_policy_lies_beside_its_scene(tmp_path):
    policy(tmp_path)
    (tmp_path / "scene.toml").write_text(
        "[vehicle]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n[[terms]]\ntype = 'control_wrench'\nlimit = [1, 1, 1, 1, 1, 1]\n"
        "[controller]\nperiod = 0.1\n[[controller.guidance]]\ntype = 'set_point'\ndepth = 1.0\n"
        "[[controller.laws]]\ntype = 'policy'\nfile = 'policy.npz'\ninputs = ['depth_error']\noutputs = ['Z']\n"
    )
    assert lw.Scene.load(tmp_path / "scene.toml").controller.laws[0].file == str(tmp_path / "policy.npz")


def test_what_wiring_sets_is_not_given():
    for name, value in {"bus": None, "actuators": {}}.items():
        with pytest.raises(TypeError, match=name):
            lw.Controller(period=0.1, laws=[lw.control.HeadingPID(kp=1.0)], **{name: value})


@pytest.mark.parametrize("law", [lw.control.HeavePID, lw.control.SpeedPID, lw.control.HeadingPID, lw.control.DepthPID,
                                 lw.control.PosePID])  # fmt: skip
def test_gains_that_are_left_out_are_zero(law):
    fields = [field for field in dataclasses.fields(law) if field.name.startswith("k")]
    gains = [field for field in fields if field.default is not dataclasses.MISSING]
    assert gains
    assert all(field.default is None or not np.any(field.default) for field in gains), gains


def nothing(t, y, r, members):
    return np.zeros((len(members), 6))


def test_a_callback_commands_several_terms():
    """Its answer has the channels side by side in the order of `to`, whatever that of the terms."""
    terms = [lw.terms.ControlWrench(name="one"), lw.terms.ControlWrench(name="two")]
    callback = lw.control.Callback(nothing, to=["two", "one"])
    controller = lw.Controller(period=0.1, laws=[callback])
    scene = lw.Scene(lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0)), terms=terms, controller=controller)
    bus = scene.controller.bus
    assert bus.rows - bus.answer == 12
    assert callback.answers({"one": 6, "two": 6}) == 12
    assert callback.to_dict()["to"] == ["two", "one"]
    found = {part.to: part.before for part in scene.controller.allocation}
    assert found == {"two": (), "one": ("two",)}
    with pytest.raises(lw.SceneError, match="is named by 2 allocations"):
        lw.Scene(
            lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0)),
            terms=terms,
            controller=lw.Controller(period=0.1, laws=[lw.control.Callback(nothing, to=["one", "one"])]),
        )


@pytest.mark.needs("navigation")
def test_a_callback_is_asked_for_its_own_numbers_alone():
    """Rows that sensors hand to a filter lie behind those of the answer."""
    sensors = [
        {"type": "sensor", "name": "compass", "of": "heading", "noise": 0.01},
        {"type": "imu", "name": "imu"},
        {"type": "error_state_filter", "name": "filter", "imu": "imu", "heading": "compass"},
    ]
    controller = lw.Controller(period=0.1, laws=[lw.control.Callback(nothing)], sensors=sensors)
    bus = lw.Scene.named("bluerov2_heavy", controller=controller).controller.bus
    assert bus.rows - bus.answer > 6
    assert controller.callback.answers({"thrusters": 8}) == 6
