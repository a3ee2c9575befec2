# SPDX-License-Identifier: Apache-2.0
"""Gates of the filter, fixes on their way, lock lost by angle: against the twin, closed forms and what chance allows.

All scenes have the same device code, one kernel: what a scene does not want has a number that does nothing.
"""

import re

import numpy as np
import pytest
from scipy.stats import binom, chi2

import lgvi_warp as lw
from tests.control.bench import measured, scene
from tests.extensions.navigation.navigating import LOG, ON_BOARD, PERIOD, UNIT, through, twins, voyage

H = 0.02
# So small that it does nothing, though it acts.
NO = 1e-12
# A right code misses such a band with a chance of 1e-4.
TAILS = (5e-5, 1.0 - 5e-5)
COUNTS = slice(0, 5)
WILD = dict(outlier=0.1, outlier_std=1.0, dropout=NO)
SENSORS = {
    "dvl": LOG | dict(outlier=0.1, outlier_std=0.1, greatest_tilt=3.0),
    "cell": dict(of="depth", noise=0.02, **WILD | {"outlier_std": 0.2}),
    "compass": dict(of="heading", noise=0.02, every=5, **WILD | {"outlier_std": 0.2}),
    "gps": dict(of="position", noise=1.0, every=10, **WILD | {"outlier_std": 10.0}),
    "usbl": dict(of="position", noise=0.5, every=5, latency=12, **WILD | {"outlier_std": 5.0}),
}
NAMES = {"dvl": "dvl", "fix": "gps", "delayed_fix": "usbl", "depth": "cell", "heading": "compass"}


def parts(gate=3.0, most_rejected=10.0, unit=UNIT, of_all=None, filter_numbers=None, **changes):
    """IMU, all sensors with changed numbers, `of_all` for each of them, and the filter with a gate."""
    sensors = [lw.control.IMU(**unit)]
    for name, numbers in SENSORS.items():
        kind = lw.control.DVL if name == "dvl" else lw.control.Sensor
        sensors.append(kind(name=name, **numbers | (of_all or {}) | changes.get(name, {})))
    numbers = dict(gate=gate, most_rejected=most_rejected) | (filter_numbers or {})
    return [*sensors, lw.control.ErrorStateFilter(**NAMES, **numbers)]


def ran(listed, truth, members=2):
    """Measurements (ticks, members, 21), NEES at the last tick (members,), and what was rejected by then (5, members)."""
    ensemble, rows = lw.Ensemble(scene(listed, period=PERIOD), members, 0), []
    seen, bus = measured(ensemble, truth, H, bus=rows), ensemble.scene.controller.bus
    return seen, rows[0][bus.belief + 21], rows[0][bus.rejected :][COUNTS]


def still(ticks):
    """At rest, level, heading north, (ticks, 1, 21)."""
    truth = np.zeros((ticks, 1, 21))
    truth[..., 3:12] = np.eye(3).reshape(-1)
    return truth


CASES = {"many in a row": (3.0, 2.0, 0.3), "by sensor": ((4.0, 2.0, np.inf, 3.0, 2.5), 10.0, 0.1)}


@pytest.mark.ci
@pytest.mark.parametrize("case", CASES)
def test_a_gated_filter_is_its_twin(case):
    # Many rejections in a row: the covariance is widened, too. Three fixes are on their way, and the tilt is up to 0.18 rad.
    gate, most, share = CASES[case]
    listed, truth = parts(gate, most, of_all={"outlier": share}, dvl={"greatest_tilt": 0.15}), voyage(300)
    seen, nees, rejected = ran(listed, truth)
    for member in range(2):
        each = twins(listed, member)
        assert np.abs(seen[:, member] - through(each, truth, member)).max() < 1e-9
        assert each[-1].rejected.tolist() == rejected[:, member].tolist()
        assert nees[member] == pytest.approx(each[-1].nees, rel=1e-6)
    assert np.all((rejected == 0.0) == np.isinf(np.broadcast_to(gate, 5))[:, None])


RIGHT = dict(
    unit=ON_BOARD["unit"], filter_numbers={name: ON_BOARD[name] for name in ("velocity_sigma", "attitude_sigma")}
)
CLEAN = {"outlier": NO}
# A unit that does not err; a first estimate that is the truth, but for what is named.
EXACT = dict.fromkeys(("accelerometer_noise", "gyroscope_noise", "accelerometer_walk", "gyroscope_walk"), NO)
KNOWN = dict.fromkeys(
    [f"{name}_sigma" for name in ("position", "velocity", "attitude", "accelerometer", "gyroscope")], 1e-9
)


@pytest.mark.ci
@pytest.mark.parametrize(("gate", "share"), [(3.0, 2.699796e-3), (2.0, 4.550026e-2)])
def test_a_gate_rejects_the_tails_of_a_normal_distribution(gate, share):
    # Where the state is known each innovation is a normal number by itself: what is rejected leaves no error behind.
    members, ticks = 300, 200
    listed = parts(gate, np.inf, unit=EXACT, filter_numbers=KNOWN, of_all=CLEAN, dvl={"dropout": NO})
    _, _, rejected = ran(listed, still(ticks), members)
    # Of four beams, three coordinates, depth and heading; of the late fix those that have arrived.
    late = len(range(12, ticks, 5))
    readings = members * np.array([4 * ticks // 2, 3 * ticks // 10, 3 * late, ticks, ticks // 5])
    low, high = (binom.ppf(tail, readings, share) for tail in TAILS)
    assert np.all((low <= rejected.sum(axis=1)) & (rejected.sum(axis=1) <= high))


@pytest.mark.ci
def test_with_a_gate_outliers_are_readings_that_are_lost():
    members, truth = 300, voyage(200)
    noises = {"dvl": 0.01, "cell": 0.02, "compass": 0.02, "gps": 1.0, "usbl": 0.5}
    wild = {name: {"outlier": 0.05, "outlier_std": 10.0 * noise} for name, noise in noises.items()}
    gated = ran(parts(3.0, **RIGHT, **wild), truth, members)
    fewer = ran(parts(np.inf, **RIGHT, of_all=CLEAN | {"dropout": 0.05}), truth, members)
    open_to_all = ran(parts(np.inf, **RIGHT, **wild), truth, members)
    # The band of a mean over 300 filters. Noises are the same, so that the difference is mostly what the gate lets pass.
    low, high = chi2.ppf(TAILS, 15 * members) / (15 * members)
    assert low < fewer[1].mean() / 15.0 < high
    assert low < gated[1].mean() / fewer[1].mean() < high
    assert open_to_all[1].mean() > 2.0 * gated[1].mean()
    # Squared errors of the position of 300 filters: their ratio has a standard deviation of sqrt(4 / 900).
    square = [((seen - truth)[-1, :, :3] ** 2).mean() for seen, *_ in (gated, fewer, open_to_all)]
    assert abs(square[0] / square[1] - 1.0) < 4.0 * np.sqrt(4.0 / 900.0)
    assert square[2] > 1.5 * square[1]


@pytest.mark.ci
def test_a_filter_that_was_shut_out_finds_back():
    # It believes that it knows its place to 0.1 m, and is 50 m off: each fix is beyond the gate.
    sigmas = {"position_sigma": 0.1, "velocity_sigma": 1e-5, "attitude_sigma": 1e-6, "start_error": 500.0}
    wrong = RIGHT | {"filter_numbers": sigmas}
    truth, lost = voyage(200), {"usbl": {"dropout": 1.0}, "cell": {"dropout": 1.0}}
    off = {}
    for most in (3.0, np.inf):
        seen, _, rejected = ran(parts(4.0, most, **wrong, of_all=CLEAN, **lost), truth, 8)
        off[most] = np.linalg.norm((seen - truth)[-1, :, :2], axis=-1)
        assert np.all(rejected[1] > 0.0)
    # After three rejections a fix is taken, to 1 m; without that the filter stays where it believes to be.
    assert np.median(off[3.0]) < 5.0
    assert np.median(off[np.inf]) > 20.0


@pytest.mark.ci
def test_three_fixes_on_their_way_are_those_of_a_straight_line():
    # As of one fix on its way in test_navigation.py: a regression on fixes, each at the time at which it was taken.
    place, velocity, noise, members, late, every = 3.0, 0.2, 0.5, 300, 12, 5
    sigmas = KNOWN | {"position_sigma": place, "velocity_sigma": velocity}
    nothing = {name: {"dropout": 1.0} for name in ("dvl", "cell", "compass", "gps")}
    listed = parts(np.inf, unit=EXACT, filter_numbers=sigmas, of_all=CLEAN, **nothing)
    assert listed[-1].uses["delayed_fix"] == "usbl"
    low, high = chi2.ppf(TAILS, 3 * members)
    information = np.diag([place**-2, velocity**-2])
    for k in range(61):
        if k >= late and (k - late) % every == 0:
            row = np.array([1.0, (k - late) * PERIOD])
            information = information + np.outer(row, row) / noise**2
        if k in (11, 12, 16, 17, 60):
            row, truth = np.array([1.0, k * PERIOD]), still(k + 1)
            variance = row @ np.linalg.solve(information, row)
            error = (ran(listed, truth, members)[0] - truth)[-1, :, :3]
            assert low < (error**2).sum() / variance < high
            each = twins(listed, 0)
            through(each, truth)
            assert each[-1].sigma[0] == pytest.approx(np.sqrt(variance), rel=1e-6)


def test_without_a_gate_there_is_no_row_of_memory_for_it():
    plain = lw.control.ErrorStateFilter(depth="cell")
    cell = lw.control.Sensor(name="cell", of="depth", noise=0.02)
    without, with_gate, silent = (
        scene([lw.control.IMU(), cell, part], period=PERIOD).controller
        for part in (plain, lw.control.ErrorStateFilter(depth="cell", gate=4.0),
                     lw.control.ErrorStateFilter(depth="cell", gate=4.0, report=False))
    )  # fmt: skip
    assert without.bus.rejected == silent.bus.rejected == -1
    assert with_gate.bus.rows == without.bus.rows + 5
    assert silent.bus.belief == silent.bus.diverged == -1
    assert "gate" not in plain.parameters()


BAD = {
    "no gate": (lambda: lw.control.ErrorStateFilter(most_rejected=3.0), "has no meaning without a gate"),
    "count": (
        lambda: lw.control.ErrorStateFilter(gate=3.0, most_rejected=1.5),
        "most_rejected = 1.5 is not a whole number. Give 1 or 2",
    ),
    "gate of 0": (lambda: lw.control.ErrorStateFilter(gate=0.0), "Give numbers above 0"),
    "two gates": (lambda: lw.control.ErrorStateFilter(gate=[3.0, 4.0]), r"\(5,\)"),
    "tilt": (lambda: lw.control.DVL(greatest_tilt=-0.1), "dvl.greatest_tilt"),
    "fixes": (
        lambda: scene(parts(usbl={"every": 5, "latency": 40}), period=PERIOD),
        r"usbl\.latency = 40\.0 has 9 fixes on their way at once.*Give less than 40",
    ),
    "filter": (
        lambda: scene([], period=PERIOD, events=[lw.events.PositionUncertain(sigma=5.0)]),
        r"position_uncertain\.filter.*is not the name of a filter",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_numbers_are_told(name):
    make, text = BAD[name]
    with pytest.raises(lw.SceneError) as found:
        make()
    assert re.search(text, str(found.value))


@pytest.mark.ci
@pytest.mark.parametrize("more", [(), ("measured_position",)], ids=["alone", "beside what is measured"])
def test_each_reading_is_taken_or_rejected_once(more):
    """Beams at every second tick and depths at each, of a run; what is saved beside changes no count."""
    sensors = [lw.control.IMU(**UNIT), lw.control.DVL(noise=0.01, every=2),
               lw.control.Sensor(of="depth", noise=0.02, name="depth_cell"),
               lw.control.ErrorStateFilter(dvl="dvl", depth="depth_cell", gate=0.5, most_rejected=np.inf)]  # fmt: skip
    fleet = lw.Ensemble(scene(sensors, period=0.1), 8, 0)
    save = lw.SaveAt(every=0.1, fields=("nis_count", "rejected", *more))
    run = lw.solve(fleet, "rk4", h=0.1, t1=1.0, save=save)
    taken, rejected = run.nis_count.sum(), run.rejected[-1].sum()
    # Ticks at 0, 0.1 ... 1 s; four beams at each second one.
    assert taken + rejected == 8 * (11 + 4 * 6)
    assert rejected > taken
