# SPDX-License-Identifier: Apache-2.0
"""Tables of speed from clocks that the tests make up: members, threads, terms and widths."""

import dataclasses
import math

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common import machine
from lgvi_warp.engine import widths
from lgvi_warp.measuring import packet_width as tuning
from lgvi_warp.measuring import scaling, speed
from lgvi_warp.measuring.cost import Cost
from lgvi_warp.runs.settle import make_plan


class Clock:
    """Time that only the test moves on."""

    def __init__(self):
        self.time = 0.0

    def __call__(self):
        return self.time


def test_costs_by_members_and_threads():
    runs, clock = [], Clock()

    def run(plan, threads):
        runs.append((plan.ensemble.members, threads))
        clock.time += (1e-6 + 1e-9 * plan.ensemble.members * plan.grid.steps) / threads + 1e-5 * (len(runs) <= 4)

    fleet = speed.fleet(64)
    sizes, counts = scaling.members_and_threads(fleet, [64, 8, 8], [2, 1, 2])
    plans = [make_plan(fleet.subset(range(n)), "psi_s", h=0.01, t1=1.0) for n in sizes]
    rows = scaling.timed_runs(plans, counts, 2, run=run, clock=clock)
    pairs = [(n, k) for n in (8, 64) for k in (1, 2)]
    assert rows == [{"members": n, "threads": k, "steps": 100,
                     "ns_per_vehicle_step": round((1e3 + n * 100) / k / (n * 100), 3)} for n, k in pairs]  # fmt: skip
    assert runs == [(8, 1), (8, 2), (64, 1), (64, 2)] * 2


def test_members_and_threads_by_default():
    sizes, counts = scaling.members_and_threads(speed.fleet(64), None, None)
    assert sizes == [1, 10, 64]
    assert counts == scaling.rising(2, machine.thread_count())
    assert (scaling.rising(2, 6), scaling.rising(10, 1), scaling.rising(10, 10)) == ([1, 2, 4, 6], [1], [1, 10])
    assert (scaling.rising(10, 100), scaling.rising(2, 9)) == ([1, 10, 100], [1, 2, 4, 8, 9])


@pytest.mark.parametrize(("arguments", "words"), [
    ({"members": [0, 1]}, "members = [0, 1]: is not within the fleet; name numbers from 1 to 8"),
    ({"members": [9]}, "members = [9]: is not within the fleet"), ({"members": []}, "members = []: is not within the fleet"),
    ({"threads": [0]}, "threads = [0]: holds no number of threads; name numbers from 1 on"),
    ({"threads": []}, "threads = []: holds no number of threads"),
])  # fmt: skip
def test_numbers_of_members_and_threads_that_are_none(arguments, words):
    with pytest.raises(lw.SceneError) as caught:
        lw.bench.scaling(speed.fleet(8), **arguments)
    assert words in str(caught.value)


def test_what_each_term_costs():
    """Ten nanoseconds without terms, seven more for each of a scene's."""
    drag, wrench = lw.terms.Drag(linear=[1.0] * 6), lw.terms.Wrench(force=[1.0, 0.0, 0.0])
    scene = dataclasses.replace(speed.example(), terms=[drag, wrench])
    plans = scaling.plans_of_terms(scene, 16, "psi_x", 0.02, "float32")
    prices = [Cost(1e-3 * (10.0 + 7.0 * len(plan.ensemble.scene.terms)) / plan.grid.h, 1.0) for plan in plans.values()]
    names = [("none", 10.0), ("drag", 17.0), ("wrench", 17.0), ("all terms", 24.0)]
    assert scaling.priced(plans, prices) == [
        {"term": name, "method": "psi_x", "dtype": "float32", "ns_per_vehicle_step": ns, "more_than_none": ns - 10.0}
        for name, ns in names]  # fmt: skip
    assert all(plan.ensemble.members == 16 and plan.grid.h == 0.02 and plan.grid.steps == 10 for plan in plans.values())
    assert list(scaling.plans_of_terms(dataclasses.replace(scene, terms=[drag]), 4, "psi_x", 0.02, None)) == [
        "none", "drag"]  # fmt: skip
    run = dataclasses.replace(scene.run, method="rk4", step=0.05)
    ending = dataclasses.replace(scene, run=run, events=[{"type": "floor", "depth": 20.0}])
    for plan in scaling.plans_of_terms(ending, 64, None, 0.05, None).values():
        assert (plan.method.name, plan.dtype, plan.grid.h, plan.ensemble.members) == ("rk4", "float64", 0.05, 64)
        assert not plan.ensemble.scene.events
    with pytest.raises(
        lw.SceneError, match=r"scene\.terms: is empty; give the scene terms whose cost is to be measured"
    ):
        lw.bench.term_cost(speed.example())


@pytest.mark.parametrize(("faster", "better"), [(0.96, True), (0.98, False)])
def test_the_width_of_each_kernel_is_the_fastest(faster, better):
    """One width of each kernel is faster than that of the table, by enough or not."""
    plans, seen, clock = [], [], Clock()
    lanes_of = {"float64": 4, "float32": 8, "float32_compensated": 8}.get

    def prepare(plan):
        plans.append(plan)
        place = (plan.dtype, plan.spec.width)

        def call():
            seen.append(place)
            clock.time += 1e-3 * (faster if plan.spec.width == lanes_of(plan.dtype) else 1.0)

        return call

    found = list(tuning.calibrate(2, prepare=prepare, clock=clock, register_width=lanes_of))
    assert [one.kernel for one in found] == list(widths.KERNELS)
    for one in found:
        kind, dtype = widths.parts(one.kernel)
        lanes = 4 if dtype == "float64" else 8
        ns = {
            n * lanes: 1e6 / (512 * 128) * (faster if n == 1 else 1.0) for n in (1, 2, 4) if n * lanes in widths.WIDTHS
        }
        assert one.ns == pytest.approx(ns)
        assert one.before == widths.of_table(kind, dtype).lanes
        assert one.best == (lanes if better or one.before == lanes else one.before)
    assert {(plan.ensemble.members, plan.grid.steps, plan.grid.h) for plan in plans} == {(512, 128, 0.01)}
    methods = [plan.method.name for plan in plans if plan.dtype == "float64"]
    assert set(methods) == {"psi_s", "psi_1", "psi_x", "rk8"}
    assert any(plan.ensemble.scene.terms for plan in plans)
    dense = tuning.TERMS["dense"][0].linear
    assert (dense != 0.0).all()
    assert np.array_equal(dense, dense.T)
    assert dense[0, 0] == 22.0
    assert dense[1, 0] == pytest.approx(0.1 * math.sqrt(20.0 * 60.0))
    assert np.linalg.eigvalsh(dense)[0] > 0.0
    assert len(seen) == 2 * len(plans)
