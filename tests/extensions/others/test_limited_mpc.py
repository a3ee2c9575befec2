# SPDX-License-Identifier: Apache-2.0
"""Model predictive control with unequal limits and limits of outputs: exact programs and the twin."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import lgvi_warp as lw
from lgvi_warp.extensions.others.twin import linear_mpc
from tests.support.refusals import refused, says

T = 0.1
STATES = ("position[2]", "velocity[2]", "angular_velocity[1]")
NUMBERS = dict(
    A=np.array([[1.0, T, 0.0], [0.0, 0.95, 0.01], [0.0, 0.02, 0.9]]),
    B=np.array([[T * T / 40.0, 0.0], [T / 20.0, 0.001], [0.0, T / 5.0]]),
    Q=np.array([3.0, 0.1, 0.2]), R=np.array([1e-4, 1e-3]), limit=np.array([5.0, 2.0]), horizon=6,
    lower=np.array([-1.0, -2.0]), outputs=np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.2]]),
    output_limit=np.array([0.04, 0.06]), excess_cost=np.array([200.0, 50.0]),
)  # fmt: skip
NAMES = dict(states=STATES, inputs=("Z", "M"), tracked=("position[2]", "angular_velocity[1]"))
RATES = dict(rate_limit=np.array([20.0, 10.0]))


def law(**more):
    return lw.control.LinearMPC(**NAMES, **(NUMBERS | more))


def twin(**more):
    part = linear_mpc.LinearMPC(**NAMES, **(NUMBERS | more))
    part.begin()
    return part


def exact(H, f, C, room, cost):
    """Inputs of least v H v / 2 + f v + cost e, by the dual problem, bounded least squares, whose active sets are SciPy's."""
    # Multipliers between 0 and the cost; a limit gives way by `eps` times its multiplier, far below what is asserted.
    eps, root = 1e-9, np.linalg.cholesky(H)
    A, b = np.linalg.solve(root, C.T), np.linalg.solve(root, f)
    whole = np.concatenate([A, np.sqrt(eps) * np.eye(len(room))])
    wanted = np.concatenate([-b, -room / np.sqrt(eps)])
    found = lsq_linear(whole, wanted, (0.0, cost), method="bvls", tol=1e-15, max_iter=10_000)
    return -np.linalg.solve(H, f + C.T @ found.x)


def off_the_optimum(v, H, f, C, room, cost):
    """Bound of the distance from the optimum, by the gap to the dual problem at multipliers that nearly belong to v."""
    left, soft = room - C @ v, np.isfinite(cost)
    near, root = np.abs(left) < 1e-6, np.linalg.cholesky(H)
    # Of what is beyond its limit the multiplier is the cost.
    multipliers = np.where(left <= -1e-6, np.where(soft, cost, 0.0), 0.0)
    if near.any():
        slope = H @ v + f + C.T @ multipliers
        multipliers[near] = lsq_linear(C[near].T, -slope, (0.0, cost[near]), tol=1e-15).x
    primal = v @ H @ v / 2.0 + f @ v + cost[soft] @ np.maximum(-left[soft], 0.0)
    dual = -(np.linalg.solve(root, f + C.T @ multipliers) ** 2).sum() / 2.0 - room @ multipliers
    return np.sqrt(2.0 * max(primal - dual, 0.0) / np.linalg.eigvalsh(H)[0])


@pytest.mark.parametrize("more", [{}, RATES, RATES | {"R": np.array([1e-6, 1e-5])}], ids=["", "rates", "cheap"])
def test_problems_are_solved_as_by_an_exact_program(more):
    # Parts of the limits; the promise is 1e-3.
    part, rng, beyond, worst = twin(**more), np.random.default_rng(2), 0, 0.0
    change = T * RATES["rate_limit"] / part.limit if "rate_limit" in more else None
    scale = np.tile(part.limit, part.horizon)
    for _ in range(12):
        x, d = rng.normal(size=3) * (1.0, 0.1, 0.3), 0.01 * rng.normal(size=3)
        H, f = part.problem(x, d)
        H, f, sides = scale[:, None] * H * scale, scale * f, part.sides(x, d, rng.uniform(-0.2, 0.9, 2), change)
        found = linear_mpc.softened(H, f, *sides, 50)
        C, room, cost = sides
        soft = np.isfinite(cost)
        excess = np.maximum(C @ found - room, 0.0)
        assert excess[~soft].max() < 1e-8
        assert off_the_optimum(found, H, f, *sides) < 1e-3
        if "R" not in more:  # of these SciPy's active sets find all
            worst = max(worst, np.abs(found - exact(H, f, *sides))[:2].max())
        beyond += excess[soft].max() > 1e-6
    assert worst < 1e-5
    # Some limits of outputs cannot be kept, and some can.
    assert 0 < beyond < 12


@pytest.mark.parametrize("more", [{}, RATES | {"horizon": 4}], ids=["", "rates"])
@pytest.mark.kernel
def test_check_controller_finds_nothing(more):
    report = lw.laws.check_controller(law(**more), twin=twin(**more))
    assert report.ok, str(report)


def test_numbers_that_do_not_go_together_are_refused():
    says(refused(law, lower=[6.0, -2.0]), "linear_mpc.lower", "is not below limit; give numbers below [5.0, 2.0]")
    says(refused(law, excess_cost=None), "linear_mpc.excess_cost = '': is missing beside the others of outputs")
    says(refused(law, horizon=101), "linear_mpc.horizon = 101: is too long; give 1 to 100")
