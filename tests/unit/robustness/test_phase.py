# SPDX-License-Identifier: Apache-2.0
"""Phase margins of loops that are made up: beside fine grids and beside the eigenvalues of the turned closed loop."""

import numpy as np
import pytest
from scipy.linalg import expm

from lgvi_warp.robustness.linear.disk import Response
from lgvi_warp.robustness.linear.phase import loci, phase, phases
from lgvi_warp.robustness.linear.sampled_loop import Opened

T = 0.1


def radius(A, B, C, angle):
    """Largest eigenvalue of the loop, closed with a phase on its demand."""
    return np.abs(np.linalg.eigvals(A + np.exp(-1j * angle) * B @ C)).max()


def held(F, G, C):
    """The loop w = C x of x' = F x + G w, held for a period."""
    n, r = G.shape
    both = expm(T * np.block([[F, G], [np.zeros((r, n + r))]]))
    return both[:n, :n], both[:n, n:], C


def double_integrator(kp, kd, J=11.0):
    return held(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / J]]), np.array([[-kp, -kd]]))


@pytest.mark.parametrize(("kp", "kd"), [(6.0, 9.0), (0.1, 20.0), (60.0, 30.0), (1e-3, 1.0)])
def test_a_held_double_integrator_in_closed_form(kp, kd, J=11.0):
    """With t = tan^2(angle/2) the gain crosses 1 at the root of a quadratic; the phase there is elementary."""
    a, b = T**2 / (2.0 * J), 2.0 * kd / T
    roots = np.roots([(a * b) ** 2 - 4.0, a**2 * (kp**2 + b**2), (a * kp) ** 2])
    (t,) = roots[roots > 0.0]
    angle = 2.0 * np.arctan(np.sqrt(t))
    margin, at = phase(Response(*double_integrator(kp, kd)))
    # Below angles of 1e-3 round-off of a double pole is 1e-16 of their square.
    assert at == pytest.approx(angle, rel=1e-9)
    assert margin == pytest.approx(np.arctan(b * np.sqrt(t) / kp) - angle / 2.0, rel=1e-9)
    assert (
        radius(*double_integrator(kp, kd), margin * (1.0 - 1e-6))
        < 1.0
        < radius(*double_integrator(kp, kd), margin * (1.0 + 1e-6))
    )


def made_up(rng, r):
    """A random loop with r inputs that settles: integrators, lags, and vibrations with little damping."""
    while True:
        n = int(rng.integers(2, 7))
        F = np.zeros((2 * n, 2 * n))
        for i in range(n):
            w, damping = rng.uniform(0.2, 20.0), rng.choice([0.0, 0.01, 0.3, 1.0])
            F[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, 1.0], [-(w**2) * (rng.random() > 0.4), -2.0 * damping * w]]
        G = rng.normal(size=(2 * n, r))
        K = rng.normal(size=(r, 2 * n)) * rng.uniform(0.01, 3.0)
        model = held(F, G, K)
        if radius(*model, 0.0) < 1.0 - 1e-4:
            return model


@pytest.mark.ci
@pytest.mark.parametrize("r", [1, 2, 3])
def test_loops_that_are_made_up(r):
    rng = np.random.default_rng(r)
    finite = several = 0
    for _ in range(10):
        A, B, C = made_up(rng, r)
        response = Response(A, B, C)
        margin, at = phase(response)
        # The smallest of all crossings of a grid 20 times as fine, of 1e-3 of the margin.
        angles = np.geomspace(1e-5, 1.0, 8_000) * np.pi
        values = loci(response(angles))
        above = np.abs(values) > 1.0
        where = np.nonzero(above[1:] != above[:-1])
        several += len(where[0]) > 1
        if not len(where[0]):
            assert margin == np.inf
            assert np.isnan(at)
            continue
        finite += 1
        coarse = np.abs(np.angle(-values[where])).min()
        assert margin <= coarse + 1e-2
        turns = np.linspace(0.0, margin, 20)
        stable = [radius(A, B, C, turn) < 1.0 and radius(A, B, C, -turn) < 1.0 for turn in turns[:-1]]
        assert all(stable)
        beyond = min(margin * (1.0 + 1e-6) + 1e-9, np.pi)
        assert max(radius(A, B, C, beyond), radius(A, B, C, -beyond)) > 1.0 - 1e-7
        closed = np.abs(np.linalg.eigvals(A + np.exp(-1j * np.array([margin, -margin]))[:, None, None] * (B @ C)))
        assert np.abs(closed - 1.0).min() < 1e-8
    assert finite > 5
    assert several > 2


def test_a_gain_that_touches_1_between_two_angles_of_the_grid_is_seen():
    """A vibration that crosses 1 twice within a thousandth of its frequency."""
    w, z = 3.0, 2e-4
    F, G = np.array([[0.0, 1.0], [-(w**2), -2.0 * z * w]]), np.array([[0.0], [1.0]])
    top = np.abs(Response(*held(F, G, np.array([[0.0, -1.0]])))(np.linspace(0.999, 1.001, 2_001) * w * T)).max()
    for factor, crosses in ((1.001, True), (0.999, False)):
        margin, at = phase(Response(*held(F, G, np.array([[0.0, -factor / top]]))))
        assert np.isfinite(margin) == crosses
        if crosses:
            assert at == pytest.approx(w * T, rel=1e-3)


def test_columns_and_one_component_of_several():
    """Loops side by side: the margin of both at once is the worse of the two; that of one, with the other closed, its own."""
    one, two = double_integrator(6.0, 9.0), double_integrator(60.0, 30.0)
    blocks = [np.block([[a, np.zeros((len(a), b.shape[1]))], [np.zeros((len(b), a.shape[1])), b]])
              for a, b in zip(one, two, strict=True)]  # fmt: skip
    each = [phase(Response(*model)) for model in (one, two)]
    both = Opened(np.array([0]), *(block[None] for block in blocks))
    found = phases([tuple(blocks)], T)
    assert found["phase"][0] == pytest.approx(min(margin for margin, _ in each), rel=1e-9)
    assert found["phase_frequency"][0] == pytest.approx(min(each)[1] / T, rel=1e-9)
    for i in range(2):
        alone = both.at(i)
        assert phase(Response(alone.A[0], alone.B[0], alone.C[0])) == pytest.approx(each[i], rel=1e-7)
    assert [len(column) for column in phases([], T).values()] == [0, 0]
