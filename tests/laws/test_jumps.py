# SPDX-License-Identifier: Apache-2.0
"""Schedules that jump at whole steps: every method sees each value for the steps that it holds, against closed forms."""

import numpy as np
import pytest

import lgvi_warp as lw

TIMES, FORCES = [0.0, 1.0, 2.4, 2.7], [0.0, 2.0, -1.0, 0.5]


def scene():
    """A neutral body of 2 kg that nothing brakes."""
    body = lw.Vehicle(2.0, inertia=[1.0, 1.0, 1.0], buoyancy=2.0 * 9.80665)
    force = [[value, 0.0, 0.0] for value in FORCES]
    return lw.Scene(body, terms=[lw.terms.WrenchSchedule(times=TIMES, force=force, interpolation="steps")])


def exact(t):
    """North at t: each piece by its constant acceleration."""
    x, v, ends = 0.0, 0.0, [*TIMES[1:], np.inf]
    for begin, end, force in zip(TIMES, ends, FORCES, strict=True):
        if (held := min(end, t) - begin) > 0.0:
            x, v = x + v * held + 0.25 * force * held**2, v + 0.5 * force * held
    return x


@pytest.mark.ci
@pytest.mark.parametrize("method", ["rk4", "rk8", "rkw3", "psi_x", "psi_s"])
@pytest.mark.parametrize("h", [0.1, 0.02])
def test_jumps_at_whole_steps_cost_no_order(method, h):
    # Nothing but a constant acts within a step: what is left is round-off, and a billionth of a step of each jump.
    result = lw.solve(scene(), method, h=h, t1=4.0)
    assert abs(result.position[-1, 0, 0] - exact(4.0)) < 1e-9


@pytest.mark.ci
def test_late_in_a_run_too():
    late = lw.Start(velocity=[0.0, 0.0, 0.0])
    shifted = [1000.0 + t for t in TIMES]
    body = scene()
    schedule = lw.terms.WrenchSchedule(times=shifted, force=body.terms[0].force, interpolation="steps")
    result = lw.solve(lw.Scene(body.vehicle, terms=[schedule], start=late), "rk4", h=0.1, t1=1004.0)
    assert abs(result.position[-1, 0, 0] - exact(4.0)) < 1e-8
