# SPDX-License-Identifier: Apache-2.0
"""The solves of the rotations: each step of Newton's method squares the error, and what they converge to is the solution.

A wrong derivative still converges, only not so fast; a solve that goes on until it has converged hides it.
"""

import numpy as np
import pytest
import warp as wp

from lgvi_kernels.lanes.arithmetic import lane, symmetric3, vec3
from lgvi_kernels.lanes.flags import CPU_FLAGS
from lgvi_kernels.maps import coupled, rotation
from lgvi_warp.physics.notation import hat

pytestmark = pytest.mark.kernel

STEPS, COUNT, ROWS = 5, 64, 12
J = np.array([0.55, 0.8, 1.0])
S = np.array([[0.3, 0.04, -0.03], [0.04, 0.2, 0.05], [-0.03, 0.05, 0.25]])


@pytest.fixture(scope="module")
def iterates():
    """(a, P, {solver: the unknown after 0 to STEPS steps, shape (STEPS + 1, COUNT, 3) or (STEPS + 1, COUNT)})."""
    Lane, Symmetric = lane(8, wp.float64), symmetric3(8, wp.float64)

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def evaluate(rows: wp.array2d(dtype=Lane), out: wp.array2d(dtype=Lane)):
        i = wp.tid()
        a = vec3(rows[0, i], rows[1, i], rows[2, i])
        P = vec3(rows[3, i], rows[4, i], rows[5, i])
        J = vec3(rows[6, i], rows[7, i], rows[8, i])
        S = Symmetric()
        S.diagonal = vec3(rows[9, i], rows[10, i], rows[11, i])
        S.off_diagonal = vec3(rows[12, i], rows[13, i], rows[14, i])
        sg = coupled.trace_less(S, P)
        q = rotation.quartic_linear(a, J)
        c = rotation.cayley_start(a, J)
        f = rotation.newton_start(a, J)
        w = coupled.w_guess(a, P, J, S, sg)
        for k in range(wp.static(STEPS + 1)):
            n = k * wp.static(ROWS)
            out[n, i] = q
            out[n + 1, i] = c.x
            out[n + 2, i] = c.y
            out[n + 3, i] = c.z
            out[n + 4, i] = f.x
            out[n + 5, i] = f.y
            out[n + 6, i] = f.z
            out[n + 7, i] = w.x
            out[n + 8, i] = w.y
            out[n + 9, i] = w.z
            q = rotation.quartic_newton(q, rotation.quartic_value(q, a, J), a, J)
            c = rotation.cayley_newton(c, rotation.cayley_value(c, a, J), a, J)
            f = rotation.newton_newton(f, rotation.newton_value(f, a, J), a, J)
            w = coupled.w_newton(w, coupled.w_value(w, a, P, J, S, sg), a, P, J, S, sg)

    rng = np.random.default_rng(3)
    a, P = rng.normal(size=(2, COUNT, 3))
    a *= rng.uniform(0.1, 0.5, (COUNT, 1)) / np.linalg.norm(a / J, axis=1, keepdims=True)
    P *= rng.uniform(0.1, 0.4, (COUNT, 1)) / np.linalg.norm(P, axis=1, keepdims=True)
    constants = np.concatenate([J, S.diagonal(), (S[1, 2], S[2, 0], S[0, 1])])
    rows = np.concatenate([a.T, P.T, np.repeat(constants[:, None], COUNT, axis=1)])
    given = wp.array(rows.reshape(15, -1, 8), dtype=Lane, shape=(15, COUNT // 8), device="cpu")
    out = wp.zeros(((STEPS + 1) * ROWS, COUNT // 8), dtype=Lane, device="cpu")
    wp.launch(evaluate, COUNT // 8, inputs=[given], outputs=[out], device="cpu")
    values = np.moveaxis(out.numpy().reshape(STEPS + 1, ROWS, COUNT), 1, 2)
    return (
        a,
        P,
        {"quartic": values[..., :1], "cayley": values[..., 1:4], "newton": values[..., 4:7], "W": values[..., 7:10]},
    )


def cay(c):
    """The rotation with Cayley's vector c, shape (n, 3)."""
    C = np.array([hat(v) for v in c])
    return np.linalg.solve(np.eye(3) - C, np.eye(3) + C)


def turn(f):
    """The rotation by the vector f, shape (n, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(f).as_matrix()


def vee(A):
    """The vector of a skew matrix, shape (n, 3, 3)."""
    return np.stack([A[:, 2, 1], A[:, 0, 2], A[:, 1, 0]], axis=1)


def left_side(F, weight):
    """vee(F D - D F^T), D = tr(weight)/2 I - weight."""
    D = 0.5 * np.trace(weight) * np.eye(3) - weight
    return vee(F @ D - D @ np.swapaxes(F, 1, 2)), D


@pytest.mark.ci
@pytest.mark.parametrize(("solver", "rotation_of"), [("cayley", cay), ("newton", turn)])
def test_the_solution_solves_equation_24(iterates, solver, rotation_of):
    a, _, values = iterates
    F = rotation_of(values[solver][-1])
    np.testing.assert_allclose(left_side(F, np.diag(J))[0], a, atol=2e-15)


def test_the_solutions_are_one_rotation(iterates):
    a, _, values = iterates
    c = values["cayley"][-1]
    np.testing.assert_allclose(cay(c), turn(values["newton"][-1]), atol=5e-15)
    np.testing.assert_allclose(np.sum(a * c, axis=1), values["quartic"][-1, :, 0], atol=1e-15)


def test_the_solution_solves_the_coupled_equation(iterates):
    """vee(F Jd - Jd F^T) + (tr(F Sd) I - F Sd) P = a + S P, where h = 1 and a = pi - S P."""
    a, P, values = iterates
    F = cay(values["W"][-1])
    FS = F @ left_side(F, S)[1]
    left = left_side(F, np.diag(J))[0] + np.trace(FS, axis1=1, axis2=2)[:, None] * P - np.einsum("nij,nj->ni", FS, P)
    np.testing.assert_allclose(left, a + P @ S, atol=2e-15)


@pytest.mark.parametrize("solver", ["quartic", "cayley", "newton", "W"])
def test_each_step_squares_the_error(iterates, solver):
    values = iterates[2][solver]
    size = np.linalg.norm(values[-1], axis=1)
    errors = np.linalg.norm(values - values[-1], axis=2) / size
    before, after = errors[:3], errors[1:4]
    seen = (before > 1e-6) & (before < 0.1)
    assert seen[0].sum() > COUNT // 4
    assert seen[1].sum() > COUNT // 8
    assert (after[seen] < 3.0 * before[seen] ** 2 + 1e-14).all(), (after[seen] / before[seen] ** 2).max()
    assert errors[3].max() < 1e-6
    assert errors[4].max() < 1e-13
