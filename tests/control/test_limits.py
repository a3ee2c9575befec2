# SPDX-License-Identifier: Apache-2.0
"""The gain and the delay at which a sampled loop turns unstable: by eigenvalues, and by members in lanes."""

import numpy as np
import pytest
from scipy.linalg import expm

import lgvi_warp as lw

pytestmark = pytest.mark.slow

H, EVERY, TIME = 0.01, 10, 240.0
PERIOD = H * EVERY
KP, KI, KD = 1.0, 0.02, 2.0
DELAY = 3  # steps, while gains vary
THRUST = 3.86  # N
SPEED = np.sqrt(THRUST / 1.62)  # m/s, at which the drag along the axis balances it


def scene():
    """REMUS 100, neutral and without torque of the propeller, under its heading law; straight ahead is an equilibrium.

    Drag of heave and pitch keeps it level: by itself its pitch swings, which slows it down.
    """
    guidance, laws = [lw.control.SetPoint(heading=0.0)], [lw.control.HeadingPID(kp=KP, ki=KI, kd=KD)]
    allocation = [lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 0]])]
    controller = lw.Controller(period=PERIOD, delay=H, guidance=guidance, laws=laws, allocation=allocation)
    level = {"type": "drag", "linear": [0.0, 0.0, 2000.0, 0.0, 2000.0, 0.0], "quadratic": [0.0] * 6}
    terms = [{"type": "wrench", "force": [THRUST, 0.0, 0.0]}, level]
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, terms=terms, controller=controller)


def plant():
    """A and B of x' = A x + B d, x = (v, p, r, roll, heading) about straight motion, d the angle of the rudder: by hand."""
    vehicle = scene().vehicle
    M = vehicle.rigid_body_mass_matrix + vehicle.added_mass_matrix
    u = SPEED
    lateral = np.ix_((1, 3, 5), (1, 3, 5))
    # Momentum and angular momentum of the straight motion, and what a sway or a turn adds to that to starboard.
    P, Pi, side = M[0, 0] * u, M[4, 0] * u, M[1, (1, 3, 5)]
    force = np.zeros((3, 5))
    force[:, 2] += -P, Pi, 0.0
    force[2, :3] -= u * side
    force[2, 0] += P
    force[2, 1] -= Pi
    force[1, 3] -= 0.0196 * 299.0
    # Lift of the hull, and of the rudder at x: by its angle less that of the flow there.
    force[:, 0] += -18.96 * u, 0.0, 4.47 * u
    fin, x = 0.5 * 1030.0 * 0.0133 * 1.4074020001459961, -0.638
    rudder = fin * u**2 * np.array([1.0, 0.0, x])
    force[:, 0] -= rudder / u
    force[:, 2] -= rudder * x / u
    inverse = np.linalg.inv(M[lateral])
    A, B = np.zeros((5, 5)), np.zeros((5, 1))
    A[:3], B[:3, 0] = inverse @ force, inverse @ rudder
    A[3, 1] = A[4, 2] = 1.0
    return A, B


def after(A, B, time):
    """Transition over a time, of x and of a held d."""
    n = len(A)
    whole = expm(np.block([[A, B], [np.zeros((1, n + 1))]]) * time)
    return whole[:n, :n], whole[:n, n:]


def growth(gain, steps):
    """The largest eigenvalue of the sampled loop, with a gain of the whole law and a delay of some steps: exact."""
    A, B = plant()
    periods, left = divmod(steps, EVERY)
    old, held = after(A, B, left * H)
    rest, fresh = after(A, B, PERIOD - left * H)
    # The state: x, I, and the commands of the last ticks, of which the oldest acts until the delay is over.
    n = len(A) + 1 + periods + 1
    law = np.zeros(n)
    law[[4, 2, 5]] = gain * KP, gain * KD, -gain * KI  # d = -N, of errors that are minus the heading
    loop = np.zeros((n, n))
    commands = np.concatenate([[law], np.eye(n)[6:]])
    loop[:5, :5] = rest @ old
    loop[:5] += rest @ held @ commands[periods + 1][None] + fresh @ commands[periods][None]
    loop[5, 5], loop[5, 4] = 1.0, -PERIOD
    loop[6:] = commands[: periods + 1]
    return np.abs(np.linalg.eigvals(loop)).max()


def stable(gains, steps):
    """Whether members with these gains and delays settle from 1 mrad.

    By the yaw rates: a slow mode of the integral hides a small fast oscillation in the heading. A loop that has grown until
    the rudder goes from limit to limit swings irregularly: so the rates must be small as well.
    """
    n = len(gains)
    zero = np.zeros((n, 3))
    c, s = np.cos(1e-3), np.sin(1e-3)
    attitude = np.tile([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], (n, 1, 1))
    ahead = np.tile([SPEED, 0.0, 0.0], (n, 1))
    parameters = {f"heading_pid.{name}": value * gains for name, value in (("kp", KP), ("ki", KI), ("kd", KD))}
    parameters["controller.delay"] = H * steps
    fleet = lw.Ensemble.from_states(scene(), zero, attitude, ahead, zero, parameters)
    result = lw.solve(fleet, "psi_x", h=H, t1=TIME, save=lw.SaveAt(every=PERIOD, fields=("angular_velocity",)))
    assert result.status.counts() == {"ok": n}
    rates = np.abs(result.angular_velocity[:, :, 2])
    third = len(rates) // 3
    end = rates[2 * third :].max(axis=0)
    return (end < 0.97 * rates[third : 2 * third].max(axis=0)) & (end < 1e-3)


def turns(values, settled):
    """The neighbours between which loops turn from unstable to stable, and back."""
    (changes,) = np.nonzero(settled[1:] != settled[:-1])
    assert len(changes) == 2
    assert not settled[0]
    assert not settled[-1]
    return [(values[i], values[i + 1]) for i in changes]


def limit(low, high, steps):
    """The gain between two at which the eigenvalues cross the unit circle."""
    inside = growth(low, steps) < 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (growth(middle, steps) < 1.0) == inside else (low, middle)
    return low


def test_the_gains_at_which_the_loop_turns_unstable():
    """The straight run is unstable without a controller: so there is a least gain as well as a greatest one."""
    gains = np.geomspace(0.02, 50.0, 128)
    brackets = turns(gains, stable(gains, np.full(128, DELAY)))
    # Each bracket and 5 % beyond it, in steps of 0.3 %.
    fine = np.concatenate([np.geomspace(low / 1.05, high * 1.05, 64) for low, high in brackets])
    found = turns(fine, stable(fine, np.full(128, DELAY)))
    for low, high in found:
        exact = limit(0.8 * low, 1.2 * high, DELAY)
        assert abs(np.sqrt(low * high) / exact - 1.0) < 0.01, (low, high, exact)


def test_the_delay_at_which_the_loop_turns_unstable():
    steps = np.arange(1, 65)
    unstable = ~stable(np.ones(64), steps)
    exact = max(i for i in steps if np.all([growth(1.0, j) < 1.0 for j in range(1, i + 1)]))
    # The last delay before the first with which it grows; some steps, of which 1 % is less than one.
    assert steps[np.argmax(unstable)] - 1 == exact
