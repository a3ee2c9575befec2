# SPDX-License-Identifier: Apache-2.0
"""The closed loop: a tick between steps, commands held until the next, whatever the method; against the twin's loop."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.loops import torpedo, twin_states

GRAVITY = 9.8
VEHICLE = torpedo(20.0 * GRAVITY, (0.01, 0.005, -0.02))
LINEAR, QUADRATIC = (3.0, 4.0, 5.0, 0.3, 0.4, 0.5), (10.0, 30.0, 40.0, 1.0, 2.0, 3.0)
WANTED = dict(depth=6.0, heading=2.5)
HEADING = dict(kp=12.0, ki=0.5, kd=25.0, integral_limit=0.8)
DEPTH = dict(kp=0.3, ki=0.01, pitch_limit=0.3, kp_pitch=20.0, ki_pitch=1.0, kd_pitch=30.0, integral_limit=(2.0, 1.0))
LIMIT = (1e6, 1e6, 1e6, 1e6, 8.0, 6.0)
LAG = (0.0, 0.0, 0.0, 0.0, 0.3, 0.2)
MATRIX = np.diag((0.0, 0.0, 0.0, 0.0, 1.1, 0.9))
STATE = {"position": (0.4, -0.3, 3.0), "velocity": (1.2, 0.3, -0.2), "angular_velocity": (0.3, -0.4, 0.5)}
H, EVERY = 0.02, 5


def controller(allocation, faults, **more):
    """Depth and heading loops."""
    laws, guidance = [lw.control.DepthPID(**DEPTH), lw.control.HeadingPID(**HEADING)], [lw.control.SetPoint(**WANTED)]
    return lw.Controller(period=EVERY * H, guidance=guidance, laws=laws, allocation=allocation, faults=faults, **more)


def scene(lag, delay=0.0, faults=(), **more):
    """A torpedo-like body with these loops and an ideal actuator."""
    loops = controller([lw.control.AllocationMatrix(to="control_wrench", matrix=MATRIX)], faults, delay=delay)
    terms = [lw.terms.Drag(linear=LINEAR, quadratic=QUADRATIC), lw.terms.ControlWrench(limit=LIMIT, time_constant=lag),
             lw.terms.Wrench(force=(15.0, 0.0, 0.0))]  # fmt: skip
    return lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), terms, lw.Start(**STATE), loops, **more)


@pytest.mark.ci
@pytest.mark.slow_but("rk4-0.3-3")
@pytest.mark.parametrize("delay", [0, 3, 7])
@pytest.mark.parametrize("lag", [0.0, 0.3])
@pytest.mark.parametrize("method", ["psi_s", "rk4", "rk8"])
def test_the_loop_is_the_twins(method, lag, delay):
    time_constant = LAG if lag else (0.0,) * 6
    steps = 300
    faults = [
        lw.control.Fault(of="control_wrench", channel=5, time=4.0, gain=0.5, offset=0.2),
        lw.control.Fault(
            name="slow", of="control_wrench", channel=4, kind="slow", time=1.03, until=3.5, time_constant=0.4
        ),
        lw.control.Fault(name="stuck", of="control_wrench", channel=5, kind="stuck", time=2.0, until=2.6),
        lw.control.Fault(
            name="late", of="control_wrench", channel=4, kind="delay", delay=0.3, time=3.0, duty=0.5, period=0.8
        ),
    ]
    looped = scene(time_constant, delay * H, faults)
    result = lw.solve(looped, method, h=H, t1=steps * H, save=lw.SaveAt(every=50 * H))
    start = STATE["position"], np.eye(3), STATE["velocity"], STATE["angular_velocity"]
    b, R = twin_states(looped, {}, start, EVERY, H, steps, method)
    assert result.status.counts() == {"ok": 1}
    # 300 steps of round-off 1e-15, which the stable loop damps.
    assert np.abs(result.position[:, 0] - b[::10]).max() < 1e-10
    assert np.abs(result.attitude[:, 0] - R[::10]).max() < 1e-10


@pytest.mark.slow
def test_the_loop_settles():
    result = lw.solve(scene(LAG), "psi_s", h=H, t1=60.0, save=lw.SaveAt(every=60.0))
    assert abs(result.position[-1, 0, 2] - WANTED["depth"]) < 0.2
    assert abs(np.arctan2(*result.attitude[-1, 0, 1::-1, 0]) - WANTED["heading"]) < 0.05
