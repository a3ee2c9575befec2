# SPDX-License-Identifier: Apache-2.0
"""Closed loops whose answer is known: a single kernel, in whose ensembles all laws act on some member."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from tests.support.tools import one

MASS, INERTIA, GRAVITY = 20.0, (5.0, 8.0, 11.0), 10.0
PERIOD = 0.1
NONE = (0.0, 0.0, 0.0)
FAR = (1e9,) * 6
# A member on which every law of the kernel acts, so that the kernel is the same whatever the others have.
LAST = {
    "wrench.force": (1.0, 0.0, 0.0),
    "vehicle.buoyancy": MASS * GRAVITY + 1.0,
    "vehicle.center_of_buoyancy": (0.0, 0.0, -0.01),
}
OTHERS = {
    "wrench.force": NONE, "vehicle.buoyancy": MASS * GRAVITY, "vehicle.center_of_buoyancy": NONE,
    "control_wrench.limit": FAR, "heading_pid.kp": 0.0, "heading_pid.kd": 0.0,
    **{f"pose_pid.{name}": NONE for name in ("kp", "ki", "kd", "kr", "kw")},
}  # fmt: skip


def scene(period=PERIOD, position=NONE, heading=0.0, **words):
    """A neutral body, set-point, PID of pose and of heading with gains of 0."""
    laws = [
        lw.control.PosePID(**dict.fromkeys(("kp", "ki", "kd", "kr", "kw"), NONE), **words),
        lw.control.HeadingPID(kp=0.0),
    ]
    controller = lw.Controller(
        period=period, guidance=[lw.control.SetPoint(position=position, heading=heading)], laws=laws
    )
    vehicle = lw.Vehicle(MASS, inertia=INERTIA, added_mass=NONE, buoyancy=MASS * GRAVITY, center_of_buoyancy=NONE)
    terms = [lw.terms.ControlWrench(limit=FAR), lw.terms.Wrench()]
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), terms, controller=controller)


def run(scene, members, h, t1, every, states=None):
    """The result of members with these numbers, {name: value}; what is not named is that of OTHERS."""
    rows = [OTHERS | member for member in (*members, LAST)]
    parameters = {name: np.array([row[name] for row in rows], float) for name in OTHERS}
    given = [np.concatenate([x, np.eye(3)[None] if x.ndim == 3 else np.zeros((1, 3))]) for x in states or ()]
    return lw.solve(one(scene, *given, parameters=parameters), "psi_s", h=h, t1=t1, save=lw.SaveAt(every=every))


def sampled(kp, kd, F, x, v, ticks, inertia=MASS):
    """(x, v) at the ticks of a double integrator with the held force F - kp x - kd v."""
    states = [(x, v)]
    for _ in range(ticks):
        a = (F - kp * x - kd * v) / inertia
        x, v = x + PERIOD * v + 0.5 * PERIOD**2 * a, v + PERIOD * a
        states.append((x, v))
    return np.array(states)


def test_a_double_integrator_is_exact_at_the_ticks():
    kp, kd, F, b0, v0 = (np.array(x) for x in ((30.0, 20.0, 10.0), (40.0, 30.0, 50.0), (3.0, -2.0, 1.0),
                                               (1.0, -2.0, 3.0), (0.5, 0.2, -0.3)))  # fmt: skip
    states = b0[None], np.eye(3)[None], v0[None], np.zeros((1, 3))
    member = {"pose_pid.kp": kp, "pose_pid.kd": kd, "wrench.force": F}
    result = run(scene(), [member], PERIOD / 5, 200 * PERIOD, PERIOD, states)
    for i in range(3):
        expected = sampled(kp[i], kd[i], F[i], b0[i], v0[i], 200)
        # A kick and a drift are exact for a force that is held: what is left is the rounding of 1000 steps.
        np.testing.assert_allclose(result.position[:, 0, i], expected[:, 0], atol=1e-13)
        np.testing.assert_allclose(result.velocity[:, 0, i], expected[:, 1], atol=1e-13)


@pytest.mark.parametrize(
    ("factors", "most"), [((1.0, 0.2), "kd"), ((0.3, 1.0), "kp")], ids=["kd = 2 m / T", "kp = 2 kd / T"]
)
def test_the_gains_at_which_it_turns_unstable(factors, most):
    members = []
    for nearness in (0.99, 1.01):
        kd = factors[0] * 2.0 * MASS / PERIOD * (nearness if most == "kd" else 1.0)
        kp = factors[1] * 2.0 * kd / PERIOD * (nearness if most == "kp" else 1.0) * (0.05 if most == "kd" else 1.0)
        members.append({"pose_pid.kp": (kp, 0.0, 0.0), "pose_pid.kd": (kd, 0.0, 0.0)})
    n = len(members)
    states = np.tile((1e-3, 0.0, 0.0), (n, 1)), np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)), np.zeros((n, 3))
    result = run(scene(), members, PERIOD / 2, 400 * PERIOD, PERIOD, states)
    for i, member in enumerate(members):
        kp, kd = member["pose_pid.kp"][0] / MASS, member["pose_pid.kd"][0] / MASS
        A = [[1 - PERIOD**2 * kp / 2, PERIOD - PERIOD**2 * kd / 2], [-PERIOD * kp, 1 - PERIOD * kd]]
        rate = np.abs(np.linalg.eigvals(A)).max()
        assert (rate < 1.0) == (i == 0)
        x = np.abs(result.velocity[:, i, 0])
        # The envelope over 200 ticks; a beat of the two eigenvalues, or of the phase, is within it.
        grown = (x[380:].max() / x[180:201].max()) ** (1.0 / 200.0)
        assert (grown < 1.0) == (i == 0)
        assert abs(grown - rate) < 1e-3


def test_what_is_left_of_a_constant_force():
    gains = {"pose_pid.kp": (40.0, 40.0, 40.0), "pose_pid.kd": (60.0, 60.0, 60.0), "wrench.force": (8.0, -4.0, 2.0)}
    result = run(scene(), [gains, gains | {"pose_pid.ki": (20.0, 20.0, 20.0)}], PERIOD, 120.0, 120.0)
    # The slowest modes decay as e^-t, and as e^-0.34 t with the integral: e^-40 is left.
    np.testing.assert_allclose(result.position[-1, 0], np.array(gains["wrench.force"]) / 40.0, atol=1e-12)
    np.testing.assert_allclose(result.position[-1, 1], 0.0, atol=1e-12)


def test_feedforward_is_that_of_the_scene_whatever_a_member_is():
    center, buoyancy = (0.02, -0.01, -0.03), MASS * GRAVITY + 6.0
    gains = {"pose_pid.kp": (40.0, 40.0, 40.0), "pose_pid.kd": (60.0, 60.0, 60.0),
             "pose_pid.kr": (20.0, 20.0, 20.0), "pose_pid.kw": (30.0, 30.0, 30.0)}  # fmt: skip
    of_scene = {"vehicle.buoyancy": buoyancy, "vehicle.center_of_buoyancy": center}
    known = scene(feedforward="restoring")
    known = dataclasses.replace(
        known, vehicle=lw.Vehicle(MASS, inertia=INERTIA, added_mass=NONE, buoyancy=buoyancy, center_of_buoyancy=center)
    )
    R = Rotation.from_euler("xyz", (0.3, -0.4, 0.5)).as_matrix()
    states = np.zeros((2, 3)), np.array([np.eye(3), R]), np.zeros((2, 3)), np.zeros((2, 3))
    members = [gains | of_scene | {"vehicle.buoyancy": buoyancy + 4.0}, OTHERS | of_scene]
    result = run(known, members, PERIOD / 5, 60.0, 60.0, states)
    # What the scene does not say is left to the gains: 4 N up, and moments of 0.08 N m and 0.04 N m.
    assert abs(result.position[-1, 0, 2] + 4.0 / 40.0) < 1e-3
    # Of a vehicle as the scene says nothing is left, at any attitude: without gains it stays where it is.
    np.testing.assert_allclose(result.position[-1, 1], 0.0, atol=1e-10)
    np.testing.assert_allclose(result.attitude[-1, 1], R, atol=1e-10)


def test_the_sampled_heading_loop():
    kp, kd = 6.0, 9.0
    errors = []
    for steps in (5, 10):
        result = run(scene(heading=0.8), [{"heading_pid.kp": kp, "heading_pid.kd": kd}], PERIOD / steps, 10.0, PERIOD)
        heading = np.arctan2(result.attitude[:, 0, 1, 0], result.attitude[:, 0, 0, 0])
        expected = 0.8 + sampled(kp, kd, 0.0, -0.8, 0.0, 100, INERTIA[2])[:, 0]
        errors.append(np.abs(heading - expected).max())
    # About one axis only the turns of a step err, as (h rate)^2 / 12 of each.
    assert errors[0] < 0.8 * (PERIOD / 5 * 0.5) ** 2 / 12.0
    assert abs(errors[0] / errors[1] - 4.0) < 0.1


MEMBERS = 10_000


@pytest.mark.ci
def test_the_lyapunov_function_rises_no_more_than_a_held_torque_lets_it():
    period, kr, kw, J = 0.2, 2.0, 3.0, np.array(INERTIA)
    rng = np.random.default_rng(11)
    attitudes = Rotation.random(MEMBERS, random_state=11).as_matrix()
    axes = rng.normal(size=(20, 3))
    attitudes[:20] = Rotation.from_rotvec(np.radians(179.9) * axes / np.linalg.norm(axes, axis=1)[:, None]).as_matrix()
    zero = np.zeros((MEMBERS, 3))
    member = {"pose_pid.kp": (1.0,) * 3, "pose_pid.kd": (1.0,) * 3, "pose_pid.kr": (kr,) * 3, "pose_pid.kw": (kw,) * 3}
    result = run(scene(period), [member] * MEMBERS, period / 10, 20.0, period, (zero, attitudes, zero, zero))
    R, Om = result.attitude[:, :MEMBERS], result.angular_velocity[:, :MEMBERS]
    trace = np.einsum("knii->kn", R)
    V = 0.5 * np.einsum("kni,i->kn", Om**2, J) + 0.5 * kr * (3.0 - trace)
    skew = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1)
    bound = (period**3 * kw * (kr * 0.5 * skew) ** 2 / (16.0 * J**2)).sum(axis=-1)
    # The bound is of leading order. Of the next one are: what damping takes of the torque within a period, kw T / (2 J) of it;
    # and how the angle moves meanwhile, kr T / (2 kw) of it. Round-off of a trace near 3 is some eps.
    bound *= 1.0 + period * (kw / (2.0 * J.min()) + kr / (2.0 * kw))
    assert np.all(np.diff(V, axis=0) <= bound[:-1] + 1e-14)
    # It does rise: the bound is no idle one.
    assert np.max(np.diff(V, axis=0) / (bound[:-1] + 1e-9)) > 0.1
    assert np.all(V[-1] < V[0])
    # Those from 179.9 degrees leave it as e^0.31 t at the slowest, and settle as e^-0.136 t: in 200 s to e^-20.
    slow = run(scene(period), [member] * 20, period / 10, 200.0, 200.0, [x[:20] for x in (zero, attitudes, zero, zero)])
    assert np.abs(slow.attitude[-1, :20] - np.eye(3)).max() < np.exp(-20.0)


def test_an_integral_waits_while_the_actuators_deliver_no_more():
    gains = {"pose_pid.kp": (20.0,) * 3, "pose_pid.ki": (2.0,) * 3, "pose_pid.kd": (30.0,) * 3,
             "control_wrench.limit": (5.0,) * 6}  # fmt: skip
    ends = []
    for words in ({}, {"anti_windup": "none"}):
        result = run(scene(position=(20.0, 0.0, 0.0), **words), [gains], PERIOD, 200.0, 1.0)
        ends.append(np.abs(result.position[100:, 0, 0] - 20.0).max())
    assert ends[0] < 0.1
    assert ends[1] > 50.0
