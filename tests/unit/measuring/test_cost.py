# SPDX-License-Identifier: Apache-2.0
"""Costs from readings of a clock that the test makes up: one number a kernel, whatever else the machine does."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.accuracy import tradeoff as tradeoffs
from lgvi_warp.accuracy.tradeoff import Measurement, Tradeoff
from lgvi_warp.measuring import cost
from lgvi_warp.measuring.comparison import Candidate, Sample
from lgvi_warp.measuring.cost import Kind, of_steps
from tests.support.refusals import says

STEPS = [1.0, 0.5, 0.25, 0.125]
TRUE = {"cheap": 10e-9, "dear": 40e-9}
ROUNDS = 5


def loaded(true, seed=0, most=30.0):
    """Readings (settings, rounds) of true costs (settings,) on a busy machine: up to `most` times as much."""
    random = np.random.default_rng(seed)
    slower = np.exp(random.uniform(0.0, np.log(most), (len(true), ROUNDS)))
    slower[-1, -1] = 1.0  # of a kernel one reading at least is undisturbed
    return np.asarray(true)[:, None] * slower


def test_a_step_of_a_kernel_costs_one_number():
    kinds = [Kind("cheap", h) for h in STEPS]
    seconds = loaded([TRUE["cheap"]] * len(STEPS))
    assert {found for found, _ in of_steps(kinds, seconds)} == {TRUE["cheap"]}
    # What medians said scatters, and not by a little.
    medians = np.median(seconds, axis=1)
    assert medians.max() / medians.min() > 1.3


@pytest.mark.parametrize("seed", range(20))
def test_a_busy_machine_changes_no_order(seed):
    kinds = [Kind(name, h) for name in TRUE for h in STEPS]
    seconds = np.concatenate([loaded([TRUE[name]] * len(STEPS), seed + i) for i, name in enumerate(TRUE)])
    found = [least for least, _ in of_steps(kinds, seconds)]
    assert found == pytest.approx([TRUE[kind.kernel] for kind in kinds], rel=1e-12)


def test_kernels_do_not_lend_each_other_readings():
    (cheap, _), (dear, _) = of_steps([Kind("cheap", 1.0), Kind("dear", 1.0)], np.array([[1.0, 2.0], [3.0, 4.0]]))
    assert (cheap, dear) == (1.0, 3.0)


def test_where_longer_steps_are_more_work_they_cost_no_less():
    kinds = [Kind("newton", h, grows=True) for h in STEPS]
    true = np.array([4.0, 3.0, 2.0, 1.0])
    quiet = of_steps(kinds, np.repeat(true[:, None], 3, axis=1))
    assert [least for least, _ in quiet] == true.tolist()
    assert all(spread == 1.0 for _, spread in quiet)
    # The second and the last were disturbed: a longer step bounds each from above.
    disturbed = [least for least, _ in of_steps(kinds, np.array([4.0, 9.0, 2.0, 30.0])[:, None])]
    assert disturbed == [4.0, 4.0, 2.0, 2.0]


@pytest.mark.parametrize(("noise", "reported"), [(1.02, False), (1.2, False), (2.0, True), (30.0, True)])
def test_readings_that_disagree_are_told(noise, reported):
    seconds = np.array([[1.0, noise, noise, noise, 1.0], [1.0, noise, 1.0, noise, noise]])
    (_, spread), _ = of_steps([Kind("a", 1.0), Kind("a", 0.5)], seconds)
    text = cost.disagreement([("psi_x float64", spread), ("rk4 float64", 1.0)])
    assert spread == noise
    if reported:
        assert f"psi_x float64 ({noise:.2g} times)" in text
        assert "rk4" not in text
        assert "idle machine" in text
    else:
        assert text is None


def test_a_least_reading_is_met_again():
    kinds = [Kind("a", 1.0), Kind("a", 0.5), Kind("b", 1.0), Kind("c", 1.0)]
    nan = np.nan
    seconds = np.array([[1.0, 5.0, nan], [1.04, 7.0, nan], [1.0, 1.2, 1.3], [2.0, nan, nan]])
    assert cost.confirmed(kinds, seconds) == [True, True, False, False]
    assert [least for least, _ in of_steps(kinds, seconds)] == [1.0, 1.0, 1.0, 2.0]


def test_many_are_told_few_by_name():
    text = cost.disagreement([(f"m{i}", 2.0 + i) for i in range(9)])
    says(text, "m8 (10 times), m7 (9 times)", "and 3 more")
    assert "m0" not in text


def test_calls_are_timed_in_turn_after_one_that_is_not_counted():
    now = SimpleNamespace(time=0.0, left=[100.0, 100.0, 1.0, 2.0, 3.0, 4.0])

    def take(factor):
        def call():
            now.time += factor * now.left.pop(0)

        return call

    readings = cost.timed([take(1.0), take(10.0)], 2, clock=lambda: now.time)
    np.testing.assert_array_equal(readings, [[1.0, 3.0], [20.0, 40.0]])


def test_settings_are_priced_by_the_clock_of_the_thread():
    """Through the machinery that trade-offs and suggestions use, with kernels that are not run."""
    slow = iter([30.0, 1.0, 7.0, 2.0] * 100)
    now = SimpleNamespace(time=0.0)

    class Packets:
        def __init__(self, plan, members):
            self.plan = plan

        def advance(self, first, stop):
            now.time += TRUE[self.plan.spec.name] * (stop - first) * self.plan.ensemble.members * next(slow)

    def plan(name, h):
        spec = SimpleNamespace(name=name, width=8)
        ensemble = SimpleNamespace(members=128, select=lambda first, stop: None)
        method = SimpleNamespace(stages=(1.0,), adaptive=False)
        return SimpleNamespace(spec=spec, grid=SimpleNamespace(h=h), ensemble=ensemble, method=method)

    plans = [plan(name, h) for name in TRUE for h in STEPS]
    prices = cost.costs(plans, make=Packets, clock=lambda: now.time, grows=lambda plan: False)
    for one, price in zip(plans, prices, strict=True):
        assert price.us_per_vehicle_second * one.grid.h == pytest.approx(1e6 * TRUE[one.spec.name], rel=1e-9)
        assert price.spread > cost.DISAGREE


def found(spread):
    """A trade-off of one setting."""
    errors = {name: dict.fromkeys(tradeoffs.KINDS, 1e-3) for name in ("position", "attitude")}
    one = Measurement(Candidate("psi_x", 0.1), 1.0, 0.0, errors, 0.0, {}, 2, {"position": True}, spread)
    doubt = cost.disagreement([("psi_x float64", spread)])
    return Tradeoff(
        (one,), "position", 1, 1.0, 1.0, "itself", {"position": 1e-9}, None, messages=(doubt,) if doubt else ()
    )


def test_the_report_says_how_costs_were_read():
    quiet, busy = str(found(1.01)), str(found(4.0))
    assert "note" not in quiet
    assert "at most 1.01 times" in quiet
    says(busy, "note        readings of cost disagree", "at most 4.00 times")
    assert found(4.0).rows()[0]["cost_spread"] == 4.0
    assert found(4.0).to_dict()["measurements"][0]["cost_spread"] == 4.0


def test_time_of_other_threads_does_not_count():
    stop = threading.Event()

    def work():
        while not stop.is_set():
            sum(range(1000))

    other = threading.Thread(target=work)
    other.start()
    try:
        wall, begun = time.perf_counter(), cost.thread_seconds()
        time.sleep(0.2)
        waited, took = time.perf_counter() - wall, cost.thread_seconds() - begun
    finally:
        stop.set()
        other.join()
    assert waited >= 0.2
    assert took < 0.5 * waited or cost.os.name == "nt"


@pytest.mark.parametrize(
    ("method", "grows"),
    [("psi_x", False), ("psi_s", False), ("rk4", False), ("kl8(psi_x)", False), ("gauss4", True), ("psi_w", True)],
)
def test_which_steps_are_more_work_when_longer(scene, method, grows):
    sample = Sample(scene, 1.0, 1)
    assert cost.work_grows(sample.plan(sample.candidate(method, 4))) is grows


@pytest.mark.parametrize("noise_step", [None, 0.0125])
def test_steps_of_several_draws_are_more_work(scene, noise_step):
    noise = lw.terms.WrenchNoise(force=[1.0, 1.0, 1.0], noise_step=noise_step)
    sample = Sample(lw.Scene(scene.vehicle, scene.environment, terms=[noise], start=scene.start), 1.0, 1).on_grid(4)
    candidates = [sample.candidate("psi_x", m) for m in (1, 4)]
    # Every run of the comparison draws on one grid; a run outside it as the scene says.
    assert [cost.work_grows(sample.plan(one)) for one in candidates] == [True, False]
    priced = [sample.plan_to_price(one) for one in candidates]
    assert [cost.work_grows(plan) for plan in priced] == [noise_step is not None, False]
    assert len({plan.spec for plan in priced} | {sample.plan(one).spec for one in candidates}) == 1
