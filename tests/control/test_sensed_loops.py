# SPDX-License-Identifier: Apache-2.0
"""Closed loops with sensors: against the twin, against the discrete Lyapunov equation, and with a sensor that dies."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

import lgvi_warp as lw
from lgvi_warp.physics.terms.noisy import channel
from lgvi_warp.reference.control.dead_reckoning import DeadReckoning
from lgvi_warp.reference.control.fault import SensorFault
from lgvi_warp.reference.control.sensor import Sensor
from tests.control.test_loop import GRAVITY, VEHICLE, WANTED
from tests.support.loops import torpedo, twin_loop, twin_run
from tests.support.tools import one

LINEAR, QUADRATIC = np.array((3.0, 4.0, 5.0, 0.3, 0.4, 0.5)), np.array((10.0, 30.0, 40.0, 1.0, 2.0, 3.0))
LIMIT = np.array((1e6, 1e6, 1e6, 1e6, 3.0, 4.0))
HEADING = dict(kp=6.0, ki=0.5, kd=4.0, integral_limit=0.8)
DEPTH = dict(kp=0.3, ki=0.02, pitch_limit=0.3, kp_pitch=12.0, ki_pitch=1.0, kd_pitch=6.0, integral_limit=(2.0, 1.0))
H, EVERY, STEPS, MEMBERS = 0.02, 5, 300, 3
SENSORS = [
    dict(name="cell", of="depth", noise=0.02, bias=0.05, drift=0.03, quantum=0.005, every=2, latency=1, dropout=0.3),
    dict(name="compass", of="heading", noise=0.02, drift=0.02, latency=2),
    dict(name="gyro", of="angular_velocity", noise=0.01, bias=(0.0, 0.01, -0.02), dropout=0.1),
]
FAULT = dict(name="weak_gyro", of="gyro", channel=2, time=3.0, gain=0.5, offset=0.02)
VARIED = {"cell.noise": np.array([0.0, 0.02, 0.1]), "compass.latency": np.array([0.0, 1.0, 3.0])}


def steered(sensors, faults=()):
    """A torpedo-like body, whose kernel's axes are not the user's, with depth and heading loops and an ideal actuator."""
    controller = lw.Controller(
        period=EVERY * H,
        sensors=sensors,
        guidance=[lw.control.SetPoint(**WANTED)],
        laws=[lw.control.DepthPID(**DEPTH), lw.control.HeadingPID(**HEADING)],
        allocation=[lw.control.AllocationMatrix(to="control_wrench", matrix=np.diag((0.0, 0.0, 0.0, 0.0, 1.0, 1.0)))],
        faults=faults,
    )
    terms = [lw.terms.Drag(linear=LINEAR, quadratic=QUADRATIC), lw.terms.ControlWrench(limit=LIMIT)]
    return lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), terms, controller=controller)


def twin(m):
    """Positions of the twin's loop with the sensors of member m."""
    body, loop = twin_loop(steered([]), {}, EVERY, H)
    parts = []
    for numbers in SENSORS:
        varied = {name.split(".")[1]: v[m] for name, v in VARIED.items() if name.startswith(numbers["name"])}
        parts.append(Sensor(**(numbers | varied), channel=channel(numbers["name"])))
        parts[-1].latency = int(parts[-1].latency)
        parts[-1].bias = np.array(parts[-1].bias)
    parts += [SensorFault(**(FAULT | {"of": "angular_velocity"})), DeadReckoning(depth="measured")]
    loop.parts = [*parts, *loop.parts]
    return twin_run(replace(body, member=m), loop, "psi_s", H, STEPS)[0]


@pytest.mark.ci
@pytest.mark.slow_for("float32")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_the_loop_is_the_twins(dtype):
    sensors = [*(lw.control.Sensor(**numbers) for numbers in SENSORS), lw.control.DeadReckoning(depth="measured")]
    members = one(steered(sensors, [lw.control.Fault(**FAULT)]), parameters=VARIED)
    result = lw.solve(members, "psi_s", h=H, t1=STEPS * H, save=lw.SaveAt(every=50 * H), dtype=dtype)
    assert result.status.counts() == {"ok": MEMBERS}
    for m in range(MEMBERS):
        # Round-off of 300 steps, which the stable loop damps; in float32 it turns some rounding to the quantum the other way.
        error = np.abs(result.position[:, m] - twin(m)[::50]).max()
        assert error < (1e-10 if dtype == "float64" else 1e-3), m


@pytest.mark.slow
def test_a_dead_sensor_of_the_depth_makes_the_vehicle_dive():
    dead = [lw.control.Fault(of="cell", time=np.inf)]
    sensors = [lw.control.Sensor(name="cell", of="depth", noise=0.01)]
    still = steered(sensors, dead)
    pushed = lw.terms.Wrench(force=(15.0, 0.0, 0.0))
    scene = lw.Scene(still.vehicle, still.environment, [*still.terms, pushed], controller=still.controller)
    members = one(scene, parameters={"fault.time": np.array([np.inf, 50.0])})
    depth = lw.solve(members, "psi_s", h=H, t1=120.0, save=lw.SaveAt(every=40.0)).position[..., 2]
    assert np.array_equal(depth[:2, 0], depth[:2, 1])
    # One settles; the other takes itself for afloat, and dives for the rest of the time.
    assert abs(depth[-1, 0] - WANTED["depth"]) < 0.3
    assert depth[-1, 1] > WANTED["depth"] + 3.0


# A double integrator: the yaw of a neutral body without drag under kp and kd, whose heading and rate are noisy.
J, KP, KD, PERIOD = 4.5, 2.0, 4.0, 0.2
HEADING_NOISE, RATE_NOISE = 0.01, 0.004


@pytest.mark.slow
def test_the_variance_under_white_noise_is_that_of_the_lyapunov_equation():
    sensors = [lw.control.Sensor(of="heading", name="compass", noise=HEADING_NOISE)]
    sensors += [lw.control.Sensor(of="angular_velocity", name="gyro", noise=RATE_NOISE)]
    controller = lw.Controller(
        period=PERIOD,
        sensors=sensors,
        guidance=[lw.control.SetPoint(heading=0.0)],
        laws=[lw.control.HeadingPID(kp=KP, kd=KD)],
    )
    vehicle = torpedo(20.0 * GRAVITY, (0.0, 0.0, -0.02), (1.5, 4.0, J))
    scene = lw.Scene(vehicle, lw.Environment(GRAVITY), [lw.terms.ControlWrench()], controller=controller)
    members = 4096
    result = lw.solve(lw.Ensemble(scene, members, 3), "psi_s", h=0.05, t1=60.0, save=lw.SaveAt(every=10.0))
    heading = np.arctan2(result.attitude[..., 1, 0], result.attitude[..., 0, 0])
    x = np.stack([heading, result.angular_velocity[..., 2]], axis=-1)[-3:].reshape(-1, 2)
    A = np.array([[1.0, PERIOD], [0.0, 1.0]])
    B = np.array([[PERIOD**2 / 2.0], [PERIOD]]) / J
    K = np.array([[KP, KD]])
    noise = np.diag([HEADING_NOISE**2, RATE_NOISE**2])
    closed = A - B @ K
    # Ten seconds apart, samples are independent: the slowest mode has decayed.
    assert np.abs(np.linalg.eigvals(closed)).max() ** (10.0 / PERIOD) < 0.02
    wanted = solve_discrete_lyapunov(closed, B @ K @ noise @ K.T @ B.T)
    seen, count = np.cov(x.T), len(x)
    for i, j in ((0, 0), (1, 1), (0, 1)):
        deviation = np.sqrt((wanted[i, i] * wanted[j, j] + wanted[i, j] ** 2) / count)
        assert abs(seen[i, j] - wanted[i, j]) < 5.0 * deviation, (i, j)
