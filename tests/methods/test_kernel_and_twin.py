# SPDX-License-Identifier: Apache-2.0
"""The Warp kernel against the NumPy twin: every method and solver, diagonal and full J and M, both precisions."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.reference import advance, rotation
from tests.support.tools import (
    METHODS,
    PAIRS,
    TURN,
    body_of,
    chosen,
    difference,
    expected,
    from_state,
    last,
    one,
    scene_of,
    to_state,
)

M, J = np.array([188.8, 193.8, 198.8]), np.array([5.46, 5.29, 5.72])
SHAPES = {
    "diagonal": (np.diag(M), np.diag(J)),
    "isotropic mass": (200.0 * np.eye(3), np.diag(J)),
    "full mass": (TURN @ np.diag(M) @ TURN.T, np.diag(J)),
    "full inertia": (np.diag(M), TURN @ np.diag(J) @ TURN.T),
    "both full": (TURN.T @ np.diag(M) @ TURN, TURN @ np.diag(J) @ TURN.T),
}
STATE = {"b": (0.0, 0.0, 10.0), "R": TURN.T, "nu": (0.6, 0.6, 0.5), "Om": (0.3, 0.8, -0.5)}


def both(shape, method, solver, steps, dtype="float64", iterations=None, h=0.01):
    """The state after so many steps by the kernel and by the twin."""
    scene = scene_of(*SHAPES[shape], net=-2.56, moment=(0.3, -0.2, -8.5))
    body = body_of(scene)
    way = lw.Method(method, solver, iterations, tolerance=None if iterations is None else 0.5)
    result = lw.solve(one(scene, **STATE), way, h=h, t1=steps * h, dtype=dtype)
    twin = rotation.SOLVERS[solver]

    def solve(a, J):
        return twin(a, J, iterations)

    x = to_state(body, *(np.array(value) for value in STATE.values()))
    x = advance.advance(x, body, PROGRAMS[method], h, steps, solve=solve)
    assert result.status.counts() == {"ok": 1}
    return last(result), from_state(body, x)


# Masses that differ with every method; other masses with the method that has a map for each part; each solver once.
QUICK = ("diagonal-*-quartic", "*-psi-quartic", "both full-psi_s-cayley", "both full-psi_s-newton")


@pytest.mark.ci
@pytest.mark.slow_but(*QUICK)
@pytest.mark.parametrize(("method", "solver"), PAIRS)
@pytest.mark.parametrize("shape", SHAPES)
def test_one_step(shape, method, solver):
    # A step is some 300 operations: 1e-13 is a few hundred round-offs.
    kernel, twin = both(shape, method, solver, 1)
    assert difference(kernel, twin) < 1e-13


@pytest.mark.ci
@pytest.mark.slow_but(*QUICK)
@pytest.mark.parametrize(("method", "solver"), PAIRS)
@pytest.mark.parametrize("shape", ["diagonal", "both full"])
def test_five_seconds(shape, method, solver):
    # 500 steps of round-off 1e-15, and an error growth of about 10 by t = 5: 1e-11 (mathematics, section 4).
    kernel, twin = both(shape, method, solver, 500)
    assert difference(kernel, twin) < 1e-11


@pytest.mark.ci
@pytest.mark.slow_but("diagonal-psi_s", "* full-psi_s", "full *-psi_s")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", SHAPES)
def test_float32(shape, method):
    # Round-off u = 6e-8 enters R, p and pi some three times a step and adds up as a random walk; the start's errors
    # grow by at most 10 until t = 5 (measured for these bodies): 6e-8 sqrt(3 * 500) 10 = 2.3e-5.
    kernel, twin = both(shape, method, "quartic", 500, "float32")
    assert difference(kernel, twin) < 2.3e-5


@pytest.mark.ci
@pytest.mark.slow_but("psi_s-*")
@pytest.mark.parametrize(("method", "key"), [("psi", "Psi"), ("psi_s", "PsiS"), ("psi_1", "Psi1")])
def test_float32_on_the_paper_example(method, key, example, scene):
    result = lw.solve(lw.Ensemble(scene), method, h=0.01, t1=5.0, dtype="float32")
    assert difference(last(result), expected(example[f"{key}_h0.01"]["5"])) < 1e-5


@pytest.mark.ci
@pytest.mark.parametrize(
    ("solver", "iterations"),
    chosen(
        [("quartic", 0), ("quartic", 1), ("quartic", 2), ("cayley", 0), ("cayley", 1), ("newton", 0), ("newton", 1)],
        lambda solver, iterations: (solver, iterations) in (("quartic", 1), ("cayley", 0)),
    ),
)
def test_fixed_iterations_make_the_same_error(solver, iterations):
    # At h = 0.3 few iterations are far from converged, and the kernel must be wrong in the same way.
    kernel, twin = both("both full", "psi_s", solver, 1, iterations=iterations, h=0.3)
    exact = both("both full", "psi_s", solver, 1, h=0.3)[1]
    assert difference(kernel, twin) < 1e-13
    if iterations < 2:
        assert difference(twin, exact) > 1e-11


# Registers of AVX-512 and of AVX2 and one lane, as on a GPU, in the short tests; two lanes in test_explicit_orders.py.
@pytest.mark.ci
@pytest.mark.parametrize(
    ("width", "dtype"),
    chosen(
        [(width, dtype) for dtype in ("float64", "float32") for width in (1, 2, 4, 8, 16)],
        lambda width, dtype: (dtype, width) in (("float64", 1), ("float64", 8), ("float32", 8)),
    ),
)
def test_every_width(width, dtype, example, scene):
    fleet = lw.Ensemble(scene, members=19)
    result = lw.solve(fleet, "psi", h=0.01, t1=5.0, dtype=dtype, width=width)
    bound = 1e-11 if dtype == "float64" else 1e-5
    for member in (0, 7, 18):
        assert difference(last(result, member), expected(example["Psi_h0.01"]["5"])) < bound


KEYS = {"phi": "Phi", "phi_adjoint": "PhiAdj", "psi": "Psi", "psi_s": "PsiS", "psi_1": "Psi1"}


@pytest.mark.ci
@pytest.mark.slow_but("*-quartic")
@pytest.mark.parametrize(("method", "solver"), PAIRS)
def test_states_of_the_paper_example(method, solver, example, scene):
    entry = example[f"{KEYS[method]}_h0.01"]
    fleet = lw.Ensemble(scene, members=1)
    way = lw.Method(method, solver)
    assert difference(last(lw.solve(fleet, way, h=0.01, t1=0.01)), expected(entry["one_step"])) < 1e-14 * 10
    result = lw.solve(fleet, way, h=0.01, t1=50.0, save=lw.SaveAt(at=[5.0]))
    at_5 = tuple(field[1, 0] for field in result.samples.values())
    assert difference(at_5, expected(entry["5"])) < 1e-11
    # Two correct codes agree to 1e-9 at t = 50 (mathematics, section 4: the growth of round-off).
    assert difference(last(result), expected(entry["50"])) < 1e-9
