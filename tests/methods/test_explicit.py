# SPDX-License-Identifier: Apache-2.0
"""The explicit methods, alone and with every law: the kernel against the twin."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.engine.survey import frame_of
from lgvi_warp.methods.tableaux import CASH_KARP, DOP853, DOPRI5, RK4
from lgvi_warp.reference import explicit, munthe_kaas
from lgvi_warp.reference.submaps import look, start, water
from lgvi_warp.runs.settle import make_plan
from tests.laws import test_parity as test_terms
from tests.laws.cases import CASES, Case, together
from tests.laws.test_parity import STATE
from tests.methods import test_coupled
from tests.support.tools import difference, last, one

TABLEAUX = {"rk4": RK4, "rk5": DOPRI5, "rk5_ck": CASH_KARP, "rk8": DOP853}
METHODS = (*TABLEAUX, "cg3", "rkmk4")
# Laws without memory, which an explicit method cannot advance. Noise is held over the step.
HAVE_MEMORY = ("Gauss", "thrusters", "rates", "pumps", "engine", "all together")
WITHOUT_MEMORY = [name for name in CASES if not any(word in name for word in HAVE_MEMORY)]


def advanced(scene, body, method, h, steps, at):
    """The twin's state after so many steps, with b, p and pi where the kernel has them."""
    fleet = lw.Ensemble.from_scene(scene)
    plan = make_plan(fleet, method, h=h, t1=steps * h)
    origin = frame_of(plan.method, fleet.parameters(0, 1), plan.kernel_choice.user_axes)[0].origin[0]
    if plan.spec.inertial:
        return explicit.advance_steady(TABLEAUX[method], begun(body, at), body, h, steps, origin)
    if method in TABLEAUX:
        step = explicit.stepper(TABLEAUX[method], origin)
    else:
        step = functools.partial({"cg3": munthe_kaas.cg3, "rkmk4": munthe_kaas.rkmk4}[method], origin=origin)
    return explicit.advance(step, begun(body, at), body, h, steps)


def begun(body, at=STATE):
    """The twin's state at the start, relative to the water."""
    b, R, nu, Om = (np.array(value) for value in at.values())
    x = start(body, b, R, np.zeros(3), np.zeros(3))
    twist = np.concatenate([nu - R.T @ water(look(x, body, 0.0), body).velocity, Om])
    return replace(x, p=(body.I6 @ twist)[:3], pi=(body.I6 @ twist)[3:])


def ended(x, body):
    """b, R, nu, Om of the twin."""
    nu, Om = np.split(np.linalg.solve(body.I6, np.concatenate([x.p, x.pi])), 2)
    return x.b, x.R, nu + x.R.T @ water(look(x, body, 0.0), body).velocity, Om


def both(scene, body, method, h, steps, at=STATE, **named):
    """The state after so many steps by the kernel and by the twin."""
    result = lw.solve(one(scene, **at), method, h=h, t1=steps * h, **named)
    assert result.status.counts() == {"ok": 1}
    return last(result), ended(advanced(scene, body, method, h, steps, at), body)


# Weight and restoring alone: the kernels of tests/methods/test_explicit_orders.py.
ALONE, PLAIN = Case((), ()), CASES["wrench"]


@pytest.mark.ci
@pytest.mark.slow_but("rk4-alone", "rkmk4-alone")
@pytest.mark.parametrize("case", [ALONE, PLAIN], ids=["alone", "wrench"])
@pytest.mark.parametrize("method", METHODS)
def test_one_step_and_half_a_second(method, case):
    scene, body = test_terms.scene_of(case), test_terms.body_of(case)
    assert difference(*both(scene, body, method, 0.02, 1)) < 1e-13
    # 25 steps of round-off 1e-15 and little growth; coefficients up to 43 in rk8.
    assert difference(*both(scene, body, method, 0.02, 25)) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_float32(method):
    scene, body = test_terms.scene_of(PLAIN), test_terms.body_of(PLAIN)
    # Round-off 6e-8 in each of 25 steps.
    assert difference(*both(scene, body, method, 0.02, 25, dtype="float32")) < 1e-5


# What depends on velocity, place and time, at once.
SEVERAL = together("drag", "current profile", "waves", "tether", "wrench schedule")


def groups(names):
    """The names in as few groups as hold each type of term once."""
    found = []
    for name in names:
        kinds = {term.key for term in CASES[name].terms}
        free = next((group for group in found if not kinds & group.keys()), None)
        if free is None:
            free = {}
            found.append(free)
        free |= dict.fromkeys(kinds, name)
    return [tuple(dict.fromkeys(group.values())) for group in found]


@pytest.mark.slow
@pytest.mark.parametrize("names", groups(WITHOUT_MEMORY), ids=", ".join)
def test_one_step_with_all_laws(names):
    case = together(*names)
    assert difference(*both(test_terms.scene_of(case), test_terms.body_of(case), "rk4", 0.02, 1)) < 1e-13


@pytest.mark.ci
@pytest.mark.slow_but("cg3")
@pytest.mark.parametrize("method", ["rk5", "rk5_ck", "rk8", "cg3", "rkmk4"])
def test_one_step_with_several_laws(method):
    scene, body = test_terms.scene_of(SEVERAL), test_terms.body_of(SEVERAL)
    assert difference(*both(scene, body, method, 0.02, 1, width=1)) < 1e-13


@pytest.mark.slow
# rk5_ck is rk5 with other numbers.
@pytest.mark.parametrize("method", [method for method in METHODS if method != "rk5_ck"])
@pytest.mark.parametrize("name", WITHOUT_MEMORY)
def test_one_step_with_each_law(method, name):
    scene, body = test_terms.scene_of(CASES[name]), test_terms.body_of(CASES[name])
    if method == "cg3" and any(term.memory and not term.accounts for term in scene.terms):
        # Its first stage lies before the start of the step.
        with pytest.raises(lw.SceneError, match="not known what control_fins remembers"):
            lw.solve(scene, method, h=0.02, t1=0.02)
        return
    assert difference(*both(scene, body, method, 0.02, 1)) < 1e-13


@pytest.mark.ci
@pytest.mark.slow_for("cg3-None*", "rk8*", "rkmk4-drag matrix*")
@pytest.mark.parametrize(
    ("method", "name"),
    [("rk4", None), ("rk4", "drag matrix"), ("rk8", "current profile"), ("cg3", None), ("rkmk4", "drag matrix")],
)
def test_coupled_inertia(method, name):
    terms, laws = (CASES[name].terms, CASES[name].laws) if name else ((), ())
    scene, body = test_coupled.scene_of(terms), test_coupled.body_of(laws)
    # One lane where there are laws: more take long to compile.
    width = {"width": 1} if name else {}
    assert difference(*both(scene, body, method, 0.02, 5, test_coupled.STATE, **width)) < 5e-13


@pytest.mark.ci
@pytest.mark.slow_for("rk4-current*", "rk5*", "rk8*")
@pytest.mark.parametrize(
    "current", [(), ({"type": "current", "velocity": (0.3, -0.2, 0.1)},)], ids=["still", "current"]
)
@pytest.mark.parametrize("method", TABLEAUX)
def test_forces_that_never_change(method, current):
    # R p is known for all times; with coupled inertia too. 5 and 50 steps, round-off of 1e-15 each.
    laws = CASES["current"].laws if current else ()
    for scene, body, at in (
        (test_terms.scene_of(Case(current, laws)), test_terms.body_of(Case(current, laws)), STATE),
        (test_coupled.scene_of(current), test_coupled.body_of(laws), test_coupled.STATE),
    ):
        for steps, bound in ((5, 2e-13), (50, 2e-12)):
            assert difference(*both(scene, body, method, 0.05, steps, at)) < bound


@pytest.mark.ci
@pytest.mark.slow_for("rk5_ck", "rk8")
@pytest.mark.parametrize("method", ["rk5", "rk5_ck", "rk8"])
def test_chosen_steps(method):
    # Both choose the same steps, so they agree far better than either meets its tolerance.
    body = test_terms.body_of(PLAIN)
    scale = np.concatenate([np.ones(9), np.full(6, body.J.max())])
    times = (0.5, 1.0, 1.5)
    states = explicit.adaptive(begun(body), body, times, 1e-7, 1e-7 * scale, TABLEAUX[method], h=0.5)
    chosen = lw.Method(method, rtol=1e-7, atol=1e-7)
    result = lw.solve(
        one(test_terms.scene_of(PLAIN), **STATE), chosen, h=0.5, t1=1.5, save=lw.SaveAt(every=0.5), width=1
    )
    assert difference(last(result), ended(states[-1], body)) < 1e-11
