# SPDX-License-Identifier: Apache-2.0
"""Drag of any strength, 1e5 seconds of falling, 1e8 steps: against exact solutions of the maps, to derived bounds."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels.maps.dissipation import GAMMA
from lgvi_warp.common.status import Status
from lgvi_warp.physics import energy as invariants
from tests.extremes import extended
from tests.extremes.cases import DTYPES, UNIT, Case, Group, ensemble, oblique, twin
from tests.support.tools import one, random_states

SLOW = pytest.mark.slow
KAPPAS = tuple(10.0**k for k in range(-6, 7))
SPHERE = {"M": (10.0, 10.0, 10.0), "J": (1.0, 1.0, 1.0)}
BRAKED = lw.Scene(lw.Vehicle(10.0, inertia=(1.0,) * 3, buoyancy=98.0), lw.Environment(9.8),
                  [lw.terms.DragMatrix(linear=np.eye(6), quadratic=np.eye(6))])  # fmt: skip


def rising(values, unit):
    """The largest rise from one sample to the next, in units of round-off of what was there."""
    return float((np.diff(values, axis=0) / (unit * values[:-1] + 1e-300)).max())


@pytest.mark.ci
@pytest.mark.slow_but("psi_s-float32")
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_energy_never_grows_by_exact_drag(method, dtype):
    # A sphere with M = m I: drifts and turns keep its kinetic energy, drag alone changes it, whatever h l / I.
    h, I6 = 0.1, np.array([10.0] * 3 + [1.0] * 3)
    cases = [Case(f"{k}", nu=oblique(1.0), Om=oblique(0.5), linear=k / h * I6, **SPHERE) for k in KAPPAS]
    cases += [Case(f"{k}", nu=oblique(1.0), Om=oblique(0.5), quadratic=k / h * I6, **SPHERE) for k in KAPPAS]
    fleet = ensemble(Group("", h, 200, tuple(cases), dragged=True))
    result = lw.solve(fleet, method, h=h, t1=20.0, save=lw.SaveAt(every=h), dtype=dtype)
    assert (np.asarray(result.status) == Status.OK).all()
    p = 10.0 * result.velocity.astype(float)
    pi = result.angular_velocity.astype(float)
    # Turns of a step round each component some ten times; in float32 energies below its smallest number are zero.
    energy = np.maximum(0.5 * (p * p).sum(-1) / 10.0 + 0.5 * (pi * pi).sum(-1), 1e-70)
    assert rising(energy, UNIT[dtype]) < 40.0


def matrices(n):
    """n full matrices (6, 6) with a positive semidefinite symmetric part, some of them singular, and a skew part."""
    rng = np.random.default_rng(4)
    A, B = rng.normal(size=(2, n, 6, 6))
    A[::3, :, 0] = 0.0
    return A @ np.swapaxes(A, 1, 2) + B - np.swapaxes(B, 1, 2)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=SLOW)])
def test_energy_never_grows_by_a_drag_matrix(dtype):
    h, n = 0.1, 4
    D = np.concatenate([k / h * matrices(n) for k in KAPPAS])
    I6 = np.diag([10.0] * 3 + [1.0] * 3)
    D = np.sqrt(I6) @ D @ np.sqrt(I6)
    m = len(D)
    b, R, nu, Om = random_states(3, 2 * m, 1.0, 0.5)
    quadratic = np.zeros((2 * m, 6, 6))
    quadratic[m:] = np.concatenate([k / h * I6 for k in KAPPAS]).reshape(-1, 6, 6).repeat(n, axis=0)
    linear = np.concatenate([D, np.zeros((m, 6, 6))])
    fleet = lw.Ensemble.from_states(
        BRAKED, b, R, nu, Om, {"drag_matrix.linear": linear, "drag_matrix.quadratic": quadratic}
    )
    result = lw.solve(fleet, "psi_s", h=h, t1=20.0, save=lw.SaveAt(every=h), dtype=dtype)
    assert (np.asarray(result.status) == Status.OK).all()
    v, Om = result.velocity.astype(float), result.angular_velocity.astype(float)
    energy = 5.0 * (v**2).sum(-1) + 0.5 * (Om**2).sum(-1)
    # What a solve of 6 equations rounds grows with the size of its right side, the energy of the step before.
    assert rising(np.maximum(energy, 1e-30 * energy[0]), UNIT[dtype]) < 400.0


@pytest.mark.ci
@pytest.mark.parametrize("kappa", KAPPAS)
def test_a_linear_drag_matrix_step(kappa):
    # Two stages with gamma = 1 - 1/sqrt(2) on v' = -z v / h: v <- v (1 + (2 gamma - 1) z) / (1 + gamma z)^2.
    h, M = 0.1, 10.0
    drag = {"drag_matrix.linear": [kappa * M / h * np.eye(6)], "drag_matrix.quadratic": np.zeros((1, 6, 6))}
    fleet = one(BRAKED, nu=(2.0, 0.0, 0.0), parameters=drag)
    u = lw.solve(fleet, "psi_s", h=h, t1=h).velocity[-1, 0, 0]
    factor = (1.0 + (2.0 * GAMMA - 1.0) * kappa) / (1.0 + GAMMA * kappa) ** 2
    # The difference 1 - ... loses digits where little is left: absolute, in units of what there was.
    assert u == pytest.approx(2.0 * factor, rel=1e-13, abs=1e-15)
    # Against e^-z: order 2, z^3 (1/6 - gamma + gamma^2 ...) < z^3 / 6 for small z; never larger than at the start.
    assert abs(u) <= 2.0
    assert kappa > 1e-2 or abs(u / 2.0 - np.exp(-kappa)) <= kappa**3 / 6.0 + 1e-15


def fall(case, h, steps):
    """Speed and depth of a vertical fall, step by step in extended precision: half a drift, kick, drag, kick, half a drift."""
    real = extended.REAL
    M, lin, q = (real(x) for x in (case.M[2], case.linear[2], case.quadratic[2]))
    half, a = real(h) / 2, real(case.net) / M
    z = real(h) * lin / M
    decay, s = np.exp(-z), (-np.expm1(-z) / z if z else real(1.0))
    w, b = real(0.0), real(0.0)
    for _ in range(steps):
        b += half * w
        w += half * a
        w = w * decay / (1 + real(h) * q / M * s * abs(w))
        w += half * a
        b += half * w
    return float(w), float(b)


@pytest.mark.ci
@pytest.mark.slow_for("float64*")
@pytest.mark.parametrize("dtype", ["float64", "float32", pytest.param("float32_compensated", marks=SLOW)])
def test_falling_and_rising_for_a_day(dtype):
    h, steps = 1.0, 100_000
    drag = {"linear": (0.0, 0.0, 2.0, 0.0, 0.0, 0.0), "quadratic": (0.0, 0.0, 20.0, 0.0, 0.0, 0.0)}
    cases = (
        Case("neutral", net=0.0),
        Case("sinking", net=3.0, **drag),
        Case("rising", net=-3.0, **drag),
        Case("sinking, linear drag", net=0.1, linear=drag["linear"]),
        Case("sinking freely", net=1e-3),
        Case("rising freely", net=-1e-3),
        # At rest; with it the kernel is the one of test_extremes.py.
        Case("righted", Br=(0.0, 0.0, -1.0), linear=(1.0,) * 6, quadratic=(1.0,) * 6),
    )
    fleet = ensemble(Group("", h, steps, cases, dragged=True))
    result = lw.solve(fleet, "psi_s", h=h, t1=h * steps, dtype=dtype)
    assert result.status.counts() == {"ok": len(cases)}
    unit = UNIT[dtype]
    for i, case in enumerate(cases):
        p = fleet.parameters(0, len(cases))
        net = float(p["vehicle.mass"][i] * p["environment.gravity"][i] - p["vehicle.buoyancy"][i])
        w, b = fall(Case("", net=net, linear=case.linear, quadratic=case.quadratic), h, steps)
        # Round-off of one sign: each step adds a unit of w and, to what moves, one of b; constants are rounded once, 4 units.
        # Compensated: what a step changes is rounded, not b; drag forgets earlier errors of w within M / l steps.
        kept = 1.0 if dtype == "float32_compensated" else min(steps, 100.0 if any(case.linear) else steps)
        bound_w = unit * (4.0 + kept) * abs(w)
        place = 4.0 * abs(b) if dtype == "float32_compensated" else steps * abs(b) / 2.0
        assert abs(result.velocity[-1, i, 2] - w) <= bound_w, case.name
        assert abs(result.position[-1, i, 2] - b) <= h * steps * bound_w + unit * place, case.name
        # Nothing else moves: R = I exactly, no drift to the side.
        assert np.array_equal(result.attitude[-1, i], np.eye(3))
        assert not result.position[-1, i, :2].any()


def spheroid(h, steps):
    """Attitude of a free symmetric top after so many steps of psi_s, exactly.

    F_0 is the first half step's rotation and Z the turn about e3 with pi_1 = Z pi_0: by symmetry F_k = Z^k F_0 Z^-k, so
    R_k = R_0 (F_0 Z)^k Z^-k, and the powers are rotations by k times the angle.
    """
    case = Case("", J=(1.0, 1.0, 1.5), Om=(0.5, 0.0, 0.8), R=np.eye(3))
    body, x = twin(Group("", h, steps, (case,)))
    one = extended.D(x, body, extended.REAL(h) / 2)
    before, after = x.pi[0], one.pi[0]
    beta = np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])
    Z = about(np.array([0.0, 0.0, 1.0], dtype=extended.REAL), beta)
    G = one.R[0] @ Z
    axis = np.array([G[2, 1] - G[1, 2], G[0, 2] - G[2, 0], G[1, 0] - G[0, 1]])
    size = np.sqrt(axis @ axis)
    angle = np.arctan2(size, G[0, 0] + G[1, 1] + G[2, 2] - 1)
    n = 2 * steps
    return case, about(axis / size, n * angle) @ about(np.array([0.0, 0.0, 1.0], dtype=extended.REAL), -n * beta)


def about(axis, angle):
    """The rotation about a unit axis."""
    H = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3, dtype=extended.REAL) + np.sin(angle) * H + (1 - np.cos(angle)) * H @ H


@pytest.mark.ci
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("steps", [100_000, pytest.param(100_000_000, marks=SLOW)])
def test_many_steps_of_a_free_spheroid(steps, dtype):
    h = 0.1
    case, R = spheroid(h, steps)
    # Other lanes: the same body and start, turned by another attitude: the same numbers in other digits.
    turned = lw.notation.matrix_from_rotation_vector(np.outer(np.linspace(0.0, 2.0, 8), [0.4, -0.7, 0.2]))
    cases = tuple(Case("", M=case.M, J=case.J, Om=case.Om, R=one) for one in turned)
    fleet = ensemble(Group("", h, steps, cases))
    samples = lw.SaveAt(every=h * steps / 10)
    result = lw.solve(fleet, "psi_s", h=h, t1=h * steps, save=samples, dtype=dtype)
    assert result.status.counts() == {"ok": 8}
    Q, unit = result.attitude.astype(float), UNIT[dtype]
    orthogonal = np.abs(np.swapaxes(Q, -1, -2) @ Q - np.eye(3)).max()
    E, L = result.energy, invariants.angular_momentum(result)
    drift = np.abs(E / E[0] - 1.0).max(), np.abs(L - L[0]).max() / np.linalg.norm(L[0, 0])
    # Two products a step, each rounding to either side: a walk of sqrt(2 steps) units, ten deviations of three entries.
    walk = 30.0 * unit * np.sqrt(2.0 * steps)
    if dtype == "float64":
        # Every product of R is also an error of phase, and one of pi a rate of it: sqrt(steps^3 / 3) in a random walk.
        phase = unit * h * np.sqrt(steps / 3.0) * steps * 3.0 + 2.0 * walk
        assert np.abs(Q[-1, 0] - R.astype(float)).max() < phase
        assert orthogonal < walk
    else:
        # Renormalised every 128 steps: 128 products of 6e-8 to either side, three entries.
        assert orthogonal < 3e-6
    assert max(drift) < walk
