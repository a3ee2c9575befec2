# SPDX-License-Identifier: Apache-2.0
"""The autopilots of another simulator on its own vehicle, as a law of one's own, beside its loop in NumPy."""

import numpy as np
import pytest

from benchmarks import foreign_remus as remus
from tests.support.foreign_remus_loop import CALM, CURRENT, WANTED, apart, ours, theirs


def test_the_loop_in_numpy_is_the_simulators():
    # Position and Euler angles after 1000 steps of the simulator itself, as of May 2025, in the current of its main program.
    theirs = [
        39.733133274042785, 6.1476495700913398, 8.2512133675520758,
        0.026391685296675176, -0.20955883199575112, 0.31435488751076968,
    ]  # fmt: skip
    position, angles = remus.simulate(**WANTED, time=20.0, sea=CURRENT, choices=remus.Choices())
    # Round-off of 1000 steps of some tens of metres.
    np.testing.assert_allclose(np.concatenate([position[-1], angles[-1]]), theirs, rtol=0.0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("sea", [CALM, CURRENT], ids=["calm", "current"])
def test_the_equations_are_the_same(sea):
    """By rk4 at two steps: what order 4 leaves at the second is a fifteenth of what they differ by."""
    coarse, fine = (theirs(sea, remus.Choices(parts, "rk4", "exact", level=False), 60.0) for parts in (1, 2))
    left = apart(coarse, fine)
    assert np.all(left < 1e-8)
    assert np.all(apart(fine, ours(sea, time=60.0)) < left)


@pytest.mark.slow
def test_the_simulators_euler_step_errs_with_order_one():
    loop, parts = ours(CALM), (1, 2, 4)
    errors = np.array([apart(theirs(CALM, remus.Choices(count, model="exact")), loop) for count in parts])
    # Errors of order 2 are below 1 % of those of order 1 at a step of 1 / 250 of the fastest swing.
    assert np.all(np.abs(errors[:-1] / errors[1:] - 2.0) < 0.05)
    # Its reference model errs as well, in the heading alone: some 0.1 mrad either way.
    assert 1e-4 < apart(theirs(CALM, remus.Choices()), loop)[2] < 3e-4
    assert errors[0, 0] < 2e-3


@pytest.mark.slow
def test_its_current_has_no_part_along_the_vehicle():
    """The other simulator takes the current for level in body axes, whatever the pitch: the largest difference."""
    depth, _, _ = apart(theirs(CURRENT, remus.Choices()), ours(CURRENT))
    assert 1.0 < depth < 1.5
