# SPDX-License-Identifier: Apache-2.0
"""Members whose filter is lost: the event, the warning, the metric of rejections; and p-values of consistency over seeds.

All scenes have the kernel of the second block of docs/controllers/navigation.md.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

import lgvi_warp as lw
from lgvi_warp.extensions.navigation.consistency import time_average
from tests.conftest import ROOT
from tests.support.tools import one

SETTINGS = dict(method="psi_x", h=0.02, threads=1)
NEVER, NO = 1e9, 1e-12
UNIT = dict(
    accelerometer_noise=5e-4, gyroscope_noise=5e-5, accelerometer_walk=1e-5, gyroscope_walk=1e-6,
    accelerometer_turn_on=0.02, gyroscope_turn_on=1e-3,
)  # fmt: skip


def sailing(outlier=0.05, sigma=NEVER, **filter_numbers):
    """REMUS 100 with its autopilot by IMU, log and depth cell."""
    autopilot = lw.Scene.load(ROOT / "examples/scenes/remus_100_autopilot.toml")
    believed = dict(gate=3.0, velocity_sigma=0.02, attitude_sigma=(0.002, 0.002, 0.005)) | filter_numbers
    sensors = [
        lw.control.IMU(**UNIT),
        lw.control.DVL(noise=0.01, every=2, outlier=outlier, outlier_std=0.1),
        lw.control.Sensor(of="depth", noise=0.02, outlier=outlier, outlier_std=0.2, name="depth_cell"),
        lw.control.ErrorStateFilter(dvl="dvl", depth="depth_cell", **believed),
    ]
    loop = replace(autopilot.controller, sensors=sensors)
    return replace(autopilot, controller=loop, events=[lw.events.PositionUncertain(sigma=sigma)])


T = float(sailing().controller.period)
SAVED = ("position", "estimate_sigma", "nees", "rejected")
# The third member believes every reading of a depth that is fifty times as noisy as it thinks.
GATES = np.array([3.0, 3.0, np.inf, 3.0])[:, None] * np.ones(5)
OF_MEMBERS = {"depth_cell.noise": np.array([0.02, 0.02, 1.0, 0.02]), "error_state_filter.gate": GATES}


def ran(limits=NEVER, t1=4.0, start=None, **more):
    """Four members with limits of their own; the first estimate of the place is good to 2 cm."""
    numbers = OF_MEMBERS | {"position_uncertain.sigma": np.broadcast_to(limits, 4).copy()}
    fleet = one(sailing(position_sigma=0.01), nu=(1.54, 0.0, 0.0), parameters=numbers)
    return lw.solve(fleet, t1=t1, start=start, **SETTINGS | {"save": lw.SaveAt(every=T, fields=SAVED)} | more)


@pytest.fixture(scope="module")
def free():
    return ran(statistics=[lw.metrics.Rejected(then=[lw.statistics.MemberValues()])])


@pytest.mark.ci
@pytest.mark.kernel
def test_a_member_ends_at_the_tick_at_which_its_filter_is_too_unsure(free):
    sigma = np.linalg.norm(free.estimate_sigma[..., :3], axis=-1)
    ticks = [21, 31]
    limits = [*(0.5 * (sigma[k - 1, i] + sigma[k, i]) for i, k in enumerate(ticks)), NEVER, 1e-3]
    assert all(np.all(sigma[:k, i] < limits[i]) and sigma[k, i] > limits[i] for i, k in enumerate(ticks))
    run = ran(limits)
    assert run.status.counts() == {"ok": 1, "position_uncertain": 3}
    np.testing.assert_allclose(run.end_time, [ticks[0] * T, ticks[1] * T, 4.0, 0.0], rtol=0.0, atol=1e-12)
    for i, k in enumerate(ticks):
        np.testing.assert_allclose(run.position[-1, i], free.position[k, i], rtol=0.0, atol=1e-9)
    assert any("1 of 4 members begin at or beyond an event" in text for text in run.messages)
    # A run in two parts ends at the same ticks.
    begun = ran(limits, t1=2.5, save=lw.SaveAt(final=True))
    again = ran(limits, start=begun.final)
    np.testing.assert_array_equal(again.status, run.status)
    np.testing.assert_allclose(again.end_time, run.end_time, rtol=0.0, atol=1e-12)
    # What a member that ended would have believed later is no warning.
    assert not run.warnings.has(lw.Warnings.FILTER_DIVERGED)[[0, 1, 3]].any()


@pytest.mark.kernel
def test_a_filter_that_diverges_has_a_warning(free):
    beyond = free.nees > 150.0
    assert beyond.any(axis=0).tolist() == [False, False, True, False]
    np.testing.assert_array_equal(free.warnings.has(lw.Warnings.FILTER_DIVERGED), beyond.any(axis=0))
    first = float(free.time[beyond[:, 2].argmax()])
    # The last sample is a tick that no step follows.
    assert abs(free.warning_value[2] - beyond[:, 2].sum()) <= 1
    assert free.warning_time[2] == pytest.approx(first, abs=1e-9)
    (text,) = (text for text in free.messages if lw.Warnings.FILTER_DIVERGED.text in text)
    assert text.startswith("1 of 4 members (")
    assert f"first in member 2 at {first:g} s" in text


@pytest.mark.kernel
def test_rejected_readings_are_counted(free):
    count = free.statistics["each rejected"].value[0, 0]
    np.testing.assert_array_equal(count, free.rejected[-1].sum(axis=-1))
    assert np.all(np.diff(free.rejected, axis=0) >= 0.0)
    assert np.all(free.rejected[-1, :, [1, 2, 4]] == 0.0)
    # 41 depths and 84 beams of which 5 % are outliers; the third member has no gate.
    assert np.all((count > 0.0) == np.isfinite(GATES[:, 0]))
    with pytest.raises(lw.SceneError, match=r"rejected\.of = 'depth'"):
        lw.metrics.Rejected("depth")


def test_without_a_gate_there_is_no_such_signal():
    scene = sailing()
    sensors = list(scene.controller.sensors)
    sensors[-1] = lw.control.ErrorStateFilter(dvl="dvl", depth="depth_cell")
    plain = replace(scene, controller=replace(scene.controller, sensors=sensors))
    with pytest.raises(lw.SceneError, match="with gate = 4 and report = true"):
        lw.solve(plain, t1=0.1, save=lw.SaveAt(every=0.1, fields=("rejected",)), **SETTINGS)


GROUPS, SIZE = 60, 25


def p_values(scale, seed=3):
    """p of NEES and of NIS of groups of filters that believe `scale` times the noise of their readings, (2, GROUPS)."""
    fleet = lw.Ensemble(sailing(NO, gate=np.inf, measurement_scale=scale), GROUPS * SIZE, seed=seed)
    run = lw.solve(fleet, t1=20.0, save=lw.SaveAt(every=0.5, fields=("nees", "nis", "nis_count")), **SETTINGS)
    found = []
    for i in range(GROUPS):
        members = slice(i * SIZE, (i + 1) * SIZE)
        part = {name: run.samples[name][:, members] for name in ("nees", "nis", "nis_count")}
        judged = lw.metrics.consistency(replace(run, samples=part, **_of_members(run, members)))
        assert judged.nees_average == time_average(part["nees"])
        found.append((judged.nees_average.p, judged.nis_average.p, judged.verdict != "consistent"))
    return np.array(found).T


def _of_members(run, members):
    """The fields of a result that have one entry for each member, of some of them."""
    n = run.members
    return {
        name: value[members] for name, value in vars(run).items() if isinstance(value, np.ndarray) and len(value) == n
    }


@pytest.mark.slow
@pytest.mark.kernel
def test_p_values_of_a_right_filter_are_uniform_and_those_of_a_wrong_one_are_small():
    nees, nis, refused = p_values(1.0)
    # A uniform sample has a distance this improbable with a chance of 1e-3, and 5 % false alarms at most with one of 1e-3.
    for p in (nees, nis):
        assert kstest(p, "uniform").pvalue > 1e-3
        assert np.count_nonzero(p < 0.05) <= 10
    assert np.count_nonzero(refused) <= 10
    # Noise that is understated by 2 is seen by every group.
    nees, nis, refused = p_values(0.5)
    assert nees.max() < 1e-3
    assert nis.max() < 1e-12
    assert np.all(refused)
