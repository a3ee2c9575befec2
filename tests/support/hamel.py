# SPDX-License-Identifier: Apache-2.0
"""The motion that a Lagrangian of a rigid body gives, by Hamel's equations and differences: no law of the package is used."""

import numpy as np

import lgvi_warp as lw


def hat(v):
    return np.cross(np.eye(3), v)


def turn(v):
    return lw.notation.matrix_from_rotation_vector(np.asarray(v))


def slopes(lagrangian, b, R, v, Om, t):
    """Derivatives of L(b, R, v, Om, t) by b, by turns of the body, by v and by Om: by steps along the imaginary axis."""
    e = 1e-30j * np.eye(3)
    moved = (
        [(b + e[i], R, v, Om, t) for i in range(3)],
        [(b, R @ (np.eye(3) + hat(e[i])), v, Om, t) for i in range(3)],
        [(b, R, v + e[i], Om, t) for i in range(3)],
        [(b, R, v, Om + e[i], t) for i in range(3)],
    )
    return tuple(np.array([lagrangian(*x).imag / 1e-30 for x in each]) for each in moved)


def left_over(lagrangian, b, R, v, Om, dv, dOm):
    """(6,) What Hamel's equations leave: dP/dt - dL/db, and dK/dt + Om x K less the derivative by turns."""

    def momenta(s):
        return np.concatenate(slopes(lagrangian, b + s * v, R @ turn(s * Om), v + s * dv, Om + s * dOm, s)[2:])

    # The derivative along the way to the fourth power of 1e-3.
    d = 1e-3
    change = (8.0 * (momenta(d) - momenta(-d)) - momenta(2.0 * d) + momenta(-2.0 * d)) / (12.0 * d)
    by_place, by_turns, _, K = slopes(lagrangian, b, R, v, Om, 0.0)
    return change + np.concatenate([-by_place, np.cross(Om, K) - by_turns])


def by_lagrangian(lagrangian, b, R, v, Om):
    """(dv/dt, dOm/dt) at t = 0: the equations are linear in them."""
    none = left_over(lagrangian, b, R, v, Om, np.zeros(3), np.zeros(3))
    matrix = np.stack([left_over(lagrangian, b, R, v, Om, e[:3], e[3:]) - none for e in np.eye(6)], axis=1)
    return np.split(np.linalg.solve(matrix, -none), 2)
