# SPDX-License-Identifier: Apache-2.0
"""Quadratic drag matrices that create energy are refused, whatever their units: the least power by descents of SciPy."""

import numpy as np
import pytest
from scipy.optimize import minimize

import lgvi_warp as lw
from lgvi_warp.physics.terms.drag import creates_energy


def least_power(matrix, size, rng, starts):
    """The least of v.D |v| v over unit vectors in these units, from many starts."""
    scaled = matrix * size[:, None] * size**2

    def power(x):
        x = x / np.linalg.norm(x)
        return x @ scaled @ (np.abs(x) * x)

    return min(minimize(power, rng.normal(size=6), method="BFGS").fun for _ in range(starts)), np.abs(scaled).max()


def drawn(rng):
    """A matrix, some of whose entries beside the diagonal are as large as this, in units in which rates are large."""
    matrix = np.diag(rng.uniform(1.0, 5.0, 6)) + rng.uniform(0.5, 1.5) * rng.normal(size=(6, 6)) * (
        rng.random((6, 6)) < 0.4
    )
    size = 10.0 ** rng.uniform(-2.0, 2.0, 6)
    return matrix / size[:, None] / size**2, size


@pytest.mark.ci
@pytest.mark.parametrize("seeds", [range(12), pytest.param(range(12, 200), marks=pytest.mark.slow)])
def test_the_least_power_decides(seeds):
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        matrix, size = drawn(rng)
        (bad,), (velocity,) = creates_energy(matrix[None], True)
        least, largest = least_power(matrix, size, rng, 30)
        if abs(least) > 1e-6 * largest:
            assert bad == (least < 0.0), (seed, least)
        if bad:
            assert velocity @ matrix @ (np.abs(velocity) * velocity) < 0.0
        found.append(bad)
    assert 0 < sum(found) < len(found)


def test_units_do_not_decide():
    rng = np.random.default_rng(1)
    for _ in range(20):
        matrix, _ = drawn(rng)
        size = 10.0 ** rng.uniform(-3.0, 3.0, 6)
        other = matrix * size[:, None] * size**2
        assert creates_energy(matrix[None], True)[0] == creates_energy(other[None], True)[0]


def test_members_are_searched_as_one_is():
    matrices = np.array([drawn(np.random.default_rng(seed))[0] for seed in range(60)])
    together = creates_energy(matrices, True)[0]
    assert together.tolist() == [bool(creates_energy(matrix[None], True)[0][0]) for matrix in matrices]


def test_published_matrices_pass():
    for name in lw.vehicles.names():
        for term in lw.Scene.named(name).terms:
            if term.type == "drag_matrix":
                assert not creates_energy(term.quadratic[None], True)[0].any()
