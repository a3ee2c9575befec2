# SPDX-License-Identifier: Apache-2.0
"""Laws against their twins, each in a member of its own: a single kernel has them all."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from lgvi_kernels.advance import kernel
from lgvi_kernels.lanes.flags import CPU_FLAGS
from lgvi_warp.engine import kernel as kernels
from tests.support.loops import torpedo, twin_states

H, EVERY, STEPS = 0.05, 2, 400
VEHICLE = torpedo(20.5 * 9.8, (0.01, 0.005, -0.02))
LIMIT = (25.0, 20.0, 15.0, 2.0, 2.5, 3.0)
rng = np.random.default_rng(7)
# A policy that damps, and pushes toward what is wanted: untrained layers of different widths.
LAYERS = [(0.3 * rng.normal(size=shape), 0.1 * rng.normal(size=shape[0])) for shape in ((7, 11), (5, 7), (3, 5))]
# The numbers of each law where it acts; elsewhere those of IDLE.
ACTING = {
    "heading_pid": {"kp": 6.0, "ki": 0.5, "kd": 4.0, "integral_limit": 0.8},
    "depth_pid": {"kp": 0.3, "ki": 0.02, "kp_pitch": 12.0, "ki_pitch": 1.0, "kd_pitch": 6.0},
    "heave_pid": {"kp": 20.0, "ki": 2.0, "kd": 30.0, "integral_limit": 1.5},
    "speed_pid": {"kp": 30.0, "ki": 3.0, "drag": 4.0},
    "pose_pid": {"kp": (20.0, 25.0, 30.0), "ki": (2.0, 3.0, 4.0), "kd": (30.0, 40.0, 50.0), "kr": (6.0, 7.0, 8.0),
                 "ki_r": (0.4, 0.5, 0.6), "kw": (3.0, 4.0, 5.0), "integral_limit": (1.0, 0.5)},
    "pose_smc": {"k_sigma": (3.0, 4.0, 5.0), "k_d": (30.0, 40.0, 50.0), "k_sigma_r": (0.5, 0.6, 0.7),
                 "k_d_r": (3.0, 4.0, 5.0)},
    "heading_smc": {"k_sigma": 0.2, "k_d": 0.8, "nomoto_gain": 0.25, "nomoto_time": 1.5},
    "state_feedback": {"K": np.hstack([np.diag((20.0, 25.0, 30.0, 6.0, 7.0, 8.0)), np.diag((30.0, 40.0, 50.0, 3.0, 4.0, 5.0))])
                       + 0.05 * rng.normal(size=(6, 12))},
    "policy": {"scale": (10.0, 1.5, 2.0)},
}  # fmt: skip
IDLE = {
    law: {name: value if name == "integral_limit" else 0.0 * np.array(value) for name, value in numbers.items()}
    for law, numbers in ACTING.items()
}
# An infinite gain of Nomoto's model demands nothing.
IDLE["heading_smc"]["nomoto_gain"] = 1e300
NAMES = tuple(ACTING)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """All laws, idle; a trajectory by way of a reference model."""
    file = tmp_path_factory.mktemp("policy") / "policy.npz"
    np.savez(
        file, **{f"{kind}_{i}": a for i, layer in enumerate(LAYERS) for kind, a in zip(("weights", "biases"), layer)}
    )
    inputs = [
        "depth_error", "position_error[1]", "heading_error", "velocity", "attitude_error", "down[0]", "speed_error",
    ]  # fmt: skip
    three = dict(
        lambda_=(0.3, 0.4, 0.5), boundary=(0.1, 0.2, 0.3), lambda_r=(0.5, 0.6, 0.7), boundary_r=(0.1, 0.2, 0.3)
    )
    laws = [
        lw.control.HeadingPID(**IDLE["heading_pid"]),
        lw.control.DepthPID(**IDLE["depth_pid"], pitch_limit=0.3, integral_limit=(2.0, 1.0)),
        lw.control.HeavePID(**IDLE["heave_pid"]),
        lw.control.SpeedPID(**IDLE["speed_pid"]),
        lw.control.PosePID(**IDLE["pose_pid"], feedforward="restoring"),
        lw.control.PoseSMC(**IDLE["pose_smc"], **three),
        lw.control.HeadingSMC(**IDLE["heading_smc"], lambda_=0.4, boundary=0.1),
        lw.control.StateFeedback(**IDLE["state_feedback"]),
        lw.control.Policy(
            file=file, inputs=inputs, outputs=["Z", "K", "N"], **IDLE["policy"], output_activation="tanh"
        ),
    ]
    guidance = [
        lw.control.Trajectory(times=(0.5, 3.0, 8.0, 12.0), positions=[(0, 0, 3), (2, 1, 4), (5, -2, 6), (4, 3, 5)],
                      headings=(0.3, 2.0, -2.5, 1.0), interpolation="cubic"),
        lw.control.ReferenceModel(natural_frequency=(1.0, 1.2, 0.8, 1.5), damping_ratio=(1.0, 0.8, 1.2, 1.0),
                          rate_limit=(0.6, 0.5, 0.4, 0.5)),
    ]  # fmt: skip
    terms = [
        lw.terms.Drag(linear=(3.0, 4.0, 5.0, 0.3, 0.4, 0.5), quadratic=(10.0, 30.0, 40.0, 1.0, 2.0, 3.0)),
        lw.terms.ControlWrench(limit=LIMIT),
    ]
    controller = lw.Controller(period=EVERY * H, guidance=guidance, laws=laws)
    return lw.Scene(VEHICLE, lw.Environment(gravity=9.8), terms, controller=controller)


def states(n):
    """Position, attitude, velocity and angular velocity of n members."""
    rng = np.random.default_rng(3)
    attitudes = Rotation.from_rotvec(0.5 * rng.normal(size=(n, 3))).as_matrix()
    velocities = rng.normal(size=(2, n, 3)) * 0.4
    return np.array((0.4, -0.3, 3.0)) + rng.normal(size=(n, 3)), attitudes, *velocities


def solved(scene):
    """(parameters, states, result): member i has the law i alone."""
    parameters = {
        f"{law}.{name}": np.array([ACTING[law][name] if law == other else IDLE[law][name] for other in NAMES], float)
        for law, names in ACTING.items()
        for name in names
    }
    given = states(len(NAMES))
    ensemble = lw.Ensemble.from_states(scene, *given, parameters)
    return parameters, given, lw.solve(ensemble, "psi_s", h=H, t1=STEPS * H, save=lw.SaveAt(every=EVERY * H))


@pytest.fixture(scope="module")
def run(scene):
    return solved(scene)


@pytest.fixture(scope="module")
def second(scene):
    """The same kernel with other words: straight pieces, speeds, two numbers filtered, another policy, no waiting."""
    guidance = [
        lw.control.Trajectory(times=(0.0, 1.0, 2.0, 2.5), positions=[(0, 0, 3), (1, 1, 4), (1, -2, 6), (1, 0, 5)],
                      headings=(0.3, 2.0, -2.5, 1.0), speed=(0.5, 1.0, 0.8, 0.2)),
        lw.control.ReferenceModel(natural_frequency=(2.0, 1.5)),
    ]  # fmt: skip
    words = {"policy": {"activation": "relu", "output_activation": "clip"}, "pose_pid": {"anti_windup": "none"}}
    laws = [dataclasses.replace(law, **words.get(law.key, {})) for law in scene.controller.laws]
    controller = lw.Controller(period=EVERY * H, guidance=guidance, laws=laws)
    changed = dataclasses.replace(scene, controller=controller)
    return changed, solved(changed)


def check(law, steps, scene, run):
    """A member is the twin's, so many steps long."""
    parameters, given, result = run
    i = NAMES.index(law)
    numbers = {name: values[i] for name, values in parameters.items()}
    b, R = twin_states(scene, numbers, [x[i] for x in given], EVERY, H, steps)
    assert result.status.counts() == {"ok": len(NAMES)}
    for got, expected in ((result.position[: len(b), i], b), (result.attitude[: len(b), i], R)):
        error = np.abs(got - expected).reshape(len(b), -1).max(axis=1)
        # A tick is some hundred roundings of numbers of size 10; 200 ticks of a stable loop add up what they leave.
        assert error[1] < 1e-12
        assert error.max() < 1e-9


@pytest.mark.ci
@pytest.mark.parametrize("steps", [60, pytest.param(STEPS, marks=pytest.mark.slow)])
@pytest.mark.parametrize("law", NAMES)
def test_a_law_is_its_twin(law, steps, scene, run):
    check(law, steps, scene, run)


@pytest.mark.ci
@pytest.mark.parametrize("law", ["speed_pid", "pose_pid", "policy", "heading_smc"])
def test_so_it_is_with_other_words(law, second):
    check(law, 60, *second)


def test_laws_act(run):
    # Each member goes a way of its own.
    result = run[2]
    ends = result.position[-1]
    gaps = np.linalg.norm(ends[:, None] - ends[None], axis=2) + 10.0 * np.eye(len(ends))
    assert gaps.min() > 1e-3


@pytest.mark.slow
def test_widths_give_the_same_bits_and_float32_is_near(scene, run, monkeypatch):
    # As in tests/runs/test_same_bits.py: left free to fuse, the compiler joins other products at another width.
    monkeypatch.setattr(kernel, "CPU_FLAGS", CPU_FLAGS.replace("-ffp-contract=fast", "-ffp-contract=off"))
    monkeypatch.setattr(kernels, "make_advance", kernel.make_advance.__wrapped__)
    parameters, given, _ = run
    # Within float32.
    idle = parameters | {"heading_smc.nomoto_gain": np.minimum(parameters["heading_smc.nomoto_gain"], 1e30)}
    ensemble = lw.Ensemble.from_states(scene, *given, idle)

    def short(**words):
        return lw.solve(ensemble, "psi_s", h=H, t1=5.0, save=lw.SaveAt(every=1.0), **words).position

    first = short(width=1)
    np.testing.assert_array_equal(short(width=8), first)
    # 100 steps of round-off 1e-7 of numbers of size 10, which stable loops damp.
    assert np.abs(short(dtype="float32") - first).max() < 1e-3


@pytest.mark.slow
def test_guidance_keeps_what_others_want():
    # A kernel of its own: the set-point's heading and the trajectory's place, whatever their order.
    point = lw.control.SetPoint(heading=0.7)
    places = lw.control.Trajectory(times=(0.0, 3.0), positions=[(0, 0, 3), (2, 1, 4)])
    for guidance in ([point, places], [places, point]):
        gains = {**dict.fromkeys(("kp", "kd"), (20.0, 25.0, 30.0)), **dict.fromkeys(("kr", "kw"), (6.0, 7.0, 8.0))}
        controller = lw.Controller(period=EVERY * H, guidance=guidance, laws=[lw.control.PosePID(**gains)])
        way = lw.Scene(
            VEHICLE, lw.Environment(gravity=9.8), [lw.terms.ControlWrench(limit=LIMIT)], controller=controller
        )
        given = states(1)
        result = lw.solve(lw.Ensemble.from_states(way, *given), "psi_s", h=H, t1=6.0, save=lw.SaveAt(every=EVERY * H))
        b, R = twin_states(way, {}, [x[0] for x in given], EVERY, H, 120)
        assert np.abs(result.position[:, 0] - b).max() < 1e-10
        assert np.abs(result.attitude[:, 0] - R).max() < 1e-10
