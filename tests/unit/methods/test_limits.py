# SPDX-License-Identifier: Apache-2.0
"""The steps that methods bear: the tables against linear theory, and what follows for methods that nobody measured.

The tables hold what runs of 0.3 rad show (tests/methods/test_warning_limits.py, of every method in the long tests). Linear
theory knows only small motions, and ends at the first instability of a composition, however narrow: measured limits lie
between 0.44 and 1.95 of it, the same of psi_s and psi_w and of a method and its adjoint.
"""

import math

import numpy as np
import pytest

from lgvi_warp.accuracy.stability import limits as theory
from lgvi_warp.methods import limits
from lgvi_warp.methods.method import Method

TABLES = {"munk": limits.MUNK, "restoring": limits.RESTORING}


def square(tableau):
    """(A (s, s), b (s,)) of a Runge-Kutta method."""
    s = len(tableau.b)
    return np.array([[*row, *[0.0] * (s - len(row))] for row in tableau.a]), np.array(tableau.b)


@pytest.mark.parametrize("motion", TABLES)
def test_the_tables_are_near_linear_theory(motion):
    table = TABLES[motion]
    assert set(table) == set(limits.MUNK)
    for name, limit in table.items():
        assert 0.44 < limit / theory.oscillation_limit(name, motion) < 1.95, name
    # Both are the same map of such a motion.
    for name, other in (("phi", "phi_adjoint"), ("psi_s", "psi_w"), ("psi_x", "psi_x8")):
        assert table[name] == table[other]


@pytest.mark.parametrize(
    ("name", "exact"), [("rk4", 2.0 * math.sqrt(2.0)), ("cg3", math.sqrt(3.0)), ("rkmk4", 2.0 * math.sqrt(2.0))]
)
def test_a_steady_spin_ends_where_the_stability_function_does(name, exact):
    """|R(iy)| <= 1 up to 2 sqrt 2 of the classical method of order 4, up to sqrt 3 of order 3."""
    assert limits.spin_limit(name) == pytest.approx(exact, abs=1e-3)
    assert limits.rotation_limit(Method(name)) == limits.spin_limit(name)


@pytest.mark.parametrize(("name", "last"), [("rk5", 1 / 600), ("rk5_ck", 1 / 800)])
def test_a_steady_spin_by_six_stages_of_order_five(name, last):
    """R(z) is the exponential's series to z^5, then last z^6: the spin ends where it grows tenfold in 4000 steps."""
    A, b = square(Method(name).tableau)
    assert b @ np.linalg.matrix_power(A, 5) @ np.ones(6) == pytest.approx(last, rel=1e-12)

    def growth(y):
        return abs(sum((1j * y) ** k / math.factorial(k) for k in range(6)) - last * y**6)

    limit = limits.spin_limit(name)
    assert growth(limit - 1e-3) ** 4000 < 10.0 < growth(limit + 2e-3) ** 4000


def test_a_composition_bears_its_base_over_its_longest_stage():
    for base in ("psi_s", "psi_x"):
        measured = Method(f"kl6({base})")
        assert limits.oscillation_limit(measured, limits.MUNK) == limits.MUNK[f"kl6({base})"]
        only_base = {base: limits.MUNK[base]}
        longest = max(abs(stage) for stage in measured.stages)
        assert limits.longest_stage(measured) == longest
        assert limits.oscillation_limit(measured, only_base) == pytest.approx(limits.MUNK[base] / longest)
    assert limits.oscillation_limit(Method("gauss6"), limits.MUNK) == np.inf
    assert limits.rotation_limit(Method("kl6(psi_x)")) == pytest.approx(
        1.0 / limits.longest_stage(Method("kl6(psi_x)"))
    )
    assert limits.rotation_limit(Method("psi_s")) == np.inf


@pytest.mark.parametrize(("name", "halves"), [("phi_adjoint", 1.0), ("psi", 2.0)])
def test_the_iteration_for_the_forces_ends_in_sixty_rounds(name, halves):
    """v = v0 - x v by iteration, x the drag number over the part of the step that Phi* takes: it contracts by x a round."""

    def left(x):
        v, exact = 1.0, 1.0 / (1.0 + x)
        for _ in range(60):
            v = 1.0 - x * v
        return abs(v / exact - 1.0)

    x = theory.drag_limit(name) / halves
    assert left(0.98 * x) < 1e-14 < left(1.02 * x)


@pytest.mark.parametrize("name", ["rk4", "rk5_ck", "rk8", "cg3"])
def test_explicit_drag_ends_where_it_grows(name):
    """h l / I at which one step of v' = -l v, by the method's own stages, no longer damps."""
    (A, b), limit = square(Method(name).tableau), theory.drag_limit(name)

    def growth(x):
        return abs(1.0 - x * b @ np.linalg.solve(np.eye(len(b)) + x * A, np.ones(len(b))))

    assert growth(limit - 2e-3) <= 1.0 < growth(limit + 2e-3)
