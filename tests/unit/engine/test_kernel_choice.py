# SPDX-License-Identifier: Apache-2.0
"""Choice of a kernel, made before it is compiled."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.runs.settle import make_plan
from tests.laws.cases import CASES
from tests.support.tools import one, vehicle


def choice_of(scene, method="psi_s"):
    return make_plan(one(scene), method, h=0.01, t1=0.1).kernel_choice


@pytest.mark.parametrize("name", ["current harmonics", "Gauss-Markov current", "current profile"])
@pytest.mark.parametrize("gravity", [0.0, 9.8])
@pytest.mark.parametrize("buoyancy", [0.0, 10.0])
def test_water_that_accelerates_pushes_by_the_displaced_mass(name, gravity, buoyancy):
    """Buoyancy over gravity is the displaced mass: without gravity nobody knows it, unless nothing is displaced."""
    body = lw.Vehicle(2.0, inertia=(1.0, 2.0, 2.5), added_mass=np.zeros((3, 3)), buoyancy=buoyancy)
    scene = lw.Scene(body, lw.Environment(gravity=gravity), terms=list(CASES[name].terms))
    if gravity == 0.0 and buoyancy > 0.0:
        with pytest.raises(lw.SceneError, match=r"environment\.gravity = 0.*displaced mass unknown.*Give gravity"):
            choice_of(scene)
    else:
        assert choice_of(scene).flow in ("uniform", "varying")


def test_steady_water_needs_no_gravity():
    scene = lw.Scene(vehicle(net=0.0), lw.Environment(gravity=0.0), terms=list(CASES["current"].terms))
    assert choice_of(scene).flow == "steady"


@pytest.mark.parametrize(("names", "timed", "memory", "flow"), [
    ((), False, False, "none"), (("drag",), False, False, "none"), (("tether",), False, False, "none"),
    (("drag", "current"), False, False, "steady"), (("tether", "wrench schedule"), True, False, "none"),
    (("current harmonics", "drag"), True, False, "uniform"), (("drag", "waves"), True, False, "varying"),
    (("tether", "thrusters"), True, True, "none"), (("Gauss-Markov current", "tether"), True, True, "uniform"),
])  # fmt: skip
def test_a_kernel_has_what_any_of_its_terms_needs(names, timed, memory, flow):
    acting = sum((CASES[name].terms for name in names), ())
    for terms in (acting, acting[::-1]):
        choice = choice_of(lw.Scene(vehicle(), terms=list(terms)))
        assert (choice.timed, choice.memory, choice.flow) == (timed, memory, flow)


@pytest.mark.parametrize("at", [0, 1])
def test_an_event_of_the_time_wants_the_time(at):
    events = [lw.events.Floor(depth=10.0)]
    events.insert(at, lw.events.StopTime(at=1.0))
    assert choice_of(lw.Scene(vehicle(), events=events)).timed
    assert not choice_of(lw.Scene(vehicle(), events=[lw.events.Floor(depth=10.0)])).timed


@pytest.mark.parametrize("method", ["psi_s", "psi", "psi_1", "kl6(psi_s)", "psi_x", "psi_w"])
def test_without_forces_nothing_is_kicked(method):
    letters = {}
    for net in (0.0, 2.0):
        choice = choice_of(lw.Scene(vehicle(net=net), lw.Environment(gravity=9.8)), method)
        letters[net] = {letter for letter, _ in (*choice.program, *([choice.lead] if choice.lead else []))}
    assert "K" in letters[2.0]
    assert letters[0.0] == letters[2.0] - {"K"}


class Mooring(lw.terms.Tether):
    """A tether by another name, whose device code is that of one."""

    type = "mooring"
    device = "tether"


@pytest.mark.parametrize("kind", [lw.terms.Tether, Mooring])
@pytest.mark.parametrize("velocity", [(0.1, 0.0, 0.0), None])
def test_a_current_works_against_what_says_that_it_is_anchored(kind, velocity):
    terms = [kind(anchor=(0.0, 0.0, 0.0), stiffness=1.0)]
    terms += [] if velocity is None else [lw.terms.Current(velocity=velocity)]
    assert choice_of(lw.Scene(vehicle(), terms=terms)).conservative is (velocity is None)
