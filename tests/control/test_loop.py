# SPDX-License-Identifier: Apache-2.0
"""The closed loop: a look between steps, commands held until the next, whatever the method; against the twin's loop."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.methods.method import PROGRAMS, Method
from lgvi_warp.reference import advance, explicit
from lgvi_warp.reference.control.depth_pid import DepthPID
from lgvi_warp.reference.control.heading_pid import HeadingPID
from lgvi_warp.reference.control.loop import Fault, Loop, closed_loop
from lgvi_warp.reference.control.matrix import AllocationMatrix
from lgvi_warp.reference.control.set_point import SetPoint
from lgvi_warp.reference.submaps import Body, start
from lgvi_warp.reference.terms.drag import Drag
from lgvi_warp.reference.terms.driven import ControlWrench
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight

GRAVITY, MASS, BUOYANCY, CENTER = 9.8, 20.0, 20.0 * 9.8, (0.01, 0.005, -0.02)
LINEAR, QUADRATIC = (3.0, 4.0, 5.0, 0.3, 0.4, 0.5), (10.0, 30.0, 40.0, 1.0, 2.0, 3.0)
WANTED = dict(depth=6.0, heading=2.5)
HEADING = dict(kp=12.0, ki=0.5, kd=25.0, integral_limit=0.8)
DEPTH = dict(kp=0.3, ki=0.01, pitch_limit=0.3, kp_pitch=20.0, ki_pitch=1.0, kd_pitch=30.0, integral_limit=(2.0, 1.0))
LIMIT = (1e6, 1e6, 1e6, 1e6, 8.0, 6.0)
LAG = (0.0, 0.0, 0.0, 0.0, 0.3, 0.2)
MATRIX = np.diag((0.0, 0.0, 0.0, 0.0, 1.1, 0.9))
STATE = {"position": (0.4, -0.3, 3.0), "velocity": (1.2, 0.3, -0.2), "angular_velocity": (0.3, -0.4, 0.5)}
H, EVERY = 0.02, 5


def scene(lag, delay=0.0, faults=(), **more):
    """A torpedo-like body with depth and heading loops and an ideal actuator."""
    controller = lw.Controller(
        period=EVERY * H,
        delay=delay,
        guidance=[lw.SetPoint(**WANTED)],
        laws=[lw.DepthPID(**DEPTH), lw.HeadingPID(**HEADING)],
        allocation=[lw.AllocationMatrix(to="control_wrench", matrix=MATRIX)],
        faults=faults,
    )
    vehicle = lw.Vehicle(
        MASS, inertia=(1.5, 4.0, 4.5), added_mass=(5.0, 22.0, 25.0), buoyancy=BUOYANCY, center_of_buoyancy=CENTER
    )
    terms = [lw.Drag(linear=LINEAR, quadratic=QUADRATIC), lw.ControlWrench(limit=LIMIT, time_constant=lag),
             lw.Wrench(force=(15.0, 0.0, 0.0))]  # fmt: skip
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), terms, lw.Start(**STATE), controller, **more)


def twin(method, lag, steps, delay=0, faults=()):
    """Positions (steps + 1, 3) and attitudes of the twin's loop."""
    from lgvi_warp.reference.terms.wrench import Wrench

    vehicle = lw.Vehicle(
        MASS, inertia=(1.5, 4.0, 4.5), added_mass=(5.0, 22.0, 25.0), buoyancy=BUOYANCY, center_of_buoyancy=CENTER
    )
    actuator = ControlWrench(limit=np.array(LIMIT), time_constant=np.array(lag))
    laws = (
        Weight(net=MASS * GRAVITY - BUOYANCY),
        Restoring(moment=BUOYANCY * np.array(CENTER)),
        Drag(linear=np.array(LINEAR), quadratic=np.array(QUADRATIC)),
        actuator,
        Wrench(force=np.array((15.0, 0.0, 0.0)), torque=np.zeros(3)),
    )
    body = Body(vehicle.mass_matrix, vehicle.inertia, laws)
    parts = [
        SetPoint(**WANTED),
        DepthPID(**DEPTH),
        HeadingPID(**HEADING),
        AllocationMatrix(to="control_wrench", matrix=MATRIX),
    ]
    loop = Loop(parts, {"control_wrench": actuator}, EVERY, delay, faults)
    b, nu, Om = (np.array(STATE[key]) for key in ("position", "velocity", "angular_velocity"))
    loop.begin()
    x = start(body, b, np.eye(3), body.M @ nu, body.J @ Om)
    if method in PROGRAMS:
        step = lambda x, body, h: advance.step(x, body, PROGRAMS[method], h)  # noqa: E731
    else:
        step = explicit.stepper(Method(method).tableau)
    states = closed_loop(x, body, loop, step, H, steps)
    return np.array([s.b for s in states]), np.array([s.R for s in states])


@pytest.mark.slow_but("rk4-0.3-3")
@pytest.mark.parametrize("delay", [0, 3, 7])
@pytest.mark.parametrize("lag", [0.0, 0.3])
@pytest.mark.parametrize("method", ["psi_s", "rk4", "rk8"])
def test_the_loop_is_the_twins(method, lag, delay):
    time_constant = LAG if lag else (0.0,) * 6
    steps = 300
    fault = dict(channel=5, time=4.0, gain=0.5, offset=0.2)
    faults = [lw.Fault(of="control_wrench", **fault)]
    result = lw.solve(scene(time_constant, delay * H, faults), method, h=H, t1=steps * H, save=lw.SaveAt(every=50 * H))
    b, R = twin(method, time_constant, steps, delay, [Fault("control_wrench", **fault)])
    assert result.status.counts() == {"ok": 1}
    # 300 steps of round-off 1e-15, which the stable loop damps.
    assert np.abs(result.position[:, 0] - b[::50]).max() < 1e-10
    assert np.abs(result.attitude[:, 0] - R[::50]).max() < 1e-10


@pytest.mark.slow
def test_the_loop_settles():
    result = lw.solve(scene(LAG), "psi_s", h=H, t1=60.0, save=lw.SaveAt(every=60.0))
    assert abs(result.position[-1, 0, 2] - WANTED["depth"]) < 0.2
    assert abs(np.arctan2(*result.attitude[-1, 0, 1::-1, 0]) - WANTED["heading"]) < 0.05
