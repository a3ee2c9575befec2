# SPDX-License-Identifier: Apache-2.0
"""Allocation within limits: beside SciPy's exact solution of the bounded least squares, demand by demand."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import lgvi_warp as lw
from lgvi_warp.control import BoundedLeastSquares, Fault, HeadingPID, PosePID, PseudoInverse, SetPoint, StateFeedback
from tests.support.refusals import refused, says

NAMED = lw.Scene.named("bluerov2_heavy")
(THRUSTERS,) = (term for term in NAMED.terms if term.type == "thrusters")
EFFECT = np.concatenate([THRUSTERS.direction, np.cross(THRUSTERS.position, THRUSTERS.direction)], axis=1).T
ARM = np.sqrt(np.square(EFFECT[3:]).sum() / np.square(EFFECT[:3]).sum())
# The demand of the law is the place, and the rate about each axis.
LAW = StateFeedback(K=-np.eye(12)[[0, 1, 2, 9, 10, 11]])


def thrust(command):
    """Thrust of a command, by the vehicle's polynomial."""
    return np.sign(command) * np.polynomial.polynomial.polyval(np.abs(command), [0.0, *THRUSTERS.polynomial])


MOST = thrust(np.linspace(0.0, 1.0, 100_001)).max()


def asked(allocation, demands, dtype="float64", faults=(), varied=None):
    """Commands, thrusts and what is told back, of demands (n, 6); varied: numbers by member."""
    controller = lw.Controller(
        period=0.1,
        guidance=[SetPoint(position=[0.0] * 3, heading=0.0)],
        laws=[LAW],
        allocation=[allocation],
        faults=faults,
    )
    scene = lw.Scene.named("bluerov2_heavy", controller=controller)
    n = len(demands)
    still = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    fleet = lw.Ensemble.from_states(scene, demands[:, :3], *still, demands[:, 3:], varied or {})
    save = lw.SaveAt(every=0.1, fields=("command", "demand", "unmet"))
    result = lw.solve(fleet, "rk4", h=0.1, t1=0.1, dtype=dtype, save=save)
    command, demand, unmet = (np.float64(getattr(result, name)[0]) for name in save.fields)
    np.testing.assert_allclose(demand, demands, rtol=1e-6)
    return command, thrust(command), unmet, demand


def drawn(n, size, seed=0):
    """Demands that some thruster is too weak for in 57 or 97 of 100 cases."""
    scale = np.abs(EFFECT).sum(axis=1) * 9.0 * size
    return np.random.default_rng(seed).normal(size=(n, 6)) * scale


def nearest(demand, priorities, least=-MOST, most=MOST):
    """The exact solution by SciPy's active sets, and its errors."""
    s = np.array(priorities) / [1.0, 1.0, 1.0, ARM, ARM, ARM]
    limits = np.broadcast_to(least, 8), np.broadcast_to(most, 8)
    best = np.array([lsq_linear(s[:, None] * EFFECT, s * w, limits, tol=1e-14, method="bvls").x for w in demand])
    return s, np.linalg.norm(s * (best @ EFFECT.T - demand), axis=1)


def compared(allocation, n, size, dtype, priorities=(1.0,) * 6):
    command, made, unmet, demand = asked(allocation, drawn(n, size), dtype)
    assert np.all(np.abs(command) <= 1.0)
    s, best = nearest(demand, priorities)
    error = np.linalg.norm(s * (made @ EFFECT.T - demand), axis=1)
    length = np.linalg.norm(s * demand, axis=1)
    feasible = best < 1e-6 * length
    return error, best, length, feasible, unmet, made @ EFFECT.T - demand


@pytest.mark.ci
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize(
    ("size", "n"), [(1.0, 300), (2.0, 300), *(pytest.param(k, 3000, marks=pytest.mark.slow) for k in (1.0, 2.0))]
)
def test_errors_are_those_of_the_exact_solution(size, n, dtype):
    error, best, length, feasible, unmet, off = compared(BoundedLeastSquares(to="thrusters"), n, size, dtype)
    assert 0.02 < feasible.mean() < 0.8
    # The inverse of the polynomial is good to 1e-8 of the largest thrust; float32 to its digits.
    exact = 1e-7 if dtype == "float64" else 1e-5
    assert (error[feasible] <= exact * length[feasible]).all()
    assert (unmet[feasible] == 0.0).all()
    assert (error[~feasible] <= 1.0001 * best[~feasible] + exact * length[~feasible]).all()
    # What is told back is what is missing, but for round-off.
    told = unmet != 0.0
    small = np.abs(off) * [1.0, 1.0, 1.0, *3 * [1.0 / ARM]] <= (1e-7 if dtype == "float64" else 1e-4) * length[:, None]
    np.testing.assert_allclose(unmet[told], -off[told], atol=1e-7 * MOST if dtype == "float64" else 3e-4 * MOST)
    assert small[~told].all()


@pytest.mark.slow
def test_moments_before_forces():
    first = (1.0, 1.0, 1.0, 10.0, 10.0, 10.0)
    error, best, length, *_ = compared(
        BoundedLeastSquares(to="thrusters", priorities=first), 3000, 2.0, "float64", first
    )
    # The inverse of the polynomial is good to 1e-8 of the largest thrust.
    assert (error <= 1.0001 * best + 1e-7 * length).all()
    moments = []
    for priorities in (first, (1.0,) * 6):
        off = compared(BoundedLeastSquares(to="thrusters", priorities=priorities), 500, 2.0, "float64")[-1]
        moments.append(np.linalg.norm(off[:, 3:], axis=1).mean())
    assert moments[0] < 0.5 * moments[1]


@pytest.mark.slow
def test_what_is_within_the_limits_is_the_pseudo_inverses_to_the_last_digit():
    demands = drawn(64, 0.1)
    ours = asked(BoundedLeastSquares(to="thrusters", priorities=[1.0, 1.0, 1.0, 50.0, 50.0, 50.0]), demands)
    theirs = asked(PseudoInverse(to="thrusters"), demands)
    np.testing.assert_array_equal(ours[0], theirs[0])
    np.testing.assert_array_equal(ours[2], 0.0)


@pytest.mark.ci
@pytest.mark.parametrize("channels", [(4,), pytest.param((0, 4, 5, 6, 7), marks=pytest.mark.slow)])
def test_lost_thrusters_make_nothing_however_many(channels):
    faults = [Fault(name=f"dead_{c}", of="thrusters", channel=c, time=0.0, gain=0.0, known=True) for c in channels]
    _, made, _, demand = asked(BoundedLeastSquares(to="thrusters"), drawn(200, 1.0), faults=faults)
    np.testing.assert_array_equal(made[:, list(channels)], 0.0)
    most = np.where(np.isin(np.arange(8), channels), 1e-12, MOST)
    s, best = nearest(demand, (1.0,) * 6, -most, most)
    error = np.linalg.norm(s * (made @ EFFECT.T - demand), axis=1)
    assert error.mean() <= 1.01 * best.mean()


@pytest.mark.ci
def test_members_beside_others_keep_their_bits():
    # One that is cut off, and one that is not, in lanes beside each other or alone.
    demands = np.concatenate([drawn(3, 2.0), drawn(3, 0.1)])
    together = asked(BoundedLeastSquares(to="thrusters"), demands)[0]
    for i in (0, 5):
        np.testing.assert_array_equal(asked(BoundedLeastSquares(to="thrusters"), demands[i : i + 1])[0][0], together[i])


@pytest.mark.slow
def test_curves_are_inverted_with_the_same_bits_beside_others():
    # The named vehicle's curve has odd powers alone; beside it one whose curve ahead has others.
    demands = drawn(40, 0.15)
    for allocation in (PseudoInverse(to="thrusters"), BoundedLeastSquares(to="thrusters")):
        alone = asked(allocation, demands)[0]
        square = np.where(np.arange(40) % 2 == 0, 0.0, 5.0)
        beside = asked(allocation, demands, varied={"thrusters.polynomial[1]": square})[0]
        np.testing.assert_array_equal(beside[::2], alone[::2])
        efforts = demands @ np.linalg.pinv(EFFECT).T
        inside = np.abs(efforts).max(axis=1) < MOST
        assert inside[::2].any() and inside[1::2].any()  # noqa: PT018
        made = thrust(beside) + np.where(beside > 0.0, square[:, None] * beside**2, 0.0)
        np.testing.assert_allclose(made[inside], efforts[inside], rtol=0.0, atol=1e-8 * MOST)


@pytest.mark.slow
def test_a_demand_that_is_no_number_ends_the_member():
    law = PosePID(kp=[1e200] * 3, kd=[1e200] * 3, kr=[1e308] * 3, kw=[1e308] * 3)
    controller = lw.Controller(period=0.1, guidance=[SetPoint(position=[1e200, 0.0, 0.0], heading=0.0)], laws=[law],
                               allocation=[BoundedLeastSquares(to="thrusters")])  # fmt: skip
    result = lw.solve(lw.Scene.named("bluerov2_heavy", controller=controller), "rk4", h=0.05, t1=0.2)
    assert "ok" not in result.status.counts()


def test_bad_numbers():
    says(refused(BoundedLeastSquares, to="thrusters", iterations=0), "iterations", "1 or more")
    table = {"type": "bounded_least_squares", "to": "thrusters", "rounds": 4}
    says(refused(lw.Controller, period=0.1, laws=[LAW], allocation=[table]), "rounds")
    says(refused(BoundedLeastSquares, to="thrusters", priorities=[1.0, 0.0, 1.0, 1.0, 1.0, 1.0]), "priorities")


# A pair of thrusters on either side, whose thrust is the square of the command, and one alone.
SIDES = dict(position=((0.0, 0.2, 0.0), (0.0, -0.2, 0.0)), direction=((1.0, 0.0, 0.0),) * 2, coefficient=(10.0, 10.0),
             limit=1.0)  # fmt: skip
ALONE = dict(position=((0.0, 0.0, 0.0),), direction=((1.0, 0.0, 0.0),), coefficient=(10.0,), limit=1.0)
DEAD = [Fault(name=f"dead_{i}", of="thrusters", channel=i, time=0.0, gain=0.0, known=True) for i in range(2)]
# Thrusters, faults, and the largest efforts.
EDGES = {
    "two": (SIDES, [], (10.0, 10.0)),
    "one": (ALONE, [], (10.0,)),
    "no thrust": (SIDES | {"coefficient": (10.0, 0.0)}, [], (10.0, 0.0)),
    "no limit left": (SIDES | {"limit": (0.0, 1.0)}, [], (0.0, 10.0)),
    "a dead band beyond the limit": (SIDES | {"dead_band": (2.0, 0.0)}, [], (0.0, 10.0)),
    "all dead": (SIDES, DEAD, (0.0, 0.0)),
}
# All at their limits, one, none, nothing asked for, what no thruster makes, and all astern.
DEMANDS = np.array([[1e3, 0, 0, 0, 0, 1.0], [15.0, 0, 0, 0, 0, 1.0], [3.0, 0, 0, 0, 0, 0.2], [0.0] * 6,
                    [0.0, 0, 5.0, 0, 2.0, 0], [-1e3, 0, 0, 0, 0, -1e3]])  # fmt: skip


def allocated(numbers, faults, dtype="float64"):
    """Commands, and what was not delivered, of DEMANDS."""
    held = SetPoint(position=[0.0] * 3, heading=0.0)
    within = [BoundedLeastSquares(to="thrusters")]
    controller = lw.Controller(period=0.1, guidance=[held], laws=[LAW], allocation=within, faults=faults)
    vehicle = lw.Vehicle(20.0, inertia=(5.0, 8.0, 11.0))
    scene = lw.Scene(vehicle, terms=[lw.terms.Thrusters(**numbers)], controller=controller)
    still = np.tile(np.eye(3), (len(DEMANDS), 1, 1)), np.zeros((len(DEMANDS), 3))
    fleet = lw.Ensemble.from_states(scene, DEMANDS[:, :3], *still, DEMANDS[:, 3:])
    save = lw.SaveAt(every=0.1, fields=("command", "unmet"))
    result = lw.solve(fleet, "rk4", h=0.1, t1=0.1, dtype=dtype, save=save)
    assert result.status.counts() == {"ok": len(DEMANDS)}
    return np.float64(result.command[0]), np.float64(result.unmet[0])


@pytest.mark.ci
@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
@pytest.mark.parametrize("edge", EDGES)
def test_edges(edge, dtype):
    numbers, faults, most = EDGES[edge]
    command, unmet = allocated(numbers, faults, dtype)
    able = np.array(most) > 0.0
    assert np.all(np.abs(command) <= np.array(numbers["limit"]))
    assert np.all(command[:, ~able] == 0.0)
    B = np.concatenate([np.array(numbers["direction"]), np.cross(numbers["position"], numbers["direction"])], axis=1).T
    # The arm is 0.2 m, where there is one.
    s = np.repeat([1.0, 5.0 if len(most) == 2 else 1.0], 3)
    exact = 1e-12 if dtype == "float64" else 1e-6
    made = 10.0 * command * np.abs(command) * able
    for w, t, left in zip(DEMANDS, made, unmet, strict=True):
        size, best = np.linalg.norm(s * w), np.zeros(len(most))
        if able.any():
            limits = np.array(most)[able]
            best[able] = lsq_linear(s[:, None] * B[:, able], s * w, (-limits, limits), tol=1e-14, method="bvls").x
        errors = [np.linalg.norm(s * (B @ efforts - w)) for efforts in (t, best)]
        assert errors[0] <= errors[1] * 1.001 + exact * size
        told = left != 0.0
        np.testing.assert_allclose(left[told], (w - B @ t)[told], rtol=0.0, atol=10 * exact * np.linalg.norm(w))
        assert (np.abs(s * (w - B @ t))[~told] <= 1e2 * exact * size).all()


@pytest.mark.slow
def test_a_thruster_that_the_loop_does_not_know_to_be_dead():
    well, dead = allocated(SIDES, []), allocated(SIDES, [Fault(of="thrusters", channel=0, time=0.0, gain=0.0)])
    np.testing.assert_array_equal(dead[0], well[0] * [0.0, 1.0])
    np.testing.assert_array_equal(dead[1], well[1])


@pytest.mark.slow
def test_a_channel_that_makes_nothing_of_what_is_asked_for():
    # Laws ask for N alone: the second thruster pushes through the origin, its column is 0.
    term = lw.terms.Thrusters(position=((-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)), direction=((0.0, 1.0, 0.0),) * 2,
                              coefficient=(10.0, 10.0), limit=1.0)  # fmt: skip
    controller = lw.Controller(period=0.1, guidance=[SetPoint(heading=2.0)], laws=[HeadingPID(kp=100.0)],
                               allocation=[BoundedLeastSquares(to="thrusters")])  # fmt: skip
    scene = lw.Scene(lw.Vehicle(20.0, inertia=(5.0, 8.0, 11.0)), terms=[term], controller=controller)
    result = lw.solve(scene, "rk4", h=0.1, t1=0.1, save=lw.SaveAt(every=0.1, fields=("command", "unmet")))
    np.testing.assert_array_equal(np.abs(result.command[0, 0]), [1.0, 0.0])
    np.testing.assert_allclose(result.unmet[0, 0], [0.0] * 5 + [190.0], rtol=1e-12)


def spread_out(count, rank, seed=0):
    """Places and directions of thrusters whose wrenches have a rank, (count, 3) each, and their wrenches (6, count)."""
    rng = np.random.default_rng(seed)
    place, way = rng.uniform(-0.5, 0.5, (count, 3)), rng.normal(size=(count, 3))
    if rank <= 5:
        # Their lines cut the x axis: no moment about it.
        place[:, 1:] = 0.0
    if rank <= 4:
        way[:, 1] = 0.0
        place[:, 1] = 0.2 * (rank == 4) * rng.choice([-1.0, 1.0], count)
    way /= np.linalg.norm(way, axis=1)[:, None]
    B = np.concatenate([way.T, np.cross(place, way).T])
    return place, way, B


# Six, eight and twelve channels, of ranks 3 to 6.
FRAMES = {(n, rank): spread_out(n, rank) for n, rank in ((8, 6), (6, 6), (12, 6), (8, 5), (12, 3), (8, 4))}
# Strong and weak thrusters, [N].
STRENGTHS = np.array([40.0, 25.0, 60.0, 40.0, 30.0, 40.0, 50.0, 40.0, 35.0, 40.0, 20.0, 40.0])


def made_of(frame, demands, priorities, dead, dtype, iterations=100):
    """Thrusts, what is told back and the messages, of demands (n, 6); priorities (6,) or (n, 6)."""
    place, way, _ = FRAMES[frame]
    strength = STRENGTHS[: len(place)]
    within = BoundedLeastSquares(to="thrusters", priorities=np.ones(6), iterations=iterations)
    lost = [Fault(name=f"dead_{c}", of="thrusters", channel=c, time=0.0, gain=0.0, known=True) for c in dead]
    controller = lw.Controller(period=0.1, guidance=[SetPoint(position=[0.0] * 3, heading=0.0)], laws=[LAW],
                               allocation=[within], faults=lost)  # fmt: skip
    term = lw.terms.Thrusters(position=place, direction=way, coefficient=strength, limit=1.0)
    scene = lw.Scene(lw.Vehicle(20.0, inertia=(5.0, 8.0, 11.0)), terms=[term], controller=controller)
    n = len(demands)
    varied = {"bounded_least_squares.priorities": np.broadcast_to(priorities, (n, 6)).copy()}
    still = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    fleet = lw.Ensemble.from_states(scene, demands[:, :3], *still, demands[:, 3:], varied)
    save = lw.SaveAt(every=0.1, fields=("command", "unmet", "unconverged"))
    result = lw.solve(fleet, "rk4", h=0.1, t1=0.1, dtype=dtype, save=save)
    command = np.float64(result.command[0])
    return np.sign(command) * command**2 * strength, np.float64(result.unmet[0]), result


@pytest.mark.ci
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize(
    ("frame", "dead", "n"),
    [((8, 6), (), 300), *(pytest.param(f, d, 2000, marks=pytest.mark.slow) for f in FRAMES for d in ((), (1, 4)))],
)
def test_priorities_of_any_size_are_met_exactly(frame, dead, n, dtype):
    """Beside SciPy's active sets: each of many demands in and out of reach, each of its own priorities from 1 to 1e4."""
    rng = np.random.default_rng(len(dead))
    B = FRAMES[frame][2]
    demands = rng.normal(size=(n, 6)) * np.abs(B).sum(axis=1) * 10.0 ** rng.uniform(0.3, 1.8, (n, 1))
    demands = np.where(rng.random((n, 6)) < 0.7, demands, 0.0)
    demands = np.float64(np.float32(demands))
    priorities = np.where(rng.random((n, 6)) < 0.5, 1.0, 10.0 ** rng.uniform(0.0, 4.0, (n, 6)))
    made, told, result = made_of(frame, demands, priorities, dead, dtype)
    # In float32 round-off may keep a channel going to its limit and back: rarely, and its error is no larger.
    unfinished = np.count_nonzero(result.warnings.has(lw.Warnings.CONTROL_NOT_CONVERGED))
    assert unfinished <= (0 if dtype == "float64" else n // 500)
    arm = np.sqrt(np.square(B[3:]).sum() / np.square(B[:3]).sum())
    units, able = np.repeat([1.0, 1.0 / arm], 3), ~np.isin(np.arange(len(B.T)), dead)
    most = STRENGTHS[: len(B.T)][able]
    assert np.all(made[:, ~able] == 0.0)
    exact, lacks = 1e-9 if dtype == "float64" else 2e-5, 0
    for w, p, t, back in zip(demands, priorities, made, told, strict=True):
        s = p * units
        best = lsq_linear(s[:, None] * B[:, able], s * w, (-most, most), tol=1e-15, method="bvls", max_iter=1000).x
        errors = [np.linalg.norm(s * (B[:, able] @ x - w)) for x in (t[able], best)]
        # Round-off is of what the channels make as well.
        assert errors[0] <= 1.01 * errors[1] + exact * np.linalg.norm(s * (np.abs(w) + np.abs(B) @ np.abs(t)))
        # In each component's own unit, whatever its priority.
        length = np.linalg.norm(units * w)
        assert np.all(units * np.abs(w - B @ t - back) <= (1e-7 if dtype == "float64" else 2e-4) * length)
        lacks += np.any(back != 0.0)
    assert lacks > n // 5


@pytest.mark.ci
def test_too_few_steps_are_told():
    demands = np.array([[300.0, 0.0, 0.0, 0.0, 0.0, 20.0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    _, _, result = made_of((8, 6), demands, np.ones(6), (), "float64", iterations=1)
    np.testing.assert_array_equal(result.warnings.has(lw.Warnings.CONTROL_NOT_CONVERGED), [True, False])
    np.testing.assert_array_equal(result.samples["unconverged"], [[1.0, 0.0], [2.0, 0.0]])
    assert any("1 of 2 members (2 times at most, first in member 0 at 0 s)" in text for text in result.messages)


@pytest.mark.ci
@pytest.mark.parametrize("priority", [50.0, *(pytest.param(p, marks=pytest.mark.slow) for p in (1.0, 1000.0))])
def test_a_loop_comes_to_its_place_whatever_the_priorities(priority):
    """A dead thruster that is known, and a current: the pseudo-inverse comes to 1e-6 m and better, and so must this."""
    law = PosePID(kp=(120.0, 120, 150), ki=(20.0, 20, 20), kd=(80.0, 80, 100), kr=(20.0,) * 3, kw=(6.0,) * 3,
                  ki_r=(2.0,) * 3, feedforward="restoring")  # fmt: skip
    within = BoundedLeastSquares(to="thrusters", priorities=[1.0] * 3 + [priority] * 3)
    dead = Fault(of="thrusters", channel=4, time=20.0, gain=0.0, known=True)
    controller = lw.Controller(period=0.1, guidance=[SetPoint(position=(0, 0, 10.0), heading=0.0)], laws=[law],
                               allocation=[within], faults=[dead])  # fmt: skip
    scene = lw.Scene.named("bluerov2_heavy", terms=[lw.terms.Current(velocity=(-0.5, 0, 0))],
                           start={"position": (-6.0, 1.0, 10.0)}, controller=controller)  # fmt: skip
    result = lw.solve(scene, "psi_x", h=0.05, t1=200.0, save=lw.SaveAt(every=10.0, fields=("position", "unmet")))
    assert np.linalg.norm(result.position[-1, 0] - [0.0, 0.0, 10.0]) < 1e-6
    np.testing.assert_array_equal(result.unmet[-1, 0], 0.0)


@pytest.mark.ci
def test_priorities_act_where_thrusters_do_not_span_the_demand():
    """Six thrusters: X pushes the nose about as well; X = 50 N alone, by the priority of M, within the limits."""
    place, way = np.array(THRUSTERS.position), np.array(THRUSTERS.direction)
    place = np.vstack([place[:4], [[0, 0.111, 0], [0, -0.111, 0]]])
    way = np.vstack([way[:4], [[0, 0, -1.0], [0, 0, -1.0]]])
    FRAMES["six"] = place, way, np.concatenate([way.T, np.cross(place, way).T])
    B, demand = FRAMES["six"][2], np.array([[50.0, 0, 0, 0, 0, 0]] * 2)
    made, told, _ = made_of("six", demand, np.array([[1.0, 1, 1, 1, p, 1] for p in (10.0, 100.0)]), (), "float64")
    np.testing.assert_allclose((made @ B.T)[:, [0, 4]], [[2.16, 0.184], [0.0226, 0.00192]], rtol=5e-3)
    np.testing.assert_allclose(told, demand - made @ B.T, atol=1e-8)
