# SPDX-License-Identifier: Apache-2.0
"""Extrapolated differences of functions whose derivatives are known."""

import numpy as np
import pytest

from lgvi_warp.uncertainty.derivatives.extrapolation import (
    FEW,
    FINE,
    KINK,
    ROUGH,
    STEPS,
    Extrapolated,
    extrapolated,
    relative_increments,
)

EPS = 2.0**-53


def derivative(function, x, dtype="float64", sides=(1.0, 1.0), noise=0.0, size=None, seed=0) -> Extrapolated:
    """Extrapolated differences of a function at x; sides: NaN for one that does not count; noise: part of each value."""
    increments = (abs(x) if size is None else size) * relative_increments(dtype)
    rng = np.random.default_rng(seed)
    at, above, below = (
        function(points) * (1.0 + noise * rng.normal(size=np.shape(points)))
        for points in (np.array([x]), x + increments, x - increments)
    )
    spans = 0.5 * ((x + increments) - (x - increments))
    return extrapolated(at, sides[0] * above[None], sides[1] * below[None], spans[None], EPS)


SMOOTH = {
    "exp": (np.exp, np.exp, 1.3),
    "tanh": (lambda x: np.log(np.cosh(x)), np.tanh, 0.7),
    "fast": (lambda x: np.sin(30.0 * x), lambda x: 30.0 * np.cos(30.0 * x), 1.0),
    "linear": (lambda x: 3.0 - 2.0 * x, lambda x: -2.0, 5.0),
    "steep": (lambda x: x**-7.0, lambda x: -7.0 * x**-8.0, 0.2),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_functions(name):
    function, truth, x = SMOOTH[name]
    found = derivative(function, x)
    assert found.code[0] == FINE
    assert abs(found.value[0] - truth(x)) <= found.error[0] <= 1e-9 * abs(truth(x))


@pytest.mark.parametrize("sides", [(1.0, np.nan), (np.nan, 1.0)])
def test_differences_to_one_side(sides):
    found = derivative(np.exp, 1.3, sides=sides)
    assert found.code[0] == FINE
    assert abs(found.value[0] - np.exp(1.3)) <= found.error[0] <= 1e-7 * np.exp(1.3)


def test_nothing_changes():
    found = derivative(lambda x: 0.0 * x + 3.0, 1.0)
    assert (found.value[0], found.code[0]) == (0.0, FINE)
    # An even function has slopes to both sides, which cancel.
    even = derivative(lambda x: 1.0 + x * x, 0.0, size=1.0)
    assert abs(even.value[0]) <= even.error[0]
    assert even.code[0] == FINE


def test_errors_hold_the_truth_whatever_round_off_is():
    """Among 1,000 sums of a line and a wave, values with round-off of 1e-16 to 1e-5, not one beyond the error told."""
    rng = np.random.default_rng(1)
    told = []
    for seed in range(1000):
        a, b, c, d = rng.normal(size=4)
        w, x, noise = rng.uniform(0.1, 20.0), rng.uniform(-2.0, 2.0), 10.0 ** rng.uniform(-16.0, -5.0)

        def wave(t, a=a, b=b, c=c, d=d, w=w):
            return a + b * t + c * np.sin(w * t + d)

        found = derivative(wave, x, noise=noise, seed=seed)
        assert abs(found.value[0] - b - c * w * np.cos(w * x + d)) <= found.error[0], seed
        told.append(found.error[0] / (noise + 1e-16))
    # And it is not told at random: some thousand times the round-off, where increments are some thousandths.
    assert np.median(told) < 1e5


def test_kinks():
    met = derivative(lambda x: x + np.abs(x - 1.0), 1.0)
    assert met.code[0] == KINK
    assert met.jump[0] == pytest.approx(2.0, abs=1e-9)
    assert met.value[0] == pytest.approx(1.0, abs=1e-9)
    # Beside a kink there is a derivative, found at increments that do not reach it.
    for apart, truth in ((3e-3, 0.0), (-3e-3, 2.0)):
        beside = derivative(lambda x, apart=apart: x + np.abs(x - 1.0 - apart), 1.0)
        assert beside.code[0] == FINE
        assert abs(beside.value[0] - truth) <= beside.error[0] < 1e-9
        assert beside.first[0] > 0


def test_steps():
    for quantum in (1e-2, 1e-3):
        assert derivative(lambda x, q=quantum: np.round(x / q + 0.2) * q, 1.0).code[0] == STEPS
    # A slope between the jumps is none of the whole.
    assert derivative(lambda x: 3.0 + x + 0.005 * np.round(1e3 * np.sin(3.0 * x)), 1.0).code[0] == STEPS


def test_a_small_jump_far_away_is_of_no_account():
    found = derivative(lambda x: 2.0 * x + 1e-5 * (np.abs(x - 1.0) > 0.01), 1.0)
    assert found.code[0] == FINE
    assert abs(found.value[0] - 2.0) <= found.error[0] < 1e-9


def test_disagreement():
    def rough(x):
        return sum(0.6**i * np.cos(7.0**i * x) for i in range(40))

    assert derivative(rough, 1.0).code[0] == ROUGH


def test_copies_that_fail():
    def domain(x):
        return np.sqrt(np.where(x < 1.001, 2.0 - x, np.nan))

    found = derivative(domain, 1.0)
    assert found.code[0] == FINE
    assert abs(found.value[0] + 0.5) <= found.error[0]
    assert derivative(lambda x: np.where(x == 1.0, 1.0, np.nan), 1.0).code[0] == FEW


def test_single_precision_has_increments_above_its_round_off():
    assert relative_increments("float32").min() > 1e-5
    assert relative_increments("float64").min() < 1e-6
