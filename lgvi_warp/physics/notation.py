# SPDX-License-Identifier: Apache-2.0
"""Conversions between the user's notation (Fossen's) and Nordkvist & Sanyal's: momenta, principal axes, attitudes.

velocity = nu, angular_velocity = Om, position = b, attitude = R (body to inertial); p = M nu, pi = J Om.
Every function accepts any leading dimensions; a leading dimension of 1 is broadcast.
"""

from __future__ import annotations

import numpy as np

# A matrix whose off-diagonal elements are below this fraction of its largest is diagonal as given.
DIAGONAL = 1e-14
# The unit matrix, which takes longer to make than to use.
EYE = np.eye(3)
EYE.flags.writeable = False
# Members whose numbers are reduced side by side.
FOLD = 64
# Places of the entries of a 3x3 matrix off its diagonal, row by row.
OFF_DIAGONAL = [1, 2, 3, 5, 6, 7]
# How far from orthogonal an attitude may be: the round-off of one printed with ten digits.
ORTHOGONAL = 1e-9


def repeated(*arrays: np.ndarray) -> list[np.ndarray]:
    """Repeat single rows, so that all arrays have the same number of rows.

    Args:
        arrays: Arrays (1 or n, ...).

    Returns:
        Views (n, ...) of the arrays.
    """
    n = max(map(len, arrays))
    return [array if len(array) == n else np.broadcast_to(array, (n, *array.shape[1:])) for array in arrays]


def hat(a: np.ndarray) -> np.ndarray:
    """Skew-symmetric matrices of vectors, for which hat(a) times a vector v is the cross product of a and v.

    Args:
        a: Vectors (..., 3).

    Returns:
        Matrices (..., 3, 3).
    """
    matrices = np.zeros((*a.shape, 3))
    matrices[..., 2, 1], matrices[..., 0, 2], matrices[..., 1, 0] = a[..., 0], a[..., 1], a[..., 2]
    matrices[..., 1, 2], matrices[..., 2, 0], matrices[..., 0, 1] = -a[..., 0], -a[..., 1], -a[..., 2]
    return matrices


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products, as by np.cross, but three times as fast for few vectors.

    Args:
        a: Vectors (..., 3).
        b: Vectors (..., 3).

    Returns:
        a x b, (..., 3).
    """
    products = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        products[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return products


def to_momenta(M: np.ndarray, J: np.ndarray, nu: np.ndarray, Om: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Momenta of velocities, p = M nu and pi = J Om.

    Args:
        M: Mass matrix, (..., 3, 3) [kg].
        J: Inertia, (..., 3, 3) [kg m2].
        nu: Velocity, (..., 3) [m/s], in body axes.
        Om: Angular velocity, (..., 3) [rad/s], in body axes.

    Returns:
        p (..., 3) [N s] and pi (..., 3) [N m s].
    """
    return (M @ nu[..., None])[..., 0], (J @ Om[..., None])[..., 0]


def principal_axes(J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal axes Q and moments d of inertia: J = Q diag(d) Q^T, det Q = +1. A diagonal J keeps its axes and their order.

    Args:
        J: Inertia (n, 3, 3) [kg m2], symmetric.

    Returns:
        Q (n, 3, 3) and d (n, 3) [kg m2].
    """
    off = np.abs(J[:, ~np.eye(3, dtype=bool)]).max(axis=1)
    turned = off > DIAGONAL * np.abs(J).max(axis=(1, 2))
    Q = np.repeat(np.eye(3)[None], len(J), axis=0)
    d = np.einsum("nii->ni", J).copy()
    if turned.any():
        d[turned], Q[turned] = np.linalg.eigh(J[turned])
        Q[turned, :, 2] *= np.sign(np.linalg.det(Q[turned]))[:, None]
    return Q, d


def off_diagonal(matrices: np.ndarray) -> np.ndarray:
    """The off-diagonal entries of 3x3 matrices.

    Args:
        matrices: Matrices (n, 3, 3).

    Returns:
        Entries (n, 6), row by row.
    """
    return matrices.reshape(-1, 9)[:, OFF_DIAGONAL]


def reduced(operation: np.ufunc, values: np.ndarray) -> np.ndarray:
    """Reduce the numbers of all members by an operation, for example to the largest.

    Args:
        operation: np.maximum, np.minimum, np.logical_or or np.bitwise_or, for which the order of members does not matter.
        values: Numbers (n, ...).

    Returns:
        Numbers (...). Many members are processed in long rows, in a third of the time.
    """
    rows, shape = values.reshape(len(values), -1), values.shape[1:]
    if len(rows) % FOLD == 0 and len(rows) > FOLD and rows.flags.c_contiguous:
        rows = operation.reduce(rows.reshape(len(rows) // FOLD, -1), axis=0).reshape(FOLD, -1)
    return np.asarray(operation.reduce(rows, axis=0)).reshape(shape)


def only_diagonal(matrices: np.ndarray) -> np.ndarray | None:
    """Diagonals of 3x3 matrices, if all other entries are zero.

    Args:
        matrices: Matrices (n, 3, 3).

    Returns:
        Diagonals (n, 3); None if some matrix is not diagonal.
    """
    entries: np.ndarray = matrices
    if len(matrices) > FOLD:
        # All bits of an entry that some matrix has, but that of the sign: a third of the time.
        entries = reduced(np.bitwise_or, np.ascontiguousarray(matrices, np.float64).view(np.int64))[None] << 1
    diagonals = np.einsum("nii->ni", matrices)
    own = diagonals if entries is matrices else np.einsum("nii->ni", entries)
    return diagonals if np.count_nonzero(entries) == np.count_nonzero(own) else None


def rotations(R: np.ndarray, limit: float = ORTHOGONAL) -> np.ndarray:
    """Mask of matrices that are rotations within a tolerance.

    Args:
        R: Matrices (..., 3, 3).
        limit: Largest size of an entry of R^T R - I (I: identity), by default 1e-9.

    Returns:
        Mask (...), False for matrices that are not finite.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        close = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(-1, -2)) <= limit
        return np.asarray(close & (np.linalg.det(R) > 0.0))


def rotate_into(Q: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Components of vectors along other axes, Q^T v.

    Args:
        Q: Rotation matrix from the other axes to the user's axes, (..., 3, 3).
        vectors: Vectors (..., 3) in the user's axes.

    Returns:
        The same vectors (..., 3) in the other axes.
    """
    return np.matmul(np.swapaxes(Q, -1, -2), vectors[..., None])[..., 0]


def rotate_out(Q: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Components of vectors along the user's axes, Q v; the inverse of `rotate_into`.

    Args:
        Q: Rotation matrix from the other axes to the user's axes, (..., 3, 3).
        vectors: Vectors (..., 3) in the other axes.

    Returns:
        The same vectors (..., 3) in the user's axes.
    """
    return np.matmul(Q, vectors[..., None])[..., 0]


def matrix_from_rotation_vector(f: np.ndarray) -> np.ndarray:
    """Rotation matrix exp(hat(f)) by Rodrigues' formula; accurate to round-off also near f = 0.

    Args:
        f: Rotation vectors (..., 3) [rad].

    Returns:
        Matrices (..., 3, 3).
    """
    f = np.asarray(f, dtype=np.float64)
    angle = np.linalg.norm(f, axis=-1)[..., None, None]
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    H = hat(f)
    return np.eye(3) + a * H + b * (H @ H)


def matrix_from_quaternion(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of a quaternion.

    Args:
        q: Quaternions (..., 4), scalar first, of any length but 0.

    Returns:
        Matrices (..., 3, 3).
    """
    q = np.asarray(q, dtype=np.float64)
    q = q / np.abs(q).max(axis=-1, keepdims=True)  # so that its square neither overflows nor vanishes
    w, v = q[..., :1, None], q[..., 1:]
    norm = np.sum(q * q, axis=-1)[..., None, None]
    H = hat(v)
    return np.eye(3) + 2.0 * (w * H + H @ H) / norm


def quaternion_from_matrix(R: np.ndarray) -> np.ndarray:
    """Unit quaternion of a rotation matrix, by the method of Shepperd (1978), which divides by the largest component.

    Args:
        R: Rotation matrices (..., 3, 3).

    Returns:
        Quaternions (..., 4), scalar first; the scalar is not negative.
    """
    R = np.asarray(R, dtype=np.float64)
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    trace = xx + yy + zz
    four = np.stack([1 + trace, 1 + 2 * xx - trace, 1 + 2 * yy - trace, 1 + 2 * zz - trace], axis=-1)
    x, y, z = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    xy, xz, yz = R[..., 0, 1] + R[..., 1, 0], R[..., 0, 2] + R[..., 2, 0], R[..., 1, 2] + R[..., 2, 1]
    w2, x2, y2, z2 = np.moveaxis(four, -1, 0)
    rows = [[w2, x, y, z], [x, x2, xy, xz], [y, xy, y2, yz], [z, xz, yz, z2]]
    matrix = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    best = np.argmax(np.where(np.isnan(four), -1.0, four), axis=-1)
    q = np.take_along_axis(matrix, best[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0.0, -q, q)


def matrix_from_euler_deg(angles: np.ndarray) -> np.ndarray:
    """Rotation matrix Rz(yaw) Ry(pitch) Rx(roll), in Fossen's zyx convention.

    Args:
        angles: Roll, pitch and yaw, (..., 3) [deg].

    Returns:
        Matrices (..., 3, 3), body to inertial axes.
    """
    roll, pitch, yaw = np.moveaxis(np.deg2rad(np.asarray(angles, dtype=np.float64)), -1, 0)
    zero = np.zeros_like(roll)

    def about(*axis: np.ndarray) -> np.ndarray:
        return matrix_from_rotation_vector(np.stack(axis, axis=-1))

    return about(zero, zero, yaw) @ about(zero, pitch, zero) @ about(roll, zero, zero)
