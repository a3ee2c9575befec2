# SPDX-License-Identifier: Apache-2.0
"""The worst case within bounds and gains of least risk, beside known ones; the kernel is that of test_linear."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.robustness.search.box import search
from tests.studies.test_linear import PERIOD, cost, regulated, regulator  # noqa: F401  (a fixture)
from tests.support.refusals import says

RUN = {"method": "psi_s", "h": PERIOD, "t1": 20.0}


def rastrigin(inside):
    """Many valleys; the least, 0, at 0.6 of each axis."""
    x = 8.0 * (inside - 0.6)
    return (x**2 - 3.0 * np.cos(2.0 * np.pi * x) + 3.0).sum(axis=1)


def test_a_search_among_many_valleys():
    found = search(rastrigin, 2, 2000, 1, 3)
    np.testing.assert_allclose(found.at, 0.6, atol=1e-4)
    assert found.cost < 1e-5
    assert len(found.restarts) == 3
    assert found.runs <= 2000
    again = search(rastrigin, 2, 2000, 1, 3)
    assert np.array_equal(again.at, found.at)
    assert again.runs == found.runs


def test_a_search_finds_a_corner_that_evolution_misses():
    """A spike at a corner, a thousandth wide, in a wide valley."""

    def spike(inside):
        apart = np.linalg.norm(inside - (1.0, 0.0), axis=1)
        return np.linalg.norm(inside - 0.3, axis=1) - 5.0 * np.exp(-((apart / 1e-3) ** 2))

    found = search(spike, 2, 400, 1, 1)
    assert found.at.tolist() == [1.0, 0.0]
    assert found.restarts[0] > -1.0


def test_a_search_ends_where_it_is_good_enough():
    found = search(lambda x: np.where(x[:, 0] > 0.5, -np.inf, x[:, 0]), 1, 10_000, 1, 3, good_enough=-1e300)
    assert found.cost == -np.inf
    assert found.runs < 100


def test_infinite_costs_do_not_stop_a_search():
    found = search(lambda x: np.where(x[:, 0] < 0.7, np.nan, x.sum(axis=1)), 2, 2000, 1, 2)
    np.testing.assert_allclose(found.at, (0.7, 0.0), atol=1e-4)


@pytest.mark.slow
def test_a_known_worst_corner():
    """A free body goes straight on, along its stable axis: the farther of two corners, both worse than what is beside them."""
    within = {"start.velocity[2]": (-2.0, 1.5), "start.position[2]": (-1.0, 2.0)}
    scene = regulated()
    told = []
    found = lw.worst_case(scene, within, "norm(position)", budget=600, progress=told.append, **RUN)
    assert found.parameters == {"start.velocity[2]": -2.0, "start.position[2]": -1.0}
    # Of drag 1e-12 of that of test_linear is left, some 1e-10 m.
    assert found.value == pytest.approx(2.0 * 20.0 + 1.0, abs=1e-9)
    assert found.runs <= 600
    assert found.at_bounds == {"start.velocity[2]": "low", "start.position[2]": "low"}
    assert told[-1] <= 1.0
    again = lw.solve(found.fleet, "psi_s", h=PERIOD, t1=20.0)
    assert np.linalg.norm(again.position[-1, 0]) == pytest.approx(found.value, abs=1e-10)
    says(str(found), "a lower bound of the largest", "(its lower bound)")
    least = lw.worst_case(scene, within, "norm(position)", worst="smallest", budget=600, **RUN)
    assert 0.0 <= least.value < 1e-2
    assert "an upper bound of the smallest" in str(least)


@pytest.mark.ci
def test_a_failure_is_the_worst_case():
    # Beyond h |Omega| = 2 the step of psi_s has no solution.
    found = lw.worst_case(regulated(), {"start.angular_velocity[2]": (0.0, 40.0)}, "norm(position)", budget=600, **RUN)
    assert found.value == np.inf
    assert found.parameters["start.angular_velocity[2]"] > 19.0
    assert str(found).startswith("A member fails at start.angular_velocity[2]")
    assert found.runs < 100


@pytest.mark.parametrize(("words", "message"), [
    ({"worst": "best"}, "worst = 'best'"), ({"budget": 3}, "is less than a generation"),
    ({"of": "position"}, "is not a single number"),
])  # fmt: skip
def test_bad_worst_cases(words, message):
    with pytest.raises(lw.SceneError, match=message):
        lw.worst_case(regulated(), {"start.velocity[2]": (1.0, 2.0)}, **{"of": "depth", **words}, **RUN)


def costs(result):
    """The sum over ticks of what a regulator makes least."""
    return cost(result)


OVER = {"state_feedback.K[2, 2]": (3.0, 60.0, "log"), "state_feedback.K[2, 8]": (3.0, 80.0, "log")}
SAVE = lw.SaveAt(every=PERIOD, fields=("position", "attitude", "velocity", "angular_velocity", "command"))
STARTS = {"start.position[2]": lw.distributions.Normal(std=1.0), "start.velocity[2]": lw.distributions.Normal(std=0.5)}


@pytest.mark.ci
@pytest.mark.parametrize("risk", ["mean", lw.metrics.CVaR(0.2)], ids=str)
def test_tuned_gains_are_those_of_the_regulator(regulator, risk):  # noqa: F811
    """The regulator's gains are the best from every start, so whatever the risk is."""
    fleet = lw.Ensemble(regulated(), 12, 3, STARTS)
    found = lw.tune_gains(fleet, OVER, costs, risk=risk, budget=12 * 700, fresh=24, save=SAVE, **RUN)
    best = regulator.K[2, [2, 8]]
    # From a start x the least sum is x^T P x; of the end at 20 s e^-9 is left, squared.
    start = fleet.select(0, 12)
    x = np.concatenate([start.position, np.zeros((12, 3)), start.velocity, start.angular_velocity], axis=1)
    least = np.einsum("ni,ij,nj->n", x, regulator.P, x)
    expected = least.mean() if risk == "mean" else lw.metrics.CVaR(0.2)(least[None])[0]
    assert abs(found.cost / expected - 1.0) < 1e-5
    # Near the least a cost that is 1e-6 larger is that of gains 1e-3 beside.
    np.testing.assert_allclose(list(found.parameters.values()), best, rtol=1e-2)
    assert (found.members, found.fresh) == (12, 24)
    assert found.fresh_before > found.fresh_cost
    assert found.optimism == found.fresh_cost - found.cost
    assert not found.at_bounds
    assert found.runs <= 12 * 700 + 48
    assert "optimism" in str(found)
    assert str(risk) in str(found)


@pytest.mark.ci
def test_what_is_told_of_fresh_members():
    fleet = lw.Ensemble(regulated(), 4, 3, STARTS)
    found = lw.tune_gains(fleet, OVER, costs, risk=0.75, budget=4 * 16, fresh=8, save=SAVE, **RUN)
    K = np.zeros((6, 12))
    for place, risk in (([0.0, 0.0], found.fresh_before), (list(found.parameters.values()), found.fresh_cost)):
        K[2, [2, 8]] = place
        scene = regulated(lw.control.StateFeedback(K=K))
        result = lw.solve(lw.Ensemble(scene, 8, 4, STARTS), "psi_s", h=PERIOD, t1=20.0, save=SAVE)
        assert risk == pytest.approx(np.quantile(costs(result), 0.75, method="inverted_cdf"), rel=1e-12)


def test_what_cannot_be_tuned():
    fleet = lw.Ensemble(regulated(), 4, 3, STARTS)
    for words, message in (
        ({"over": {"start.position[2]": (0.0, 1.0)}}, "varies by member too"),
        ({"risk": "median"}, "is not a risk"),
        ({"budget": 10}, "is less than a generation of all members"),
        ({"fresh": -1}, "is not a number of members"),
    ):
        with pytest.raises(lw.SceneError, match=message):
            lw.tune_gains(fleet, **{"over": OVER, "minimise": "depth", **words}, **RUN)


@pytest.mark.ci
def test_a_course_is_searched_among_starts():
    """A neutral body moves on along its axis: the farthest west is due west, and the members' own spread adds its mean."""
    vary = {"start.position[1]": lw.distributions.Normal(std=1.0)}
    fleet = lw.Ensemble(
        lw.Scene.named("sphere", start={"velocity": [0.5, 0.0, 0.0], "euler_deg": [0.0] * 3}), 8, 1, vary
    )
    over = {"start.euler_deg[2]": (-150.0, 20.0), "start.velocity[0]": (0.2, 1.5)}
    found = lw.tune_gains(fleet, over, "position[1]", budget=8 * 600, fresh=16, h=0.1, t1=2.0)
    assert abs(found.parameters["start.euler_deg[2]"] + 90.0) < 0.5
    assert found.parameters["start.velocity[0]"] == 1.5
    np.testing.assert_allclose(found.cost, fleet.select(0, 8).position[:, 1].mean() - 3.0, atol=1e-4)
    turned = lw.Ensemble(fleet.scene, 8, 1, {"start.euler_deg": lw.distributions.Normal(std=[0.1, 0.1, 0.1])})
    with pytest.raises(lw.SceneError, match="varies by member too"):
        lw.tune_gains(turned, {"start.euler_deg[2]": (-150.0, 20.0)}, "position[1]", h=0.1, t1=2.0)


def test_indices_of_members_are_whole_numbers():
    run = lw.prepare(regulated(), None, "depth", **RUN)
    for wrong, words in (
        (np.arange(3), "are not one whole number from 0 for each member"),
        (np.array([0.5, 1.0]), "Give whole numbers from 0"),
    ):
        with pytest.raises(lw.SceneError, match=words):
            run.states(np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), *np.zeros((2, 2, 3)), indices=wrong)


@pytest.mark.slow
def test_candidates_meet_the_noise_of_the_members():
    scene = regulated()
    noisy = dataclasses.replace(scene, terms=[*scene.terms, lw.terms.WrenchNoise(force=(1.0, 1.0, 1.0))])
    fleet = lw.Ensemble(noisy, 5, 7, STARTS)
    members = fleet.select(0, 5)
    run = lw.prepare(noisy, None, "norm(position)", **RUN)
    twice = np.tile(np.arange(5), 2)
    states = (getattr(members, name)[twice] for name in ("position", "attitude", "velocity", "angular_velocity"))
    found = run.states(*states, indices=members.indices[twice], seed=fleet.seed)
    expected = np.linalg.norm(lw.solve(fleet, "psi_s", h=PERIOD, t1=20.0).position[-1], axis=1)
    np.testing.assert_array_equal(found, np.tile(expected, 2))


@pytest.mark.slow
def test_searches_by_metrics_of_a_loop():
    """The objective is the metric of a run, at every tick; a loop that never settles is infinitely bad."""
    fleet = lw.Ensemble(regulated(), 4, 3, STARTS)
    tuned = lw.tune_gains(fleet, OVER, "iae depth", risk=lw.metrics.CVaR(0.5), budget=4 * 32, fresh=8, **RUN)
    K = np.zeros((6, 12))
    K[2, [2, 8]] = list(tuned.parameters.values())
    wanted = dataclasses.replace(regulated(lw.control.StateFeedback(K=K)))
    iae = lw.metrics.IAE("depth", then=[lw.statistics.MemberValues()])
    for members, seed, risk in ((4, 3, tuned.cost), (8, 4, tuned.fresh_cost)):
        result = lw.solve(lw.Ensemble(wanted, members, seed, STARTS), "psi_s", h=PERIOD, t1=20.0, statistics=[iae])
        each = result.statistics["each iae depth"].value[0]
        assert risk == pytest.approx(lw.metrics.CVaR(0.5)(each)[0], rel=1e-12)
    assert tuned.of == "iae depth"
    assert tuned.fresh_before > tuned.fresh_cost
    within = {"start.position[2]": (-1.0, 2.0)}
    for of in (lw.metrics.MaxError("depth"), {"type": "max_error", "of": "depth"}):
        far = lw.worst_case(regulated(), within, of, budget=64, **RUN)
        assert far.value == pytest.approx(2.0, abs=1e-9)
        assert far.of == "max_error depth"
        assert far.at_bounds == {"start.position[2]": "high"}
    # Nothing acts: what starts away from its goal never settles.
    never = lw.worst_case(regulated(), within, "settling_time depth", budget=64, **RUN)
    assert never.value == np.inf
    assert str(never).startswith("settling_time depth is infinite, or a member fails, at start.position[2]")
    for of, message in (
        ("iae depht", "depht"),
        ("mean", "is not a metric"),
        (lw.statistics.Mean("depth"), "is not a metric"),
    ):
        with pytest.raises(lw.SceneError, match=message):
            lw.worst_case(regulated(), within, of, budget=64, **RUN)
