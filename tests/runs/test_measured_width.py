# SPDX-License-Identifier: Apache-2.0
"""Long runs measure two widths of their kernel, and later ones know the better."""

import pytest

import lgvi_warp as lw
from lgvi_warp.engine import widths
from lgvi_warp.measuring import speed
from lgvi_warp.runs.measured_width import candidates, measure, with_best_width
from lgvi_warp.runs.settle import make_plan


class Clock:
    """A clock that goes on by a given time with each second reading, as around each launch."""

    def __init__(self, seconds):
        self.seconds, self.now, self.readings = seconds, 0.0, 0

    def __call__(self):
        self.readings += 1
        self.now += self.seconds * (self.readings % 2 == 0)
        return self.now


def plan_of(members=64, steps=8, **named):
    return make_plan(speed.fleet(members), "psi_s", h=0.01, t1=0.01 * steps, **named)


def test_a_short_run_measures_nothing(measured_widths):
    clock = Clock(1.0)
    plan = plan_of()
    assert with_best_width(plan, 1, clock) is plan
    assert clock.readings == 0


@pytest.mark.ci
def test_a_run_that_turns_out_short_keeps_its_width(measured_widths):
    plan = plan_of(members=2_000_000)
    # 16 million vehicle-steps of 1 us.
    clock = Clock(1e-6 * 512 * 8)
    assert with_best_width(plan, 1, clock) is plan
    assert (clock.readings, widths.measured()) == (4, {})


@pytest.mark.parametrize("requested", [{"width": 8}, {"method": "rk5"}])
def test_a_width_that_was_asked_for_and_steps_that_are_chosen_stay(measured_widths, requested):
    method = lw.Method("rk5", rtol=1e-6, atol=1e-9) if "method" in requested else "psi_s"
    plan = make_plan(speed.fleet(2_000_000), method, h=0.01, t1=0.1, width=requested.get("width"))
    clock = Clock(1e3)
    assert with_best_width(plan, 1, clock) is plan
    assert clock.readings == 0


@pytest.mark.ci
def test_a_long_run_measures_two_widths_and_later_runs_know(measured_widths):
    plan = plan_of(members=2_000_000)
    # 16 million vehicle-steps of 10 us, on each width alike: the width stays, and is known to be measured.
    chosen = with_best_width(plan, 1, Clock(1e-5 * 512 * 8))
    assert (chosen.spec, chosen.width_source) == (plan.spec, "measured")
    assert widths.measured() == {plan.kernel.hash: plan.spec.width}
    again, clock = plan_of(members=2_000_000), Clock(1e3)
    assert (again.width_source, with_best_width(again, 1, clock)) == ("measured", again)
    assert clock.readings == 0


@pytest.mark.ci
def test_a_run_goes_on_where_its_width_cannot_be_kept(measured_widths):
    measured_widths.mkdir()  # a file cannot stand here
    try:
        chosen = with_best_width(plan_of(members=2_000_000), 1, Clock(1e-5 * 512 * 8))
        assert chosen.width_source == "measured"
    finally:
        measured_widths.rmdir()


@pytest.mark.ci
def test_the_faster_width_is_taken(measured_widths):
    plan = plan_of()
    (one,), (two,) = candidates(plan, (1,)), candidates(plan, (2,))
    assert (one, two) == (plan.spec.width // 2, plan.spec.width) or (one, two) == (plan.spec.width, 2 * plan.spec.width)
    other = two if plan.spec.width == one else one
    # The plan's own width is warmed first, then the other, then both in turn: the other takes 1 % or 10 % less.
    for less, best in ((0.99, plan.spec.width), (0.9, other)):
        times = iter([1.0, less] * 6)
        found = measure(plan, [other], 5, Ticks(times))
        assert (found.before, found.best) == (plan.spec.width, best)
        assert found.ns[other] == pytest.approx(less * found.ns[plan.spec.width])


class Ticks(Clock):
    """The same with a time of its own for each launch."""

    def __init__(self, times):
        super().__init__(0.0)
        self.times = times

    def __call__(self):
        self.readings += 1
        self.now += next(self.times) if self.readings % 2 == 0 else 0.0
        return self.now
