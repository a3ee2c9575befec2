# SPDX-License-Identifier: Apache-2.0
"""The initial states of members, in the axes, about the origin and in the units of the kernel.

The order of every sum is written out. lgvi_kernels/packing/states.py uses the same order, and so gives the same bits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lgvi_warp.physics import notation

# Of a state: attitude row by row, position, momenta p and pi.
NUMBERS = 18


class Starts(NamedTuple):
    """Numbers from which the states of m members are built, each (1 or m, ...).

    Attitude (3, 3), position (3,) [m], velocity (3,) [m/s] and angular velocity (3,) [rad/s] in the user's axes.
    water: (3,) [m/s], velocity of the water in the user's body axes; None if it rests.
    axes, origin: the kernel's, in the user's axes, (3, 3) and (3,) [m]; None if they are the user's.
    mass, moments: (3,) [kg] and (3,) [kg m2] in the kernel's axes, if momenta are their products with velocities alone.
    inertia: (6, 6) in other cases; else None.
    scale: () [kg m2], divisor of momenta. inertial: whether the state contains R p instead of p.
    """

    attitude: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    water: np.ndarray | None
    axes: np.ndarray | None
    origin: np.ndarray | None
    mass: np.ndarray | None
    moments: np.ndarray
    inertia: np.ndarray | None
    scale: np.ndarray
    inertial: bool


def times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Products A v, (n, k), of matrices (1 or n, k, d) and vectors (1 or n, d)."""
    # One number of all members after another: rows of a few numbers would take several times as long.
    (_, k, d), n = matrices.shape, max(len(matrices), len(vectors))
    columns = np.moveaxis(matrices, 0, -1)
    total, product = np.empty((2, k, n))
    np.multiply(columns[:, 0], vectors[:, 0], out=total)
    for i in range(1, d):
        total += np.multiply(columns[:, i], vectors[:, i], out=product)
    return np.ascontiguousarray(total.T)


def into(axes: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Products Q^T v, (n, 3), of matrices (1 or n, 3, 3) and vectors (1 or n, 3)."""
    return times(np.swapaxes(axes, 1, 2), vectors)


def _summed(terms: np.ndarray) -> np.ndarray:
    """Sum over the last dimension, from the first term to the last."""
    total = terms[..., 0] + terms[..., 1]
    for i in range(2, terms.shape[-1]):
        total += terms[..., i]
    return np.asarray(total)


def momenta(starts: Starts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Attitudes (1 or m, 3, 3) and scaled momenta p and pi (1 or m, 3), in the form of states."""
    R, nu, Om = starts.attitude, starts.velocity, starts.angular_velocity
    if starts.origin is not None:
        nu = nu + notation.cross(Om, starts.origin)
    if starts.water is not None:
        nu = nu - starts.water
    if starts.axes is not None:
        Q = starts.axes
        R = _summed(R[:, :, None, :] * np.swapaxes(Q, 1, 2)[:, None, :, :])
        nu, Om = into(Q, nu), into(Q, Om)
    if starts.mass is not None:
        p, pi = starts.mass * nu, starts.moments * Om
    else:
        assert starts.inertia is not None
        both = times(starts.inertia, np.concatenate(np.broadcast_arrays(nu, Om), axis=1))
        p, pi = both[:, :3], both[:, 3:]
    if starts.inertial:
        p = times(R, p)
    scale = starts.scale[:, None]
    return R, p / scale, pi / scale


def write_rows(starts: Starts, rows: np.ndarray, compensated: bool) -> None:
    """Write the states into rows (m, fields of a state)."""
    R, rows[:, 12:15], rows[:, 15:NUMBERS] = momenta(starts)
    rows[:, :9] = R.reshape(-1, 9)
    rows[:, 9:12] = starts.position
    if starts.origin is not None:
        rows[:, 9:12] += times(starts.attitude, starts.origin)
    if compensated:
        low = rows[:, :NUMBERS] - rows[:, :NUMBERS].astype(np.float32)
        rows[:, NUMBERS:] = np.where(np.isfinite(low), low, 0.0)
    else:
        rows[:, NUMBERS:] = 0.0
