# SPDX-License-Identifier: Apache-2.0
"""Stratified water against exact solutions."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import terms
from tests.extensions.gliders.cases import STRATIFICATION
from tests.laws.test_water import scene
from tests.support.tools import one, random_states, slope

pytestmark = pytest.mark.ci


def test_oscillation_in_stratified_water():
    # Upright, the centre of buoyancy is at d0 + A cos(omega t), omega^2 = B gradient / M33.
    term, M33 = terms.Stratification(**STRATIFICATION), 3.0
    here = scene(term, M=(1.0, 2.0, M33), moment=(0.0, 0.0, -0.5))
    rest = term.reference_depth - here.vehicle.center_of_buoyancy[2]
    omega = np.sqrt(here.vehicle.buoyancy * term.gradient / M33)
    steps, errors = np.array([0.2, 0.1, 0.05, 0.025]), []
    for h in steps:
        result = lw.solve(one(here, b=(0.0, 0.0, rest + 1.5)), "psi_s", h=h, t1=20.0)
        b, v = result.position[-1, 0, 2] - rest, result.velocity[-1, 0, 2]
        errors.append(np.hypot(b - 1.5 * np.cos(20.0 * omega), v / omega + 1.5 * np.sin(20.0 * omega)))
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.05)
    assert errors[-1] < 1e-2


def test_energy_in_stratified_water():
    # Force and torque follow from the potential: the energy of a turning vehicle changes with the square of the step.
    here = scene(terms.Stratification(**STRATIFICATION), moment=(0.3, -0.2, 0.5))
    fleet = one(here, *random_states(3, 4))
    changes = []
    for h in (0.02, 0.01, 0.005):
        energy = lw.solve(fleet, "psi_s", h=h, t1=4.0, save=lw.SaveAt(every=0.2)).energy
        changes.append(np.abs(energy - energy[0]).max())
    assert slope(np.array([0.02, 0.01, 0.005]), changes) == pytest.approx(2.0, abs=0.1)
