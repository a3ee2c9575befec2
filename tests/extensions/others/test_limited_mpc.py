# SPDX-License-Identifier: Apache-2.0
"""Model predictive control with unequal limits and limits of outputs: exact programs and the twin."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.optimize import lsq_linear, nnls

import lgvi_warp as lw
from lgvi_warp.extensions.others.twin import linear_mpc
from tests.extensions.others.test_linear_mpc import NAMES, RATES, T
from tests.extensions.others.test_linear_mpc import NUMBERS as SYMMETRIC
from tests.support.loops import twin_states
from tests.support.refusals import refused, says

NUMBERS = SYMMETRIC | dict(
    lower=np.array([-1.0, -2.0]), outputs=np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.2]]),
    output_limit=np.array([0.04, 0.06]), excess_cost=np.array([200.0, 50.0]),
)  # fmt: skip


def law(**more):
    return lw.control.LinearMPC(**NAMES, **(NUMBERS | more))


def twin(**more):
    part = linear_mpc.LinearMPC(**NAMES, **(NUMBERS | more))
    part.begin()
    return part


def exact(H, f, C, room, cost):
    """Inputs of least v H v / 2 + f v + cost e, by the dual problem, bounded least squares, whose active sets are SciPy's."""
    # Multipliers between 0 and the cost; a limit gives way by `eps` times its multiplier, far below what is asserted.
    eps, root = 1e-9, np.linalg.cholesky(H)
    A, b = np.linalg.solve(root, C.T), np.linalg.solve(root, f)
    whole = np.concatenate([A, np.sqrt(eps) * np.eye(len(room))])
    wanted = np.concatenate([-b, -room / np.sqrt(eps)])
    found = lsq_linear(whole, wanted, (0.0, cost), method="bvls", tol=1e-15, max_iter=10_000)
    return -np.linalg.solve(H, f + C.T @ found.x)


def gap_to_the_dual(v, H, f, C, room, cost):
    """What v costs beyond a bound from below of all costs, of the dual problem at any multipliers, here three guesses."""
    left, soft, root = room - C @ v, np.isfinite(cost), np.linalg.cholesky(H)
    prices, gaps = np.where(soft, cost, 0.0), []
    primal = v @ H @ v / 2.0 + f @ v + prices @ np.maximum(-left, 0.0)
    for size in (1e-6, 1e-5, 1e-4):
        # Of what is beyond its limit the multiplier is the cost; of what is at it, what leaves no slope.
        near, multipliers = np.abs(left) < size, np.where(left <= -size, prices, 0.0)
        if near.any():
            slope = H @ v + f + C.T @ multipliers
            multipliers[near] = np.minimum(nnls(C[near].T, -slope, maxiter=10_000)[0], cost[near])
        dual = -(np.linalg.solve(root, f + C.T @ multipliers) ** 2).sum() / 2.0 - room @ multipliers
        gaps.append(max(primal - dual, 0.0))
    return min(gaps)


@pytest.mark.parametrize("more", [{}, RATES, RATES | {"R": np.array([1e-6, 1e-5])}], ids=["", "rates", "cheap"])
def test_problems_are_solved_as_by_an_exact_program(more):
    # Parts of the limits; the promise is 1e-3.
    part, rng, beyond, worst = twin(**more), np.random.default_rng(2), 0, 0.0
    change = T * RATES["rate_limit"] / part.limit if "rate_limit" in more else None
    scale = np.tile(part.limit, part.horizon)
    for _ in range(12):
        x, d = rng.normal(size=3) * (1.0, 0.1, 0.3), 0.01 * rng.normal(size=3)
        H, f = part.problem(x, d)
        H, f, sides = scale[:, None] * H * scale, scale * f, part.sides(x, d, rng.uniform(-0.2, 0.9, 2), change)
        found = linear_mpc.softened(H, f, *sides, 50)
        C, room, cost = sides
        soft = np.isfinite(cost)
        excess = np.maximum(C @ found - room, 0.0)
        assert excess[~soft].max() < 1e-8
        # Costs curve by the least eigenvalue of H at least: so far the optimum is at most.
        far = np.sqrt(2.0 * gap_to_the_dual(found, H, f, *sides) / np.linalg.eigvalsh(H)[0])
        assert far < 1e-3
        if "R" not in more:  # of these SciPy's active sets find all
            worst = max(worst, np.abs(found - exact(H, f, *sides))[:2].max())
        beyond += excess[soft].max() > 1e-6
    assert worst < 1e-5
    # Some limits of outputs cannot be kept, and some can.
    assert 0 < beyond < 12


@pytest.mark.ci
@pytest.mark.parametrize("more", [{}, RATES | {"horizon": 4}], ids=["", "rates"])
@pytest.mark.kernel
def test_check_controller_finds_nothing(more):
    report = lw.laws.check_controller(law(**more), twin=twin(**more))
    assert report.ok, str(report)


def test_numbers_that_do_not_go_together_are_refused():
    says(refused(law, lower=[6.0, -2.0]), "linear_mpc.lower", "is not below limit. Give numbers below [5.0, 2.0]")
    says(refused(law, excess_cost=None), "linear_mpc.excess_cost = '' is missing beside the others of outputs")
    says(refused(law, horizon=101), "linear_mpc.horizon = 101 is too long. Give 1 to 100")


# Heave of a body of 20 kg with a drag of 9 N s/m, over a period of 0.1 s in which the force is held: exact.
DECAY = np.exp(-9.0 / 20.0 * T)
GAIN = (1.0 - DECAY) / 9.0
A, B = np.array([[1.0, 20.0 * GAIN], [0.0, DECAY]]), np.array([(T - 20.0 * GAIN) / 9.0, GAIN])
DEPTHS, AT, TICKS = (5.0, 8.0, 6.5), (0.0, 2.0, 5.0), 80
LIMITS = dict(limit=[40.0], lower=[-25.0], rate_limit=[60.0], horizon=30)
SINKS = dict(outputs=[[0.0, 1.0]], output_limit=[1.2], excess_cost=[500.0])


def wanted(t):
    return DEPTHS[np.searchsorted(AT, t + 1e-9, side="right") - 1]


def by_hand(line=(0.0, 1.0), at_most=1.2):
    """Depths and forces, of a program of the next depths and forces at each tick, proven to cost least.

    line: the output, of the errors of depth and velocity; it is at most `at_most`.
    """
    N, x, u, depths, forces = LIMITS["horizon"], np.array([5.0, 0.0]), 0.0, [], []
    powers = [np.linalg.matrix_power(A, j) for j in range(N + 1)]
    made = np.array([[powers[j - i] @ B if i <= j else np.zeros(2) for i in range(N)] for j in range(N)])
    eye, steps = np.eye(N), np.eye(N) - np.eye(N, k=-1)
    H = 2.0 * (40.0 * made[:, :, 0].T @ made[:, :, 0] + 1e-4 * eye)
    C = np.concatenate([eye, -eye, steps, -steps, made @ line])
    cost = np.concatenate([np.full(4 * N, np.inf), np.full(N, 500.0)])
    for k in range(TICKS + 1):
        free = np.array([powers[j + 1] @ x for j in range(N)])
        free[:, 0] -= [wanted((k + j + 1) * T) for j in range(N)]
        f = 2.0 * 40.0 * made[:, :, 0].T @ free[:, 0]
        since = np.eye(N)[0] * u
        room = np.concatenate(
            [np.full(N, 40.0), np.full(N, 25.0), 6.0 + since, 6.0 - since, np.full(N, at_most) - free @ line]
        )
        # In parts of 40 N, as the method takes them.
        problem = 1600.0 * H, 40.0 * f, 40.0 * C, room, cost
        v = linear_mpc.softened(*problem, 80)
        assert gap_to_the_dual(v, *problem) < 1e-6 * (1.0 + np.abs(problem[1]).max())
        depths, forces, u = [*depths, x[0]], [*forces, 40.0 * v[0]], 40.0 * v[0]
        x = A @ x + B * u
    return np.array(depths), np.array(forces)


def diving(part, buoyancy=200.0, guidance=None, depth=5.0):
    """The body, whose law alone drives it; its reference jumps from depth to depth."""
    path = lw.control.Trajectory(times=AT, positions=[(0.0, 0.0, z) for z in DEPTHS], interpolation="steps")
    body = lw.Vehicle(
        20.0, inertia=(5.0, 8.0, 11.0), added_mass=(0, 0, 0), buoyancy=buoyancy, center_of_buoyancy=(0, 0, 0)
    )
    terms = [lw.terms.ControlWrench(limit=1e6), lw.terms.Drag(linear=(5, 8, 9.0, 2, 3, 4.0))]
    loop = lw.Controller(period=T, guidance=[guidance or path], laws=[part])
    return lw.Scene(body, lw.Environment(gravity=10.0), terms, lw.Start(position=(0, 0, depth)), loop)


def heave_law(**more):
    names = dict(states=["position[2]", "velocity[2]"], inputs=["Z"], A=A, B=B[:, None], Q=[40.0, 0.0], R=[1e-4])
    return lw.control.LinearMPC(**(names | LIMITS | more))


SAVE = lw.SaveAt(every=T, fields=("position", "velocity", "demand", "unconverged"))


@pytest.mark.ci
@pytest.mark.kernel
def test_a_loop_that_looks_ahead_is_that_of_exact_programs():
    # The model is exact, so that the estimate of a disturbance has nothing to add, whatever the reference does.
    scene = diving(heave_law(preview=True, **SINKS))
    result = lw.solve(scene, "rk4", h=T / 5.0, t1=TICKS * T, save=SAVE)
    at_rest = np.array([0.0, 0.0, 5.0]), np.eye(3), np.zeros(3), np.zeros(3)
    twins, _ = twin_states(scene, {}, at_rest, 5, T / 5.0, 60, "rk4")
    np.testing.assert_allclose(result.position[:13, 0], twins, atol=1e-6)
    depths, forces = by_hand()
    # Promised to 1e-6 of the limit, of 40 N.
    np.testing.assert_allclose(result.samples["demand"][:, 0, 2], forces, atol=4e-5)
    np.testing.assert_allclose(result.position[:, 0, 2], depths, atol=1e-6)
    assert result.samples["unconverged"][-1, 0] == 0.0
    # It dives before it is wanted to, at the largest rate and no faster, and its force is at both limits.
    assert 5.3 < result.position[19, 0, 2] < 8.0
    assert result.velocity[:, 0, 2].max() == pytest.approx(1.2, abs=1e-5)
    assert forces.max() == pytest.approx(40.0, abs=1e-6) or forces.min() == pytest.approx(-25.0, abs=1e-6)


@pytest.mark.ci
@pytest.mark.kernel
def test_limits_of_errors_are_of_the_reference_that_it_sees_ahead():
    """At most 0.2 m deeper than is wanted then, at a cost: it rises before the reference does."""
    corridor = dict(outputs=[[1.0, 0.0]], output_limit=[0.2], excess_cost=[500.0])
    result = lw.solve(diving(heave_law(preview=True, **corridor)), "rk4", h=T / 5.0, t1=TICKS * T, save=SAVE)
    depths, forces = by_hand((1.0, 0.0), 0.2)
    np.testing.assert_allclose(result.samples["demand"][:, 0, 2], forces, atol=4e-5)
    np.testing.assert_allclose(result.position[:, 0, 2], depths, atol=1e-6)


@pytest.mark.ci
@pytest.mark.kernel
def test_a_short_horizon_looks_ahead_too():
    """Loops of a few rounds are unrolled. A reference that does not change gives nothing to see."""
    still = lw.control.SetPoint(position=(0.0, 0.0, 8.0))
    scenes = [diving(heave_law(preview=ahead, horizon=5, **SINKS), guidance=still) for ahead in (False, True)]
    plain, ahead = (lw.solve(scene, "rk4", h=T / 5.0, t1=3.0, save=SAVE).samples["demand"] for scene in scenes)
    assert np.abs(plain).max() > 10.0
    np.testing.assert_allclose(ahead, plain, atol=1e-9)


@pytest.mark.ci
@pytest.mark.kernel
def test_a_loop_in_single_precision_is_that_of_exact_programs():
    result = lw.solve(diving(heave_law(preview=True)), "rk4", h=T / 5.0, t1=TICKS * T, save=SAVE, dtype="float32")
    depths, forces = by_hand(at_most=50.0)
    # Promised to 1e-2 of the limit, of 40 N.
    np.testing.assert_allclose(result.samples["demand"][:, 0, 2], forces, atol=0.4)
    np.testing.assert_allclose(result.position[:, 0, 2], depths, atol=1e-2)
    assert result.samples["unconverged"][-1, 0] == 0.0


@pytest.mark.ci
@pytest.mark.parametrize("lower", [None, [-25.0]], ids=["", "lower"])
@pytest.mark.kernel
def test_a_jump_of_the_reference_is_no_disturbance(lower):
    """By an exact model: after 2 s at rest a jump of 3 m makes the dive of a body that begins 3 m above its set-point."""
    part = heave_law(lower=lower)
    jumps = lw.control.Trajectory(times=(0.0, 2.0), positions=[(0, 0, 5.0), (0, 0, 8.0)], interpolation="steps")
    late = lw.solve(diving(part, guidance=jumps), "rk4", h=T / 5.0, t1=7.0, save=SAVE)
    begun = lw.solve(diving(part, guidance=lw.control.SetPoint(depth=8.0)), "rk4", h=T / 5.0, t1=5.0, save=SAVE)
    # Round-off of the model's numbers and of 50 ticks; the estimate would add 0.3 m.
    np.testing.assert_allclose(late.position[20:, 0, 2], begun.position[:, 0, 2], atol=1e-9)
    assert begun.position[-1, 0, 2] > 7.5


@pytest.mark.ci
@pytest.mark.parametrize("cost", [1e3, 1e7, 1e9])
@pytest.mark.kernel
def test_a_limit_that_is_broken_at_the_start_is_met_again_whatever_it_costs(cost):
    """A body sinks at 1 m/s, 0.2 m/s being allowed: the largest force brings it back, at its rate and then at its limit."""
    part = heave_law(horizon=20, outputs=[[0.0, 1.0]], output_limit=[0.2], excess_cost=[cost])
    scene = diving(part, guidance=lw.control.SetPoint(depth=8.0))
    scene = scene.with_numbers({"start.velocity": [0.0, 0.0, 1.0]})
    result = lw.solve(scene, "rk4", h=T / 5.0, t1=3.0, save=SAVE)
    forces, speeds = result.samples["demand"][:, 0, 2], result.velocity[:, 0, 2]
    np.testing.assert_allclose(forces[:4], [-6.0, -12.0, -18.0, -24.0], atol=4e-5)
    assert speeds[-1] == pytest.approx(0.2, abs=1e-6)
    # Costs of 1e9 leave too few digits for its residuals at some ticks, which it says.
    assert result.samples["unconverged"][-1, 0] == 0.0 or cost > 1e6


@pytest.mark.ci
@pytest.mark.kernel
def test_an_output_that_inputs_hardly_move_converges():
    """By what round-off leaves of a linear model: the output is exceeded, whatever the inputs do, and they ignore it."""
    forces = []
    for effect in (0.0, 1e-17, 1e-12):
        more = dict(states=["position[2]", "velocity[2]", "velocity[0]"], Q=[40.0, 0.0, 0.0], lower=None, rate_limit=None,
                    A=np.pad(A, (0, 1)) + np.diag([0.0, 0.0, 0.95]), B=np.append(B, effect)[:, None], horizon=10,
                    outputs=[[0.0, 0.0, 1.0]], output_limit=[-0.5], excess_cost=[100.0])  # fmt: skip
        scene = diving(heave_law(**more), guidance=lw.control.SetPoint(depth=8.0))
        result = lw.solve(scene, "rk4", h=T / 5.0, t1=2.0, save=SAVE)
        assert result.samples["unconverged"][-1, 0] == 0.0
        forces.append(result.samples["demand"][:, 0, 2])
    np.testing.assert_allclose(forces[1:], [forces[0]] * 2, atol=1e-6)


def test_members_numbers_have_the_conditions_of_one():
    part = heave_law(P=np.diag([40.0, 0.0]))
    still = np.diag([1.0, 1.0])
    for name, bad in {"lower": [41.0], "P": -still, "A": 2.0 * still, "B": np.zeros((2, 1)), "limit": [-30.0]}.items():
        values = np.stack([np.array(getattr(part, name)), np.array(bad)])
        place = np.tile([0.0, 0.0, 5.0], (2, 1)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), np.zeros((2, 3))
        text = refused(lw.Ensemble.from_states, diving(part), *place, {f"linear_mpc.{name}": values})
        says(text, f"linear_mpc.{name} of member 1", "is unphysical (1 of 2 members)")


def test_a_horizon_over_which_an_unstable_model_outgrows_its_digits_is_refused():
    """The gain of the free optimum, with the regulator's cost at the end, is the regulator's, or the horizon is refused."""
    unstable = np.array([[1.0, T], [0.05, 1.35]])
    P = solve_discrete_are(unstable, B[:, None], np.diag([40.0, 0.0]), [[1e-4]])
    K = (B @ P @ unstable) / (1e-4 + B @ P @ B)
    model = dict(A=unstable, P=(P + P.T) / 2.0)
    part = heave_law(**(model | {"horizon": 28}))
    best = part.condensed({name: value[None] for name, value in part.parameters().items()}, 0, T).best
    np.testing.assert_allclose(-40.0 * best[0, :2], K, rtol=1e-6)
    text = refused(heave_law, **(model | {"horizon": 50}))
    says(text, "linear_mpc.horizon = 50", "grows 1.36 times in a period", "Give at most ")
    # Also where the growth over the horizon is beyond all numbers.
    text = refused(heave_law, A=np.array([[1.0, T], [0.0, 1e9]]), horizon=50)
    says(text, "linear_mpc.horizon = 50", "grows 1e+09 times in a period")


def test_only_guidance_that_follows_from_the_time_can_be_foreseen():
    part = law(preview=True)
    way = lw.control.Waypoints(points=[(0.0, 0.0, 3.0), (9.0, 0.0, 3.0)], speed=1.0, look_ahead=3.0, radius=1.0)
    text = refused(lw.Controller, period=T, guidance=[way], laws=[part])
    says(text, "'linear_mpc': looks ahead, and what waypoints will want is not known. Give a set_point or a trajectory")
