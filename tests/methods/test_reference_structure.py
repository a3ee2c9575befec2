# SPDX-License-Identifier: Apache-2.0
"""Invariants of the twin's maps: momenta, orthogonality, reversibility, the symplectic form; exactly the true claims."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.reference import advance, energy, rotation
from lgvi_warp.reference.submaps import Body, State
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight
from tests.support.tools import METHODS, TURN, difference, from_state, slope

SYMMETRIC = ("psi", "psi_s", "psi_1")
SYMPLECTIC = ("psi_s", "psi_1")
FULL = TURN @ np.diag([1.0, 2.0, 3.0]) @ TURN.T
J = np.diag([1.0, 2.0, 2.5])
TERMS = (Weight(net=-0.7), Restoring(moment=np.array([0.1, -0.2, -0.5])))
SHAPES = {"general": 0.5 * (FULL + FULL.T), "isotropic": 2.0 * np.eye(3)}


def state(speed=1.0):
    """A state of no symmetry."""
    p, pi = np.array([0.5, -1.2, 0.9]), np.array([0.8, 0.6, -1.1])
    return State(np.array([1.0, -2.0, 3.0]), TURN.T, speed * p, speed * pi)


def walk(method, body, x, h, steps, every=1):
    return advance.trajectory(x, body, PROGRAMS[method], h, steps, every, solve=rotation.quartic)


FREE_STEPS = 400


@functools.cache
def free_walk(method, shape):
    """States of a free body, every twentieth step of h = 0.1."""
    return walk(method, Body(SHAPES[shape], J), state(), 0.1, FREE_STEPS, 20)


def change(values):
    values = np.array(values)
    return np.abs(values - values[0]).max()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("method", METHODS)
def test_linear_momentum_without_forces(method, shape):
    # R p is kept exactly by every map: round-off of all steps, 3e-16 each at most, all one way.
    states = free_walk(method, shape)
    assert change([energy.linear_momentum(x) for x in states]) < FREE_STEPS * 3e-16
    assert change([x.p for x in states]) > 0.1


@pytest.mark.parametrize(
    ("method", "shape"), [(m, "general") for m in SYMPLECTIC] + [(m, "isotropic") for m in METHODS]
)
def test_angular_momentum_without_forces(method, shape):
    # L = R pi + b x R p is kept by T and by D; |b| reaches 40 m here, and b x R p is rounded at every step.
    states = free_walk(method, shape)
    reach = max(np.abs(x.b).max() for x in states)
    assert change([energy.angular_momentum(x) for x in states]) < FREE_STEPS * 3e-16 * reach
    assert change([x.pi for x in states]) > 0.1


@pytest.mark.parametrize(("method", "sign"), [("phi", -1.0), ("phi_adjoint", 1.0)])
def test_phi_keeps_a_shifted_angular_momentum(method, sign):
    # Phi keeps L - h P x R nu and Phi* keeps L + h P x R nu: neither keeps L unless M = m I.
    body, h = Body(SHAPES["general"], J), 0.1
    states = free_walk(method, "general")
    reach = max(np.abs(x.b).max() for x in states)
    L = [energy.angular_momentum(x) for x in states]
    shift = [h * np.cross(x.R @ x.p, x.R @ np.linalg.solve(body.M, x.p)) for x in states]
    assert change([a + sign * b for a, b in zip(L, shift, strict=True)]) < FREE_STEPS * 3e-16 * reach
    assert change(L) > 1e-2


@pytest.mark.slow
def test_psi_keeps_neither_but_within_the_square_of_the_step():
    # For general M: not L, not either shifted one; L stays within a bound of the order h^2, also over ten times as long.
    body, steps = Body(SHAPES["general"], J), np.array([0.08, 0.04, 0.02])
    states = {h: walk("psi", body, state(), h, round(40.0 / h)) for h in steps}
    changes = [change([energy.angular_momentum(x) for x in states[h]]) for h in steps]
    assert slope(steps, changes) == pytest.approx(2.0, abs=0.2)
    assert min(changes) > 1e-6
    L = np.array([energy.angular_momentum(x) for x in states[0.08]])
    Q = np.array([0.08 * np.cross(x.R @ x.p, x.R @ np.linalg.solve(body.M, x.p)) for x in states[0.08]])
    assert min(change(L - Q), change(L + Q)) > 1e-4
    long = walk("psi", body, state(), 0.08, 5000, 5)
    assert change([energy.angular_momentum(x) for x in long]) < 3.0 * changes[0]


@pytest.mark.slow_for("phi*", "psi_1*")
@pytest.mark.parametrize("method", METHODS)
def test_attitude_stays_orthogonal(method):
    # Raw products: each rounds R by 3e-16 at most.
    states = walk(method, Body(SHAPES["general"], J, TERMS), state(), 0.02, 1000, 100)
    assert max(np.abs(x.R.T @ x.R - np.eye(3)).max() for x in states) < 3e-13


def there_and_back(forth, back, h, x, body):
    y = advance.step(x, body, PROGRAMS[forth], h, solve=rotation.newton)
    y = advance.step(y, body, PROGRAMS[back], -h, solve=rotation.newton)
    return difference(from_state(body, y), from_state(body, x))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    ("forth", "back"), [*[(m, m) for m in SYMMETRIC], ("phi", "phi_adjoint"), ("phi_adjoint", "phi")]
)
def test_reversible(forth, back, shape):
    # Psi_{-h} Psi_h = identity and Phi*_{-h} Phi_h = identity, to round-off of some hundred operations.
    for h in (0.05, 0.3):
        assert there_and_back(forth, back, h, state(), Body(SHAPES[shape], J, TERMS)) < 1e-14


@pytest.mark.parametrize(("method", "order"), [("phi", 2), ("phi_adjoint", 2)])
def test_phi_alone_is_not_reversible(method, order):
    # Order 1: Phi_{-h} Phi_h misses by O(h^2). The test above can fail.
    steps = np.array([0.08, 0.04, 0.02])
    missed = [there_and_back(method, method, h, state(), Body(SHAPES["general"], J, TERMS)) for h in steps]
    assert slope(steps, missed) == pytest.approx(order, abs=0.2)


def two_form(x):
    """S of the canonical form at p, pi, left-trivialised: <dm1, u2> - <dm2, u1> - <m, [u1, u2]>, u = (v, w), m = (p, pi).

    [u1, u2] = (w1 x v2 - w2 x v1, w1 x w2) in se(3); rows and columns are (v, w, dp, dpi).
    """
    S = np.zeros((12, 12))
    S[6:, :6], S[:6, 6:] = np.eye(6), -np.eye(6)
    S[3:6, :3] = S[:3, 3:6] = rotation.hat(x.p)
    S[3:6, 3:6] = rotation.hat(x.pi)
    return S


def moved(x, d):
    """The state moved by d (12,): R^T db, the rotation vector of R^T R', dp, dpi."""
    return State(x.b + x.R @ d[:3], x.R @ rotation.exp(d[3:6]), x.p + d[6:9], x.pi + d[9:])


def coordinates(x, centre):
    """The move from centre to x, to second order: enough for a derivative at the centre."""
    relative = centre.R.T @ x.R
    w = rotation.vee(relative - relative.T) / 2
    return np.concatenate([centre.R.T @ (x.b - centre.b), w, x.p - centre.p, x.pi - centre.pi])


def symplectic_defect(method, h, M, eps=1e-3):
    """max |DPsi^T S DPsi - S| of one step, by central differences of order 6."""
    body, x = Body(M, J, TERMS), state(0.6)

    def image(d):
        return advance.step(moved(x, d), body, PROGRAMS[method], h, solve=rotation.newton)

    centre = image(np.zeros(12))
    columns = []
    for e in eps * np.eye(12):
        d = [coordinates(image(k * e), centre) - coordinates(image(-k * e), centre) for k in (1, 2, 3)]
        columns.append((45.0 * d[0] - 9.0 * d[1] + d[2]) / (60.0 * eps))
    D = np.array(columns).T
    return np.abs(D.T @ two_form(centre) @ D - two_form(x)).max()


@pytest.mark.parametrize("method", SYMPLECTIC)
@pytest.mark.parametrize("M", [(1.0, 2.0, 3.0), (1.0, 1.2, 6.0), "full"])
def test_symplectic(method, M):
    # Differences: eps^6 = 1e-18 times a seventh derivative of at most 1e6, and round-off 1e-15 / eps = 1e-12.
    M = SHAPES["general"] if M == "full" else np.diag(M)
    for h in (0.05, 0.2):
        assert symplectic_defect(method, h, M) < 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_every_map_is_symplectic_for_isotropic_mass(method):
    assert symplectic_defect(method, 0.2, SHAPES["isotropic"]) < 1e-9


def test_psi_is_not_symplectic_for_anisotropic_mass():
    # Mathematics, section 2: defect O(h^3) at M = (1, 2, 3). Phi and Phi* preserve forms S + h S1 and S - h S1, S1 of
    # the state, which changes by O(h) in a step: defect O(h^2).
    steps = np.array([0.2, 0.1, 0.05])
    M = np.diag([1.0, 2.0, 3.0])
    defects = [symplectic_defect("psi", h, M) for h in steps]
    assert min(defects) > 1e-6
    assert slope(steps, defects) == pytest.approx(3.0, abs=0.2)
    for method in ("phi", "phi_adjoint"):
        assert slope(steps, [symplectic_defect(method, h, M) for h in steps]) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("omega", [0.1, 3.0, 9.0])
def test_spin_about_a_principal_axis(method, axis, omega):
    # Exact: k steps turn by k asin(h Om) with one solve over h, by 2 k asin(h Om / 2) with two over h / 2.
    h, k, e = 0.1, 7, np.eye(3)[axis]
    body = Body(SHAPES["isotropic"], J)
    x = replace(state(), R=np.eye(3), p=np.zeros(3), pi=omega * J @ e)
    end = walk(method, body, x, h, k)[-1]
    angle = 2 * k * np.arcsin(h * omega / 2) if method in ("psi", "psi_s") else k * np.arcsin(h * omega)
    # asin's condition at .9 is 1 / sqrt(1 - .81) = 2.3.
    assert np.abs(end.R - rotation.exp(angle * e)).max() < 1e-13
    assert np.abs(end.pi - x.pi).max() < 1e-14 * omega
    with pytest.raises(rotation.NoSolution):
        walk(method, body, replace(x, pi=x.pi * (2.1 if method in ("psi", "psi_s") else 1.05) / (h * omega)), h, 1)


@pytest.mark.parametrize("method", METHODS)
def test_vertical_fall(method):
    # R = I, force along b3: symplectic Euler under Phi (old velocity moves) and Phi* (new one), Verlet, which is exact
    # for a constant force, under Psi, PsiS, Psi1.
    h, k, net, m = 0.1, 20, -0.7, 2.0
    body = Body(m * np.eye(3), J, (Weight(net=net),))
    x = State(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))
    end = walk(method, body, x, h, k)[-1]
    count = {"phi": k * (k - 1), "phi_adjoint": k * (k + 1)}.get(method, k * k)
    assert end.b[2] == pytest.approx(0.5 * net / m * h * h * count, rel=1e-13)
    assert end.p[2] == pytest.approx(net * k * h, rel=1e-13)
    np.testing.assert_array_equal(end.R, np.eye(3))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi", *SYMPLECTIC])
def test_energy_error_is_bounded_and_of_order_two(method):
    # 40 s of a tumbling body: the largest energy error falls by 4 as h is halved.
    body, steps = Body(SHAPES["general"], J, TERMS), np.array([0.04, 0.02, 0.01])
    spread = [change([energy.energy(x, body) for x in walk(method, body, state(), h, round(40.0 / h))]) for h in steps]
    assert slope(steps, spread) == pytest.approx(2.0, abs=0.2)
