# SPDX-License-Identifier: Apache-2.0
"""What actuators compute once for all stages at one time: the twin computes it at each stage."""

from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels.laws import control_fins_with, thrusters_with
from lgvi_kernels.maps.compose import ANEW, plays
from lgvi_warp.physics import terms
from lgvi_warp.reference.terms.control_fins import ControlFins
from tests.laws.case import Case
from tests.laws.cases import together
from tests.laws.cases_lift import DENSITY
from tests.laws.test_device_code import ALONE
from tests.laws.test_parity import STATE, body_of, scene_of
from tests.methods.test_explicit import both
from tests.support.tools import difference, last, one

pytestmark = pytest.mark.kernel

# In one step of 0.02 s the first fin turns by 0.4 rad, the second by less than 1/16 rad, in which a short series is used.
TIMES = (0.0, 0.5, 0.52, 1.0)
FINS = dict(
    position=((-0.6, 0.0, 0.1), (-0.6, 0.1, 0.0)), chord=((1.0, 0.0, 0.0),) * 2, normal=((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    area=(0.02, 0.03), lift_slope=(2.0, 3.0), drag=(0.02, 0.02), drag_normal=(1.0, 1.0), limit=(0.4, 0.4), times=TIMES,
)  # fmt: skip
ANGLES = ((0.0, 0.0), (-0.2, 0.1), (0.2, 0.12), (0.1, -0.3))
FAST = Case(
    (terms.ControlFins(**FINS, command_schedule=ANGLES),),
    (ControlFins(**{key: np.array(value) for key, value in FINS.items()}, command=np.array(ANGLES), density=DENSITY,
                 rate_limit=np.full(2, 1e6)),),
)  # fmt: skip
METHODS = ("rk4", "rk8", "rkmk4", "rkw3")
KINDS = {
    "fast fins": FAST,
    "prompt thrusters": ALONE["prompt thrusters"],
    "both": together("thrusters", "control fins"),
}


@pytest.mark.ci
@pytest.mark.slow_but("rk4-fast fins", "rk4-prompt thrusters")
@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("method", METHODS[:3])
def test_stages_read_what_the_twin_computes(method, name):
    # 50 steps of round-off 1e-15 and little growth; coefficients up to 43 in rk8.
    assert difference(*both(scene_of(KINDS[name]), body_of(KINDS[name]), method, 0.02, 50)) < 2e-12


@pytest.mark.ci
@pytest.mark.slow_but("rk4-fast fins", "rk4-prompt thrusters")
@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("method", METHODS)
def test_no_bit_depends_on_where_launches_end(method, name):
    # Each sample ends a launch of steps, and what was computed at its end is computed anew.
    fleet = one(scene_of(KINDS[name]))
    ends = [last(lw.solve(fleet, method, h=0.02, t1=1.0, save=save)) for save in (None, lw.SaveAt(every=0.02))]
    for a, b in zip(*ends, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.ci
def test_code_without_zeros_is_that_of_members_with_others():
    # Entries of the second member's thruster and fin are zero in the first, which alone has code of its own.
    thrusters, fins = ALONE["prompt thrusters"].terms[0], FAST.terms[0]
    scene = scene_of(Case((thrusters, fins), ()))
    positions = np.array([thrusters.position, np.add(thrusters.position, (0.0, 0.1, 0.2))])
    normals = np.array([fins.normal, np.add(fins.normal, (0.1, 0.3, 0.2))])
    parameters = {f"{thrusters.key}.position": positions, f"{fins.key}.normal": normals}
    states = [np.broadcast_to(value, (2, *np.shape(value))) for value in STATE.values()]
    fleet = lw.Ensemble.from_states(scene, *states, parameters=parameters)
    whole = lw.solve(fleet, "rk4", h=0.02, t1=1.0)
    ends = []
    for i in range(2):
        changed = replace(thrusters, position=positions[i]), replace(fins, normal=normals[i])
        alone = last(lw.solve(one(scene_of(Case(changed, ())), **STATE), "rk4", h=0.02, t1=1.0))
        assert difference(alone, last(whole, i)) < 1e-13
        ends.append(alone)
    assert difference(*ends) > 1e-3


@pytest.mark.parametrize("law_of", [thrusters_with.made, control_fins_with.made], ids=["thrusters", "fins"])
def test_commands_that_nothing_follows_behind_are_settled_once_a_step(law_of):
    within = {features: plays(law_of(features), "settle_later") for features in (("driven",), ("driven", "lag"), ())}
    assert within[("driven",)] is None
    assert None not in (within[("driven", "lag")], within[()])
    assert plays(law_of(("driven",)), ANEW) is not None


@pytest.mark.ci
@pytest.mark.parametrize("delay", [0.0, 0.3])
@pytest.mark.parametrize("method", ["rk4", "rk8"])
def test_commands_of_a_tick_act_as_held_ones_do(method, delay):
    # One tick, at the start; its commands begin at a whole step, and nothing follows behind them. The host sums held ones.
    controller = lw.Controller(
        period=1.0,
        delay=delay,
        guidance=[lw.control.SetPoint(position=(0.0, 0.0, 5.0), heading=0.3)],
        laws=[lw.control.PosePID(kp=(4.0,) * 3, kd=(6.0,) * 3, kr=(1.0,) * 3, kw=(0.4,) * 3)],
    )
    named = lw.Scene.named("bluerov2_heavy")

    def with_thrusters(**fields):
        return [
            term.with_fields({"time_constant": None} | fields) if term.key == "thrusters" else term
            for term in named.terms
        ]

    settings = dict(method=method, h=0.02)
    save = lw.SaveAt(fields=[*lw.SaveAt().fields, "command"])
    loop = lw.solve(replace(named, terms=with_thrusters(), controller=controller), t1=1.0, save=save, **settings)
    command = loop.command[0, 0]
    assert np.abs(command).max() > 0.05
    resting = replace(named, terms=with_thrusters())
    begun = last(lw.solve(resting, t1=delay, **settings)) if delay else ()
    held = replace(named, terms=with_thrusters(command=command))
    assert difference(last(loop), last(lw.solve(one(held, *begun), t1=1.0 - delay, **settings))) < 1e-12
