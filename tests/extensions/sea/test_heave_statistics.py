# SPDX-License-Identifier: Apache-2.0
"""Second-order statistics of a vehicle's heave in a random sea against a transfer function from a linear model."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics.terms.base import own

# A REMUS 100 that floats up against a line, at rest 4 m deep, with linear drag.
REMUS = lw.Scene.named("remus_100")
DEPTH, LENGTH, STIFFNESS, PERIOD = 4.0, 5.0, 60.0, 0.05
DRAG = np.diag([30.0, 60.0, 60.0, 2.0, 8.0, 8.0])
HEADING = np.radians(30.0)


def moored(*terms):
    """The scene in equilibrium, with more terms."""
    lift = REMUS.vehicle.buoyancy - REMUS.vehicle.weight
    line = lw.terms.Tether(
        anchor=[0.0, 0.0, DEPTH + LENGTH + lift / STIFFNESS], stiffness=STIFFNESS, rest_length=LENGTH
    )
    drag = lw.terms.DragMatrix(linear=DRAG, quadratic=np.zeros((6, 6)))
    start = lw.Start(position=[0.0, 0.0, DEPTH])
    return lw.Scene(REMUS.vehicle, REMUS.environment, terms=[line, drag, *terms], start=start)


def responses(model, omega, k):
    """Heave over the amplitude of the surface at the vehicle, for e^(i omega t), of waves of these frequencies.

    Through the water the vehicle is pushed by (rho V - m) du/dt at the centres, and the water carries its position.
    """
    v, g = REMUS.vehicle, REMUS.environment.gravity
    displaced, dry = v.buoyancy / g, v.weight / g
    lever = displaced * v.center_of_buoyancy - dry * v.center_of_gravity
    found = []
    for w, wavenumber in zip(omega, k, strict=True):
        u = w * np.exp(-wavenumber * DEPTH) * np.array([np.cos(HEADING), np.sin(HEADING), -1j])
        force = np.concatenate([(displaced - dry) * 1j * w * u, np.cross(lever, 1j * w * u)])
        # Held over a period at the values of its middle: to (omega T)^2 / 24 = 1e-3 of the shortest waves.
        carried = 0.5 * model.dt * (np.eye(len(model.A)) + model.A)[:, :3] @ u
        push = (model.B @ force + carried) * np.exp(0.5j * w * model.dt)
        found.append(np.linalg.solve(np.exp(1j * w * model.dt) * np.eye(len(model.A)) - model.A, push)[2])
    return np.array(found)


@pytest.mark.slow
@pytest.mark.kernel
def test_heave_in_a_random_sea_is_that_of_the_transfer_function():
    sea = lw.terms.SeaState(significant_height=0.05, peak_period=6.0, heading_deg=np.degrees(HEADING))
    members, save = 100, lw.SaveAt(every=0.5)
    fleet = lw.Ensemble(moored(sea), members, seed=3)
    result = lw.solve(fleet, "rk4", h=PERIOD, t1=160.0, save=save)
    assert result.status.counts() == {"ok": members}
    late = result.time >= 60.0
    heave = result.position[late, :, 2] - DEPTH
    model = lw.linear.linearize(moored(), inputs="wrench", period=PERIOD, method="rk4", h=PERIOD)
    # Wave by wave, with the members' own frequencies and phases: a sea of k a = 0.01 is linear to some 1 %.
    p, term = fleet.parameters(0, members), fleet.scene.terms[-1]
    c = term.wave_table(own(term, p), p)
    H = responses(model, c.omega.ravel(), c.k.ravel()).reshape(c.omega.shape)
    turning = np.exp(1j * (result.time[late, None, None] * c.omega - c.phase))
    linear = np.real(np.sum(H * c.amplitude * turning, axis=-1))
    assert np.sqrt(np.mean((heave - linear) ** 2)) < 0.02 * heave.std()
    # And the variance is the integral of |H|^2 S: 100 members of some 10 independent waves, 4 standard errors.
    f = np.linspace(0.4, 3.0, 600)[:-1] / 6.0
    w = 2.0 * np.pi * f
    S, response = term.density(f), responses(model, w, w**2 / REMUS.environment.gravity)
    variance = np.sum(np.abs(response) ** 2 * S) * (f[1] - f[0])
    assert heave.var() == pytest.approx(variance, rel=4.0 * np.sqrt(2.0 / (10 * members)))
    # The line makes it another motion than the water's.
    water = np.sum(np.exp(-2.0 * w**2 / REMUS.environment.gravity * DEPTH) * S) * (f[1] - f[0])
    assert abs(variance / water - 1.0) > 0.2
