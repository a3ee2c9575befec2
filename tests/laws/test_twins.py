# SPDX-License-Identifier: Apache-2.0
"""The twin's laws, sums, momenta and programs."""

import ast
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import lgvi_warp.reference
from lgvi_warp.reference import advance, energy, rotation
from lgvi_warp.reference.submaps import Body, State
from lgvi_warp.reference.terms import Law
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight
from tests.support.tools import TURN


@dataclass(frozen=True)
class Spring(Law):
    """A user's law that depends on b and R: U = k b3^2 / 2, a spring to the surface."""

    k: float

    def wrench(self, view):
        return -self.k * view.b[2] * view.down, np.zeros(3)

    def potential(self, view):
        return 0.5 * self.k * view.b[2] ** 2


LAWS = {"weight": Weight(net=-2.56), "restoring": Restoring(moment=np.array([0.3, -0.2, -8.5])), "spring": Spring(1.7)}


@pytest.mark.parametrize("law", [*LAWS, "all"])
def test_wrench_is_the_gradient_of_the_potential(law):
    # f = -R^T dU/db and mU . w = -dU/dw along R exp(hat(w)): differences of order 2 of a function that is at most
    # quadratic in b and bilinear in R: eps^2 = 1e-10 times a third derivative of 10, and 1e-15 / eps = 1e-10.
    terms = tuple(LAWS.values()) if law == "all" else (LAWS[law],)
    body, eps = Body(np.eye(3), np.eye(3), terms), 1e-5
    b, R = np.array([1.0, -2.0, 3.0]), TURN
    force, torque = body.wrench(b, R)
    for e, f, m in zip(np.eye(3), R @ force, torque, strict=True):
        slope_b = (body.potential(b + eps * e, R) - body.potential(b - eps * e, R)) / (2 * eps)
        turned = [body.potential(b, R @ rotation.exp(sign * eps * e)) for sign in (1.0, -1.0)]
        assert f == pytest.approx(-slope_b, abs=2e-9)
        assert m == pytest.approx(-(turned[0] - turned[1]) / (2 * eps), abs=2e-9)


def test_signs_of_the_paper():
    # Section IV: U = -(m - rho V) g b3 + B r.R^T e3, b3 down. A buoyant body (net < 0) is pushed up, and a centre of
    # buoyancy above that of gravity (r3 < 0) rights a body that rolled by +90 degrees about e1 (z = e2).
    R = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    body = Body(np.eye(3), np.eye(3), (Weight(net=-2.0), Restoring(moment=np.array([0.0, 0.0, -8.0]))))
    force, torque = body.wrench(np.zeros(3), R)
    np.testing.assert_allclose(R @ force, [0.0, 0.0, -2.0])
    np.testing.assert_allclose(torque, [-8.0, 0.0, 0.0])
    assert body.potential(np.array([0.0, 0.0, 5.0]), np.eye(3)) == pytest.approx(10.0 - 8.0)


def test_energy_and_momenta():
    M, J = TURN @ np.diag([1.0, 2.0, 3.0]) @ TURN.T, np.diag([1.0, 2.0, 2.5])
    nu, Om, b = np.array([0.4, -0.2, 1.0]), np.array([0.3, 0.1, -0.6]), np.array([1.0, 2.0, 3.0])
    x = State(b, TURN.T, M @ nu, J @ Om)
    # Eq. (2): <M nu, nu>/2 + <J Om, Om>/2 + U
    kinetic = 0.5 * nu @ M @ nu + 0.5 * Om @ J @ Om
    assert energy.energy(x, Body(M, J)) == pytest.approx(kinetic, rel=1e-14)
    assert energy.energy(x, Body(M, J, (Weight(net=2.0),))) == pytest.approx(kinetic - 6.0, rel=1e-14)
    np.testing.assert_allclose(energy.linear_momentum(x), TURN.T @ M @ nu, rtol=1e-14)
    spatial = TURN.T @ J @ Om + np.cross(b, TURN.T @ M @ nu)
    np.testing.assert_allclose(energy.angular_momentum(x), spatial, rtol=1e-13)


def test_programs_stages_and_trajectories():
    # K alone: p grows by h f for each step, whatever palindrome of stages with sum 1 divides it.
    body = Body(np.eye(3), np.eye(3), (Weight(net=2.0),))
    x = State(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))
    states = advance.trajectory(x, body, (("K", 0.25), ("K", 0.75)), 0.5, 6, every=2, stages=(1.5, -2.0, 1.5))
    np.testing.assert_allclose([s.p[2] for s in states], [0.0, 2.0, 4.0, 6.0], rtol=1e-14)
    np.testing.assert_array_equal(states[0].p, x.p)
    with pytest.raises(ValueError, match="divide"):
        advance.trajectory(x, body, (("K", 1.0),), 0.5, 5, every=2)


def test_the_twin_needs_numpy_only():
    allowed = {"numpy", "lgvi_warp", "dataclasses", "typing", "collections", "math", "zlib"}
    files = list(Path(lgvi_warp.reference.__file__).parent.rglob("*.py"))
    assert len(files) > 20
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) else []
            assert {n.split(".")[0] for n in names} <= allowed
            assert all(n.startswith("lgvi_warp.reference") for n in names if n.startswith("lgvi_warp"))
