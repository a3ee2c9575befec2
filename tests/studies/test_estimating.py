# SPDX-License-Identifier: Apache-2.0
"""`lw.estimate` on bodies whose statistics are known in closed form, and what it refuses."""

import dataclasses
import pickle

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtri

import lgvi_warp as lw
from tests.support import closed_answers as closed
from tests.support.pages import blocks
from tests.support.refusals import refused, says

RUN = {"t1": closed.TIME, "method": closed.METHOD, "threads": 1}
DEEP, NORTH = 425.0, 3.0
NORTHERN = stats.norm(closed.mean_north(), closed.spread_north())
WORST = NORTHERN.mean() + NORTHERN.std() * stats.norm.pdf(stats.norm.ppf(0.9)) / 0.1

# Ensemble, what is asked, how, the error asked for, and the truth.
KNOWN = {
    "fall": (closed.falling, "mean position[2]", {}, 0.05, closed.mean_depth()),
    "deeper": (closed.falling, "position[2] above 425", {}, 0.02, closed.probability_deeper(DEEP)),
    "north": (closed.pushed, "mean position[0]", {}, 0.05, NORTHERN.mean()),
    "farther": (closed.pushed, "position[0] above 3", {}, 0.02, NORTHERN.sf(NORTH)),
    "quantile": (closed.pushed, lw.statistics.Quantiles("position[0]", levels=[0.9]), {}, 0.1, NORTHERN.ppf(0.9)),
    "worst": (closed.pushed, "position[0]", {"risk": lw.metrics.CVaR(0.1)}, 0.1, WORST),
}


def estimated(name, seed=0, **settings):
    """The answer to one of the known questions, and the truth."""
    make, of, how, error, truth = KNOWN[name]
    return lw.estimate(make(), of, settings.pop("error", error), seed=seed, **RUN, **how, **settings), truth


@pytest.mark.ci
@pytest.mark.parametrize("name", KNOWN)
def test_answers_are_near_the_truth(name):
    """Four times the error that is told is passed once in 15,000 times; error told is at most about the one asked."""
    found, truth = estimated(name)
    assert abs(found.value - truth) <= 4.0 * np.hypot(found.error_reached, 0.5 * np.ptp(found.bias_interval))
    assert found.interval[0] < found.value < found.interval[1]
    assert found.sampling_error <= found.error
    assert 0.0 < found.pilot_seconds < found.seconds
    assert pickle.loads(pickle.dumps(found)).value == found.value
    assert found.provenance["versions"]


@pytest.mark.ci
def test_the_same_seed_gives_the_same_bits():
    """Choices follow costs, which vary; a fixed step, and so few members that none is chosen, do not."""
    few = [estimated("fall", error=1.0, h=0.5)[0] for _ in range(2)]
    assert few[0].value == few[1].value
    assert few[0].value != estimated("fall", 1, error=1.0, h=0.5)[0].value


@pytest.mark.ci
def test_small_errors_cost_less_than_plain_members():
    found, truth = estimated("fall", error=1e-3)
    assert abs(found.value - truth) <= 4e-3
    assert found.estimator != "plain Monte Carlo"
    assert found.plain_seconds > 5.0 * found.seconds
    assert max(found.rivals.values()) > 10.0


@pytest.mark.ci
def test_a_fixed_step_has_its_bias_told():
    """An order-2 method at 2 s, a fifth of the relaxation: the truth is inside the interval, which the bias widens."""
    vary = {"vehicle.buoyancy": lw.distributions.Normal(std=1.0)}
    fleet = lw.Ensemble(closed.sphere(), 64, vary=vary)
    found = lw.estimate(fleet, "mean position[2]", 0.01, t1=closed.TIME, method="psi_x", h=2.0, threads=1)
    assert found.settings["h"] == 2.0
    truth = 400.0 + closed.fall()
    assert found.interval[0] <= truth <= found.interval[1]
    assert found.bias_interval[0] <= found.value - truth + 0.02
    assert found.value - truth - 0.02 <= found.bias_interval[1]


@pytest.mark.ci
@pytest.mark.parametrize("where", ["argument", "scene"])
def test_a_step_longer_than_the_run_has_its_bias_told(where):
    """A step of 50 s is made as one of 20 s, and half of it too: the bias is told by half of what is made."""
    scene = closed.sphere()
    if where == "scene":
        scene = lw.Scene.from_dict(scene.to_dict() | {"run": {"step": 50.0, "method": closed.METHOD}})
    fleet = lw.Ensemble(scene, 64, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
    error, h = (0.1, 50.0) if where == "argument" else (1.0, None)
    found = lw.estimate(fleet, "mean position[2]", error, h=h, **RUN)
    assert found.settings["h"] == closed.TIME
    assert abs(found.bias) > 0.1
    assert found.interval[0] <= 400.0 + closed.fall() <= found.interval[1]


@pytest.mark.ci
@pytest.mark.parametrize("h", [None, 0.125])
def test_single_precision_has_its_bias_told(h):
    """At 1e6 m positions are multiples of 1/16 m: steps of 0.125 s lose what they move by, at any step of that precision."""
    scene = dataclasses.replace(closed.sphere(), start=lw.Start(position=[0.0, 0.0, 1e6]))
    fleet = lw.Ensemble(scene, 64, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
    found = lw.estimate(fleet, "mean position[2]", 0.05, dtype="float32", h=h, **RUN)
    assert found.settings["dtype"] == "float32"
    assert found.interval[0] <= 1e6 + closed.fall() <= found.interval[1]
    assert "float64" in found.reference
    assert abs(found.bias) > 0.1


@pytest.mark.slow
def test_a_suggestion_for_a_mean_knows_the_bias_of_a_scene_in_single_precision():
    scene = dataclasses.replace(closed.sphere(), start=lw.Start(position=[0.0, 0.0, 1e6]))
    scene = lw.Scene.from_dict(scene.to_dict() | {"run": {"dtype": "float32"}})
    fleet = lw.Ensemble(scene, 64, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
    found = lw.suggest(fleet, 0.05, "mean position[2]", t1=closed.TIME, methods=[closed.METHOD])
    assert found.settings["dtype"] == "float64"


@pytest.mark.ci
def test_an_error_above_the_spread_takes_few_members():
    found, truth = estimated("fall", error=20.0)
    assert sum(found.members.values()) <= 64
    assert abs(found.value - truth) < 20.0


@pytest.mark.ci
def test_what_does_not_vary_is_one_run():
    found = lw.estimate(lw.Ensemble(closed.sphere(), 4), "mean position[2]", 1e-3, **RUN)
    assert found.estimator == "one run"
    assert found.sampling_error == 0.0
    assert found.value == pytest.approx(400.0 + closed.fall(), abs=2e-3)
    says(" ".join(found.messages), "nothing varies and no noise acts")


@pytest.mark.ci
def test_noise_without_numbers_that_vary():
    fleet = lw.Ensemble(closed.pushed().scene, 4)
    found = lw.estimate(fleet, "mean position[0]", 0.05, **RUN)
    assert abs(found.value - closed.mean_north()) <= 0.2
    assert found.estimator in ("plain Monte Carlo", "levels")


@pytest.mark.ci
def test_one_number_that_varies_and_a_relative_error():
    fleet = lw.Ensemble(closed.sphere(), 4, vary={"vehicle.buoyancy": lw.distributions.Normal(std=4.0)})
    found = lw.estimate(fleet, lambda result: result.position[-1, :, 2] - 400.0, relative_error=1e-3, **RUN)
    assert found.error == pytest.approx(1e-3 * closed.fall(), rel=0.05)
    assert found.value == pytest.approx(closed.fall(), rel=4e-3)


@pytest.mark.ci
def test_steps_at_which_members_fail_are_left_out():
    """Explicit steps of 1 s overflow where drag relaxes in 0.03 s."""
    scene = closed.sphere()
    stiff = dataclasses.replace(scene, terms=[lw.terms.Drag(linear=[4000.0] * 3 + [1.0] * 3)])
    fleet = lw.Ensemble(stiff, 4, vary={"vehicle.buoyancy": lw.distributions.Normal(std=4.0)})
    found = lw.estimate(fleet, "mean position[2]", 1e-4, **RUN)
    assert found.value == pytest.approx(400.0 + closed.fall(4000.0), abs=4e-4)
    says(" ".join(found.messages), "rk4 1 is left out: 64 of 64 members fail")


@pytest.mark.slow
def test_the_probability_of_an_event():
    scene = closed.sphere(events=[lw.events.Floor(depth=DEEP)])
    fleet = lw.Ensemble(scene, 4, vary=closed.falling().vary)
    found = lw.estimate(fleet, lw.statistics.Outcome("floor"), 0.03, **RUN)
    assert abs(found.value - closed.probability_deeper(DEEP)) <= 4.0 * found.error_reached + found.bias_interval[1]
    assert 0.0 <= found.interval[0] < found.interval[1] <= 1.0


@pytest.mark.ci
def test_a_cheaper_scene_may_carry_a_level():
    found, truth = estimated("fall", error=2e-3, cheaper=[{"environment.gravity": closed.GRAVITY}])
    assert abs(found.value - truth) <= 8e-3


@pytest.mark.ci
def test_members_that_two_steps_leave_apart():
    """A number that the last digits of a position decide: its mean over a normal position is 0."""

    def last_digits(result):
        return np.sin(1e10 * result.position[-1, :, 2])

    found = lw.estimate(closed.falling(), last_digits, 0.02, **RUN)
    says(" ".join(found.messages), "levels gain nothing", "as in chaos")
    assert abs(found.value) <= 4.0 * found.sampling_error
    assert not found.estimator.startswith("levels")


@pytest.mark.ci
def test_the_page(tmp_path, monkeypatch):
    """The snippets of docs/guide/least_cost.md."""
    known = {}
    monkeypatch.chdir(tmp_path)
    for code in blocks("docs/guide/least_cost.md", "python"):
        exec(code, known)
    found, fleet = known["found"], known["fleet"]
    many = lw.Ensemble(fleet.scene, 4096, 5, fleet.vary, sampling="sobol")
    save = lw.SaveAt(fields=("position",))
    # The same kernel at half the step: 4,096 Sobol points tell the mean to a few millimetres.
    finer = lw.solve(many, method=found.settings["method"], h=0.5 * found.settings["h"], t1=10.0, save=save)
    assert abs(found.value - finer.position[-1, :, 0].mean()) < 0.04


@pytest.mark.ci
def test_refusals():
    fleet = closed.falling()

    def ask(of="mean position[2]", error=0.1, **settings):
        return refused(lw.estimate, settings.pop("fleet", fleet), of, error, **RUN | settings)

    says(ask(error=None), "error = None", "Give one of them")
    says(ask(error=-1.0), "error = -1.0")
    says(ask(t1=None), "t1 = None is missing")
    says(ask(cheaper={"vehicle.mass": 1.0}), "is not a list of scenes")
    says(ask(cheaper=[1]), "cheaper[0] = 1 is not a scene")
    says(ask(risk="large"), "is not a risk")
    says(ask("position[2] above 425", risk=0.5), "Leave it out")
    says(ask(lambda result: 1.0 / (result.position[-1, :, 2] - 422.0), 0.01), "has no finite variance", "risk=0.5")
    says(ask("position[2] above 900", None, relative_error=0.1), "lw.rare_event", "65,536 members")
    says(ask(lambda result: 0.0 * result.position[-1, :, 2], None, relative_error=0.1), "which is 0", "Give error=")
    says(ask(error=1e-9), "would take", "Give a larger one")
    says(ask(error=1e-300), "would take", "Give a larger one")
    says(ask(seed=-1), "seed = -1")
    says(ask("position"), "is 3 numbers", "Name one of its entries")
    table = lw.Ensemble(closed.sphere(), sampling=lw.designs.Table({"vehicle.buoyancy": [950.0, 955.0]}))
    says(ask(fleet=table), "gives vehicle.buoyancy to its members", "lw.solve")
    fails = lw.Ensemble(closed.sphere(), vary={"drag.linear[2]": lw.distributions.Uniform(1e6, 1e8)}, members=4)
    says(ask(fleet=fails, h=0.5), "64 of 64 members fail", "Give a shorter step")


@pytest.mark.ci
@pytest.mark.parametrize("name", ["plain Monte Carlo", "sobol", "regression"])
def test_an_estimator_may_be_fixed(name):
    found, truth = estimated("fall", estimator=name, h=0.5)
    assert found.estimator == name
    assert abs(found.value - truth) <= 4.0 * found.error_reached
    again = estimated("fall", estimator=name, h=0.5)[0]
    assert (found.value, found.interval) == (again.value, again.interval)


@pytest.mark.ci
def test_levels_may_be_fixed_and_what_cannot_be_had_is_refused():
    found, truth = estimated("north", error=0.02, estimator="levels", h=0.5)
    assert found.estimator == "levels"
    assert abs(found.value - truth) <= 4.0 * found.error_reached
    still = lw.Ensemble(closed.pushed().scene, 4)
    fault = refused(lw.estimate, still, "mean position[0]", 0.05, estimator="sobol", **RUN)
    says(fault, "estimator = 'sobol'", "cannot be had", "Leave it out")
    says(refused(estimated, "fall", estimator="best"), "estimator = 'best'")


@pytest.mark.slow
def test_processes_have_the_bits_of_threads():
    how = {"estimator": "sobol", "h": 0.5}
    assert estimated("fall", executor="processes", **how)[0].value == estimated("fall", **how)[0].value


@pytest.mark.ci
def test_progress_ends_at_one_and_an_interrupt_says_how_far_it_was():
    parts = []
    estimated("fall", progress=parts.append)
    assert parts == sorted(parts)
    assert parts[-1] == 1.0

    def stop(part):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="there is no answer yet"):
        estimated("fall", progress=stop)


@pytest.mark.ci
def test_a_suggestion_for_a_mean_stands_on_the_same_bias():
    """An order-4 method on a fall that relaxes in 10 s: the mean of a run at the suggested step is as near as told."""
    fleet = closed.falling()
    found = lw.suggest(fleet, 1e-3, "mean position[2]", t1=closed.TIME, methods=[closed.METHOD])
    assert found.expected <= 1e-3
    many = lw.Ensemble(fleet.scene, 256, 0, fleet.vary)
    coarse, fine = (lw.solve(many, t1=closed.TIME, save=lw.SaveAt(fields=("position",)), threads=1,
                             **found.settings | {"h": found.settings["h"] / k}) for k in (1, 8))  # fmt: skip
    apart = (coarse.position[-1, :, 2].astype(float) - fine.position[-1, :, 2]).mean()
    assert abs(apart) <= found.expected
    says(refused(lw.suggest, fleet, 1e-14, "mean position[2]", t1=closed.TIME, methods=["rk4"]), "its bias is known to")


@pytest.mark.slow
def test_a_suggestion_for_a_mean_in_noise():
    found = lw.suggest(closed.pushed(), 0.02, "mean position[0]", t1=closed.TIME, methods=[closed.METHOD])
    assert 0.0 < found.expected <= 0.02


def test_studies_of_errors_refuse_weights():
    values = {"vehicle.buoyancy": [950.0, 955.0]}
    fleet = lw.Ensemble(closed.sphere(), sampling=lw.designs.Table(values, weights=[0.2, 0.8]))
    says(refused(lw.suggest, fleet, 1e-3, t1=1.0), "members with weights", "Leave the weights out")
    says(refused(lw.tradeoff, fleet, 1.0), "members with weights", "Leave the weights out")
    says(refused(lw.worst_case, fleet, {"vehicle.mass": (90.0, 110.0)}, "depth"), "weights", "Give the scene alone")


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN)
def test_intervals_hold_over_seeds(name):
    """Sampling and bias together, over 200 seeds, and the error told is the one seen to a quarter.

    Of 200 intervals of 95 %, 182 or more hold in 99 of 100 tries.
    """
    held, apart, told = [], [], []
    for seed in range(200):
        found, truth = estimated(name, seed)
        held.append(found.interval[0] <= truth <= found.interval[1])
        apart.append(found.value - truth)
        told.append(found.error_reached)
    assert np.mean(held) >= 0.91
    assert np.sqrt(np.mean(np.square(apart))) <= KNOWN[name][3]
    assert np.sqrt(np.mean(np.square(apart))) <= 1.25 * np.sqrt(np.mean(np.square(told)))


@pytest.mark.ci
@pytest.mark.parametrize("risk", [0.99, 0.999, 0.01, lw.metrics.CVaR(0.05), lw.metrics.CVaR(0.01)], ids=str)
def test_tails_have_members_in_them(risk):
    # A sphere that sinks against linear drag: its depth is linear in its normal start.
    scene = lw.Scene.named("sphere", terms=[lw.terms.Drag(linear=[20.0, 20.0, 20.0, 1.0, 1.0, 1.0])])
    fleet = lw.Ensemble(scene, vary={"start.velocity[2]": lw.distributions.Normal(std=0.3)})
    time = 1.5 * float(scene.vehicle.mass) / 20.0
    spread = 0.3 * time * (1.0 - np.exp(-3.0 / time))
    if isinstance(risk, float):
        truth = ndtri(risk) * spread
    else:
        truth = np.exp(-0.5 * ndtri(risk.share) ** 2) / np.sqrt(2.0 * np.pi) / risk.share * spread
    found = lw.estimate(fleet, "depth", error=0.05 * spread, risk=risk, t1=3.0, threads=1, seed=3, method="rk4")
    assert 0.0 < found.sampling_error < 0.06 * spread
    # Four errors, of a sampling error that 16 replicates know to a fifth.
    assert abs(found.value - truth) < 4.0 * found.sampling_error + 1e-3 * spread


def test_a_level_beyond_what_a_pilot_sees_is_refused():
    fleet = lw.Ensemble(lw.Scene.named("sphere"), vary={"start.velocity[2]": lw.distributions.Normal(std=0.3)})
    with pytest.raises(
        lw.SceneError, match=r"risk = .*members of the pilot, too few to know its error. Ask for a level"
    ):
        lw.estimate(fleet, "depth", error=0.05, risk=0.99999, t1=1.0, threads=1, method="rk4")
