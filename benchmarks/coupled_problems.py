# SPDX-License-Identifier: Apache-2.0
"""Bodies whose M and J are coupled, forces on them, their truth, and the NumPy twin's steps: for tables and tests."""

import numpy as np
from scipy.integrate import solve_ivp

from lgvi_warp.reference import coupled, rotation
from lgvi_warp.reference.coupled import PROGRAMS, CoupledState, Direction
from lgvi_warp.reference.rotation import cay, cross, hat

# "Numbers to reproduce": the general body and its first state.
GENERAL = np.array(
    [
        [24, 0.3, -0.2, 0.1, 0.9, 0.6],
        [0.3, 42, 0.5, -0.8, 0.15, 1.8],
        [-0.2, 0.5, 48, -0.5, -1.5, 0.05],
        [0.1, -0.8, -0.5, 0.98, 0.032, -0.066],
        [0.9, 0.15, -1.5, 0.032, 3.59, 0.074],
        [0.6, 1.8, 0.05, -0.066, 0.074, 3.326],
    ]
)
MG, BUOYANCY = 196.0, 198.0
MOMENT = MG * np.array([0.03, -0.02, 0.06]) - BUOYANCY * np.array([0.01, 0.0, -0.02])
START = (
    np.array([1.0, -2.0, 10.0]),
    cay(np.array([0.5, 0.25, -0.25])),
    np.array([1.0, 0.2, -0.1]),
    np.array([0.3, -0.4, 0.5]),
)
AT_5 = (
    np.array([4.3944400541961, -1.6749447690584, 7.9192874311700]),
    np.array(
        [
            [-0.2580576144412, 0.8320956970024, 0.4909409523140],
            [-0.7310763881934, 0.1640240883815, -0.6622865037555],
            [-0.6316118921102, -0.5298234134697, 0.5659978518372],
        ]
    ),
    np.array([0.1129933497652, 0.8665851392687, 0.0081797986589]),
    np.array([3.2088456165880, 0.8907608655936, -1.6589323325913]),
)
# Kahan & Li, orders 6 and 8, from section 2 of mathematics.md: the first half of each palindrome.
KL6 = (0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.08221359629355080023)
KL8 = (
    0.13020248308889008088,
    0.56116298177510838456,
    -0.38947496264484728641,
    0.15884190655515560090,
    -0.39590389413323757734,
    0.18453964097831570709,
    0.25837438768632204729,
    0.29501172360931029887,
)

# A tether of 30 N/m from the inertial origin to a point off the user's origin.
STIFFNESS, KNOT = 30.0, np.array([-0.4, 0.1, 0.05])
NEAR = (np.array([0.3, -0.2, 0.4]), *START[1:])
HELD = np.array([3.0, -1.0, 2.0, 0.4, -0.2, 0.3])
DRAGS = (
    Direction(np.array([1.0, 0.1, 0.0, 0.0, 0.05, 0.0]), 4.0, 20.0),
    Direction(np.array([0.0, 1.0, 0.2, 0.3, 0.0, 0.1]), 9.0, 60.0),
    Direction(np.array([0.1, 0.0, 0.0, 1.0, 0.2, -0.3]), 0.0, 3.0),
)


def hydrostatic(b, R):
    """Weight and buoyancy: net z, (mg rg - B rb) x z."""
    return (MG - BUOYANCY) * R[2], cross(MOMENT, R[2])


def tethered(b, R):
    f, m = hydrostatic(b, R)
    pull = -STIFFNESS * R.T @ (b + R @ KNOT)
    return f + pull, m + cross(KNOT, pull)


def held(b, R):
    f, m = hydrostatic(b, R)
    return f + HELD[:3], m + HELD[3:]


def with_coupling(k, seed=3):
    """The general body's M and J with another C, scaled to the coupling norm k."""
    C = np.random.default_rng(seed).normal(size=(3, 3))
    I6 = GENERAL.copy()
    I6[:3, 3:], I6[3:, :3] = 1e-3 * C, 1e-3 * C.T
    scale = 1e-3 * k / coupled.coupling(I6)
    I6[:3, 3:], I6[3:, :3] = scale * C, scale * C.T
    return I6


def remus(zg):
    """REMUS 100, Prestero 2001: m 30.48 kg, centre of gravity zg [m] below the origin, added mass of the thesis."""
    m, yaw = 30.48, 1.93
    C = -m * hat(np.array([0.0, 0.0, zg])) + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -yaw], [0.0, yaw, 0.0]])
    M, J = np.diag([m + 0.93, m + 35.5, m + 35.5]), np.diag([0.177 + 0.0704, 3.45 + 4.88, 3.45 + 4.88])
    return np.block([[M, C], [C.T, J]])


def damping(I6, drags, v):
    """The sum over the directions of -twist (l + q |w|) w, w = twist.v."""
    return sum((-z.twist * (z.linear + z.quadratic * abs(z.twist @ v)) * (z.twist @ v) for z in drags), np.zeros(6))


def truth(I6, wrench, start, t, drags=()):
    """b, R, nu, Om at t of Kirchhoff's equations in the user's frame: p' = p x Om + f, pi' = pi x Om + p x nu + m."""

    def rate(_, y):
        R, mu = y[3:12].reshape(3, 3), y[12:]
        v = np.linalg.solve(I6, mu)
        wrenches = np.concatenate(wrench(y[:3], R)) + damping(I6, drags, v)
        turned = np.concatenate([cross(mu[:3], v[3:]), cross(mu[3:], v[3:]) + cross(mu[:3], v[:3])])
        return np.concatenate([R @ v[:3], (R @ hat(v[3:])).ravel(), turned + wrenches])

    y = np.concatenate([start[0], start[1].ravel(), I6 @ np.concatenate(start[2:])])
    y = solve_ivp(rate, (0.0, t), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    v = np.linalg.solve(I6, y[12:])
    return y[:3], y[3:12].reshape(3, 3), v[:3], v[3:]


def walk(name, I6, start, h, steps, wrench, newtons=None, stages=(1.0,)):
    """b, R, nu, Om after so many steps."""
    body = coupled.reduce(I6, name)
    x = body.to_reduced(*start)
    for _ in range(steps):
        for g in stages:
            x = coupled.step(x, body, g * h, PROGRAMS[name], wrench, newtons)
    return body.from_reduced(x)


def damped_step(x, body, h, name, wrench, drags, last=coupled.E_adjoint):
    x = coupled.step(coupled.E(x, body, 0.5 * h, drags), body, h, PROGRAMS[name], wrench)
    return last(x, body, 0.5 * h, drags)


def errors(x, y):
    """Euclidean norms of the differences of b, R, nu, Om: those that the document prints."""
    return np.array([np.linalg.norm(u - v) for u, v in zip(x, y, strict=True)])


def w_case(rng, spin, slip):
    """A random reduced body and p, pi with h = 1, |Om| = spin, and |p| |S| / Jmin = slip."""
    body = coupled.reduce_w(with_coupling(rng.uniform(0.1, 0.9), int(rng.integers(1000))))
    p, Om = rng.normal(size=(2, 3))
    p *= slip * body.Js[0] / (rotation.norm(p) * np.linalg.norm(body.S, 2))
    Om *= spin / rotation.norm(Om)
    return body, p, body.Js * Om + body.S @ p


def two_form(x):
    """The canonical form at p, pi, left-trivialised; rows and columns (v, w, dp, dpi). See tests/support/two_form.py."""
    S = np.zeros((12, 12))
    S[6:, :6], S[:6, 6:] = np.eye(6), -np.eye(6)
    S[3:6, :3] = S[:3, 3:6] = hat(x.p)
    S[3:6, 3:6] = hat(x.pi)
    return S


def moved(x, d):
    """The state moved by d (12,): R^T db, the rotation vector of R^T R', dp, dpi."""
    return CoupledState(x.b + x.R @ d[:3], x.R @ rotation.exp(d[3:6]), x.p + d[6:9], x.pi + d[9:])


def coordinates(x, centre):
    """The move from centre to x, to second order: enough for a derivative at the centre."""
    relative = centre.R.T @ x.R
    w = rotation.vee(relative - relative.T) / 2
    return np.concatenate([centre.R.T @ (x.b - centre.b), w, x.p - centre.p, x.pi - centre.pi])


def symplectic_defect(name, h, I6, newtons=None, eps=1e-3):
    """max |DPsi^T S DPsi - S| of one step, by central differences of order 6."""
    body = coupled.reduce(I6, name)
    x = body.to_reduced(*NEAR)

    def image(d):
        return coupled.step(moved(x, d), body, h, PROGRAMS[name], tethered, newtons)

    centre = image(np.zeros(12))
    columns = []
    for e in eps * np.eye(12):
        d = [coordinates(image(k * e), centre) - coordinates(image(-k * e), centre) for k in (1, 2, 3)]
        columns.append((45.0 * d[0] - 9.0 * d[1] + d[2]) / (60.0 * eps))
    D = np.array(columns).T
    return np.abs(D.T @ two_form(centre) @ D - two_form(x)).max()
