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
    ({"fields": ("positon",)}, "Did you mean 'position'"),
])  # fmt: skip
def test_faults_of_save_at(named, text):
    with pytest.raises(lw.SceneError, match=text):
        lw.SaveAt(**named)


def test_too_many_samples_are_refused_before_they_are_counted():
    with pytest.raises(lw.SceneError, match=r"save.every = 1e-300: asks for more than 10000000 samples"):
        time_grid(0.1, 1.0, lw.SaveAt(every=1e-300))


def grids_of(count, seed=1):
    """(T, k, m, grid with h = T / (k m) and every = T / k) for random durations T."""
    rng = np.random.default_rng(seed)
    for T in [2.0 * np.pi, np.e, 10.0 * np.sqrt(2.0), *rng.uniform(0.5, 200.0, count)]:
        k, m = int(rng.integers(1, 60)), int(rng.integers(1, 200))
        yield float(T), k, m


def check_grid(T, k, m):
    n = k * m
    grid = time_grid(T / n, T, lw.SaveAt(every=T / k))
    assert (grid.steps, len(grid.times), grid.messages) == (n, k + 1, ())
    np.testing.assert_allclose(grid.h, T / n, rtol=1e-14)
    np.testing.assert_allclose(grid.times, np.arange(k + 1) * (T / k), rtol=1e-14)
    at = time_grid(T / n, T, lw.SaveAt(at=np.linspace(0.0, T, k + 1).tolist()))
    assert (at.steps, len(at.times), at.messages) == (n, k + 1, ())
    # A run that goes on from there, and steps that do not divide the interval of samples.
    second = time_grid(T / n, 2.0 * T, lw.SaveAt(every=T / k), T)
    assert (second.first, second.last, len(second.times)) == (n, 2 * n, k + 1)
    assert grid.shifted(3.0 * T).first == 3 * n
    longer = time_grid(1.3 * T / n, T, lw.SaveAt(every=T / k))
    assert (longer.steps, len(longer.times)) == (k * int(np.ceil(m / 1.3 - 1e-9)), k + 1)
    # A step of float32 is the same step.
    assert time_grid(float(np.float32(T / n)), T, lw.SaveAt(every=T / k)).steps == n


def test_durations_that_are_no_short_decimals_are_met():
    for row in grids_of(20):
        check_grid(*row)


@pytest.mark.slow
def test_thousand_durations_are_met():
    for row in grids_of(1000, seed=2):
        check_grid(*row)


def test_numbers_of_float32_are_taken_as_meant():
    tenths = np.linspace(0.0, 1.0, 11, dtype=np.float32)
    for h, save in [
        (np.float32(0.01), lw.SaveAt(every=0.1)), (0.01, lw.SaveAt(at=tenths)), (0.01, lw.SaveAt(every=np.float32(0.1))),
        (float(np.float32(0.01)), lw.SaveAt(at=tenths.astype(float).tolist())),
    ]:  # fmt: skip
        grid = time_grid(h, 1.0, save)
        assert (grid.h, grid.steps, grid.messages, grid.asked) == (0.01, 100, (), None)
        assert grid.times.tolist() == [k / 10 for k in range(11)]
    assert time_grid(np.float32(0.1), np.float32(0.7), lw.SaveAt()).steps == 7


def test_times_that_share_no_step_are_still_refused():
    T = 2.0 * np.pi
    for save in (
        lw.SaveAt(at=[1.0, T / 3.0]),
        lw.SaveAt(every=T / 20.0 * (1.0 + 1e-6)),
        lw.SaveAt(at=[T / 10.0 + 1e-5]),
    ):
        with pytest.raises(lw.SceneError, match="shrink"):
            time_grid(T / 1000.0, T, save)
    with pytest.raises(lw.SceneError, match="beyond"):
        time_grid(T / 1000.0, T, lw.SaveAt(at=[T * (1.0 + 1e-6)]))


def test_parts_of_an_end_share_a_step():
    T = 10.0 * np.sqrt(2.0)
    grid = time_grid(T / 100.0, T, lw.SaveAt(at=[T / 3.0, T / 2.0]))
    assert grid.steps == 102
    np.testing.assert_allclose(grid.times, [0.0, T / 3.0, T / 2.0, T], rtol=1e-15)


def test_samples_are_read_from_any_sequence():
    times = [0.1, 0.2, 0.5]
    expected = lw.SaveAt(at=times, fields=("position",))
    for given in (tuple(times), np.array(times), iter(times), (t for t in times)):
        save = lw.SaveAt(at=given, fields=np.array(["position"]))
        assert save == expected
        assert type(save.fields[0]) is str
    assert lw.SaveAt(at=range(3)) == lw.SaveAt(at=[0.0, 1.0, 2.0])


@pytest.mark.ci
@pytest.mark.kernel
def test_a_run_over_a_period_goes_on_to_the_bit():
    T = 2.0 * np.pi
    scene, h = lw.Scene.named("sphere", start={"velocity": [1.0, 0.2, 0.1]}), T / 200.0
    whole = lw.solve(scene, "psi_s", h=h, t1=2.0 * T, save=lw.SaveAt(every=T / 20.0))
    first = lw.solve(scene, "psi_s", h=h, t1=T, save=lw.SaveAt(at=whole.time[:21]))
    second = lw.solve(scene, "psi_s", h=h, t1=2.0 * T, save=lw.SaveAt(every=T / 20.0), start=first.final)
    assert len(whole.time) == 41
    for result, rows in ((first, slice(0, 21)), (second, slice(20, 41))):
        np.testing.assert_array_equal(result.time, whole.time[rows])
        np.testing.assert_array_equal(result.position, whole.position[rows])


@pytest.mark.parametrize(
    ("h", "t1", "fault"), [(0.05, 5e-324, "shrink"), (1e308, 0.5, "shrink"), (5e-324, 150.0, "needs")]
)
def test_times_whose_quotient_no_number_holds_are_refused(h, t1, fault):
    with pytest.raises(lw.SceneError, match=fault):
        time_grid(h, t1, lw.SaveAt())
