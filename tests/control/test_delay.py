# SPDX-License-Identifier: Apache-2.0
"""Delays of commands, by member: q periods and s steps, exactly; and faults of actuators at their ticks."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.loops import torpedo
from tests.support.tools import one

# A yaw without drag: a double integrator under the moment that the loop commands.
J, KP, KD, H, EVERY, STEPS = 4.5, 2.0, 3.0, 0.02, 5, 120
DELAYS = np.array([0, 1, 4, 5, 7, 10, 22, 48])


def members(delays, times=np.inf):
    """Members with these delays in steps, and with a fault from these times on: one kernel for all."""
    vehicle = torpedo(196.0, (0.0, 0.0, -0.02), (1.5, 4.0, J))
    guidance = [lw.control.SetPoint(heading=0.3)]
    faults = [lw.control.Fault(of="control_wrench", channel=5, gain=0.5, offset=0.05)]
    controller = lw.Controller(
        period=EVERY * H, guidance=guidance, laws=[lw.control.HeadingPID(kp=KP, kd=KD)], faults=faults
    )
    scene = lw.Scene(vehicle, lw.Environment(9.8), [lw.terms.ControlWrench()], controller=controller)
    times = np.broadcast_to(times, len(delays))
    return one(scene, parameters={"controller.delay": np.asarray(delays) * H, "fault.time": times})


def wanted(delay, fault=(np.inf, 1.0, 0.0)):
    """Headings of the exact recursion: between steps a held moment, and the command of a tick acts `delay` steps later."""
    heading, rate, moments, headings = 0.0, 0.0, [], [0.0]
    for k in range(STEPS):
        if k % EVERY == 0:
            moments.append(KP * (0.3 - heading) - KD * rate)
        last = (k - delay) // EVERY
        moment = moments[last] if last >= 0 else 0.0
        begin, gain, offset = fault
        if k // EVERY * EVERY * H >= begin - 1e-9:
            moment = gain * moment + offset
        heading += H * rate + 0.5 * H * H * moment / J
        rate += H * moment / J
        headings.append(heading)
    return np.array(headings)


@pytest.mark.ci
@pytest.mark.slow_for("rk4")
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_delay_is_whole_periods_and_steps(method):
    # Samples at each step end launches of one step; those of whole runs are compared with them.
    fleet = members(DELAYS)
    result = lw.solve(fleet, method, h=H, t1=STEPS * H, save=lw.SaveAt(every=H))
    heading = np.arctan2(result.attitude[..., 1, 0], result.attitude[..., 0, 0])
    for i, delay in enumerate(DELAYS):
        # A held moment about a principal axis is exact for rk4; the turn of psi_s follows equation (24), with an error of
        # (rate h)^2 / 24 of the angle of a step at most: here the rate stays below 0.2 rad/s.
        allowed = 1e-11 if method == "rk4" else 0.3 * (0.2 * H) ** 2
        assert np.abs(heading[:, i] - wanted(delay)).max() < allowed, delay
        assert np.all(heading[: delay + 1, i] == 0.0)
        assert heading[delay + 1, i] > 0.0
    ends = lw.solve(fleet, method, h=H, t1=STEPS * H, save=lw.SaveAt(every=STEPS * H))
    assert np.array_equal(ends.attitude[-1], result.attitude[-1])


@pytest.mark.ci
def test_a_delay_that_varies_is_that_of_the_nearest_step():
    nearest = lw.solve(members([2.25, 2.75, 6.9, 0.2]), "psi_s", h=H, t1=1.0)
    whole = lw.solve(members([2, 3, 7, 0]), "psi_s", h=H, t1=1.0)
    assert np.array_equal(nearest.attitude, whole.attitude)


@pytest.mark.ci
def test_a_fault_begins_at_the_first_tick_at_or_after_its_time():
    # Ticks at 0.5 and 0.6 s; a time on a tick, one after it, never.
    times = np.array([0.5, 0.51, 0.6, np.inf, 0.0])
    delays = np.repeat((0, 7), len(times))
    result = lw.solve(members(delays, np.tile(times, 2)), "psi_s", h=H, t1=STEPS * H,
                      save=lw.SaveAt(every=H))  # fmt: skip
    heading = np.arctan2(result.attitude[..., 1, 0], result.attitude[..., 0, 0])
    for i, (delay, time) in enumerate(zip(delays, np.tile(times, 2), strict=True)):
        assert np.abs(heading[:, i] - wanted(delay, (time, 0.5, 0.05))).max() < 0.3 * (0.2 * H) ** 2, (delay, time)
