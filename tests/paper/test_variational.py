# SPDX-License-Identifier: Apache-2.0
"""The discrete principle of docs/theory/integrator.md: its variation by differences, and that paths of Phi make it zero."""

import numpy as np
import pytest

from lgvi_warp.reference import paper, rotation, variational
from lgvi_warp.reference.submaps import Body, start
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight
from lgvi_warp.reference.terms.wrench import Wrench
from tests.paper.test_reference_paper import symmetric
from tests.support.tools import TURN

H = 0.2
POTENTIAL = Weight(net=-3.0), Restoring(moment=np.array([0.3, -0.2, -1.5]))
PUSH = np.array([0.4, -0.9, 0.3]), np.array([-0.2, 0.5, 0.1])


def body(*terms):
    """Mass and inertia that are no multiples of the identity, in axes that are not principal."""
    return Body(symmetric(1, 2.0, 9.0), symmetric(2, 1.1, 2.0), terms)


def varied(seed, n):
    """A variation of n configurations that is zero at both ends."""
    inner = np.random.default_rng(seed).normal(size=(n, 2, 3)) * np.r_[0.0, np.ones(n - 2), 0.0][:, None, None]
    return [tuple(each) for each in inner]


def any_path(seed, n):
    """A path that no law makes."""
    rng = np.random.default_rng(seed)
    return [(rng.normal(size=3), rotation.exp(rng.normal(size=3))) for _ in range(n)]


def motion(which, steps):
    """States (b, R, nu, Om) of the printed map from one start."""
    states = [(np.array([1.0, -2.0, 3.0]), TURN, np.array([0.6, -0.4, 0.5]), np.array([0.7, 0.5, -0.9]))]
    for _ in range(steps):
        states.append(paper.phi(*states[-1], which, H))
    return states


def forced_path(which, steps):
    """Configurations of Phi with forces that do not follow from a potential."""
    b, R, nu, Om = motion(which, 0)[0]
    x = start(which, b, R, which.M @ nu, which.J @ Om)
    path = [(x.b, x.R)]
    for _ in range(steps):
        x = paper.Phi(x, which, H)
        path.append((x.b, x.R))
    return path


NOTHING = [(np.zeros(3), np.zeros(3))] * 5


@pytest.mark.parametrize("seed", range(3))
def test_equation_9_is_the_variation_of_the_sum(seed):
    # Differences of order 2 of a smooth sum near 100: (1e-5)^2 and 1e-14 / 1e-5, times some 10.
    which, path, variation = body(*POTENTIAL), any_path(seed, 6), varied(seed + 10, 6)
    by_hand = variational.equation_9(path, variation, NOTHING, which, H)
    by_differences = variational.equation_3(path, variation, NOTHING, which, H, 1e-5)
    assert abs(by_hand) > 1.0, "a path that no law makes is not stationary"
    np.testing.assert_allclose(by_differences, by_hand, rtol=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_a_path_of_phi_is_stationary(seed):
    # (9) along a solution is round-off of terms near 10; (3) is that over 1e-5, and its own order 2.
    which = body(*POTENTIAL)
    path, variation = [state[:2] for state in motion(which, 5)], varied(seed, 6)
    assert abs(variational.equation_9(path, variation, NOTHING, which, H)) < 1e-12
    assert abs(variational.equation_3(path, variation, NOTHING, which, H, 1e-5)) < 1e-7


def test_forces_enter_as_work():
    which = body(*POTENTIAL, Wrench(force=PUSH[0], torque=PUSH[1]))
    path, variation = forced_path(which, 5), varied(4, 6)
    assert abs(variational.equation_9(path, variation, [PUSH] * 5, which, H)) < 1e-12
    assert abs(variational.equation_9(path, variation, NOTHING, which, H)) > 0.1


def test_legendre_transforms_meet_at_each_time():
    which = body(*POTENTIAL)
    states = motion(which, 5)
    for (b, R, nu, Om), (b_k1, R_k1, nu_k1, Om_k1) in zip(states, states[1:], strict=False):
        after = variational.momenta_after(nu, Om, R.T @ R_k1, b_k1, R_k1, which, H)
        before = variational.momenta_before(nu_k1, Om_k1, b_k1, R_k1, which, H)
        np.testing.assert_allclose(after, before, atol=1e-13)


def test_the_momentum_map_is_kept():
    which = body()
    kept, plain = [], []
    for b, R, nu, Om in motion(which, 40):
        discrete = variational.momenta_before(nu, Om, b, R, which, H)
        kept.append(np.concatenate(variational.momentum_map(b, R, *discrete)))
        plain.append(variational.momentum_map(b, R, which.M @ nu, which.J @ Om)[1])
    # Round-off of 40 steps; R J Om + b x R p alone, without the term of (I6), moves by h |p| |nu|.
    assert np.abs(np.array(kept) - kept[0]).max() < 1e-12
    assert np.abs(np.array(plain) - plain[0]).max() > 1e-2


def test_identities_and_kinematics():
    J, Om, h = symmetric(3, 1.0, 1.9), np.array([0.3, -0.2, 0.9]), 1e-3
    np.testing.assert_allclose(variational.equation_5(Om, J), rotation.hat(J @ Om), atol=1e-14)
    np.testing.assert_allclose(variational.equation_6(Om, J), Om @ J @ Om, rtol=1e-14)
    # (4) is off by (h |Om|)^2 / 2, and so is what (7) then says of J Om, over h.
    F = rotation.exp(h * Om)
    assert np.abs(variational.equation_4(Om, h) - F).max() < 0.5 * (h * 1.0) ** 2
    np.testing.assert_allclose(variational.equation_7(F, J, h), J @ Om, atol=h * 2.0)
    np.testing.assert_allclose(variational.equation_7(paper.equation_10(Om, Body(J, J), h), J, h), J @ Om, atol=1e-11)


def test_equations_8_and_17_hold_of_the_printed_maps():
    which = body(*POTENTIAL)
    before, after = motion(which, 1)
    np.testing.assert_allclose(variational.equation_8(before[0], before[1], after[0], H), before[2], atol=1e-14)
    b, R, nu, Om = before
    _, R_k1, _, Om_k1 = paper.phi_adjoint(b, R, nu, Om, which, H)
    np.testing.assert_allclose(variational.equation_17(R_k1.T @ R, which.J, H), which.J @ Om_k1, atol=1e-13)


def test_the_lagrangian_gives_the_momenta():
    which, b, nu, Om = body(*POTENTIAL), np.ones(3), np.array([0.6, -0.4, 0.5]), np.array([0.7, 0.5, -0.9])
    # Of a quadratic function, differences of size 1 are exact but for round-off.
    for e in np.eye(3):
        by_nu = variational.equation_2(b, nu + e, TURN, Om, which) - variational.equation_2(b, nu - e, TURN, Om, which)
        by_Om = variational.equation_2(b, nu, TURN, Om + e, which) - variational.equation_2(b, nu, TURN, Om - e, which)
        np.testing.assert_allclose([by_nu / 2, by_Om / 2], [e @ which.M @ nu, e @ which.J @ Om], atol=1e-13)
