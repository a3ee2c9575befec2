# SPDX-License-Identifier: Apache-2.0
"""Against the quad-precision solution of the continuous equations, and the numbers of the paper's Fig. 1."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.paper.test_reference_paper import ERRORS, FIGURE_1, errors, half_digit
from tests.support.tools import expected, last, slope

ORDERS = {"phi": 1, "phi_adjoint": 1, "psi": 2, "psi_s": 2, "psi_1": 2}


@pytest.fixture(scope="module")
def run(scene):
    """The paper's vehicle alone, for some seconds: (result, state at the end)."""

    def solve(method, h, t1, save=None):
        result = lw.solve(lw.Ensemble(scene), method, h=h, t1=t1, save=save)
        return result, last(result)

    return solve


# Errors at t = 5 and 50 with h = 0.01 follow from those at t = 2, h = 0.0125 (order) and the growth of errors; the
# published states of each method give them to all digits: error of the method itself, method state minus truth.
@pytest.mark.parametrize(("method", "key"), [("phi", "Phi"), ("psi", "Psi"), ("psi_s", "PsiS"), ("psi_1", "Psi1")])
@pytest.mark.parametrize("t1", [5, 50])
def test_error_against_truth(method, key, t1, run, example):
    truth = expected(example["truth"][str(t1)])
    published = errors(expected(example[f"{key}_h0.01"][str(t1)]), truth)
    measured = errors(run(method, 0.01, float(t1))[1], truth)
    np.testing.assert_allclose(measured, published, rtol=1e-4)


@pytest.mark.parametrize("method", ["phi", "psi", "psi_s"])
def test_errors_at_two_seconds(method, run):
    truth = run("kl8(psi_s)", 0.05, 2.0)[1]
    for value, printed in zip(errors(run(method, 0.0125, 2.0)[1], truth), ERRORS[method], strict=True):
        assert abs(value - float(printed)) <= 1.01 * half_digit(printed)


@pytest.mark.parametrize(("method", "order"), ORDERS.items())
def test_order(method, order, run, example):
    # Steps small enough for the leading term, errors far above round-off (1e-12): the slope is the order within 3 %.
    steps = np.array([0.04, 0.02, 0.01, 0.005]) / (16 if order == 1 else 1)
    truth = expected(example["truth"]["5"])
    measured = np.array([errors(run(method, h, 5.0)[1], truth) for h in steps])
    for quantity in range(4):
        assert slope(steps, measured[:, quantity]) == pytest.approx(order, abs=0.03 * order + 0.05)


@pytest.mark.slow_for("su4(psi_1)*")
@pytest.mark.parametrize(("method", "order", "steps"), [
    ("tj4(psi_s)", 4, (0.05, 0.025, 0.0125)), ("su4(psi_s)", 4, (0.1, 0.05, 0.025)), ("su4(psi_1)", 4, (0.1, 0.05, 0.025)),
    ("kl6(psi_s)", 6, (0.25, 0.125, 0.0625)), ("kl8(psi_s)", 8, (0.25, 0.2, 0.125)),
])  # fmt: skip
def test_order_of_compositions(method, order, steps, run, example):
    truth = expected(example["truth"]["5"])
    measured = [errors(run(method, h, 5.0)[1], truth)[1] for h in steps]
    # Few steps per period: the next term still shows, by some 10 % of the order.
    assert slope(np.array(steps), measured) == pytest.approx(order, abs=0.12 * order)


def test_compositions_reach_the_published_errors(run, example):
    # Mathematics, section 4: attitude error at t = 5 with h = 0.25 (one digit each).
    truth = expected(example["truth"]["5"])
    assert errors(run("kl6(psi_s)", 0.25, 5.0)[1], truth)[1] == pytest.approx(8e-6, rel=0.1)
    assert errors(run("kl8(psi_s)", 0.25, 5.0)[1], truth)[1] == pytest.approx(6e-9, rel=0.1)


@pytest.mark.parametrize("method", ["psi", "psi_s", "psi_1", "phi"])
def test_energy_of_figure_1(method, run):
    result, _ = run(method, 0.01, 150.0, lw.SaveAt(every=0.01))
    change = result.energy[:, 0] - result.energy[0, 0]
    assert result.energy[0, 0] == pytest.approx(124.645643084254, abs=1e-10)
    early = np.abs(change[result.time <= 5.0]).argmax()
    measured = (change[early], np.abs(change).max(), change[-1])
    for value, printed in zip(measured, FIGURE_1[method], strict=True):
        assert printed is None or abs(value - float(printed)) <= 1.01 * half_digit(printed)
