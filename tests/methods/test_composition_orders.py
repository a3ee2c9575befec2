# SPDX-License-Identifier: Apache-2.0
"""Compositions of every kind against the quad-precision truth at t = 5, and what they refuse."""

import math

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.methods.method import COMPOSITIONS, HALVES, TWO_PART
from tests.support.tools import difference, expected, free_scene, last, one, slope

ORDERS = {
    "yo6(psi_s)": (6, (0.2, 0.125, 0.1)), "ss6_11(psi_s)": (6, (0.25, 0.2, 0.125)),
    "ss6_13(psi_s)": (6, (0.25, 0.2, 0.125)), "ss6_13(psi_x)": (6, (0.25, 0.2, 0.125)),
    "su8_15(psi_s)": (8, (0.2, 0.125, 0.1)), "su8_15(psi_x)": (8, (0.2, 0.125, 0.1)),
    "ss8_21(psi_s)": (8, (0.25, 0.2, 0.125)), "ss8_21(psi_x)": (8, (0.25, 0.2, 0.125)),
    "bm4(psi_x)": (4, (0.1, 0.05, 0.025)), "bm4(psi_s)": (4, (0.1, 0.05, 0.025)),
    "bm6(psi_x)": (6, (0.2, 0.125, 0.1)), "bm6(psi_s)": (6, (0.2, 0.125, 0.1)), "rkn4_6": (4, (0.1, 0.05, 0.025)),
    "rkn6_11": (6, (0.2, 0.125, 0.1)), "rkn6_14": (6, (0.2, 0.125, 0.1)),
}  # fmt: skip


def run(scene, method, h, **named):
    return lw.solve(lw.Ensemble(scene, members=1), method, h=h, t1=5.0, save=lw.SaveAt(every=5.0), **named)


def error(scene, method, h, example):
    return difference(last(run(scene, method, h)), expected(example["truth"]["5"]))


def power_sum(g, n):
    return math.fsum(a**n for a in g)


@pytest.mark.parametrize("name", COMPOSITIONS)
def test_coefficients(name):
    # A symmetric method of order 2, composed: sum g = 1 and sum g^3 = 0, sum g^5 = 0, ... below the order.
    order, g = COMPOSITIONS[name]
    assert g == g[::-1]
    assert power_sum(g, 1) == pytest.approx(1.0, abs=2e-16)
    assert [power_sum(g, n) for n in range(3, order, 2)] == pytest.approx([0.0] * (order // 2 - 1), abs=2e-14)


@pytest.mark.parametrize("name", HALVES)
def test_coefficients_of_halves(name):
    # chi over a_i in the odd places and its adjoint in the even ones: sum a = 1, sum (+-) a^2 = 0 by symmetry, sum a^3 = 0.
    a = lw.Method(f"{name}(psi_x)").stages
    assert a == a[::-1]
    assert len(a) == {"bm4": 12, "bm6": 20}[name]
    assert power_sum(a, 1) == pytest.approx(1.0, abs=1e-15)
    assert power_sum(a, 3) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("name", TWO_PART)
def test_coefficients_of_two_parts(name):
    numbers = lw.Method(name).stages
    assert (len(numbers) + 1) // 2 == {"rkn4_6": 7, "rkn6_11": 12, "rkn6_14": 15}[name]
    assert [sum(numbers[0::2]), sum(numbers[1::2])] == pytest.approx([1.0, 1.0], abs=1e-15)


# The kernels of every kind: compositions of psi_s, halves of psi_x, and both orders of two parts.
@pytest.mark.ci
@pytest.mark.slow_for("ss6_13(psi_x)", "su8_15(psi_x)", "ss8_21(psi_x)", "bm?(psi_s)")
@pytest.mark.parametrize("name", ORDERS)
def test_order(name, scene, example):
    order, steps = ORDERS[name]
    measured = [error(scene, name, h, example) for h in steps]
    # Few steps per period: the next term still shows, by some 12 % of the order.
    assert slope(np.array(steps), measured) == pytest.approx(order, abs=0.12 * order)
    assert lw.Method(name).order == order


@pytest.mark.ci
@pytest.mark.slow_for("kl8(psi_x)*", "su8_15(psi_x)*", "ss8_21(psi_x)*")
@pytest.mark.parametrize(("method", "h", "at_most"), [
    ("kl8(psi_x)", 0.05, 1e-12), ("su8_15(psi_x)", 0.05, 1e-12), ("ss8_21(psi_x)", 0.1, 1e-12), ("ss8_21(psi_s)", 0.1, 2e-12),
    ("rkn6_14", 0.125, 1e-11), ("rkn6_14", 0.0625, 1e-12), ("bm6(psi_x)", 0.03125, 1e-10),
])  # fmt: skip
def test_errors_at_five_seconds(method, h, at_most, scene, example):
    assert error(scene, method, h, example) < at_most


@pytest.mark.ci
@pytest.mark.slow_but("bm6(psi_x)")
@pytest.mark.parametrize("method", ["ss6_13(psi_x)", "bm6(psi_x)", "rkn6_11"])
def test_float32_reaches_its_round_off(method, scene, example):
    truth = expected(example["truth"]["5"])
    result = run(scene, method, 0.125, dtype="float32")
    assert difference(last(result), truth) < 1e-5


def test_a_quarter_turn_is_too_large():
    # Spin about the second axis: the step's longest rotation by part A, over c h, below or above a quarter turn.
    scene = free_scene()
    longest = max(abs(c) for c in lw.Method("rkn6_11").stages[1::2])
    below, above = (f * 0.5 * math.pi / longest for f in (0.95, 1.05))
    spins = [[0.0, below, 0.0], [0.0, above, 0.0], [0.0, 0.1, 0.0]]
    result = lw.solve(one(scene, Om=spins), "rkn6_11", h=1.0, t1=2.0)
    assert result.status.tolist() == [Status.OK, Status.STEP_TOO_LARGE, Status.OK]
    assert result.failure_value[1] == pytest.approx(1.05, rel=1e-9)
    assert result.failure_time[1] == 0.0
    # About a principal axis the modified rotation is by the angle h c Om, up to the error of its series.
    angle = result.attitude[-1, 2]
    np.testing.assert_allclose(angle[0, 2], math.sin(0.2), atol=1e-9)
