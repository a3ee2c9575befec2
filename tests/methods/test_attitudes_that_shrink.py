# SPDX-License-Identifier: Apache-2.0
"""Why rk4 loses more energy in float64 than in float32: its R leaves the rotations, and float32 alone brings it back."""

from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels.advance.spec import CHUNK
from tests.support.tools import one

pytestmark = pytest.mark.ci

STEPS = 1_000_000


def lost(fleet, h, steps, dtype="float64"):
    """(energy lost by the first member [J], its last attitude)."""
    result = lw.solve(fleet, "rk4", h=h, t1=h * steps, dtype=dtype, checks="none")
    return float(result.energy[0, 0]) - float(result.energy[-1, 0]), result.attitude[-1, 0].astype(float)


def factor(angle):
    """By how much a step of rk4 shrinks what turns by an angle: the modulus of exp(i angle) to the fourth power."""
    return abs(sum((1j * angle) ** k / d for k, d in enumerate((1, 1, 2, 6, 24))))


def test_a_spin_loses_the_energy_that_its_attitude_shrinks_by():
    # Without forces the state holds P = R p, so p = R^T P. A spin about the third axis at an angle of 0.1 a step shrinks the
    # part of R across it by a factor in each step, and the energy of v across it by the square.
    h, rate, mass, v = 0.05, 2.0, 3.0, np.array([0.8, -0.5, 0.4])
    fleet = one(
        lw.Scene(lw.Vehicle(mass, inertia=(1.0, 1.5, 2.0)), lw.Environment(gravity=0.0)), nu=v, Om=(0.0, 0.0, rate)
    )
    shrunk = factor(rate * h) ** STEPS
    across = 0.5 * mass * (v[0] ** 2 + v[1] ** 2)
    energy, R = lost(fleet, h, STEPS)
    assert energy == pytest.approx(across * (1.0 - shrunk**2), rel=1e-6)
    assert np.linalg.det(R) == pytest.approx(shrunk**2, rel=1e-6)
    # In float32 R is a rotation again after every 128 steps: what it loses until then, and round-off of R.
    energy, R = lost(fleet, h, STEPS, "float32")
    assert abs(energy) < across * (CHUNK * (1.0 - factor(rate * h) ** 2) + 20.0 * np.finfo(np.float32).eps)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-5)


def test_with_its_attitude_made_a_rotation_float64_loses_what_float32_does(scene):
    start, h = lw.Ensemble(scene).select(0, 1), 0.1
    scene = lw.Scene(replace(scene.vehicle, buoyancy=0.0), lw.Environment(gravity=0.0))
    fleet = one(scene, start.position, start.attitude, start.velocity, start.angular_velocity)
    # The figures of docs/explain/long_runs.md.
    (energy, R), (energy32, _) = (lost(fleet, h, STEPS, dtype) for dtype in ("float64", "float32"))
    assert (energy, energy32) == (pytest.approx(1.44, abs=0.01), pytest.approx(0.065, abs=0.005))
    assert np.linalg.det(R) == pytest.approx(0.979, abs=5e-4)
    # As the kernel does in float32: the nearest rotation in place of R every 128 steps, P = R p as it was.
    M, blocks, members = scene.vehicle.mass_matrix, 200, fleet
    (energy, _), (energy32, _) = (lost(fleet, h, blocks * CHUNK, dtype) for dtype in ("float64", "float32"))
    for _ in range(blocks):
        result = lw.solve(members, "rk4", h=h, t1=h * CHUNK, checks="none")
        R, p = result.attitude[-1, 0], M @ result.velocity[-1, 0]
        left, _, right = np.linalg.svd(R)
        turned = left @ right
        p = turned.T @ np.linalg.solve(R.T, p)
        members = one(scene, result.position[-1], turned, np.linalg.solve(M, p), result.angular_velocity[-1])
    made = energy_of(fleet) - energy_of(members)
    # Round-off of float32 adds 1e-4 J in as many steps; what is left is what the rates lose, in either precision.
    assert made == pytest.approx(energy32, abs=2e-4)
    assert energy > 15.0 * made


def energy_of(fleet):
    """The energy with which a member starts [J]."""
    return lw.solve(fleet, "rk4", h=0.1, t1=0.1, checks="none").energy[0, 0]
