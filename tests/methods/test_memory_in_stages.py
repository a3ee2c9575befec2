# SPDX-License-Identifier: Apache-2.0
"""Lags and limited rates in Runge-Kutta methods: what laws remember is exact at every stage, so methods keep their orders."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.measuring.comparison import Sample
from lgvi_warp.methods import tableaux
from lgvi_warp.methods.method import ORDERS
from lgvi_warp.physics import terms
from lgvi_warp.reference import explicit, linearly_implicit, munthe_kaas
from lgvi_warp.reference.terms.control_fins import ControlFins
from lgvi_warp.reference.terms.thrusters import Thrusters
from tests.laws import test_parity as test_terms
from tests.laws.case import Case
from tests.laws.cases import together
from tests.laws.cases_lift import DENSITY
from tests.methods.test_exact_solutions import drag_of, run, sphere
from tests.methods.test_explicit import TABLEAUX, begun, both, ended
from tests.support.tools import difference, last, one, slope

STEPPERS = {name: explicit.stepper(tableau) for name, tableau in TABLEAUX.items()}
STEPPERS |= {"rkmk4": munthe_kaas.rkmk4, "rkw3": linearly_implicit.stepper(tableaux.RKW3)}

# Commands jump at t = 0 and turn at half time; all else is smooth. The first thruster lags, the second does not.
JUMP = 1e-12
TIMES, HALF, END = (0.0, JUMP, 0.5, 1.0), 0.5, 1.0
THRUSTERS = dict(
    position=((-0.5, 0.2, 0.0), (-0.5, -0.2, 0.1)), direction=((1.0, 0.0, 0.0), (0.0, 0.6, 0.8)), dead_band=(0.0, 0.0),
    limit=(2.0, 2.0), time_constant=(0.3, 0.0), times=TIMES,
)  # fmt: skip
COMMAND = ((0.0, 0.3), (1.0, 0.3), (1.0, 0.8), (0.4, 0.2))
# The first fin turns at its limited rate all the time; the second follows a command that is slower.
FINS = dict(
    position=((-0.6, 0.0, 0.1), (-0.6, 0.1, 0.0)), chord=((1.0, 0.0, 0.0),) * 2, normal=((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    area=(0.02, 0.03), lift_slope=(2.0, 3.0), drag=(0.02, 0.02), drag_normal=(1.0, 1.0), limit=(0.4, 0.4),
    rate_limit=(0.2, 0.4), times=TIMES,
)  # fmt: skip
ANGLES = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.3, -0.05))
CASE = Case(
    (
        terms.Thrusters(**THRUSTERS, command_schedule=COMMAND, coefficient=(20.0, 15.0)),
        terms.ControlFins(**FINS, command_schedule=ANGLES),
    ),
    (
        Thrusters(**{key: np.array(value) for key, value in THRUSTERS.items()}, command=np.array(COMMAND),
                  forward=np.array((20.0, 15.0)), backward=np.array((20.0, 15.0))),
        ControlFins(**{key: np.array(value) for key, value in FINS.items()}, command=np.array(ANGLES), density=DENSITY),
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def body():
    return test_terms.body_of(CASE)


@pytest.fixture(scope="module")
def truth(body):
    """The end, with the lagged command as one unknown more, and the angles as they are by their rates."""
    command = np.array(COMMAND)

    def rates(t, y):
        lagged, other = (np.interp(t, TIMES[1:], column) for column in command[1:].T)
        angles = np.array([0.2 * t, np.interp(t, TIMES, np.array(ANGLES)[:, 1])])
        x = explicit.unpack(y[:15], begun(body), t)
        x = replace(x, memory=(*x.memory[:2], np.array([y[15], other]), angles))
        return np.append(explicit.rates(x, body, 1.0), (lagged - y[15]) / 0.3)

    y = np.append(explicit.pack(begun(body)), 0.0)
    for span in ((0.0, HALF), (HALF, END)):
        y = solve_ivp(rates, span, y, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return explicit.unpack(y[:15], begun(body), END), y[15]


# Commands turn between steps.
STEPS = {
    "rk4": (0.05, 0.025, 0.0125), "rk5": (0.0625, 0.05, 0.025), "rk5_ck": (0.0625, 0.05, 0.025),
    "rk8": (0.125, 0.1, 0.0625), "rkmk4": (0.05, 0.025), "rkw3": (0.05, 0.025, 0.0125),
}  # fmt: skip


@pytest.mark.ci
@pytest.mark.parametrize("name", STEPS)
def test_the_twin_keeps_the_order(name, body, truth):
    errors = []
    for h in STEPS[name]:
        x = explicit.advance(STEPPERS[name], begun(body), body, h, round(END / h))
        # Exact whatever the step: what is left is round-off, and that the jump takes 1e-12 s.
        np.testing.assert_allclose(x.memory[2], (truth[1], 0.2), rtol=1e-11)
        np.testing.assert_allclose(x.memory[3], (0.2, -0.05), rtol=1e-11)
        errors.append(difference(ended(x, body), ended(truth[0], body)))
    # The next term of the error shows.
    assert slope(STEPS[name], errors) == pytest.approx(ORDERS[name], abs=0.1 * ORDERS[name])


@pytest.mark.ci
def test_a_turn_within_a_step_costs_order(body, truth):
    # 1 / 15 s never ends at half time, where the command of the thruster has a kink: the velocity loses h^2 once.
    steps = np.array([1 / 15, 1 / 31])
    ends = (explicit.advance(STEPPERS["rk8"], begun(body), body, h, round(END / h)) for h in steps)
    assert 1.5 < slope(steps, [difference(ended(x, body), ended(truth[0], body)) for x in ends]) < 3.5


# Commands that turn and reach their limits within steps, and come to meet the fins.
ROUGH = together("thrusters", "control fins with rates")


@pytest.mark.ci
@pytest.mark.slow_but("rk4-float64*")
@pytest.mark.parametrize(
    ("method", "dtype", "bound"),
    # 12 steps of round-off, of either precision.
    [(name, "float64", 1e-13) for name in STEPPERS if name != "rkw3"] + [("rk4", "float32", 1e-5)],
)
def test_the_kernel_is_as_the_twin(method, dtype, bound):
    scene, laws = test_terms.scene_of(ROUGH), test_terms.body_of(ROUGH)
    assert difference(*both(scene, laws, method, 0.1, 12, dtype=dtype)) < bound


@pytest.mark.slow
def test_a_member_has_the_same_bits_among_others():
    # Commands that turn at other times, other lags and rates: the pieces of one lane are not those of its neighbours.
    varied = {"thrusters.times": lw.distributions.Normal(relative=0.1),
              "thrusters.time_constant": lw.distributions.Uniform(relative=0.5),
              "control_fins.rate_limit": lw.distributions.Uniform(relative=0.5)}  # fmt: skip
    fleet = lw.Ensemble(test_terms.scene_of(ROUGH), 24, 5, varied)
    result = lw.solve(fleet, "rk4", h=0.1, t1=1.2)
    for i in range(0, 24, 5):
        alone = lw.solve(fleet.member(i), "rk4", h=0.1, t1=1.2)
        assert all(np.array_equal(a, b) for a, b in zip(last(result, i), last(alone), strict=True))


@pytest.mark.slow
def test_the_linearly_implicit_kernel_is_as_the_twin():
    body = test_terms.body_of(ROUGH)
    result = lw.solve(one(test_terms.scene_of(ROUGH), **test_terms.STATE), "rkw3", h=0.1, t1=1.2, width=1)
    end = explicit.advance(STEPPERS["rkw3"], begun(body), body, 0.1, 12)
    assert difference(last(result), ended(end, body)) < 1e-13


# The last stage of rk5_ck is at 7/8 of a step, of the others at its end.
@pytest.mark.slow_but("rk5_ck")
@pytest.mark.parametrize("name", ["rk5", "rk5_ck", "rk8"])
def test_chosen_steps(name, body):
    # Both choose the same steps, so they agree far better than either meets its tolerance; refused steps leave no trace.
    scale = np.concatenate([np.ones(9), np.full(6, body.J.max())])
    states = explicit.adaptive(begun(body), body, (0.5, 1.0), 1e-6, 1e-6 * scale, TABLEAUX[name], h=0.5)
    fleet = one(test_terms.scene_of(CASE), **test_terms.STATE)
    result = lw.solve(fleet, lw.Method(name, rtol=1e-6, atol=1e-6), h=0.5, t1=1.0, width=1)
    assert result.provenance["steps_tried"] > result.provenance["steps_made"] == states[-1].step
    assert difference(last(result), ended(states[-1], body)) < 1e-11


@pytest.mark.slow
def test_a_member_stops_with_what_its_laws_remember_there():
    # The part of a step up to the event is a step of that length.
    scene, body = test_terms.scene_of(ROUGH), test_terms.body_of(ROUGH)
    stopping = lw.Scene(scene.vehicle, scene.environment, terms=scene.terms, events=[lw.events.StopTime(at=0.37)])
    result = lw.solve(one(stopping, **test_terms.STATE), "rk8", h=0.1, t1=1.0, width=1)
    x = explicit.advance(STEPPERS["rk8"], begun(body), body, 0.1, 3)
    x = STEPPERS["rk8"](x, body, 0.07)
    assert difference(last(result), ended(x, body)) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize(("method", "steps"), [("rk4", (0.1, 0.05, 0.025)), ("rk8", (0.5, 0.4, 0.25))])
def test_a_thruster_that_is_switched_on(method, steps):
    # M v' = c n^2 - d v, n = 1 - e^(-t / tau): v and the way are sums of exponentials.
    M, c, d, tau, t1 = 30.0, 20.0, 12.0, 0.4, 2.0
    k, powers = d / M, ((1.0, 0.0), (-2.0, 1.0 / tau), (1.0, 2.0 / tau))
    v = c / M * sum(a * (np.exp(-s * t1) - np.exp(-k * t1)) / (k - s) for a, s in powers)
    ways = [(1.0 - np.exp(-s * t1)) / s if s else t1 for _, s in powers]
    way = c / M * sum(a * (of - (1.0 - np.exp(-k * t1)) / k) / (k - s) for (a, s), of in zip(powers, ways, strict=True))
    thruster = terms.Thrusters(position=[(0.0, 0.0, 0.0)], direction=[(1.0, 0.0, 0.0)], coefficient=[c], time_constant=[tau],
                               times=(0.0, JUMP), command_schedule=((0.0,), (1.0,)))  # fmt: skip
    errors = []
    for h in steps:
        r = run(sphere(), [drag_of(linear=(d, 0.0, 0.0, 0.0, 0.0, 0.0)), thruster], {}, h, t1, method, width=1)
        errors.append(max(abs(r.velocity[-1, 0, 0] - v), abs(r.position[-1, 0, 0] - way)))
    assert slope(steps, errors) == pytest.approx(ORDERS[method], abs=0.1 * ORDERS[method])


def test_what_is_refused_and_what_studies_try():
    fleet = one(test_terms.scene_of(ROUGH), **test_terms.STATE)
    laws = test_terms.body_of(ROUGH)
    with pytest.raises(ValueError, match="not known before a step"):
        munthe_kaas.cg3(begun(laws), laws, 0.1)
    assert Sample(fleet, 1.0, 1).accepted(["rk4", "rk5", "rk8", "rkmk4", "rkw3"])[1] == {}
