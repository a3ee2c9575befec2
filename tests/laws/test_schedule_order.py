# SPDX-License-Identifier: Apache-2.0
"""Lags and rate limits along a schedule cost no order: every actuator, every kind of following, splittings and rk4."""

import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from tests.support.tools import slope

MASS, SPEED, T = 30.0, 1.2, 8.0
BODY = lw.Vehicle(MASS, inertia=(1.5, 4.0, 4.5), buoyancy=MASS * 9.8)
SEA = lw.Environment(9.8, 1000.0)
# Turns at whole seconds; at a rate of 0.175 1/s a channel meets its command at 4 s and at 6 s.
TIMES, COMMANDS = (0.0, 2.0, 4.0, 5.0, 6.0, 8.0), np.array((0.1, 0.8, 0.8, 0.45, 0.45, 0.65))
FAST = 40.0
# Time constants [s] and rate limits [1/s] of channels whose commands are of size 1. With a lag the times at which the limit
# is reached are anywhere in a step: the worst of several channels counts.
FOLLOWED = {
    "no lag, limit not reached": [(0.0, FAST)],
    "long lag": [(2.0, FAST)],
    "short lag": [(0.004, FAST)],
    "limit reached": [(0.0, 0.175)],
    "lag and limit reached": [(tau, rate) for tau in (0.21, 0.33, 0.5) for rate in (0.15, 0.19)],
}
CHANNELS = [channel for channels in FOLLOWED.values() for channel in channels]
# Size of the commands, axis of the motion, and the acceleration by a command n of size 1.
ACTUATORS = {
    "ballast": (1e-3, 2, lambda n: -9.8 * n / MASS),
    "thrusters": (1.0, 0, lambda n: 20.0 * n * abs(n) / MASS),
    "control_fins": (0.3, 2, lambda n: 0.5 * 1000.0 * 0.02 * 2.0 * SPEED**2 * 0.3 * n / MASS),
}


def actuator(name, **following):
    """An actuator at the body's origin, so that nothing turns: ballast lifts, a thruster and a fin push along one axis."""
    size = ACTUATORS[name][0]
    row = {"position": [[0.0, 0.0, 0.0]], "times": TIMES, "command_schedule": size * COMMANDS[:, None]}
    if name == "ballast":
        return lw.terms.Ballast(**row | following)
    if name == "thrusters":
        return lw.terms.Thrusters(direction=[[1.0, 0.0, 0.0]], coefficient=[20.0], **row | following)
    row |= {"chord": [[1.0, 0.0, 0.0]], "normal": [[0.0, 0.0, 1.0]], "area": 0.02, "lift_slope": 2.0, "drag": 0.0}
    return lw.terms.ControlFins(**row | {"limit": 1.0, "flow_angle": False} | following)


def scene(*terms, body=BODY, turning=(0.0, 0.0, 0.0)):
    start = lw.Start(position=[0.0, 0.0, 50.0], velocity=[SPEED, 0.0, 0.0], angular_velocity=turning)
    return lw.Scene(body, SEA, terms=list(terms), start=start)


def fleet(name):
    """A member for each channel."""
    size, (taus, rates) = ACTUATORS[name][0], np.transpose(CHANNELS)
    whole = scene(actuator(name, time_constant=[0.1], rate_limit=[size]))
    numbers = {f"{name}.time_constant": taus[:, None], f"{name}.rate_limit": size * rates[:, None]}
    states = [np.tile(x, (len(taus), *[1] * np.ndim(x)))
              for x in ([0.0, 0.0, 50.0], np.eye(3), [SPEED, 0.0, 0.0], np.zeros(3))]  # fmt: skip
    return lw.Ensemble.from_states(whole, *states, parameters=numbers)


@functools.cache
def moved(name):
    """Displacement of each member of a fleet along its axis [m], by LSODA from kink to kink."""
    acceleration, found = ACTUATORS[name][2], []
    for tau, rate in CHANNELS:

        def motion(t, y, tau=tau, rate=rate):
            u = np.interp(t, TIMES, COMMANDS)
            if tau == 0.0 and rate == FAST:
                return [0.0, acceleration(u), y[1]]
            return [np.clip((u - y[0]) / max(tau, 1e-5), -rate, rate), acceleration(y[0]), y[1]]

        y = np.array([COMMANDS[0], 0.0, 0.0])
        for part in zip(TIMES, TIMES[1:], strict=False):
            y = solve_ivp(motion, part, y, "LSODA", rtol=1e-10, atol=1e-13, max_step=0.05).y[:, -1]
        found.append(y[2])
    return np.array(found)


def errors(name, method, h):
    axis = ACTUATORS[name][1]
    start = np.array([SPEED * T, 0.0, 50.0])[axis]
    return np.abs(lw.solve(fleet(name), method, h=h, t1=T).position[-1, :, axis] - start - moved(name))


METHODS = ("psi_s", "psi_x", "psi_1", "psi", "psi_x8", "psi_w", "rk4")


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.slow_but("psi_s-ballast", "psi_x-thrusters")
@pytest.mark.parametrize("name", ACTUATORS)
@pytest.mark.parametrize("method", METHODS)
def test_a_schedule_that_is_followed_late_keeps_the_order(method, name):
    steps = (0.2, 0.1, 0.05)
    found = np.array([errors(name, method, h) for h in steps])
    # A channel that is late by a quarter of the step moves the vehicle by 1e-2 m and more.
    assert np.all(found[-1] < 3e-4), found
    kinds = iter(found.T)
    orders = {
        kind: slope(steps, np.max([next(kinds) for _ in channels], axis=0)) for kind, channels in FOLLOWED.items()
    }
    assert method == "rk4" or min(orders.values()) > 1.8, orders


# One that is never reached, for each way of writing none: the device code has a lag, a limit, both, or none of them.
UNREACHED = {
    "rate": {"rate_limit": 5.0},
    "both": {"time_constant": 0.0, "rate_limit": 5.0},
    "lag": {"time_constant": 0.4},
}


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.slow_but("psi_s-ballast-*", "psi_x-flow_angle-rate")
@pytest.mark.parametrize("way", UNREACHED)
@pytest.mark.parametrize("name", [*ACTUATORS, "flow_angle"])
@pytest.mark.parametrize("method", ["psi_s", "psi_x", "rk4"])
def test_a_limit_that_is_not_reached_changes_nothing(method, name, way):
    fins = name == "flow_angle"
    made = functools.partial(actuator, "control_fins", flow_angle=True) if fins else functools.partial(actuator, name)
    size = ACTUATORS["control_fins" if fins else name][0]
    following = {key: [value * size if key == "rate_limit" else value] for key, value in UNREACHED[way].items()}
    # Of a lag the limit of the rate is the one that is not reached.
    plain, limited = (
        ({"time_constant": [0.4]}, following | {"rate_limit": [5.0 * size]}) if way == "lag" else ({}, following)
    )
    a, b = (lw.solve(scene(made(**more)), method, h=0.1, t1=T) for more in (plain, limited))
    np.testing.assert_allclose(a.position[-1], b.position[-1], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(a.velocity[-1], b.velocity[-1], rtol=0.0, atol=1e-12)


TURNING = {
    "flow_angle": lambda: actuator(
        "control_fins", flow_angle=True, position=[[-0.2, 0.0, 0.0]], rate_limit=[0.3 * 0.175]
    ),
    "moving_mass": lambda: lw.terms.MovingMass(
        mass=2.0, times=TIMES, places=np.array((0.02, 0.0, 0.05)) * COMMANDS[:, None], inertia=False
    ),
}


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.slow_but("psi_x-flow_angle")
@pytest.mark.parametrize("name", TURNING)
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_what_turns_the_vehicle_keeps_the_order(method, name):
    whole, steps = scene(TURNING[name](), turning=(0.1, 0.05, -0.1)), (0.1, 0.05, 0.025)

    def end(method, h):
        result = lw.solve(whole, method, h=h, t1=T)
        return np.concatenate([result.position[-1, 0], result.velocity[-1, 0], result.angular_velocity[-1, 0]])

    truth = end("rk8", 0.05)
    assert slope(steps, [np.abs(end(method, h) - truth).max() for h in steps]) > 1.9


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.slow_for("psi_x")
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_float32_follows_as_float64_does(method):
    a, b = (
        lw.solve(fleet("thrusters"), method, h=0.05, t1=T, dtype=dtype).position[-1] for dtype in ("float64", "float32")
    )
    np.testing.assert_allclose(a, b, rtol=0.0, atol=5e-4)


@pytest.mark.ci
@pytest.mark.kernel
def test_a_run_that_goes_on_in_the_midst_keeps_its_bits():
    first = lw.solve(fleet("ballast"), "psi_s", h=0.1, t1=3.0)
    second = lw.solve(fleet("ballast"), "psi_s", h=0.1, t1=T, start=first.final)
    whole = lw.solve(fleet("ballast"), "psi_s", h=0.1, t1=T)
    np.testing.assert_array_equal(second.position[-1], whole.position[-1])
