# SPDX-License-Identifier: Apache-2.0
"""Actuators whose commands are held from the start: nothing is remembered, and what they push is what a schedule would."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import terms
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.sampling.distributions.basic import Normal, Uniform
from tests.laws.cases import PROPELLERS, TABLE_OF_THRUST, THRUSTERS
from tests.laws.cases_lift import FINS
from tests.laws.test_parity import GRAVITY, STATE, VEHICLE
from tests.support.tools import difference, last, one

# One beyond its limit, one astern, one within the dead band.
COMMAND = (1.5, -0.6, 0.04)
SQUARE = dict(coefficient=(20.0, 20.0, 10.0), coefficient_astern=(15.0, 15.0, 8.0))
CURVES = {
    "square": SQUARE,
    "polynomial": dict(polynomial=(3.0, 0.5, 8.0, -2.0, 1.0), polynomial_astern=(2.0, 7.0, -1.5)),
    "table": dict(table_commands=TABLE_OF_THRUST[0], table_thrusts=TABLE_OF_THRUST[1], rate_limit=(0.8, 2.0, 1.5)),
    "torque": SQUARE | dict(torque_coefficient=(0.5, -0.4, 0.2)),
}
# The wrench of three thrusters is some twenty products, each rounded once; a hundred steps add as many such errors.
ROUND_OFF = {"float64": 1e-13, "float32": 3e-5, "float32_compensated": 3e-5}


def scene_of(*laws):
    return lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), terms=list(laws))


def plan_of(*laws, method="psi_s"):
    return make_plan(one(scene_of(*laws), **STATE), method, h=0.02, t1=0.4)


def held(**more):
    return terms.Thrusters(**THRUSTERS | {"command": COMMAND} | more)


def looked_up(**more):
    return terms.Thrusters(**THRUSTERS | {"times": (0.0, 10.0), "command_schedule": (COMMAND, COMMAND)} | more)


@pytest.mark.parametrize("curve", CURVES)
def test_held_commands_leave_no_memory_and_no_time(curve):
    choice = plan_of(held(**CURVES[curve])).kernel_choice
    assert (choice.memory, choice.timed) == (False, False)
    choice = plan_of(looked_up(**CURVES[curve])).kernel_choice
    assert (choice.memory, choice.timed) == (True, True)


def test_one_kernel_serves_all_curves():
    kernels = {id(plan_of(held(**numbers)).kernel.advance) for numbers in CURVES.values()}
    assert len(kernels) == 1


@pytest.mark.parametrize("more", [{}, {"time_constant": 0.2}], ids=["rate", "lag"])
def test_fins_that_are_held_remember_nothing(more):
    slow = dict(FINS, rate_limit=0.5, **more)
    choice = plan_of(terms.ControlFins(**slow, command=(0.1, -0.2, 0.3))).kernel_choice
    assert (choice.memory, choice.timed) == (False, False)


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.slow_but("rk4-float64-square")
@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize(
    ("method", "dtype"),
    [(method, "float64") for method in ("rk4", "psi_x", "psi", "rkw3")]
    + [("rk8", "float32"), ("psi_x", "float32"), ("psi_x", "float32_compensated")],
)
def test_held_commands_push_as_a_schedule_does_that_never_changes(method, dtype, curve):
    ends = []
    for law in (held(**CURVES[curve]), looked_up(**CURVES[curve])):
        ends.append(last(lw.solve(one(scene_of(law), **STATE), method, h=0.02, t1=2.0, dtype=dtype)))
    assert difference(*ends) < ROUND_OFF[dtype]


@pytest.mark.ci
@pytest.mark.kernel
def test_members_may_hold_other_commands():
    # Among others and alone: to the last bit.
    law = held(**CURVES["polynomial"])
    fleet = lw.Ensemble(scene_of(law), 20, 3, {"thrusters.command": Normal(std=0.3), "thrusters.limit": Uniform(relative=0.2),
                                               "thrusters.time_constant": Uniform(relative=0.5)})  # fmt: skip
    result = lw.solve(fleet, "rk4", h=0.02, t1=0.4)
    assert len(np.unique(result.position[-1, :, 0])) == 20
    for i in (0, 7, 19):
        alone = lw.solve(fleet.subset([i]), "rk4", h=0.02, t1=0.4)
        assert all(np.array_equal(a, b) for a, b in zip(last(result, i), last(alone), strict=True))


def test_thrust_that_falls_with_the_speed_stays_a_law_of_the_velocities():
    lossy = held(**SQUARE, **PROPELLERS)
    choice = plan_of(lossy, method="rkw3").kernel_choice
    assert [hasattr(module, "damping") for term, module in choice.laws if term.key == "thrusters"] == [True]
    assert not choice.memory


def test_lags_that_the_scene_has_not_are_still_refused():
    with pytest.raises(lw.SceneError, match=r"time_constant of member \d+ = .* does not act: the scene has none"):
        lw.Ensemble(
            scene_of(held(**SQUARE, time_constant=0.0)), 4, 1, {"thrusters.time_constant": Uniform(low=0.1, high=0.2)}
        )
