# SPDX-License-Identifier: Apache-2.0
"""Outliers, and losses in bursts, of sensors and of the beams of a log: how often, how large and how long, by their laws."""

import re

import numpy as np
import pytest
from scipy.stats import kstest, norm

import lgvi_warp as lw
from tests.control.bench import measured, scene
from tests.support.tools import one

MEMBERS, TICKS, T, H = 300, 300, 0.1, 0.02
# A chance of 6e-7 for a right code; the seed is fixed.
ERRORS = 5.0
NOISE, OUTLIER, FAR = 0.1, 0.08, 4.0
LOST, LENGTH = 0.3, 4.0


def still(ticks):
    rows = np.zeros((ticks, 1, 21))
    rows[..., 3:12] = np.eye(3).reshape(-1)
    return rows


def rough(**numbers):
    return dict(noise=NOISE, outlier=OUTLIER, outlier_std=FAR) | numbers


@pytest.fixture(scope="module")
def readings():
    """A velocity with outliers, rates lost in bursts, a depth with both, and a position lost by itself."""
    sensors = [
        lw.control.Sensor(name="log", of="velocity", **rough()),
        lw.control.Sensor(name="gyro", of="angular_velocity", noise=NOISE, dropout=LOST, burst=LENGTH),
        lw.control.Sensor(name="cell", of="depth", **rough(dropout=LOST, burst=2.0)),
        lw.control.Sensor(name="flow", of="water_velocity", noise=NOISE, dropout=LOST),
    ]
    return measured(lw.Ensemble(scene(sensors, period=T), MEMBERS, seed=3), still(TICKS), H)


def within(count, n, chance):
    """Whether a count of n is that of a chance."""
    return abs(count - n * chance) < ERRORS * np.sqrt(n * chance * (1.0 - chance))


@pytest.mark.ci
@pytest.mark.kernel
def test_outliers_are_as_often_and_as_large_as_they_say(readings):
    log = readings[..., 12:15].reshape(-1, 3)
    # Either normal, one for all axes: the mixture's distribution function.
    wide = np.hypot(NOISE, FAR)
    mixed = lambda x: (1.0 - OUTLIER) * norm.cdf(x, scale=NOISE) + OUTLIER * norm.cdf(x, scale=wide)  # noqa: E731
    for axis in log.T:
        assert kstest(axis, mixed).pvalue > 1e-6
    beyond = np.abs(log) > 6.0 * NOISE
    chance = OUTLIER * 2.0 * norm.sf(6.0 * NOISE / wide)
    assert within(beyond[:, 0].sum(), len(log), chance)
    # All axes of an outlier are, each of a size of its own.
    few = 2.0 * norm.sf(6.0 * NOISE / wide)
    assert within((beyond[:, 0] & beyond[:, 1]).sum(), beyond[:, 0].sum(), few)
    both = log[beyond.all(axis=1)]
    assert abs(np.corrcoef(both[:, 0], both[:, 1])[0, 1]) < ERRORS / np.sqrt(len(both))
    # One tick says nothing of the next.
    far = beyond[:, 0].reshape(TICKS, MEMBERS)
    assert within((far[1:] & far[:-1]).sum(), far[1:].size, chance**2)


def runs_of(lost):
    """Lengths of the runs of losses (ticks, members) that begin in the first half of the ticks, after one that is not lost."""
    lengths = []
    for column in lost.T:
        changes = np.flatnonzero(np.diff(column.astype(int)))
        starts = [(i, j) for i, j in zip(changes, changes[1:], strict=False) if column[i + 1] and i < len(column) // 2]
        lengths += [j - i for i, j in starts]
    return np.array(lengths)


@pytest.mark.kernel
@pytest.mark.parametrize(("columns", "length"), [
    (slice(18, 21), LENGTH), (slice(2, 3), 2.0), (slice(15, 18), 1.0 / (1.0 - LOST)),
])  # fmt: skip
def test_losses_last_as_long_as_they_say(readings, columns, length):
    repeats = np.all(readings[1:, :, columns] == readings[:-1, :, columns], axis=-1)
    # The share from the first tick on: neighbours depend, by 1 - 1/length - begins each tick.
    begins = LOST / (1.0 - LOST) / length
    tied = 1.0 - 1.0 / length - begins
    for lost in (repeats[0], repeats[: TICKS // 2], repeats):
        spread = np.sqrt(LOST * (1.0 - LOST) / lost.size * (1.0 + max(tied, 0.0)) / (1.0 - max(tied, 0.0)))
        assert abs(lost.mean() - LOST) < ERRORS * spread
    lengths = runs_of(repeats)
    assert abs(lengths.mean() - length) < ERRORS * np.sqrt(length * (length - 1.0) / len(lengths))
    # A run is of any length by the same law: geometric.
    for least in (2, 3, 5):
        assert within((lengths >= least).sum(), len(lengths), (1.0 - 1.0 / length) ** (least - 1))


@pytest.mark.kernel
@pytest.mark.slow
def test_beams_of_a_log_have_outliers_and_bursts_of_their_own():
    """By the rows of its beams, each tick from the start anew."""
    log = lw.control.DVL(**rough(dropout=LOST, burst=LENGTH))
    fleet = lw.Ensemble(scene([log], period=T), MEMBERS, seed=3)
    first, rows = fleet.scene.controller.bus.rows + 3, []
    for k in range(40):
        measured(fleet, still(k + 1), H, bus=rows)
    beams = np.array([each[first : first + 8] for each in rows])
    along, fresh = beams[:, :4].transpose(0, 2, 1).reshape(-1, 4), beams[:, 4:] > 0.5
    wide = np.hypot(NOISE, FAR)
    mixed = lambda x: (1.0 - OUTLIER) * norm.cdf(x, scale=NOISE) + OUTLIER * norm.cdf(x, scale=wide)  # noqa: E731
    assert all(kstest(beam, mixed).pvalue > 1e-6 for beam in along.T)
    beyond = np.abs(along) > 6.0 * NOISE
    chance = OUTLIER * 2.0 * norm.sf(6.0 * NOISE / wide)
    assert within((beyond[:, 0] & beyond[:, 1]).sum(), len(along), chance**2)
    was, now = ~fresh[:-1], ~fresh[1:]
    assert within((was & now).sum(), was.sum(), 1.0 - 1.0 / LENGTH)
    assert within((~was & now).sum(), (~was).sum(), LOST / (1.0 - LOST) / LENGTH)
    assert within((~fresh[0]).sum(), fresh[0].size, LOST)
    pair = ~fresh[:, 0] & ~fresh[:, 1]
    assert abs(pair.mean() - LOST**2) < ERRORS * np.sqrt(LOST**2 / pair.size) * np.sqrt(2.0 * LENGTH)


@pytest.mark.parametrize("make", [
    lambda **numbers: lw.control.Sensor(of="depth", **numbers), lambda **numbers: lw.control.DVL(**numbers),
])  # fmt: skip
def test_bursts_that_cannot_be_are_refused(make):
    for numbers, text in (
        (dict(dropout=0.8, burst=2.0), "is too short for dropout = 0.8. Give at least 4, or 0"),
        (dict(dropout=0.1, burst=0.5), "Give at least 1, or 0"),
        (dict(outlier=1.5), "outlier = 1.5"),
        (dict(outlier_std=-1.0), "outlier_std = -1.0"),
    ):
        with pytest.raises(lw.SceneError, match=re.escape(text)):
            make(**numbers)
    with pytest.raises(lw.SceneError, match="burst"):
        one(scene([make(dropout=0.5, burst=2.0)], period=T), parameters={f"{make().key}.dropout": np.array([0.5, 0.9])})


def test_what_no_member_has_is_no_code():
    from lgvi_kernels import built_in
    from lgvi_warp.runs.settle import make_plan

    def module(**numbers):
        fleet = lw.Ensemble(scene([lw.control.Sensor(of="depth", **numbers)]), 4)
        return make_plan(fleet, "psi_s", H, 1.0).spec.control.parts[0]

    # A burst without losses, a size without a chance, and a chance of no size.
    for idle in (dict(burst=3.0), dict(outlier_std=2.0), dict(outlier=0.1)):
        assert module(**idle) is built_in("laws.control", "sensor:depth")
    assert module(dropout=0.1, burst=3.0) is built_in("laws.control", "sensor:depth,dropout,burst")
