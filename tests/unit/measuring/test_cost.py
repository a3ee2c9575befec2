# SPDX-License-Identifier: Apache-2.0
"""Costs from readings of a clock that the test makes up: one number a kernel, whatever else the machine does."""

import math
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.accuracy import tradeoff as tradeoffs
from lgvi_warp.accuracy.tradeoff import Measurement, Tradeoff, report_text
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


def test_a_least_reading_is_met_again():
    kinds = [Kind("a", 1.0), Kind("a", 0.5), Kind("b", 1.0), Kind("c", 1.0)]
    nan = np.nan
    seconds = np.array([[1.0, 5.0, nan], [1.04, 7.0, nan], [1.0, 1.2, 1.3], [2.0, nan, nan]])
    assert cost.confirmed(kinds, seconds) == [True, True, False, False]
    assert [least for least, _ in of_steps(kinds, seconds)] == [1.0, 1.0, 1.0, 2.0]


def test_costs_that_are_unsure_are_read_again():
    """Of two kernels one is disturbed: it alone is read again, at most three times, until two readings are near."""
    left = [iter([1.0] * 9), iter([1.0, 9.0, 5.0, 3.0, 2.0, 2.05] + [1.0] * 9)]
    read = []

    def of_kinds(which):
        read.append(list(which))
        return np.array([[next(left[i]) for _ in range(2)] for i in which])

    kinds = [Kind("quiet", 0.5), Kind("busy", 0.5)]
    seconds = cost.readings(kinds, of_kinds)
    assert read == [[0, 1], [1], [1], [1]]
    nan = np.nan
    np.testing.assert_array_equal(seconds, [[1, 1, *[nan] * 6], [1, 9, 5, 3, 2, 2.05, 1, 1]])
    assert cost.of_steps(kinds, seconds) == [(1.0, 1.0), (1.0, np.median([1, 9, 5, 3, 2, 2.05, 1, 1]))]


def test_disagreement_is_above_its_bound():
    assert cost.disagreement([("a", 1.3)]) is None
    assert cost.disagreement([]) is None
    text = cost.disagreement([("b", 1.31), ("a", 2.0), ("b", 4.0), ("b", 3.0)])
    assert text == ("readings of cost disagree: their median is above the least, which is taken, for b (4 times), a (2 "
                    "times); other programs run at the same time, and costs that lie closer are not told apart; run again "
                    "on an idle machine")  # fmt: skip
    assert " and 1 more; " in cost.disagreement([(f"m{i}", 2.0 + i) for i in range(7)])
    assert " more" not in cost.disagreement([(f"m{i}", 2.0 + i) for i in range(6)])
    head = "CPU time of one thread, the least of several readings; their median is at most "
    assert cost.agreement_text([1.0, 2.345, math.inf]) == f"{head}2.35 times that"
    assert cost.agreement_text([]) == cost.agreement_text([math.nan]) == f"{head}1.00 times that"


def test_readings_near_the_least():
    nan = np.nan
    ones = [Kind("a", 1.0), Kind("b", 1.0), Kind("c", 1.0)]
    readings = np.array([[1.0, 1.05], [1.0, 1.051], [1.0, nan]])
    assert cost.confirmed(ones, readings) == [True, False, False]
    assert cost.confirmed([Kind("a", 1.0)], np.array([[1.0]])) == [False]
    growing = [Kind("a", 1.0, True), Kind("a", 2.0, True)]
    assert cost.confirmed(growing, np.array([[1.0, 3.0], [1.0, 3.0]])) == [True, False]
    # Only readings of the very same step can disagree where longer ones are more work.
    (_, short), (_, long) = cost.of_steps(growing, np.array([[1.0, 3.0, 3.0], [8.0, 8.0, 8.0]]))
    assert (short, long) == (3.0, 1.0)


def test_launches_are_long_enough_to_time():
    """A step that costs `price` for each vehicle is launched so often that it takes two milliseconds."""
    now, asked = SimpleNamespace(time=0.0), []

    class Packets:
        def __init__(self, plan, members):
            assert members == ("members", 0, plan.ensemble.members)
            self.plan = plan

        def advance(self, first, stop):
            asked.append((first, stop))
            now.time += self.plan.price * (stop - first) * self.plan.ensemble.members

    def plan(price, n=100, stages=1):
        return SimpleNamespace(price=price, spec=SimpleNamespace(width=8), method=SimpleNamespace(stages=(1.0,) * stages),
                               ensemble=SimpleNamespace(members=n, select=lambda a, b: ("members", a, b)))  # fmt: skip

    calls, steps = cost.launches([plan(20e-9), plan(1.0), plan(1e-15), plan(20e-9, 100, 10), plan(20e-9, 2)],
                                 make=Packets, clock=lambda: now.time)  # fmt: skip
    assert [stop for _, stop in asked] == [200, 200, 200, 20, 2500]
    assert all(first == 0 for first, _ in asked)
    assert steps[:, 0] == pytest.approx([1000 * 100, 10 * 100, 100_000 * 100, 1000 * 100, 50_000 * 2], rel=1e-2)
    begun = now.time
    calls[0]()
    assert now.time - begun == pytest.approx(2e-3, rel=1e-2)


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
    quiet, busy = report_text(found(1.01)), report_text(found(4.0))
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
