# SPDX-License-Identifier: Apache-2.0
"""Indices from members at hand: against functions whose indices are known, and how often the intervals cover."""

import numpy as np
import pytest

from lgvi_warp.statistics.estimates.given_data import explained


def test_indices_of_ishigami():
    """sin x + 7 sin^2 y + 0.1 z^4 sin x has the first-order indices 0.3139, 0.4424 and 0 (Saltelli et al. 2008)."""
    x, y, z = np.random.default_rng(1).uniform(-np.pi, np.pi, (3, 40_000))
    found = explained({"x": x, "y": y, "z": z}, np.sin(x) + 7.0 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x), 0.95)
    for name, index in (("x", 0.3139), ("y", 0.4424), ("z", 0.0)):
        # Bins of a 64th leave (2 pi / 64)^2 / 12 of the slope's variance, half a percent; chance adds about as much.
        assert found[name].share == pytest.approx(index, abs=0.012)
        assert found[name].lower - 0.005 <= index <= found[name].upper + 0.005
    assert found["x"].p < 1e-6
    assert found["y"].p < 1e-6
    assert found["z"].p > 1e-3
    # A linear regression sees x, whose slope is 3 / pi^2 of a standard deviation's worth, and neither of the others.
    assert found["x"].slope > 0.3
    assert abs(found["y"].slope) < 0.02
    assert abs(found["z"].slope) < 0.02


def test_slopes_are_those_of_the_regression():
    x, y, noise = np.random.default_rng(2).normal(size=(3, 5000))
    out = 2.0 * x - y + 0.5 * noise
    found = explained({"x": x, "y": 10.0 * y}, out, 0.95)
    size = out.std()
    np.testing.assert_allclose([found["x"].slope, found["y"].slope], [2.0 / size, -1.0 / size], atol=0.03)


def test_what_decides_success_is_found_and_a_step_is_seen():
    x, y = np.random.default_rng(3).normal(size=(2, 4000))
    found = explained({"ballast": x, "bias": y}, x > -1.0, 0.95)
    # A bin of 32 holds the limit: it alone is mixed.
    assert found["ballast"].share > 0.95
    assert abs(found["bias"].share) < 0.02
    assert found["ballast"].slope > 0.3


def test_choices_and_constants():
    rng = np.random.default_rng(4)
    choice = rng.choice([1.0, 2.0, 5.0], 3000)
    found = explained({"choice": choice, "constant": np.ones(3000)}, choice == 2.0, 0.95)
    assert found["choice"].share == 1.0
    assert np.isnan(found["constant"].share)
    assert np.isnan(found["constant"].slope)
    assert np.isnan(explained({"choice": choice}, np.ones(3000), 0.95)["choice"].share)
    lost = np.where(rng.random(3000) < 0.1, np.nan, choice == 2.0)
    assert explained({"choice": choice}, lost, 0.95)["choice"].share == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("index", [0.0, 0.05, 0.5])
def test_intervals_cover_95_percent(index):
    # With 1,000 members there are 20 bins, which leave a 20th squared of a slope's variance: it is in the truth here.
    rng, hits = np.random.default_rng(5), 0
    for _ in range(1000):
        level = rng.integers(0, 10, 1000)
        x = (level - 4.5) / np.sqrt(8.25)
        y = np.sqrt(index) * x + np.sqrt(1.0 - index) * rng.normal(size=1000)
        found = explained({"x": x}, y, 0.95)["x"]
        hits += found.lower <= index <= found.upper
    # At 0 only the upper end can miss.
    assert (0.93 if index else 0.96) <= hits / 1000 <= (0.97 if index else 0.99)


@pytest.mark.parametrize(("members", "tries"), [(200, 40), pytest.param(500, 200, marks=pytest.mark.slow)])
def test_intervals_cover_a_square_and_a_product(members, tries):
    """x + y^2 + x z of normal numbers: their first-order indices are 1/4, 2/4 and 0, of numbers that are not normal."""
    rng, hits = np.random.default_rng(6), np.zeros(3)
    for _ in range(tries):
        x, y, z = rng.normal(size=(3, members))
        found = explained({"x": x, "y": y, "z": z}, x + y**2 + x * z, 0.95)
        hits += [found[name].lower <= truth <= found[name].upper for name, truth in zip("xyz", (0.25, 0.5, 0.0))]
    # Of 40 intervals of which 90 % hold, 30 or more do in 99 of 100 tries; of 200, 169.
    assert (hits >= (30 if members == 200 else 169)).all()


def test_what_an_input_explains_alone_is_all():
    x = np.random.default_rng(7).normal(size=500)
    found = explained({"x": x}, 3.0 * x + 1e6, 0.95)["x"]
    assert (found.share, found.upper) == (pytest.approx(1.0), 1.0)


@pytest.mark.parametrize("noise", [1e-3, 1e-5, 1e-7, 1e-9])
def test_what_explains_all_but_a_trace_has_an_interval(noise):
    """The part that is left is known to its own chance, however small it is beside what is explained."""
    x, rest = np.random.default_rng(4).normal(size=(2, 500))
    found = explained({"x": x}, x + noise * rest, 0.95)["x"]
    left = noise**2 / (1.0 + noise**2)
    assert found.upper >= 1.0 - left - 1e-15
    assert 1.0 - found.lower == pytest.approx(left, rel=1.0)
    assert found.lower <= found.share <= found.upper


@pytest.mark.parametrize("noise", [1e-2, 1e-4, 1e-7])
def test_what_an_input_explains_nearly_alone(noise):
    """The remainder is a variance: 95 % intervals of 20 samples hold, but for 4 of them once in 300 tries."""
    rng, hits = np.random.default_rng(8), 0
    for _ in range(20):
        x, z = rng.normal(size=(2, 300))
        found = explained({"x": x}, x + noise * z, 0.95)["x"]
        hits += 1.0 - found.upper <= noise**2 / (1.0 + noise**2) <= 1.0 - found.lower
    assert hits >= 16
