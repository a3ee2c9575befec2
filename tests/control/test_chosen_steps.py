# SPDX-License-Identifier: Apache-2.0
"""Steps that a method chooses within those of the run, under commands that are held over a period."""

import re

import numpy as np
import pytest

import lgvi_warp as lw
from tests.control.test_hold import ends
from tests.control.test_loop import EVERY, LAG, H, scene

NONE, TIME = (0.0,) * 6, 10.0
PERIOD = EVERY * H
SAVE = lw.SaveAt(every=PERIOD, fields=("position", "attitude", "velocity", "angular_velocity", "command"))


def run(method, h, lag=NONE, delay=0.0):
    return lw.solve(scene(lag, delay), method, h=h, t1=TIME, save=SAVE)


def chosen(tolerance):
    return lw.Method("rk8", rtol=tolerance, atol=tolerance)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("h", "lag", "delay"), [(PERIOD, NONE, 0.0), (PERIOD / 2, NONE, PERIOD / 2), (PERIOD, LAG, 0.0)],
    ids=["held", "delayed", "lagged"],
)  # fmt: skip
def test_the_loop_is_that_of_fixed_steps(h, lag, delay):
    exact, tolerances, errors = run("rk8", H / 4, lag, delay), (1e-6, 1e-8, 1e-10), []
    for tolerance in tolerances:
        result = run(chosen(tolerance), h, lag, delay)
        # Of 100 periods each has its own commands: they are held in all steps between two ticks, and only there.
        commands = np.abs(result.command - exact.command).max()
        errors.append(max(np.abs(ends(result) - ends(exact)).max(), commands))
    # A step errs by less than atol + rtol |y|, with |y| of some tens; the loop forgets in some seconds, some tens of steps.
    assert np.all(np.array(errors) < 1e3 * np.array(tolerances))
    # The longest step is the run's, which bounds the first error.
    assert errors[0] > 10.0 * errors[2], errors


def test_what_is_refused():
    # Ticks are at whole steps of the run, whatever steps are chosen within.
    sentence = "controller.period = 0.1 is not a whole number of steps of 0.04 s. Give 0.08 or 0.12 s, or another step"
    with pytest.raises(lw.SceneError, match=re.escape(sentence)):
        lw.solve(scene(NONE), chosen(1e-6), h=0.04, t1=1.0)
