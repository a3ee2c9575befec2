# SPDX-License-Identifier: Apache-2.0
"""Invariants of the compositions: linear momentum, reversal of time, and an energy that does not drift."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.tools import TURN, free_scene, last, one, scene_of

START = {"b": (0.0, 0.0, 10.0), "R": TURN.T, "nu": (0.6, 0.6, 0.5), "Om": (0.3, 0.8, -0.5)}
# The kernels of tests/methods/test_composition_orders.py: with weight, however small.
METHODS = ("ss6_13(psi_s)", "ss6_13(psi_x)", "bm4(psi_x)", "bm6(psi_s)", "rkn6_11", "rkn6_14", "gauss6")
SWINGING = scene_of(net=1e-13, moment=(0.1, -0.2, -0.5))
SLOW = ("ss6_13(psi_x)*", "bm6(psi_s)*", "rkn6_11*", "rkn6_14*")


@pytest.mark.ci
@pytest.mark.slow_for(*SLOW)
@pytest.mark.parametrize("method", METHODS)
def test_linear_momentum_without_forces(method):
    scene = free_scene()
    result = lw.solve(one(scene, **START), method, h=0.1, t1=100.0, save=lw.SaveAt(every=10.0))
    momentum = np.einsum("kij,kj->ki", result.attitude[:, 0], result.velocity[:, 0] @ scene.vehicle.mass_matrix)
    # Round-off of 1000 steps of up to 20 stages.
    assert np.abs(momentum - momentum[0]).max() < 1e-11


@pytest.mark.ci
@pytest.mark.slow_for(*SLOW)
@pytest.mark.parametrize("method", METHODS)
def test_reversible(method):
    # Velocities reversed: the same orbit back to the start, but for the error of a round trip's round-off.
    b, R, nu, Om = last(lw.solve(one(SWINGING, **START), method, h=0.1, t1=5.0))
    b, R, nu, Om = last(lw.solve(one(SWINGING, b, R, -nu, -Om), method, h=0.1, t1=5.0))
    for end, begin in zip((b, R, -nu, -Om), START.values(), strict=True):
        np.testing.assert_allclose(end, begin, atol=1e-11)


@pytest.mark.ci
@pytest.mark.slow_for(*SLOW)
@pytest.mark.parametrize("method", METHODS)
def test_energy_does_not_drift(method):
    result = lw.solve(one(SWINGING, **START), method, h=0.25, t1=500.0, save=lw.SaveAt(every=1.0))
    change = np.abs(result.energy[:, 0] - result.energy[0, 0])
    half = len(change) // 2
    assert change.max() < 1e-2
    assert change[half:].max() < 2.0 * change[:half].max() + 1e-11
