# SPDX-License-Identifier: Apache-2.0
"""Members as columns of numbers for a filter: states, attitudes relative to their mean, and learned numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lgvi_warp.physics import notation
from lgvi_warp.physics.notation import matrix_from_rotation_vector

VECTORS = ("position", "velocity", "angular_velocity")


def mean_attitude(attitude: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) nearest to the weighted mean of rotations (n, 3, 3)."""
    U, _, V = np.linalg.svd(np.einsum("n,nij->ij", weights, attitude))
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V)


def rotation_vectors(attitude: np.ndarray) -> np.ndarray:
    """Rotation vectors (n, 3) of rotations (n, 3, 3)."""
    q = notation.quaternion_from_matrix(attitude)
    size = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(size, q[:, :1])
    return np.asarray(np.divide(angle, size, out=np.full_like(size, 2.0), where=size > 1e-12) * q[:, 1:])


def rows_of(
    states: Mapping[str, np.ndarray], learned: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ensemble (d, n) of position, velocity, angular velocity, rotation from the mean attitude and learned numbers.

    The mean attitude is the second result.
    """
    centre = mean_attitude(states["attitude"], weights)
    turns = rotation_vectors(np.einsum("ji,njk->nik", centre, states["attitude"]))
    return np.concatenate([*(states[name].T for name in VECTORS), turns.T, learned]), centre


def states_of(ensemble: np.ndarray, centre: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """States {field: (n, ...)} and learned numbers (p, n) of an ensemble (d, n)."""
    states = {name: ensemble[3 * i : 3 * i + 3].T.copy() for i, name in enumerate(VECTORS)}
    attitude = centre @ matrix_from_rotation_vector(ensemble[9:12].T)
    # Products of rotations, but for round-off, which a run would refuse after many updates.
    U, _, V = np.linalg.svd(attitude)
    states["attitude"] = U @ V
    return states, ensemble[12:]
