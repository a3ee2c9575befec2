# SPDX-License-Identifier: Apache-2.0
"""Steady motions, linear models and regulators, beside answers that are known: two kernels."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_lyapunov
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from lgvi_warp.reference.control import Measurement, Reference, pose_errors
from lgvi_warp.robustness.linear.bench import MotionBench, plant
from tests.laws import test_remus_100 as equations

MASS, INERTIA, GRAVITY, PERIOD, LAG = 20.0, np.array((5.0, 8.0, 11.0)), 10.0, 0.1, 0.3
BUOYANCY, CENTER = MASS * GRAVITY + 6.0, np.array((0.02, 0.0, -0.05))
DRAG = np.array((4.0, 9.0, 12.0, 1.0, 2.0, 3.0))
NONE = (0.0, 0.0, 0.0)


LAGS = (LAG, 0.0, 0.0, 0.0, 0.0, LAG)


def hover(drag=DRAG, buoyancy=BUOYANCY, center=CENTER, lags=LAGS, velocity=NONE):
    """A body with drag, whose actuator lags in X and N alone."""
    terms = [lw.terms.ControlWrench(limit=1e3, time_constant=lags), lw.terms.Drag(quadratic=drag)]
    vehicle = lw.Vehicle(
        MASS, inertia=INERTIA, added_mass=(5.0, 22.0, 25.0), buoyancy=buoyancy, center_of_buoyancy=center
    )
    return lw.Scene(vehicle, lw.Environment(GRAVITY), terms, lw.Start(velocity=velocity))


# Weight and buoyancy that act, far below what is compared: so the kernel stays the same.
NEUTRAL = {"buoyancy": MASS * GRAVITY + 1e-12, "center": (0.0, 0.0, -1e-14)}


def at(names, *wanted):
    return [names.index(name) for name in wanted]


@pytest.mark.ci
def test_a_trim_balances_the_forces_of_the_equations():
    found = lw.linear.trim(hover(), 1.5, method="psi_s", h=0.02)
    R, nu = found.start.attitude, found.start.velocity
    assert np.abs(R @ nu - (1.5, 0.0, 0.0)).max() < 1e-12 or found.values["drift"] != 0.0
    assert abs((R @ nu)[2]) < 1e-12
    assert abs(np.linalg.norm(nu) - 1.5) < 1e-12
    w = found.commands["control_wrench"]
    down, p = R[2], np.diag(MASS + np.array((5.0, 22.0, 25.0))) @ nu
    force = w[:3] + (MASS * GRAVITY - BUOYANCY) * down - DRAG[:3] * np.abs(nu) * nu
    torque = w[3:] - BUOYANCY * np.cross(CENTER, down) + np.cross(p, nu)
    # The steady motion of a step is that of the equations but for the splitting, h^2 times products of their rates.
    assert np.abs(force).max() < 0.02**2 * 50.0
    assert np.abs(torque).max() < 0.02**2 * 50.0
    assert found.free == ("roll", "pitch", "drift", *(f"control_wrench[{i}]" for i in range(6)))
    assert found.fixed == {"speed": 1.5}
    assert np.abs(found.residual).max() < 1e-8
    assert "speed 1.5 m/s" in str(found)


@pytest.mark.ci
def test_a_run_from_a_trim_stays_there():
    found = lw.linear.trim(hover(), 1.0, free=("control_wrench",), fixed={"pitch": 0.1}, method="psi_s", h=0.02)
    assert found.free == tuple(f"control_wrench[{i}]" for i in range(6))
    assert found.fixed["pitch"] == 0.1
    scene = dataclasses.replace(hover(), start=found.start)
    bench = MotionBench(lw.Ensemble(plant(scene, 10.0), 1), "psi_s", 0.02, 20.0, 10.0)
    motion = bench.start(np.zeros(1, int))
    motion.memory[""][0, :6] = motion.memory["control_wrench"][0] = found.commands["control_wrench"]
    after = bench.run(np.zeros(1, int), motion, 500, 1000)
    # Of each of 500 steps an acceleration is left; a steady motion that is unstable makes it grow, here by e^3 at most.
    most = np.abs(found.residual).max() * 10.0 * np.exp(3.0) + 1e-12
    assert np.abs(after.apart(motion)[0, 3:]).max() < 10.0 * most
    np.testing.assert_allclose(after.position[0], 10.0 * found.start.attitude @ found.start.velocity, atol=100.0 * most)


@pytest.mark.ci
@pytest.mark.parametrize(("words", "message"), [
    ({"speed": 1.0, "free": ("pitch",)}, "has no steady motion with pitch free"),
    ({"speed": 1.0, "free": ("pich",)}, "Did you mean 'pitch'"),
    ({"speed": 1.0, "fixed": {"speed": 2.0}}, "is given twice"),
    ({"free": ("pitch",), "fixed": {"pitch": 0.1}}, "has a value too"),
])  # fmt: skip
def test_what_has_no_trim(words, message):
    with pytest.raises(lw.SceneError, match=message):
        lw.linear.trim(hover(), **words, method="psi_s", h=0.02)


def test_waves_and_noise_let_nothing_be_steady():
    scene = hover()
    noisy = dataclasses.replace(scene, terms=[*scene.terms, lw.terms.WrenchNoise(force=(1.0, 0.0, 0.0))])
    for study in (lw.linear.trim, lw.linear.linearize):
        with pytest.raises(lw.SceneError, match=r"wrench_noise.*lets no motion be steady"):
            study(noisy, h=0.02)


def neutral():
    """At rest, with no force but the actuator's."""
    return hover(drag=1e-12 * DRAG, **NEUTRAL)


def lagged(inertia, lag, period):
    """(A, B) of place, velocity and a lagged push, in continuous time over a period."""
    rate = np.array(
        [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0 / inertia, 0.0], [0.0, 0.0, -1.0 / lag, 1.0 / lag], [0.0] * 4]
    )
    whole = expm(rate * period)
    return whole[:3, :3], whole[:3, 3]


def test_a_double_integrator_and_a_lag():
    masses = {"X": (MASS + 5.0, "position[0]", "velocity[0]"), "N": (INERTIA[2], "rotation[2]", "angular_velocity[2]")}
    errors = {name: [] for name in masses}
    for h in (0.02, 0.01):
        linear = lw.linear.linearize(neutral(), period=PERIOD, method="psi_s", h=h)
        for i, (name, (mass, place, rate)) in enumerate(masses.items()):
            rows = at(linear.states, place, rate, f"control_wrench.place[{5 * i}]")
            A, B = lagged(mass, LAG, PERIOD)
            push = linear.inputs.index(f"control_wrench[{5 * i}]")
            errors[name].append(np.abs(linear.A[np.ix_(rows, rows)] - A).max())
            # The lag itself is exact: differences of linear numbers have round-off alone, eps / 1e-5.
            np.testing.assert_allclose(linear.A[rows[2], rows[2]], A[2, 2], atol=1e-10)
            np.testing.assert_allclose(linear.B[rows[2], push], B[2], atol=1e-10)
    # A kick of a force that moves within the step is of order 2.
    for each in errors.values():
        assert 3.6 < each[0] / each[1] < 4.4
    rows, push = at(linear.states, "position[1]", "velocity[1]"), linear.inputs.index("control_wrench[1]")
    mass = MASS + 22.0
    np.testing.assert_allclose(linear.A[np.ix_(rows, rows)], [[1.0, PERIOD], [0.0, 1.0]], atol=1e-9)
    np.testing.assert_allclose(linear.B[rows, push], [0.5 * PERIOD**2 / mass, PERIOD / mass], atol=1e-10)
    assert linear.outputs == linear.states[:12]
    assert np.array_equal(linear.C, np.eye(12, 18))
    assert not linear.D.any()
    assert linear.inputs == tuple(f"control_wrench[{i}]" for i in range(6))


def test_the_error_of_the_differences_goes_with_their_square():
    """Drag stops |v| v exactly: after T a speed v is v / (1 + q v T), whose derivative is 1 / (1 + q v T)^2."""
    speed, q = 1.5, DRAG[0] / (MASS + 5.0)
    scene = hover(**NEUTRAL, velocity=(speed, 0.0, 0.0))
    errors = []
    for step in (0.04, 0.02):
        linear = lw.linear.linearize(scene, period=PERIOD, method="psi_s", h=0.02, step=step)
        row = linear.states.index("velocity[0]")
        errors.append(linear.A[row, row] - 1.0 / (1.0 + q * speed * PERIOD) ** 2)
    # step^2 v^2 / 6 times the third derivative, 6 (q T)^2 / (1 + q v T)^4.
    for step, error in zip((0.04, 0.02), errors, strict=True):
        expected = (step * speed * q * PERIOD) ** 2 / (1.0 + q * speed * PERIOD) ** 4
        assert abs(error / expected - 1.0) < 0.01
    linear = lw.linear.linearize(scene, period=PERIOD, method="psi_s", h=0.02)
    assert abs(linear.A[row, row] - 1.0 / (1.0 + q * speed * PERIOD) ** 2) < 1e-10


def test_a_part_and_a_state_space():
    control = pytest.importorskip("control")
    linear = lw.linear.linearize(neutral(), period=PERIOD, method="psi_s", h=0.02)
    surge = linear.part(("position[0]", "velocity[0]", "control_wrench.place[0]"), ("control_wrench[0]",))
    system = surge.state_space()
    assert isinstance(system, control.StateSpace)
    assert (system.dt, system.nstates) == (PERIOD, 3)
    np.testing.assert_array_equal(system.A, surge.A)
    assert linear.part(("velocity",)).states == ("velocity[0]", "velocity[1]", "velocity[2]")
    with pytest.raises(lw.SceneError, match="velocities"):
        linear.part(("velocities",))


WEIGHTS = np.repeat((4.0, 9.0, 1.0, 2.0), 3), np.full(6, 0.02)


def regulated(law=None):
    """A free body under a state feedback, whose actuator follows at once; with an event that never comes.

    So the kernel of its runs is that of the models above, which have no merged lead.
    """
    law = law or lw.control.StateFeedback(K=np.zeros((6, 12)))
    controller = lw.Controller(
        period=PERIOD, guidance=[lw.control.SetPoint(position=NONE, heading=0.0)], laws=[law],
        allocation=[lw.control.AllocationMatrix(to="control_wrench", matrix=np.eye(6))])  # fmt: skip
    free = hover(drag=1e-12 * DRAG, lags=(1e-9,) * 6, **NEUTRAL)
    return dataclasses.replace(free, controller=controller, events=[lw.events.StopTime(at=1e9)])


@pytest.fixture(scope="module")
def regulator():
    linear = lw.linear.linearize(regulated(), method="psi_s", h=0.02)
    # Nothing depends on where an actuator was that follows at once.
    assert not linear.A[:, 12:].any()
    motion = linear.part(("position", "rotation", "velocity", "angular_velocity"))
    return lw.linear.lqr(dataclasses.replace(motion, inputs=("X", "Y", "Z", "K", "M", "N")), *WEIGHTS)


def test_a_regulator_in_the_loop(regulator):
    closed = lw.linear.linearize(regulated(regulator.law()), 1.0, closed=True, method="psi_s", h=0.02)
    # Commands are states of the loop after a tick; they add poles at 0.
    expected = np.concatenate([regulator.poles, np.zeros(len(closed.poles) - 12)])
    apart = np.abs(closed.poles[:, None] - expected)
    assert apart.min(axis=0).max() < 1e-6
    assert apart.min(axis=1).max() < 1e-6
    assert np.abs(closed.poles).max() < 1.0


def test_the_law_of_a_moving_vehicle_has_the_gains_of_the_model(regulator):
    """The law's error of velocity is taken in the axes of the vehicle, and that of the model in those of the steady motion."""
    rng = np.random.default_rng(7)
    R, v, K = Rotation.from_rotvec((0.3, -0.5, 1.0)).as_matrix(), np.array((1.5, -0.2, 0.4)), rng.normal(size=(6, 12))
    moving = dataclasses.replace(regulator.model, about=regulator.model.about | {"velocity": v, "attitude": R})
    law = dataclasses.replace(regulator, K=K, model=moving).law("steady")
    assert law.key == "steady"
    wanted = Reference(np.zeros(3), R @ v, R, np.zeros(3), 0.0)
    left = []
    for size in (1e-3, 5e-4):
        x = size * np.array((0.3, -0.2, 0.5, 0.7, -0.4, 0.2, 0.1, 0.6, -0.3, 0.2, 0.4, -0.8))
        turned = R @ Rotation.from_rotvec(x[3:6]).as_matrix()
        e, e_R, velocity, rate = pose_errors(wanted, Measurement(x[:3], turned, v + x[6:9], v + x[6:9], x[9:]))
        left.append(np.abs(law.K @ np.concatenate([-e, e_R, -velocity, -rate]) - K @ x).max())
    # Errors of second order: a quarter at half the size.
    assert left[0] < 1e-5
    assert 3.8 < left[0] / left[1] < 4.2


def cost(result, start=0):
    """The sum over ticks of x^T Q x + u^T R u of each member."""
    skew = [result.attitude[:, :, i, j] - result.attitude[:, :, j, i] for i, j in ((2, 1), (0, 2), (1, 0))]
    x = np.concatenate([result.position, 0.5 * np.stack(skew, -1), result.velocity, result.angular_velocity], axis=-1)
    return (x**2 @ WEIGHTS[0] + result.command**2 @ WEIGHTS[1]).sum(axis=0)


def test_the_cost_of_a_run_is_that_of_the_matrix_and_no_other_gains_have_less(regulator):
    x = np.random.default_rng(3).normal(size=12) * 1e-4
    R = np.eye(3) + np.array([[0.0, -x[5], x[4]], [x[5], 0.0, -x[3]], [-x[4], x[3], 0.0]])
    u, _, v = np.linalg.svd(R)
    scene = regulated(regulator.law())
    K = np.asarray(scene.controller.laws[0].K)
    factors = np.array((1.0, 0.9, 1.1, 1.3))
    n = len(factors)
    states = (np.tile(x[:3], (n, 1)), np.tile(u @ v, (n, 1, 1)), np.tile(x[6:9], (n, 1)), np.tile(x[9:], (n, 1)))
    gains = {"state_feedback.K": factors[:, None, None] * K}
    fleet = lw.Ensemble.from_states(scene, *states, gains)
    save = lw.SaveAt(every=PERIOD, fields=("position", "attitude", "velocity", "angular_velocity", "command"))
    costs = cost(lw.solve(fleet, "psi_s", h=0.02, t1=40.0, save=save))
    least = x @ regulator.P @ x
    # What is not linear is of the size of the state, 1e-4, beside 1; the end at 40 s is e^-20 of the start.
    assert abs(costs[0] / least - 1.0) < 1e-4
    for factor, of_run in zip(factors[1:], costs[1:], strict=True):
        gain = factor * regulator.K
        closed = regulator.model.A - regulator.model.B @ gain
        P = solve_discrete_lyapunov(closed.T, np.diag(WEIGHTS[0]) + gain.T @ np.diag(WEIGHTS[1]) @ gain)
        assert of_run > costs[0]
        assert abs(of_run / (x @ P @ x) - 1.0) < 1e-4


def test_what_has_no_regulator(regulator):
    with pytest.raises(lw.SceneError, match=r"Q = .*has shape"):
        lw.linear.lqr(regulator.model, np.ones(3), np.ones(6))
    with pytest.raises(lw.SceneError, match=r"R = .*is not symmetric and positive"):
        lw.linear.lqr(regulator.model, np.ones(12), np.zeros(6))
    with pytest.raises(lw.SceneError, match="poles that no input moves are 1"):
        lw.linear.lqr(regulator.model.part(regulator.model.states, ("X",)), np.ones(12), np.ones(1))
    lagging = lw.linear.linearize(neutral(), period=PERIOD, method="psi_s", h=0.02)
    with pytest.raises(lw.SceneError, match=r"control_wrench\.place\[0\].*is nothing that a state feedback knows"):
        lw.linear.lqr(lagging, np.ones(18), np.ones(6)).law()


@pytest.mark.parametrize(("words", "message"), [
    ({"inputs": "thrust"}, "Did you mean|Known: commands"), ({"closed": True, "period": 0.2}, "is that of a plant"),
    ({"about": 3.0}, "is not a motion"), ({"step": 0.0}, "step"),
])  # fmt: skip
def test_what_cannot_be_linearised(words, message):
    with pytest.raises(lw.SceneError, match=message):
        lw.linear.linearize(regulated(), **words, method="psi_s", h=0.02)
    with pytest.raises(lw.SceneError, match="needs a controller"):
        lw.linear.linearize(neutral(), closed=True, h=0.02)


def by_equations(start, rudder):
    """Continuous (F, G): rates of position, rotation, velocity and angular velocity, by these and by the rudder."""
    R, nu = start.attitude, start.velocity

    def rates(x, deflection):
        turned = R @ Rotation.from_rotvec(x[3:6]).as_matrix()
        velocity = np.concatenate([nu + x[6:9], x[9:]])
        pushed = equations.acceleration(velocity, turned[2], deflection, equations.LEVER, equations.TORQUE)
        # Without rates a rotation vector moves as they do.
        return np.concatenate([turned @ velocity[:3], x[9:], pushed])

    delta = 1e-6
    F = [(rates(x, rudder) - rates(-x, rudder)) / (2.0 * delta) for x in delta * np.eye(12)]
    G = (rates(np.zeros(12), rudder + delta) - rates(np.zeros(12), rudder - delta)) / (2.0 * delta)
    return np.array(F).T, G, rates(np.zeros(12), rudder)[6:]


@pytest.mark.slow
def test_trim_and_model_of_remus_beside_equations_written_once_more():
    scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, start=lw.Start(velocity=(1.5, 0.0, 0.0)))
    left, errors = [], []
    for h in (0.02, 0.01):
        found = lw.linear.trim(scene, method="psi_x", h=h)
        F, G, rates = by_equations(found.start, found.commands["control_fins"][0])
        left.append(np.abs(rates).max())
        whole = expm(np.block([[F, G[:, None]], [np.zeros((1, 13))]]) * PERIOD)
        linear = lw.linear.linearize(scene, found, period=PERIOD)
        errors.append([np.abs(linear.A - whole[:12, :12]).max(), np.abs(linear.B[:, 0] - whole[:12, 12]).max()])
    # The steady speed is known, and so is the roll that the propeller's torque holds.
    assert abs(found.values["speed"] - equations.CRUISE) < 1e-4
    roll = np.arcsin(equations.TORQUE / (equations.LEVER * equations.WEIGHT))
    assert abs(found.values["roll"] - roll) < 1e-4
    assert left[1] < 1e-4
    # Order 2 of the steps, but for the differences of |v| v, which are first order in their own size, 1e-5.
    ratios = np.array(errors[0]) / np.array(errors[1])
    assert np.all(ratios > 3.5)
    assert np.all(ratios < 4.5)
    assert np.max(errors[1]) < 1e-2
