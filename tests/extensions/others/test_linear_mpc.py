# SPDX-License-Identifier: Apache-2.0
"""Linear model predictive control: against its twin, exact quadratic programs, Riccati's equation, and in closed loops."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import lsq_linear, nnls

import lgvi_warp as lw
from lgvi_warp.extensions.others.control.linear_mpc import COORDINATES
from lgvi_warp.extensions.others.twin import linear_mpc
from lgvi_warp.robustness.linear.bench import COORDINATES as OF_MODELS
from tests.support.loops import torpedo, twin_states

T = 0.1
STATES = ("position[2]", "velocity[2]", "angular_velocity[1]")
NUMBERS = dict(
    A=np.array([[1.0, T, 0.0], [0.0, 0.95, 0.01], [0.0, 0.02, 0.9]]),
    B=np.array([[T * T / 40.0, 0.0], [T / 20.0, 0.001], [0.0, T / 5.0]]),
    Q=np.array([3.0, 0.1, 0.2]), R=np.array([1e-4, 1e-3]), limit=np.array([5.0, 2.0]), horizon=6,
)  # fmt: skip
NAMES = dict(states=STATES, inputs=("Z", "M"), tracked=("position[2]", "angular_velocity[1]"))
RATES = dict(rate_limit=np.array([20.0, 10.0]))


def law(**more):
    return lw.control.LinearMPC(**NAMES, **(NUMBERS | more))


def twin(**more):
    part = linear_mpc.LinearMPC(**NAMES, **(NUMBERS | more))
    part.begin()
    return part


@pytest.mark.ci
@pytest.mark.parametrize(
    "more", [{}, RATES, RATES | {"horizon": 1, "disturbance_time": np.inf}], ids=["", "rates", "one"]
)
@pytest.mark.kernel
def test_check_controller_finds_nothing(more):
    report = lw.laws.check_controller(law(**more), twin=twin(**more))
    assert report.ok, str(report)


@pytest.mark.ci
@pytest.mark.kernel
def test_every_state_and_input_is_that_of_the_twin():
    rng = np.random.default_rng(4)
    A = np.eye(12) + 0.02 * rng.normal(size=(12, 12))
    B = np.concatenate([0.01 * np.eye(6), 0.1 * np.eye(6)]) + 0.001 * rng.normal(size=(12, 6))
    numbers = dict(states=list(COORDINATES), inputs=list("XYZKMN"), A=A, B=B, Q=rng.uniform(1.0, 2.0, 12), R=np.full(6, 0.1),
                   limit=rng.uniform(3.0, 9.0, 6), horizon=2, rate_limit=np.full(6, 40.0))  # fmt: skip
    report = lw.laws.check_controller(lw.control.LinearMPC(**numbers), twin=linear_mpc.LinearMPC(**numbers))
    assert report.ok, str(report)


@pytest.mark.slow
def test_its_law_within_the_limits_is_that_of_the_regulator():
    """All states and inputs at once; the regulator's StateFeedback has a test of its own for its signs."""
    scene = lw.Scene.named("bluerov2_heavy", start={"position": [0.0, 0.0, 5.0]})
    model = lw.linear.linearize(scene, period=T, inputs="wrench", method="psi_s", h=0.02).part(list(COORDINATES))
    Q, R = [4.0] * 3 + [9.0] * 3 + [1.0] * 6, [0.01] * 6
    wanted = lw.control.SetPoint(position=(0.02, -0.03, 5.04), heading=0.02)
    demands = []
    for part in (lw.linear.mpc(model, Q, R, limit=[1e3] * 6, horizon=3), lw.linear.lqr(model, Q, R).law()):
        controller = lw.Controller(period=T, guidance=[wanted], laws=[part])
        driven = dataclasses.replace(scene, controller=controller)
        start = dict(velocity=(0.01, 0.02, -0.01), angular_velocity=(0.01, -0.02, 0.03), euler_deg=(2.0, -1.0, 1.0))
        driven = dataclasses.replace(driven, start=lw.Start(position=(0.0, 0.0, 5.0), **start))
        save = lw.SaveAt(every=T, fields=("demand",))
        demands.append(lw.solve(driven, "psi_s", h=0.02, t1=T, save=save).samples["demand"][0, 0])
    assert np.abs(demands[0]).min() > 1e-3
    np.testing.assert_allclose(demands[0], demands[1], rtol=1e-9, atol=1e-9)


def problem(part, x, d):
    """(H, f) in parts of limits."""
    H, f = part.problem(x, d)
    scale = np.tile(part.limit, part.horizon)
    return scale[:, None] * H * scale, scale * f


def exact(H, f, before, change):
    """The inputs of least cost v H v / 2 + f v within +-1 and, for changes, +-change: no iterations of ours."""
    root = np.linalg.cholesky(H).T
    goal = -np.linalg.solve(root.T, f)
    if change is None:
        return lsq_linear(root, goal, (-1.0, 1.0), method="bvls", tol=1e-15, max_iter=10_000).x
    # A least distance: G v >= h is that of y = root v - goal; Lawson & Hanson (1974), chapter 23.
    size, m = len(f), len(before)
    D, since = np.eye(size) - np.eye(size, k=-m), np.concatenate([before, np.zeros(size - m)])
    changes = np.tile(change, size // m)
    G = np.concatenate([np.eye(size), -np.eye(size), D, -D])
    h = np.concatenate([-np.ones(2 * size), since - changes, -since - changes])
    G = np.linalg.solve(root.T, G.T).T
    h = h - G @ goal
    u, _ = nnls(np.concatenate([G.T, h[None]]), np.eye(size + 1)[-1], maxiter=10_000)
    r = np.concatenate([G.T @ u, [h @ u - 1.0]])
    return np.linalg.solve(root, goal - r[:-1] / r[-1])


def cases(part, count=60, seed=1):
    """Random states, disturbances and last inputs."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield rng.normal(size=3) * (1.0, 0.5, 0.5), 0.02 * rng.normal(size=3), rng.uniform(-0.9, 0.9, 2)


@pytest.mark.parametrize("more", [{}, RATES, RATES | {"horizon": 20}, RATES | {"R": np.array([1e-7, 1e-6])}])
def test_problems_are_solved(more):
    """To 1e-6 of the limits, in the default iterations and in a third of them; the gap ends at 1e-12 of the slope."""
    saturated = 0
    for iterations in (50, 18):
        part = twin(**(more | {"iterations": iterations}))
        change = T * RATES["rate_limit"] / part.limit if "rate_limit" in more else None
        for x, d, before in cases(part, 30):
            H, f = problem(part, x, d)
            true = exact(H, f, before, change)
            saturated += np.abs(true + np.linalg.solve(H, f)).max() > 1e-6
            found = part.solved(H, f, before, change).ravel()
            assert np.abs(found - true)[:2].max() < 1e-6
            cost, least = (v @ H @ v / 2.0 + f @ v for v in (found, true))
            assert cost - least < 1e-9 * (abs(least) + np.abs(f).max())
    assert saturated > 10


def rushing(iterations, dtype="float64"):
    """A body whose law has a long horizon, a small cost of inputs and rate limits; its depths and demands, and the result."""
    part = lw.control.LinearMPC(states=["position[2]", "velocity[2]"], inputs=["Z"], A=RUSH["A"], B=RUSH["B"], Q=RUSH["Q"],
                                R=RUSH["R"], limit=[40.0], rate_limit=[60.0], disturbance_time=np.inf, horizon=20,
                                iterations=iterations)  # fmt: skip
    loop = lw.Controller(period=T, guidance=[lw.control.SetPoint(depth=12.0)], laws=[part])
    body = lw.Vehicle(
        20.0, inertia=(5.0, 8.0, 11.0), added_mass=(0, 0, 0), buoyancy=200.0, center_of_buoyancy=(0, 0, 0)
    )
    terms = [lw.terms.ControlWrench(limit=1e6), lw.terms.Drag(linear=(5, 8, 9.0, 2, 3, 4.0))]
    scene = lw.Scene(body, lw.Environment(gravity=10.0), terms, lw.Start(position=(0, 0, 5.0)), loop)
    save = lw.SaveAt(every=T, fields=("position", "demand", "unconverged"))
    return lw.solve(scene, "rk4", h=0.02, t1=8.0, dtype=dtype, save=save)


DECAY = np.exp(-9.0 / 20.0 * T)
GAIN = (1.0 - DECAY) / 9.0
RUSH = dict(A=np.array([[1.0, 20.0 * GAIN], [0.0, DECAY]]), B=np.array([[(T - 20.0 * GAIN) / 9.0], [GAIN]]),
            Q=np.array([40.0, 0.0]), R=np.array([1e-4]))  # fmt: skip


@pytest.mark.ci
def test_a_loop_with_rate_limits_is_that_of_exact_problems():
    """Depths and demands of problems that Lawson & Hanson's method solves at each tick: an overshoot of 0.428 m."""
    part = linear_mpc.LinearMPC(
        states=["position[2]", "velocity[2]"], inputs=["Z"], limit=np.array([40.0]), horizon=20, **RUSH
    )
    x, u, depths, demands = np.array([-7.0, 0.0]), np.zeros(1), [], []
    for _ in range(81):
        H, f = problem(part, x, np.zeros(2))
        u = exact(H, f, u, np.array([0.15]))[:1]
        depths, demands = [*depths, x[0]], [*demands, 40.0 * u[0]]
        x = RUSH["A"] @ x + RUSH["B"] @ (40.0 * u)
    assert max(depths) == pytest.approx(0.428, abs=1e-3)
    result = rushing(50)
    np.testing.assert_allclose(result.samples["demand"][:, 0, 2], demands, atol=1e-4)
    np.testing.assert_allclose(result.position[:, 0, 2] - 12.0, depths, atol=1e-5)
    assert not result.warnings.any()
    assert result.samples["unconverged"][-1, 0] == 0.0
    # Of float32 the demand is right to a part of 1e-2: the overshoot to 1 %.
    assert (rushing(50, "float32").position[:, 0, 2] - 12.0).max() == pytest.approx(max(depths), rel=0.01)


@pytest.mark.ci
def test_too_few_iterations_are_told():
    result = rushing(3)
    count = result.samples["unconverged"][:, 0]
    assert result.warnings.counts() == {"control_not_converged": 1}
    assert result.warning_time[0] == 0.0
    # From the first tick on, where the body is far from its depth; the count grows by 1 a tick at most.
    assert count[0] == 1.0
    assert set(np.diff(count)) == {0.0, 1.0}
    assert result.warning_value[0] == count[-1] > 20
    (message,) = (text for text in result.messages if "had converged" in text)
    assert f"1 of 1 members ({count[-1]:.0f} times at most, first in member 0 at 0 s)" in message
    assert lw.Warnings.CONTROL_NOT_CONVERGED.text in message


def test_within_the_limits_it_is_the_regulator_of_a_finite_horizon():
    """Riccati's difference equation, backward from P: to round-off."""
    P = np.diag([5.0, 2.0, 1.0]) + 0.1
    part = twin(limit=np.array([1e3, 1e3]), P=P, iterations=1, horizon=20)
    own = law(limit=np.array([1e3, 1e3]), P=P, iterations=1, horizon=20)
    A, B, Q, R = NUMBERS["A"], NUMBERS["B"], np.diag(NUMBERS["Q"]), np.diag(NUMBERS["R"])
    for _ in range(20):
        K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ K)
    numbers = {name: np.asarray(value)[None] for name, value in own.parameters().items()}
    best = own.condensed(numbers, 0, T).best
    np.testing.assert_allclose(best[:2, :3] * 1e3, -K, rtol=1e-11, atol=1e-9)
    x = np.array([0.3, -0.2, 0.1])
    H, f = problem(part, x, np.zeros(3))
    np.testing.assert_allclose(part.solved(H, f, np.zeros(2), None)[0] * 1e3, -K @ x, rtol=1e-10)
    # Under a disturbance it holds the steady state: the first input there is the steady one.
    d = np.array([0.01, -0.02, 0.03])
    x_s, u_s = part.steady_state(d)
    np.testing.assert_allclose(A @ x_s + B @ u_s + d, x_s, atol=1e-14)
    np.testing.assert_allclose((best @ np.concatenate([x_s, d]))[:2] * 1e3, u_s, rtol=1e-9)


H, EVERY = 0.05, 2


def heaving(part, buoyancy=20.0 * 9.8 + 3.0, depth=4.0):
    """A body that its law alone holds at a depth, 3 N too light."""
    wanted = [lw.control.SetPoint(depth=depth, heading=0.0)]
    heading = lw.control.HeadingPID(kp=30.0, kd=40.0)
    controller = lw.Controller(period=T, guidance=wanted, laws=[part, heading])
    drag = lw.terms.Drag(linear=(3.0, 40.0, 40.0, 3.0, 4.0, 5.0), quadratic=(20.0, 90.0, 90.0, 1.0, 2.0, 3.0))
    limit = lw.terms.ControlWrench(limit=(60.0, 60.0, 60.0, 20.0, 20.0, 20.0))
    return lw.Scene(
        torpedo(buoyancy, (0.0, 0.0, -0.1)), lw.Environment(gravity=9.8), [drag, limit], controller=controller
    )


def designed(**more):
    """The law of heave by the linear model of its scene at rest."""
    plain = heaving(lw.control.HeavePID(kp=30.0, kd=40.0), 20.0 * 9.8)
    model = lw.linear.linearize(plain, period=T, inputs="wrench", method="psi_s", h=H)
    settings = dict(Q=[4.0, 0.1], R=[1e-3], limit=[12.0], rate_limit=[30.0]) | more
    return lw.linear.mpc(model.part(("position[2]", "velocity[2]"), ("Z",)), **settings)


@pytest.fixture(scope="module")
def heave():
    return designed()


def start(n):
    depths = np.linspace(0.5, 6.0, n)
    position = np.column_stack([np.zeros((n, 2)), depths])
    return position, np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)), np.zeros((n, 3))


@pytest.fixture(scope="module")
def loop(heave):
    """Five depths and limits of their own, for half a minute."""
    varied = {"linear_mpc.limit": np.array([[12.0], [8.0], [20.0], [12.0], [30.0]])}
    fleet = lw.Ensemble.from_states(heaving(heave), *start(5), varied)
    fields = ("position", "attitude", "velocity", "angular_velocity", "demand")
    return varied, lw.solve(fleet, "psi_s", h=H, t1=40.0, save=lw.SaveAt(every=T, fields=fields))


@pytest.mark.slow
def test_a_saturated_loop_is_that_of_the_twin(heave, loop):
    varied, result = loop
    given = start(5)
    # A law of states is unlike those of loops.py: it takes its lists as they are.
    for i in (0, 4):
        numbers = {name: values[i] for name, values in varied.items()}
        b, R = twin_states(heaving(heave), numbers, [x[i] for x in given], EVERY, H, 200)
        # The limits of inputs make the loop jump nowhere: round-off of 100 ticks, as in test_laws.py.
        assert np.abs(result.position[: len(b), i] - b).max() < 1e-9
        assert np.abs(result.attitude[: len(b), i] - R).max() < 1e-9


@pytest.mark.ci
def test_a_loop_keeps_its_limits_and_leaves_no_error(loop):
    varied, result = loop
    Z = result.samples["demand"][..., 2]
    assert np.all(np.abs(Z) <= varied["linear_mpc.limit"][:, 0] + 1e-12)
    assert np.abs(np.diff(Z, axis=0)).max() <= 30.0 * T + 1e-9
    # The first member is at both limits for a while.
    assert np.sum(np.abs(Z[:, 0]) > 12.0 - 1e-9) > 10
    assert np.sum(np.abs(np.diff(Z[:, 0])) > 3.0 - 1e-9) >= 3
    # Too light by 3 N, which the model does not know: time constants of 5 s, so that e^-8 is left after 40 s.
    assert np.abs(result.position[-1, :, 2] - 4.0).max() < 5e-3
    np.testing.assert_allclose(Z[-1], 3.0, atol=0.05)


@pytest.mark.slow
def test_without_a_disturbance_an_error_is_left(heave):
    """Then the law is a regulator: it settles where the gain of the depth makes what is missing."""
    plain = dataclasses.replace(heave, disturbance_time=np.inf)
    result = lw.solve(
        lw.Ensemble.from_states(heaving(plain), *start(2)), "psi_s", h=H, t1=60.0, save=lw.SaveAt(every=60.0)
    )
    K = lw.linear.lqr(lw.linear.linearize(heaving(plain), period=T, inputs="wrench", method="psi_s", h=H).part(
        ("position[2]", "velocity[2]"), ("Z",)), [4.0, 0.1], [1e-3]).K  # fmt: skip
    np.testing.assert_allclose(result.position[-1, :, 2] - 4.0, -3.0 / K[0, 0], rtol=1e-3)


@pytest.mark.slow
def test_remus_goes_to_its_depth_by_fins_at_their_limit():
    """From trim to 5 m deeper: the moment is within its box, the depth comes without an error, and better than it began."""
    scene = lw.Scene.named(
        "remus_100", vehicle={"buoyancy": 300.0}, start={"position": [0, 0, 5.0], "velocity": [1.5, 0, 0]}
    )
    steady = lw.linear.trim(scene, method="psi_x", h=0.05)
    model = lw.linear.linearize(scene, steady, period=T, inputs="wrench")
    names = ("position[2]", "rotation[1]", "velocity[2]", "angular_velocity[1]")
    part = lw.linear.mpc(model.part(names, ("M",)), Q=[0.05, 5.0, 0.0, 1.0], R=[0.1], limit=[2.0], rate_limit=[10.0],
                         horizon=20, disturbance_time=10.0)  # fmt: skip
    fins = lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -0.14], [0, 0, 0, 0, -0.14, 0]])
    controller = lw.Controller(period=T, guidance=[lw.control.SetPoint(depth=10.0, heading=0.0)],
                               laws=[part, lw.control.HeadingPID(kp=10.0, kd=20.0)], allocation=[fins])  # fmt: skip
    driven = dataclasses.replace(scene, start=steady.start, controller=controller)
    save = lw.SaveAt(every=T, fields=("position", "demand", "unmet"))
    result = lw.solve(driven, "psi_x", h=0.05, t1=120.0, save=save)
    M, delivered = (result.samples["demand"] - share * result.samples["unmet"] for share in (0.0, 1.0))
    M, delivered = M[:, 0, 4], delivered[:, 0, 4]
    assert result.status[0] == lw.Status.OK
    # At its limit.
    assert 1.99 < np.abs(M).max() <= 2.0 + 1e-9
    # From what acted over the last period.
    assert np.abs(M[1:] - delivered[:-1]).max() <= 10.0 * T + 1e-9
    assert abs(result.position[-1, 0, 2] - 10.0) < 0.02
    assert result.position[:, 0, 2].max() < 10.2


@pytest.mark.slow
def test_bluerov2_holds_its_depth_by_thrusters():
    scene = lw.Scene.named("bluerov2_heavy")
    model = lw.linear.linearize(scene, period=T, inputs="wrench", method="psi_s", h=0.02)
    part = lw.linear.mpc(model.part(("position[2]", "velocity[2]"), ("Z",)), Q=[10.0, 0.1], R=[1e-3], limit=[40.0],
                         rate_limit=[100.0], disturbance_time=2.0)  # fmt: skip
    controller = lw.Controller(period=T, guidance=[lw.control.SetPoint(depth=3.0, heading=0.0)],
                               laws=[part, lw.control.HeadingPID(kp=10.0, kd=10.0)])  # fmt: skip
    held = dataclasses.replace(scene, controller=controller)
    save = lw.SaveAt(every=T, fields=("position", "demand"))
    result = lw.solve(held, "psi_s", h=0.02, t1=40.0, save=save)
    Z = result.samples["demand"][:, 0, 2]
    assert np.abs(Z).max() == pytest.approx(40.0, abs=1e-9)
    assert abs(result.position[-1, 0, 2] - 3.0) < 0.01
    assert result.position[:, 0, 2].max() < 3.3


@pytest.mark.parametrize(("more", "words"), [
    ({"horizon": 101}, "linear_mpc.horizon = 101 is too long. Give 1 to 100"),
    ({"horizon": 0}, "linear_mpc.horizon = 0 is not a number of periods"),
    ({"iterations": 0}, "linear_mpc.iterations = 0"),
    ({"R": [0.0, 1.0]}, "linear_mpc.R.*not positive"),
    ({"Q": [-1.0, 1.0, 1.0]}, "linear_mpc.Q.*out of bounds"),
    ({"rate_limit": [0.0, 1.0]}, "linear_mpc.rate_limit.*not positive"),
    ({"limit": [0.0, 1.0]}, "linear_mpc.limit.*not positive"),
    ({"P": np.diag([1.0, -1.0, 1.0])}, "linear_mpc.P.*is not symmetric and at least 0"),
    ({"A": np.eye(2)}, r"linear_mpc\.B.*Give 2 x"),
    ({"states": STATES[:2]}, r"linear_mpc.states.*are 2. Name the 3 of A and B"),
    ({"states": ("depth", *STATES[1:])}, r"linear_mpc.states\[0\] = 'depth'"),
    ({"tracked": ["velocity[0]"]}, r"linear_mpc.tracked\[0\] = 'velocity\[0\]'"),
    ({"tracked": STATES}, "linear_mpc.tracked.*are 3. Name at most 2"),
    # The depth follows from its rate: no inputs hold another rate.
    ({"B": np.zeros((3, 2))}, "linear_mpc.tracked.*has no steady inputs"),
])  # fmt: skip
def test_bad_input(more, words):
    with pytest.raises(lw.SceneError, match=words):
        lw.control.LinearMPC(**(NAMES | NUMBERS | more))


def test_another_period_than_the_model_s_is_refused(heave):
    scene = heaving(heave)
    with pytest.raises(
        lw.SceneError, match=r"linear_mpc\.period = 0.1 is that of the model, and the controller's is 0.2 s"
    ):
        dataclasses.replace(scene, controller=dataclasses.replace(scene.controller, period=0.2))


def test_states_have_the_names_of_linear_models():
    assert tuple(COORDINATES) == OF_MODELS


def test_a_law_of_a_scene_file_is_the_same(heave):
    again = lw.control.LinearMPC(**{name: value for name, value in heave.to_dict().items() if name != "type"})
    for name in ("A", "B", "P", "Q", "R", "limit", "rate_limit"):
        np.testing.assert_array_equal(getattr(again, name), getattr(heave, name))
    assert again.states == heave.states


def test_limits_that_exclude_each_other_leave_the_box(heave):
    """The last inputs are beyond the box by more than a period's change: they go back into the box at once."""
    part = twin(**RATES)
    part.begun, part.u = True, np.array([9.0, -3.0])
    change = T * RATES["rate_limit"] / part.limit
    f_H = problem(part, np.array([1.0, 0.0, 0.0]), np.zeros(3))
    found = part.solved(*f_H, part.u / part.limit, change)
    assert np.all(np.isfinite(found))
    assert np.all(np.abs(found) <= 1.0)


@pytest.mark.ci
def test_singular_weights_have_an_answer():
    """Weights on inputs alone give no input; weights on the depth alone leave a problem of R."""
    none = twin(Q=np.zeros(3), limit=np.array([1e3, 1e3]))
    H_, f = problem(none, np.ones(3), np.zeros(3))
    np.testing.assert_allclose(none.solved(H_, f, np.zeros(2), None), 0.0, atol=1e-15)
    depth = twin(Q=np.array([1.0, 0.0, 0.0]), R=np.array([1e-12, 1e-12]))
    H_, f = problem(depth, np.ones(3), np.zeros(3))
    assert np.all(np.isfinite(depth.solved(H_, f, np.zeros(2), None)))
    report = lw.laws.check_controller(law(Q=np.zeros(3)))
    assert report.ok, str(report)


@pytest.mark.ci
def test_a_run_goes_on_in_the_middle_of_its_problems(heave):
    fleet = lw.Ensemble.from_states(heaving(heave), *start(3))
    saved = {"fields": ("position", "attitude", "velocity", "angular_velocity")}
    whole = lw.solve(fleet, "psi_s", h=H, t1=2.0, save=lw.SaveAt(every=1.0, **saved))
    first = lw.solve(fleet, "psi_s", h=H, t1=1.0, save=lw.SaveAt(**saved))
    second = lw.solve(fleet, "psi_s", h=H, t1=2.0, save=lw.SaveAt(**saved), start=first.final)
    for name in saved["fields"]:
        assert whole.samples[name][-1].tobytes() == second.samples[name][-1].tobytes(), name


@pytest.mark.slow
def test_one_many_and_float32(heave):
    n = 4096
    fleet = lw.Ensemble.from_states(heaving(heave), *start(n))
    many = lw.solve(fleet, "psi_s", h=H, t1=20.0, save=lw.SaveAt(every=5.0))
    one = lw.solve(lw.Ensemble.from_states(heaving(heave), *(x[-1:] for x in start(n))), "psi_s", h=H, t1=20.0,
                   save=lw.SaveAt(every=5.0))  # fmt: skip
    np.testing.assert_allclose(one.position[:, 0], many.position[:, -1], atol=1e-9)
    short = lw.solve(fleet, "psi_s", h=H, t1=20.0, save=lw.SaveAt(every=5.0), dtype="float32")
    # Round-off of float32 in problems whose numbers spread over some 1e3.
    assert np.abs(short.position - many.position).max() < 1e-3
