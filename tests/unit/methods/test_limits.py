# SPDX-License-Identifier: Apache-2.0
"""The steps that methods bear: the tables against linear theory, and what follows for methods that nobody measured.

The tables hold what runs of 0.3 rad show (tests/methods/test_warning_limits.py, of every method in the long tests). Linear
theory knows only small motions, and ends at the first instability of a composition, however narrow: measured limits lie
between 0.44 and 1.95 of it, the same of psi_s and psi_w and of a method and its adjoint.
"""

import math

import numpy as np
import pytest

from lgvi_warp.methods import limits
from lgvi_warp.methods.method import Method
from lgvi_warp.studies.stability import limits as theory

TABLES = {"munk": limits.MUNK, "restoring": limits.RESTORING}


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
    assert limits.imaginary_limit(name) == pytest.approx(exact, abs=1e-3)
    assert limits.rotation_limit(Method(name)) == limits.imaginary_limit(name)


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


@pytest.mark.parametrize("name", ["rk4", "rk8", "cg3"])
def test_explicit_drag_ends_where_it_grows(name):
    """h l / I at which one step of v' = -l v, by the method's own stages, no longer damps."""
    tableau, limit = Method(name).tableau, theory.drag_limit(name)
    n = len(tableau.b)

    def growth(x):
        A = np.array([[*row[:n], *[0.0] * (n - len(row[:n]))] for row in tableau.a[:n]])
        return abs(1.0 - x * np.array(tableau.b) @ np.linalg.solve(np.eye(n) + x * A, np.ones(n)))

    assert growth(limit - 2e-3) <= 1.0 < growth(limit + 2e-3)
