# SPDX-License-Identifier: Apache-2.0
"""Vehicles of the package right themselves, run ahead and turn as equations written a second time say.

The truth is tests/support/steady_motion.py, which reads the vehicle's file only; closed forms check both.
"""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk

from benchmarks import named_vehicles as named
from lgvi_warp.vehicles.fossen import vehicle_tables
from tests.support.steady_motion import Body

pytestmark = pytest.mark.slow
NAMES = tuple(named.TRIALS)
ran = cache(named.run)
# From the first instant; long enough for a few swings.
SHORT = 5.0


def body(name, member):
    """The independent vehicle with the commands of a member."""
    commands, which = {}, named.MEMBERS.index(member)
    for key, rows in named.parameters(name).items():
        kind, word = key.split(".")
        commands[kind] = commands.get(kind, {}) | {word: rows[which]}
    return Body(vehicle_tables(name), commands, neutral=member == "neutral")


@pytest.mark.parametrize("name", NAMES)
def test_it_settles_on_the_circle_of_the_steady_equations(name):
    run = ran(name)
    for member in ("ahead", "turn"):
        end = run.end(member)
        steady = body(name, member).steady(end)
        # What moves still is the slowest transient: at 1e-4 of it by the end, or drag by the square alone, which
        # never dies out exponentially (Girona 500: its net weight of 0.09 N settles by tanh, 2e-7 by then).
        np.testing.assert_allclose(end, steady, atol=1e-6, err_msg=member)
    rate = run.end("turn")[5]
    assert abs(rate) > np.radians(2.0)
    # The path is that circle: half a turn later it is a diameter away.
    level, _ = run.over_ground("turn")
    at = run.position[:, named.MEMBERS.index("turn"), :2]
    half = np.pi / abs(rate)
    back = np.array([np.interp(run.time[-1] - half, run.time, at[:, i]) for i in range(2)])
    assert np.linalg.norm(at[-1] - back) == pytest.approx(2.0 * level / abs(rate), rel=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_a_command_to_starboard_turns_to_starboard(name):
    assert ran(name).end("turn")[5] > 0.0


@pytest.mark.parametrize(("name", "balance"), [
    ("lauv", lambda u: 14.0 - 2.4 * u - 2.4 * u * u), ("eca_a9", lambda u: 32.0 - 8.0 * u * u),
    ("girona_500", lambda u: 0.5 * 153.7875 - 148.0 * u * u),
    ("dsrv", lambda u: 322.0846433879751 - 19.067175980960034 * u * u),
])  # fmt: skip
def test_a_neutral_one_s_speed_is_where_thrust_is_drag(name, balance):
    end, t1 = ran(name).end("neutral"), named.TRIALS[name].t1
    speed = brentq(balance, 0.0, 20.0, xtol=1e-13)
    assert end[0] == pytest.approx(speed, rel=1e-7)
    # The Girona 500 sinks before it is neutral no more than drag lets it: w below m / (k t), from any start.
    assert np.abs(end[1:]).max() < (
        147.0 / (148.0 * t1) if name == "girona_500" else 2e-4 if name == "eca_a9" else 1e-7
    )


def test_the_rexrov_does_not_hold_its_heading():
    """Pushed ahead without a law for heading it goes round, as its added mass (1222 kg across, 780 kg ahead) makes it."""
    end = ran("rexrov").end("neutral")
    assert abs(end[5]) > 0.1
    np.testing.assert_allclose(end, body("rexrov", "neutral").steady(end), atol=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_it_comes_back_from_20_degrees_as_the_equations_say(name):
    run, coarse = ran(name), named.run(name, step=2.0 * named.TRIALS[name].step, t1=SHORT + 1.0)
    for member, start in (("rolled", {"roll": named.ANGLE}), ("pitched", {"pitch": named.ANGLE})):
        which, errors = named.MEMBERS.index(member), []
        for one in (run, coarse):
            times = one.time[one.time <= SHORT]
            v, down = body(name, member).run(times, **start)
            at = slice(0, len(times))
            off = one.velocity[at, which] - v, one.attitude[at, which, 2] - down
            errors.append(max(np.abs(gap).max() for gap in off))
        # Of order 4 in the step, 16 times less at half the step, until the truth's own error of 1e-7 or less. Laws with
        # |v| v have a kink where a velocity changes sign, which costs h^3 times where it lies in its step: 8 times less on
        # the average, 3 asked for.
        assert errors[0] < errors[1] / (12.0 if name == "dsrv" else 3.0) + 1e-7, (member, errors)
        angle = run.angle(member)
        late = np.abs(angle[run.time > 0.9 * run.time[-1]]).max()
        undamped = name == "dsrv"  # no drag at rest
        assert late < (1.001 if undamped else 0.1) * named.ANGLE, member


def period(run, member):
    """Period of a swing: from the first passage through upright to the third [s]."""
    angle, time = run.angle(member), run.time
    turned = np.flatnonzero(np.diff(np.sign(angle)) != 0)
    cross = time[turned] - angle[turned] * np.diff(time)[turned] / np.diff(angle)[turned]
    return cross[2] - cross[0]


def test_the_dsrv_swings_as_a_pendulum():
    """Undamped: 4 K(sin(angle / 2)) / w, w^2 = B lever / (J + A), exactly."""
    w = np.sqrt(22870.037671875 * 0.43775315955477445 / 202.5364778167229)
    exact = 4.0 * ellipk(np.sin(0.5 * named.ANGLE) ** 2) / w
    assert exact == pytest.approx(2.0 * np.pi / w, rel=0.008)
    # The step's phase error, (w h)^4 / 120 = 3e-6, and the chord between samples, (w 0.02)^2 / 8 of them, on both sides.
    assert period(ran("dsrv"), "rolled") == pytest.approx(exact, rel=1e-4)


def test_the_lauv_s_roll_is_a_damped_swing():
    """2 pi / sqrt(k / J - (l / 2 J)^2), B lever = 1.77 N m, J = 0.0556 kg m2, l = 0.3 N m s; 20 degrees add 0.8 % at most."""
    J = 0.050625 + 0.005
    damped = 2.0 * np.pi / np.sqrt(1.77 / J - (0.3 / (2.0 * J)) ** 2)
    assert 1.0 - 1e-3 < period(ran("lauv"), "rolled") / damped < 1.008


def test_the_a9_s_roll_is_hardly_damped_at_rest():
    """2 pi sqrt((J + A) / (B lever)); 20 degrees add 0.8 % at most, the fins' damping of 5 % or less another 0.5 %."""
    free = 2.0 * np.pi * np.sqrt((0.6 + 0.4) / (685.0899212062258 * 0.06))
    assert 1.0 < period(ran("eca_a9"), "rolled") / free < 1.013


def test_the_girona_comes_back_without_a_swing():
    """Overdamped: 130^2 > 4 J k, k = W lever = 48 N m."""
    assert 130.0**2 > 4.0 * 8.0 * 961.38 * 0.05
    for member in ("rolled", "pitched"):
        angle = ran("girona_500").angle(member)
        assert np.all(np.diff(angle[angle > 1e-6]) < 0.0)
        assert np.all(angle > -1e-6)
