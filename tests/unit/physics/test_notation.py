# SPDX-License-Identifier: Apache-2.0
"""The border between the two notations: every way across and back.

Tolerance of the rotations: a handful of products and sums of numbers up to 1 (or 2), each rounded at 1.1e-16: 2e-15.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgvi_warp.physics import notation

ROUND = 2e-15
EYE = np.eye(3)


def about(axis, angle):
    """Elementary right-handed rotation, written out."""
    c, s = np.cos(angle), np.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def random_rotations(n, seed=0):
    return notation.matrix_from_rotation_vector(2.0 * np.random.default_rng(seed).normal(size=(n, 3)))


def assert_rotations(R):
    # An entry of R is off by up to 8 roundings, so one of R^T R by twice that. det(I + E) = 1 + tr(E) bounds det R by three
    # halves of it, and the determinant's own products round some ten times.
    defect = 2.0 * ROUND
    np.testing.assert_allclose(np.swapaxes(R, -1, -2) @ R, np.broadcast_to(EYE, R.shape), rtol=0, atol=defect)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, rtol=0, atol=1.5 * defect + ROUND)


def test_rotation_vector_about_each_axis():
    angle = 0.7
    for i, axis in enumerate("xyz"):
        R = notation.matrix_from_rotation_vector(angle * EYE[i])
        np.testing.assert_allclose(R, about(axis, angle), rtol=0, atol=ROUND)


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), st.floats(-18, 2))
def test_rotation_vector_gives_rotations_of_any_size(f, exponent):
    f = np.array(f) * 10.0**exponent
    R = notation.matrix_from_rotation_vector(f)
    assert_rotations(R)
    np.testing.assert_allclose(R @ f, f, rtol=0, atol=ROUND * max(1.0, np.abs(f).max()))  # the axis stays


def test_rotation_vector_near_zero():
    f = np.array([1e-9, -2e-9, 3e-9])
    # exp(f^) = I + f^ + O(|f|^2 / 2): the rest is 7e-18
    linear = EYE + np.array([[0, -f[2], f[1]], [f[2], 0, -f[0]], [-f[1], f[0], 0]])
    np.testing.assert_allclose(notation.matrix_from_rotation_vector(f), linear, rtol=0, atol=1e-17)
    np.testing.assert_array_equal(notation.matrix_from_rotation_vector(np.zeros((2, 3))), [EYE, EYE])


def test_euler_angles_are_fossens():
    roll, pitch, yaw = np.deg2rad([10.0, -20.0, 130.0])
    expected = about("z", yaw) @ about("y", pitch) @ about("x", roll)
    R = notation.matrix_from_euler_deg(np.array([[10.0, -20.0, 130.0], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(R, [expected, EYE], rtol=0, atol=ROUND)
    # Nose up, z down: body x points to -z.
    np.testing.assert_allclose(notation.matrix_from_euler_deg([0.0, 90.0, 0.0]) @ EYE[0], -EYE[2], rtol=0, atol=ROUND)


def test_quaternion_of_a_known_rotation():
    q = np.array([np.cos(0.35), 0.0, 0.0, np.sin(0.35)])
    np.testing.assert_allclose(notation.matrix_from_quaternion(q), about("z", 0.7), rtol=0, atol=ROUND)
    np.testing.assert_allclose(notation.quaternion_from_matrix(about("z", 0.7)), q, rtol=0, atol=ROUND)


@pytest.mark.parametrize("length", [1e-300, 1e-3, 7.0, 1e300])
def test_quaternion_length_does_not_matter(length):
    q = np.array([0.5, -0.5, 0.5, 0.5])
    np.testing.assert_allclose(
        notation.matrix_from_quaternion(length * q), notation.matrix_from_quaternion(q), rtol=0, atol=ROUND
    )


def test_quaternion_and_matrix_there_and_back():
    R = random_rotations(2000)
    q = notation.quaternion_from_matrix(R)
    assert q.shape == (2000, 4)
    assert (q[:, 0] >= 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, rtol=0, atol=ROUND)
    np.testing.assert_allclose(notation.matrix_from_quaternion(q), R, rtol=0, atol=ROUND)


@pytest.mark.parametrize("axis", [*EYE, *-EYE, np.array([0.6, -0.8, 0.0]), np.array([0.0, -0.6, 0.8])])
@pytest.mark.parametrize("short_of_half_a_turn", [0.0, 1e-12, 1e-8, 1e-3])
def test_every_branch_of_the_quaternion_near_half_a_turn(axis, short_of_half_a_turn):
    R = notation.matrix_from_rotation_vector((np.pi - short_of_half_a_turn) * axis)
    q = notation.quaternion_from_matrix(R)
    assert q[0] >= 0.0
    np.testing.assert_allclose(notation.matrix_from_quaternion(q), R, rtol=0, atol=ROUND)


def test_a_quaternion_of_nan_is_nan():
    assert np.isnan(notation.quaternion_from_matrix(np.full((1, 3, 3), np.nan))).all()


def test_momenta():
    rng = np.random.default_rng(1)
    A, B = rng.normal(size=(2, 50, 3, 3))
    M, J = A @ np.swapaxes(A, 1, 2) + 3.0 * EYE, B @ np.swapaxes(B, 1, 2) + 3.0 * EYE
    nu, Om = rng.normal(size=(2, 50, 3))
    p, pi = notation.to_momenta(M, J, nu, Om)
    np.testing.assert_allclose(p[7], M[7] @ nu[7], rtol=1e-14)  # p = M nu
    np.testing.assert_allclose(pi[7], J[7] @ Om[7], rtol=1e-14)  # pi = J Om


def test_momenta_with_shared_matrices():
    nu, Om = np.random.default_rng(2).normal(size=(2, 5, 3))
    p, pi = notation.to_momenta(np.diag([1.0, 2.0, 3.0])[None], np.diag([4.0, 5.0, 6.0])[None], nu, Om)
    np.testing.assert_array_equal(p, nu * [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(pi, Om * [4.0, 5.0, 6.0])


def test_a_diagonal_inertia_keeps_its_axes_and_order():
    J = np.diag([5.72, 5.29, 5.46])[None]
    Q, d = notation.principal_axes(J)
    np.testing.assert_array_equal(Q, EYE[None])
    np.testing.assert_array_equal(d, [[5.72, 5.29, 5.46]])


def test_principal_axes():
    turns = random_rotations(200, seed=3)
    given_d = np.random.default_rng(4).uniform(1.0, 5.0, size=(200, 3))
    J = (turns * given_d[:, None, :]) @ np.swapaxes(turns, 1, 2)
    J = 0.5 * (J + np.swapaxes(J, 1, 2))
    J[3] = np.diag([3.0, 1.0, 2.0])  # one that is diagonal among others
    Q, d = notation.principal_axes(J)
    assert_rotations(Q)
    # eigh is backward stable: J = Q diag(d) Q^T to a few roundings of |J| < 5
    np.testing.assert_allclose((Q * d[:, None, :]) @ np.swapaxes(Q, 1, 2), J, rtol=0, atol=2e-14)
    np.testing.assert_array_equal(Q[3], EYE)


def test_principal_axes_of_repeated_inertias():
    turn = random_rotations(1, seed=5)[0]
    J = turn @ np.diag([2.0, 2.0, 3.0]) @ turn.T
    Q, d = notation.principal_axes(0.5 * (J + J.T)[None])
    assert_rotations(Q)
    np.testing.assert_allclose(np.sort(d[0]), [2.0, 2.0, 3.0], rtol=1e-14)


def test_vectors_into_axes_and_out():
    Q = random_rotations(20, seed=6)
    v = np.random.default_rng(7).normal(size=(20, 3))
    inside = notation.rotate_into(Q, v)
    np.testing.assert_allclose(inside[4], Q[4].T @ v[4], rtol=0, atol=ROUND)
    np.testing.assert_allclose(notation.rotate_out(Q, inside), v, rtol=0, atol=4 * ROUND)


@pytest.mark.parametrize("members", [1, 63, 64, 128, 640, 700])
@pytest.mark.parametrize("operation", [np.maximum, np.minimum, np.logical_or])
def test_numbers_of_all_members_together(members, operation):
    values = np.random.default_rng(members).normal(size=(members, 2, 3)) * (np.arange(6).reshape(2, 3) > 1)
    for each in (values, values.transpose(0, 2, 1), values[:, 0, 0]):
        np.testing.assert_array_equal(notation.reduced(operation, each), operation.reduce(each, axis=0))


@pytest.mark.parametrize("count", [1, 3, 64, 65, 1024, 1030])
@pytest.mark.parametrize("beside", [1e-320, -1.0, np.nan, np.inf])
def test_one_entry_beside_a_diagonal_is_seen_among_many_matrices(count, beside):
    matrices = np.zeros((count, 3, 3))
    matrices[:, [0, 1, 2], [0, 1, 2]] = [1.0, -2.0, 0.0]
    matrices[:, 0, 1] = -0.0
    assert np.array_equal(notation.only_diagonal(matrices), np.tile([1.0, -2.0, 0.0], (count, 1)))
    matrices[count // 2, 2, 1] = beside
    assert notation.only_diagonal(matrices) is None
    assert notation.only_diagonal(np.swapaxes(matrices, -1, -2)) is None
