# SPDX-License-Identifier: Apache-2.0
"""The grid of steps meets every sample time and the end."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.methods.saveat import time_grid


def test_a_step_that_fits_is_kept():
    grid = time_grid(0.01, 150.0, lw.SaveAt(every=1.0))
    assert (grid.h, grid.steps, grid.messages) == (0.01, 15_000, ())
    np.testing.assert_array_equal(grid.sample_steps, np.arange(0, 15_001, 100))
    np.testing.assert_array_equal(grid.times, np.arange(151.0))


def test_start_and_end_are_always_kept():
    assert list(time_grid(0.1, 1.0, lw.SaveAt()).times) == [0.0, 1.0]
    assert list(time_grid(0.1, 1.0, lw.SaveAt(at=[])).times) == [0.0, 1.0]
    assert list(time_grid(0.1, 1.0, lw.SaveAt(every=0.4)).times) == [0.0, 0.4, 0.8, 1.0]


@pytest.mark.parametrize(("h", "t1", "save", "step"), [
    (0.03, 1.0, lw.SaveAt(every=0.1), 0.025), (0.4, 1.0, lw.SaveAt(), 1.0 / 3.0),
    (0.3, 1.0, lw.SaveAt(at=[0.25]), 0.25), (10.0, 1.0, lw.SaveAt(), 1.0),
])  # fmt: skip
def test_a_step_that_does_not_fit_is_shortened_with_a_message(h, t1, save, step):
    grid = time_grid(h, t1, save)
    assert grid.h == pytest.approx(step, rel=1e-15)
    np.testing.assert_allclose(grid.sample_steps * grid.h, grid.times, rtol=1e-15)
    assert len(grid.messages) == 1
    assert str(h) in grid.messages[0]


def test_decimals_are_taken_as_meant():
    grid = time_grid(0.1, 0.1 + 0.2, lw.SaveAt())
    assert (grid.steps, grid.h) == (3, 0.1)
    assert time_grid(1.0 / 3.0, 2.0, lw.SaveAt()).steps == 6
    assert time_grid(1e-12, 1e-9, lw.SaveAt(every=1e-10)).steps == 1000
    assert time_grid(1e6, 1e8, lw.SaveAt()).steps == 100


@pytest.mark.kernel
def test_a_spacing_of_the_scene_longer_than_the_run_is_dropped_with_a_message(scene):
    result = lw.solve(lw.Ensemble(scene), h=0.01, t1=0.1)
    assert list(result.time) == [0.0, 0.1]
    assert "save_every" in result.messages[0]


@pytest.mark.kernel
def test_the_message_reaches_the_result(scene):
    result = lw.solve(lw.Ensemble(scene), h=0.03, t1=0.1)
    assert "shortened" in result.messages[0]
    assert result.provenance["step"] == pytest.approx(0.025)


@pytest.mark.parametrize(("h", "t1", "save", "text"), [
    (0.0, 1.0, lw.SaveAt(), "step = 0"), (-1.0, -1.0, lw.SaveAt(), "2 faults"),
    (0.1, 1.0, lw.SaveAt(at=[1.5]), "beyond"), (0.1, 1.0, lw.SaveAt(every=3.0), "longer"),
    (0.1, 1.0, lw.SaveAt(at=[0.123456]), "shrink"), (1e-9, 1e3, lw.SaveAt(), "steps"),
    (1e-12, 1.0, lw.SaveAt(), "steps"), (1e-320, 1.0, lw.SaveAt(), "steps"),
    (float("inf"), 1.0, lw.SaveAt(), "finite"),
])  # fmt: skip
def test_what_cannot_be_met_is_refused(h, t1, save, text):
    with pytest.raises(lw.SceneError, match=text):
        time_grid(h, t1, save)


@pytest.mark.parametrize(("named", "text"), [
    ({"every": 0.0}, "every"), ({"every": -1.0}, "every"), ({"every": 1.0, "at": [1.0]}, "both"),
    ({"at": [2.0, 1.0]}, "rising"), ({"at": [-1.0]}, "rising"), ({"at": ["a"]}, "numeric"),
    ({"fields": ("positon",)}, "did you mean 'position'"),
])  # fmt: skip
def test_faults_of_save_at(named, text):
    with pytest.raises(lw.SceneError, match=text):
        lw.SaveAt(**named)


def test_too_many_samples_are_refused_before_they_are_counted():
    with pytest.raises(lw.SceneError, match=r"save.every = 1e-300: asks for more than 10000000 samples"):
        time_grid(0.1, 1.0, lw.SaveAt(every=1e-300))
