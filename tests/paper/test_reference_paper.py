# SPDX-License-Identifier: Apache-2.0
"""The twin against the paper's printed equations, the states of its example, and the truth in quadruple precision."""

import functools

import numpy as np
import pytest

from lgvi_warp.methods.method import COMPOSITIONS, PROGRAMS
from lgvi_warp.reference import advance, classical, energy, paper, rotation
from lgvi_warp.reference.submaps import Body
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight
from tests.support.tools import TURN, difference, expected, from_state, slope, to_state

KEYS = {"phi": "Phi", "phi_adjoint": "PhiAdj", "psi": "Psi", "psi_s": "PsiS", "psi_1": "Psi1", "cg3": "CG3",
        "rkmk4": "RKMK4"}  # fmt: skip
ORDERS = {"phi": 1, "phi_adjoint": 1, "psi": 2, "psi_s": 2, "psi_1": 2, "cg3": 3, "rkmk4": 4}
CLASSICAL = {"cg3": classical.cg3, "rkmk4": classical.rkmk4}
PRINTED = {"phi": paper.phi, "phi_adjoint": paper.phi_adjoint, "psi": paper.psi}


def run(method, x, body, h, steps, every=None):
    """States (b, R, nu, Om) after every `every` steps, the start first; `every` is all the steps if not given."""
    every = every or steps
    if method in PROGRAMS:
        states = advance.trajectory(x, body, PROGRAMS[method], h, steps, every, solve=rotation.quartic)
        return [from_state(body, state) for state in states]
    return classical_run(CLASSICAL[method], from_state(body, x), body, h, steps, every)


def classical_run(step, y, body, h, steps, every):
    states = [y]
    for k in range(1, steps + 1):
        y = step(*y, body, h)
        if k % every == 0:
            states.append(y)
    return states


def errors(x, y):
    """Norms of the errors of b, R, nu, Om."""
    return np.array([np.linalg.norm(u - v) for u, v in zip(x, y, strict=True)])


def half_digit(printed):
    """Half a unit of the last digit of a number written as text."""
    mantissa, _, exponent = printed.partition("e")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


@functools.cache
def symmetric(seed, low, high):
    """A symmetric (3, 3) matrix with eigenvalues between low and high, low + low > high."""
    Q = rotation.exp(np.random.default_rng(seed).normal(size=3))
    A = Q @ np.diag(np.random.default_rng(seed).uniform(low, high, 3)) @ Q.T
    return 0.5 * (A + A.T)


@pytest.mark.parametrize("solver", rotation.SOLVERS)
@pytest.mark.parametrize("method", PRINTED)
def test_program_is_the_printed_map(method, solver):
    # The sub-maps' program and the equations as printed are one map: some 300 operations apart, 1e-13.
    terms = Weight(net=-3.0), Restoring(moment=np.array([0.3, -0.2, -1.5]))
    body = Body(symmetric(1, 2.0, 9.0), symmetric(2, 1.1, 2.0), terms)
    y = (np.array([1.0, -2.0, 3.0]), TURN, np.array([0.6, -0.4, 0.5]), np.array([0.7, 0.5, -0.9]))
    solve = rotation.SOLVERS[solver]
    x = advance.advance(to_state(body, *y), body, PROGRAMS[method], 0.2, 3, solve=solve)
    for _ in range(3):
        y = PRINTED[method](*y, body, 0.2, solve)
    assert difference(from_state(body, x), y) < 1e-13


# Growth of round-off (mathematics, section 4): 1e-13 after a step, 1e-11 at t = 5, 1e-9 at t = 50.
@pytest.mark.slow_for("*-50-*")
@pytest.mark.parametrize(("time", "steps", "bound"), [("one_step", 1, 1e-13), ("5", 500, 1e-11), ("50", 5000, 1e-9)])
@pytest.mark.parametrize("method", KEYS)
def test_states_of_the_example(method, time, steps, bound, example, body, start):
    end = run(method, start, body, 0.01, steps)[-1]
    assert difference(end, expected(example[f"{KEYS[method]}_h0.01"][time])) < bound


@pytest.mark.slow_but("newton*")
@pytest.mark.parametrize(("solver", "bound"), [("newton", 1e-11), ("cayley", 1e-11), ("riccati", 1e-11),
                                               ("moser_veselov", 1e-10)])  # fmt: skip
def test_psi_with_every_solver(solver, bound, example, body, start):
    # The paper's own two among them; Moser-Veselov's F misses SO(3) by 1e-14 a solve (paper, section IV), the errors of
    # 1000 solves grow 10 times by t = 5.
    x = advance.advance(start, body, PROGRAMS["psi"], 0.01, 500, solve=rotation.SOLVERS[solver])
    assert difference(from_state(body, x), expected(example["Psi_h0.01"]["5"])) < bound


@pytest.mark.slow
def test_truth_at_five_seconds(example, body, start):
    # RKMK4's error at h = .0125, t = 2 is 4e-9: at h = .002, t = 5 it is some 4e-12 times the growth of errors, 10.
    state = run("rkmk4", start, body, 0.002, 2500)[-1]
    assert errors(state, expected(example["truth"]["5"])).max() < 1e-10


# Mathematics, section 4: errors of b, R, nu, Om at t = 2 for h = .0125. There psi_s has 2.9e-5 for Om; it is 2.845e-5 by
# kl8 and by RKMK4 alike, of twin and kernel.
ERRORS = {
    "phi": ("5e-4", "5e-3", "4e-3", "6e-4"),
    "psi": ("3.5e-7", "2.1e-5", "1.5e-5", "3.6e-5"),
    "psi_s": ("7.5e-7", "1.7e-5", "8.9e-6", "2.845e-5"),
    "cg3": ("1.3e-6", "1.3e-6", "1.3e-6", "1.1e-6"),
    "rkmk4": ("3.5e-9", "2.7e-9", "1.9e-9", "4.0e-9"),
}


class Bench:
    """Body, start and truth at t = 2."""

    def __init__(self, body, start):
        self.body, self.start = body, start
        kl8 = COMPOSITIONS["kl8"][1]
        end = advance.advance(start, body, PROGRAMS["psi_s"], 0.05, 40, kl8, rotation.quartic)
        self.truth = from_state(body, end)

    def errors(self, method, h):
        return errors(run(method, self.start, self.body, h, round(2.0 / h))[-1], self.truth)


@pytest.fixture(scope="module")
def bench(body, start):
    """Truth by kl8(psi_s), h = .05: within 3e-12 of RKMK4 with h = .002."""
    return Bench(body, start)


@pytest.mark.parametrize("method", ERRORS)
def test_errors_at_two_seconds(method, bench):
    for value, printed in zip(bench.errors(method, 0.0125), ERRORS[method], strict=True):
        assert abs(value - float(printed)) <= 1.01 * half_digit(printed)


@pytest.mark.slow_for("phi_adjoint")
@pytest.mark.parametrize("method", ORDERS)
def test_order(method, bench):
    # Errors from 1e-2 down to 4e-9, far above the truth's 3e-12. The next term of the error is h times the first, or
    # h^2 for the symmetric maps: the slope may be off by 5 %. Old and new nu exchanged in (14), (19) would show here.
    order = ORDERS[method]
    steps = np.array([0.005, 0.0025, 0.00125]) if order == 1 else np.array([0.05, 0.025, 0.0125])
    measured = np.array([bench.errors(method, h) for h in steps])
    for quantity in range(4):
        assert slope(steps, measured[:, quantity]) == pytest.approx(order, rel=0.06)


@pytest.mark.parametrize(("composition", "error"), [("kl6", "8e-6"), ("kl8", "6e-9")])
def test_compositions(composition, error, example, body, start):
    # Mathematics, section 4: attitude error at t = 5 with h = .25.
    stages = COMPOSITIONS[composition][1]
    x = advance.advance(start, body, PROGRAMS["psi_s"], 0.25, 20, stages, rotation.quartic)
    value = np.linalg.norm(x.R - np.array(example["truth"]["5"]["R"]))
    assert abs(value - float(error)) <= 1.01 * half_digit(error)


# Mathematics, section 4, h = .01: dE of largest size on 0-5 s, largest |dE| on 0-150 s, dE(150).
FIGURE_1 = {
    "psi": ("3.1658e-4", "3.2059e-4", "6.14e-5"),
    "cg3": ("-1.7458e-4", "1.97095e-3", "-1.9709e-3"),
    "psi_s": ("9.68e-5", "9.68e-5", "-1.0e-5"),
    "psi_1": ("-6.35e-4", "6.90e-4", "-5.0e-4"),
    "phi": ("5.9e-2", "8.2e-2", None),
    "rkmk4": ("8.8e-8", "9.3e-8", None),
}
TIMES = {"psi": 1.03, "cg3": 5.0}


@pytest.mark.slow
@pytest.mark.parametrize("method", FIGURE_1)
def test_energy_of_figure_1(method, bench):
    states = run(method, bench.start, bench.body, 0.01, 15_000, 1)
    E = np.array([energy.energy(to_state(bench.body, *y), bench.body) for y in states])
    assert E[0] == pytest.approx(124.645643084254, abs=6e-13)
    change = E - E[0]
    early = np.abs(change[:501]).argmax()
    measured = (change[early], np.abs(change).max(), change[-1])
    for value, printed in zip(measured, FIGURE_1[method], strict=True):
        assert printed is None or abs(value - float(printed)) <= 1.01 * half_digit(printed)
    assert early == round(100 * TIMES.get(method, early / 100))


def test_the_start_of_the_example(bench):
    # R(0) = exp(hat(1, 2, 3)), nu(0) = R(0)^T (.1, .2, 1): section IV.
    R = rotation.exp(np.array([1.0, 2.0, 3.0]))
    printed = np.array([0.0, 0.0, 10.0]), R, R.T @ np.array([0.1, 0.2, 1.0]), np.array([0.3, 0.2, 0.1])
    assert difference(from_state(bench.body, bench.start), printed) < 1e-14


def test_a_steady_turn_is_exact_in_the_classical_methods():
    # Free, M = m I, J = j I: Om is constant, and both methods turn by exp(h Om) a step, exactly.
    body = Body(2.0 * np.eye(3), 3.0 * np.eye(3))
    y = (np.zeros(3), np.eye(3), np.array([1.0, 0.5, -0.2]), np.array([0.3, -0.4, 0.9]))
    for step in CLASSICAL.values():
        _, R, _, Om = classical_run(step, y, body, 0.1, 20, 20)[-1]
        assert np.abs(R - rotation.exp(2.0 * y[3])).max() < 1e-14 * 20
        np.testing.assert_allclose(Om, y[3], rtol=1e-14)
