# SPDX-License-Identifier: Apache-2.0
"""Refusals of a controller's period, and of a vehicle without actuators; no run begins."""

import re

import pytest

import lgvi_warp as lw
from lgvi_warp.control import HeadingPID, PseudoInverse, SetPoint


def scene(terms=(), **controller):
    """A body that turns its head."""
    vehicle = lw.Vehicle(20.0, inertia=(5.0, 8.0, 11.0))
    loop = lw.Controller(period=0.06, guidance=[SetPoint(heading=0.0)], laws=[HeadingPID(kp=1.0, kd=1.0)], **controller)
    return lw.Scene(vehicle, terms=list(terms), controller=loop)


@pytest.mark.parametrize(("h", "t1", "words"), [
    # The period is two of the steps that were asked for, and the end made other steps of them.
    (0.03, 2.0, "controller.period = 0.06 is not a whole number of steps of 0.0298507463 s, which the end of the run and its "
                "sample times have made of 0.03 s. Give an end and sample times that are whole numbers of 0.03 s, or another"),
    # It is none of either.
    (0.04, 1.99, "steps of 0.0398 s, which the end of the run and its sample times have made of 0.04 s. Give 0.0398 or "
                 "0.0796 s, or another step"),
    (0.04, 2.0, "controller.period = 0.06 is not a whole number of steps of 0.04 s. Give 0.04 or 0.08 s, or another step"),
])  # fmt: skip
def test_a_step_that_was_fitted_to_the_end_is_told(h, t1, words):
    with pytest.raises(lw.SceneError, match=re.escape(words)):
        lw.solve(scene([lw.terms.ControlWrench()]), "psi_s", h=h, t1=t1, threads=1)


def test_a_delay_beside_a_fitted_step():
    loop = scene([lw.terms.ControlWrench()], delay=0.03)
    with pytest.raises(lw.SceneError) as caught:
        lw.solve(loop, "psi_s", h=0.03, t1=2.0, threads=1)
    assert [fault.split(" = ")[0] for fault in caught.value.faults] == ["controller.period", "controller.delay"]
    assert all("have made of 0.03 s. Give an end" in fault for fault in caught.value.faults)


@pytest.mark.parametrize(
    ("allocation", "key"), [((), "controller"), ([PseudoInverse(to="thrusters")], "allocation.to")]
)
def test_a_vehicle_without_actuators_is_told_of_the_term(allocation, key):
    with pytest.raises(lw.SceneError) as caught:
        scene([lw.terms.Drag(linear=[1.0] * 6)], allocation=allocation)
    (fault,) = caught.value.faults
    assert key in fault
    assert '[[terms]] type = "thrusters", "control_fins" or "control_wrench"' in fault
    assert "[[controller.allocation]]" not in fault
