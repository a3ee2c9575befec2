# SPDX-License-Identifier: Apache-2.0
"""Laws against exact solutions: each is stated in its test, and so is why the tolerance is what it is."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import terms
from tests.support.loops import torpedo
from tests.support.tools import one, slope

GRAVITY = 10.0
# Zeros would leave the kernel. With numbers below round-off in their place all tests here share a few kernels.
NET, ARM, DRAG = 2.0**-44, (0.0, 0.0, -1e-30), np.full(6, 1e-30)
WRENCH, CURRENT = terms.Wrench(force=(1e-30, 0.0, 0.0), torque=ARM), terms.Current(velocity=(1e-30, 0.0, 0.0))


def sphere(net=NET, center=ARM):
    """A body of 20 kg whose added mass is the same on every axis, to round-off."""
    return lw.Vehicle(
        20.0, inertia=(0.4, 0.4, 0.4), added_mass=(10.0, 10.0, 10.0 + 2.0**-48), buoyancy=20.0 * GRAVITY - net,
        center_of_buoyancy=center,
    )  # fmt: skip


def drag_of(linear=DRAG, quadratic=DRAG):
    """Drag along the six axes."""
    return terms.Drag(linear=DRAG + linear, quadratic=DRAG + quadratic)


def run(vehicle, terms, state, h, t1, method="psi_s", **named):
    """The result of one member; kernels of width 1 are sooner compiled, and of no use to other tests."""
    scene = lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), terms=terms)
    return lw.solve(one(scene, **state), method, h=h, t1=t1, **named)


@pytest.mark.ci
@pytest.mark.slow_for("psi", "psi_1*")
@pytest.mark.parametrize("method", ["psi_s", "psi_1", "psi_x", "psi"])
def test_terminal_fall(method):
    # M w' = net - q w^2 from rest: w = w_e tanh(t / tau), w_e = sqrt(net / q), tau = M / sqrt(net q).
    net, q, M = 30.0, 40.0, 30.0
    drag = [drag_of(quadratic=(0.0, 0.0, q, 0.0, 0.0, 0.0))]
    steps = np.array([0.08, 0.04, 0.02])
    errors = []
    for h in steps:
        w = run(sphere(net), drag, {}, h, 0.8, method, width=1 if method == "psi_x" else None).velocity[-1, 0, 2]
        errors.append(abs(w - np.sqrt(net / q) * np.tanh(0.8 * np.sqrt(net * q) / M)))
    # Second order; the next term of the error moves a slope between such steps by a few hundredths.
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)
    assert max(errors) < 1e-2


@pytest.mark.slow_for("psi_x*")
@pytest.mark.parametrize("kappa", [1e-6, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_drag_alone_is_exact_at_any_stiffness(method, kappa):
    # M v' = -l v: v0 e^-kappa after one step of h = kappa M / l. M v' = -q v^2: v0 / (1 + kappa), kappa = h q v0 / M.
    M, v0, h = 30.0, 2.0, 0.1
    for linear, quadratic, expected in (
        (kappa * M / h, 0.0, v0 * np.exp(-kappa)),
        (0.0, kappa * M / (h * v0), v0 / (1.0 + kappa)),
    ):
        drag = drag_of((linear, 0, 0, 0, 0, 0), (quadratic, 0, 0, 0, 0, 0))
        u = run(sphere(), [drag], {"nu": (v0, 0.0, 0.0)}, h, h, method).velocity[-1, 0, 0]
        # Round-off of e^-kappa is that of kappa times kappa; below the smallest number it is 0.
        assert u == pytest.approx(expected, rel=1e-15 * (10.0 + min(kappa, 700.0)), abs=1e-300)


@pytest.mark.ci
@pytest.mark.slow_for("psi_1*", "psi_x8*")
@pytest.mark.parametrize("method", ["psi_s", "psi_1", "psi_x", "psi_x8"])
def test_steady_helix(method):
    # Without forces p = lambda Om with lambda^2 = (J1 - J3) / (1/M1 - 1/M3) and Om in the plane of axes 1 and 3 is a relative
    # equilibrium: velocities in body axes stay, the path is a helix about Om.
    M, J, a, c = np.array([10.0, 20.0, 40.0]), np.array([3.0, 2.5, 2.0]), 0.6, 0.8
    size = np.sqrt((J[0] - J[2]) / (1.0 / M[0] - 1.0 / M[2]))
    Om = np.array([a, 0.0, c])
    nu = size * Om / M
    vehicle = lw.Vehicle(10.0, inertia=J, added_mass=M - 10.0, buoyancy=10.0 * GRAVITY - NET, center_of_buoyancy=ARM)
    steps, errors = np.array([0.1, 0.05, 0.025]), []
    for h in steps:
        r = run(vehicle, [], {"nu": nu, "Om": Om}, h, 2.0, method)
        turned = lw.notation.matrix_from_rotation_vector(2.0 * Om)
        n = np.linalg.norm(Om)
        H = np.array([[0, -c, 0], [c, 0, -a], [0, a, 0]]) / n
        angle = 2.0 * n
        V = 2.0 * (np.eye(3) + (1 - np.cos(angle)) / angle * H + (1 - np.sin(angle) / angle) * H @ H)
        errors.append(np.abs(r.position[-1, 0] - V @ nu).max() + np.abs(r.attitude[-1, 0] - turned).max())
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)


@pytest.mark.ci
@pytest.mark.slow_but("psi_s")
@pytest.mark.parametrize("method", ["psi_s", "psi_x", "psi"])
def test_equilibrium_pitch_of_a_trim_moment(method):
    # Buoyancy z below... -B r x z balances a held torque: B |z_b| sin(pitch) = torque. Where all forces vanish a kick does
    # nothing, so the equilibrium of the equations is that of every method, whatever the step.
    lever, torque = 0.02, 1.5
    held = [terms.Wrench(torque=(0.0, torque, 0.0)), drag_of((10.0, 10.0, 10.0, 1.0, 1.0, 1.0)), CURRENT]
    r = run(sphere(center=(0.0, 0.0, -lever)), held, {}, 0.05, 100.0, method, width=1)
    pitch = -np.arcsin(r.attitude[-1, 0, 2, 0])
    assert pitch == pytest.approx(np.arcsin(torque / (200.0 * lever)), abs=1e-12)
    assert np.abs(r.velocity[-1]).max() < 1e-12
    assert np.abs(r.angular_velocity[-1]).max() < 1e-12


@pytest.mark.ci
@pytest.mark.slow_but("psi_s")
@pytest.mark.parametrize("method", ["psi_s", "psi_1", "psi_x", "psi", "kl6(psi_s)"])
def test_a_steady_current_only_carries(method):
    # In the frame of the water everything is as in still water: positions differ by u t, velocities by R^T u.
    u = np.array([0.3, -0.2, 0.05])
    vehicle = torpedo(19.9 * GRAVITY, (0.01, 0.005, -0.02))
    drag = terms.Drag(linear=(3.0, 4.0, 5.0, 0.3, 0.4, 0.5), quadratic=(10.0, 30.0, 40.0, 1.0, 2.0, 3.0))
    R = lw.notation.matrix_from_rotation_vector(np.array([0.3, -0.4, 0.8]))
    nu, Om = np.array([1.2, 0.3, -0.2]), (0.3, -0.4, 0.5)
    still = run(vehicle, [drag], {"R": R, "nu": nu, "Om": Om}, 0.02, 4.0, method)
    current = [drag, WRENCH, terms.Current(velocity=u)]
    moving = run(vehicle, current, {"R": R, "nu": nu + R.T @ u, "Om": Om}, 0.02, 4.0, method, width=1)
    # 200 steps of round-off. In psi the current is a part of the iteration of Phi*, to 1e-14 of the momenta each.
    bound = 2e-12
    assert np.abs(moving.position[-1] - still.position[-1] - 4.0 * u).max() < bound
    assert np.abs(moving.attitude[-1] - still.attitude[-1]).max() < bound
    assert np.abs(moving.velocity[-1, 0] - still.velocity[-1, 0] - still.attitude[-1, 0].T @ u).max() < bound


@pytest.mark.ci
def test_a_neutral_body_at_rest_goes_with_accelerating_water():
    # rho V = m: the water's acceleration pushes the body as it pushes the water. R = I, M anisotropic: no relative motion.
    schedule = terms.CurrentProfile(depths=(0.0, 100.0), velocities=((0.5, 0.0, 0.0), (0.5, 0.0, 0.0)))
    vehicle, state = torpedo(20.0 * GRAVITY - NET, ARM), {"b": (0.0, 0.0, 10.0), "nu": (0.5, 0.0, 0.0)}
    r = run(vehicle, [schedule], state, 0.05, 10.0, width=1)
    assert np.abs(r.position[-1, 0] - (5.0, 0.0, 10.0)).max() < 1e-12


@pytest.mark.ci
def test_shear_lifts_a_sphere_that_falls_through_it():
    # A neutral sphere of mass m and added mass a in u = s b3 along north: (m + a) nu_1' = -m s nu_3, and by Auton's lift
    # (m + a) nu_3' = -a s nu_1. From nu = (0, 0, w) over ground v_1 = w sqrt(a / m) sinh(k t) and v_3 = w cosh(k t).
    s, w, t, h = 0.1, 0.5, 10.0, 0.05
    body = sphere()
    m, a = body.mass, body.added_mass[0, 0]
    k = s * np.sqrt(m * a) / (m + a)
    profile = terms.CurrentProfile(
        depths=(-1000.0, 1000.0), velocities=((-1000.0 * s, 0.0, 0.0), (1000.0 * s, 0.0, 0.0))
    )
    r = run(body, [profile], {"nu": (0.0, 0.0, w)}, h, t, width=1)
    speed = w * np.array([np.sqrt(a / m) * np.sinh(k * t), 0.0, np.cosh(k * t)])
    way = w / k * np.array([np.sqrt(a / m) * (np.cosh(k * t) - 1.0), 0.0, np.sinh(k * t)])
    # Order 2: a part (s h)^2 of a change that is as large as w, or w t.
    assert r.velocity[-1, 0] == pytest.approx(speed, abs=(s * h) ** 2 * w)
    assert r.position[-1, 0] == pytest.approx(way, abs=(s * h) ** 2 * w * t)
