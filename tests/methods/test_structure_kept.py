# SPDX-License-Identifier: Apache-2.0
"""Invariants of the discrete maps: momenta, orthogonality, reversibility, the symplectic form; exactly the true claims."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import energy as invariants
from tests.support import tools
from tests.support.tools import EQUAL, METHODS, difference, free_scene, last, one, random_states, scene_of, slope
from tests.support.two_form import coordinates, moved, two_form

# One kernel for each method: masses that differ, weight and a restoring moment.
FREE = {"general": free_scene(), "isotropic": free_scene(EQUAL)}
SYMPLECTIC = ("psi_s", "psi_1")


def free_run(shape, method, h=0.01, steps=100_000, n=8):
    """Eight free bodies with |nu|, |Om| near 0.3 to 1: result, R p, and L = R pi + b x R p over time."""
    fleet = one(FREE[shape], *random_states(11, n, 0.5, 0.5))
    result = lw.solve(fleet, method, h=h, t1=h * steps, save=lw.SaveAt(at=[h * steps / 10 * i for i in range(1, 11)]))
    assert result.status.counts() == {"ok": n}
    return result, invariants.linear_momentum(result), invariants.angular_momentum(result)


def change(values):
    return np.abs(values - values[:1]).max()


@pytest.mark.ci
@pytest.mark.parametrize("shape", FREE)
@pytest.mark.parametrize("method", METHODS)
def test_linear_momentum_without_forces(shape, method):
    # 1e5 steps of a product rounded to 1e-16: a random walk of 3e-14, or 1e-11 if every rounding went one way.
    _, P, _ = free_run(shape, method)
    assert change(P) < 1e-11


@pytest.mark.ci
@pytest.mark.parametrize(
    ("shape", "method"), [("general", m) for m in SYMPLECTIC] + [("isotropic", m) for m in METHODS]
)
def test_angular_momentum_without_forces(shape, method):
    # |b| reaches 1 km here: round-off of b x P is 1e-13 a step.
    result, _, L = free_run(shape, method)
    reach = np.abs(result.position).max()
    assert change(L) < 1e-11 * max(1.0, reach)


@pytest.mark.ci
@pytest.mark.parametrize(("method", "sign"), [("phi", -1.0), ("phi_adjoint", 1.0)])
def test_phi_keeps_a_shifted_angular_momentum(method, sign):
    # For general M, Phi keeps L - h P x R nu and Phi* keeps L + h P x R nu (mathematics, section 5), and not L itself.
    h = 0.01
    result, P, L = free_run("general", method, h, steps=20_000)
    Rnu = np.einsum("knij,knj->kni", result.attitude, result.velocity)
    reach = np.abs(result.position).max()
    assert change(L + sign * h * np.cross(P, Rnu)) < 1e-11 * max(1.0, reach)
    assert change(L) > 1e-4


@pytest.mark.ci
def test_psi_keeps_neither_but_within_the_square_of_the_step():
    steps = np.array([0.04, 0.02, 0.01])
    changes = [change(free_run("general", "psi", h, steps=round(200.0 / h))[2]) for h in steps]
    assert min(changes) > 1e-7
    assert slope(steps, changes) == pytest.approx(2.0, abs=0.3)


@pytest.mark.ci
@pytest.mark.parametrize(("dtype", "bound"), [("float64", 1e-12), ("float32", 3e-6)])
def test_attitude_stays_orthogonal(dtype, bound, scene):
    # float64: raw products, 1e6 steps (mathematics, section 5). float32: renormalised every 128 steps,
    # each of two products rounded to 6e-8: 6e-8 sqrt(256) = 1e-6 an element, and three of them in R^T R.
    result = lw.solve(lw.Ensemble(scene, members=8), h=0.001, t1=1000.0, dtype=dtype)
    R = result.attitude[-1].astype(np.float64)
    assert np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max() < bound


@pytest.mark.ci
@pytest.mark.parametrize(
    ("forward", "back", "steps"),
    [(method, method, steps) for method in ("psi", "psi_s", "psi_1") for steps in (1, 500)]
    + [("phi", "phi_adjoint", steps) for steps in (1, 200)],
)
def test_reversed_momenta_lead_back(forward, back, steps):
    # Psi_{-h} Psi_h = identity, and Phi*_h = (Phi_{-h})^-1: the maps are even in the momenta.
    scene = scene_of((10.0, 12.0, 15.0), (1.0, 2.0, 2.5), net=-0.3, moment=(0.0, 0.1, -0.5))
    b, R, nu, Om = (x[0] for x in random_states(2, 1, 0.5, 0.5))
    end = last(lw.solve(one(scene, b, R, nu, Om), forward, h=0.01, t1=0.01 * steps))
    start = last(lw.solve(one(scene, end[0], end[1], -end[2], -end[3]), back, h=0.01, t1=0.01 * steps))
    # One step: round-off. 500 steps: round-off 1e-16 a step and operation, grown at most 100 times on the way.
    assert difference((start[0], start[1], -start[2], -start[3]), (b, R, nu, Om)) < (1e-14 if steps == 1 else 1e-11)


def symplectic_defect(method, h, M, eps=2e-4):
    """|DPsi^T S DPsi - S| of one kernel step by central differences of order 4, in left-trivialised coordinates."""
    scene = scene_of(M, (1.0, 2.0, 2.5), net=-0.7, moment=(0.1, -0.2, -0.5))
    body = tools.body_of(scene)
    x = tools.to_state(body, *(value[0] for value in random_states(4, 1, 0.6, 0.6)))
    moves = np.concatenate([*(k * eps * np.eye(12) for k in (-2, -1, 1, 2)), np.zeros((1, 12))])
    states = zip(*(tools.from_state(body, moved(x, d)) for d in moves), strict=True)
    result = lw.solve(one(scene, *map(np.array, states)), method, h=h, t1=h)
    *around, centre = (tools.to_state(body, *last(result, i)) for i in range(len(moves)))
    out = np.array([coordinates(y, centre) for y in around]).reshape(4, 12, 12)
    derivative = ((out[0] - out[3]) + 8.0 * (out[2] - out[1])).T / (12.0 * eps)
    return np.abs(derivative.T @ two_form(centre) @ derivative - two_form(x)).max()


slow = pytest.mark.slow
COMPOSED = ("psi_w", "bm6(psi_x)", "kl8(psi_x)", "rkn4_6", "rkn6_14")


@pytest.mark.ci
@pytest.mark.parametrize(
    "method", [*SYMPLECTIC, "su4(psi_s)", "psi_x", "bm4(psi_x)", *(pytest.param(name, marks=slow) for name in COMPOSED)]
)
def test_symplectic(method):
    # Differences of order 4: eps^4 = 2e-15 times a fifth derivative, and round-off 1e-16 / eps = 1e-12.
    assert symplectic_defect(method, 0.1, (1.0, 2.0, 3.0)) < 1e-9
    assert symplectic_defect(method, 0.05, (1.0, 1.2, 6.0)) < 1e-9


@pytest.mark.ci
@pytest.mark.parametrize(
    ("method", "order"), [("rk4", 4), *(pytest.param(*row, marks=slow) for row in (("gauss4", 4), ("cg3", 3)))]
)
def test_others_are_symplectic_to_their_order_only(method, order):
    # Gauss collocation too: (R, p, pi) are not canonical variables. Its quadratic invariants are another matter.
    defects = [symplectic_defect(method, h, (1.0, 2.0, 3.0)) for h in (0.2, 0.1)]
    assert defects[1] > 1e-7
    assert 0.7 * 2.0 ** (order + 1) < defects[0] / defects[1] < 1.5 * 2.0 ** (order + 1)


@pytest.mark.ci
@pytest.mark.parametrize("method", ["phi", "phi_adjoint", "psi"])
def test_the_papers_maps_are_symplectic_for_isotropic_mass(method):
    assert symplectic_defect(method, 0.1, EQUAL) < 1e-9


@pytest.mark.ci
def test_psi_is_not_symplectic_for_anisotropic_mass():
    # Section 2 of the mathematics: the defect is O(h^3).
    steps = np.array([0.2, 0.1, 0.05])
    defects = [symplectic_defect("psi", h, (1.0, 2.0, 3.0)) for h in steps]
    assert min(defects) > 1e-6
    assert slope(steps, defects) == pytest.approx(3.0, abs=0.3)


@pytest.mark.ci
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("omega", [0.1, 3.0, 9.9])
def test_spin_about_a_principal_axis(axis, method, omega):
    # Exact: k asin(h Om) under Phi and Phi*, 2 k asin(h Om / 2) under Psi, PsiS; Psi1 has one solve over h.
    h, k = 0.1, 7
    Om = omega * np.eye(3)[axis]
    result = lw.solve(one(FREE["isotropic"], Om=Om), method, h=h, t1=k * h)
    angle = 2 * k * np.arcsin(h * omega / 2) if method in ("psi", "psi_s") else k * np.arcsin(h * omega)
    R = lw.notation.matrix_from_rotation_vector(angle * np.eye(3)[axis])
    assert result.status.counts() == {"ok": 1}
    # Near h Om = 1 (here 0.99) the root is nearly double: the angle's error is the square root of the residual's 1e-14.
    assert np.abs(last(result)[1] - R).max() < (1e-6 if omega > 9 and method not in ("psi", "psi_s") else 1e-12)
    assert np.abs(last(result)[3] - Om).max() < 1e-12 * omega


@pytest.mark.ci
@pytest.mark.parametrize("method", METHODS)
def test_vertical_fall(method):
    # R = I, force net along b3, mass m: symplectic Euler under Phi, Verlet under Psi, PsiS, Psi1 (position exact).
    h, k, net, m = 0.1, 20, -0.7, 2.0
    result = lw.solve(one(scene_of(EQUAL, net=net, moment=(0.0, 0.0, -1.0))), method, h=h, t1=k * h)
    g = net / m
    depth = {"phi": 0.5 * g * h * h * k * (k - 1), "phi_adjoint": 0.5 * g * h * h * k * (k + 1)}
    b, _, nu, _ = last(result)
    assert b[2] == pytest.approx(depth.get(method, 0.5 * g * (k * h) ** 2), rel=1e-13)
    assert nu[2] == pytest.approx(g * k * h, rel=1e-13)
