# SPDX-License-Identifier: Apache-2.0
"""Disk margins: beside python-control's of the same loops written by hand, and beside a sweep by SciPy of coupled ones."""

import numpy as np
import pytest
from scipy.optimize import minimize

import lgvi_warp as lw
from lgvi_warp.control import HeadingPID
from tests.support.refusals import refused, says
from tests.support.turning_loops import (
    GAINS,
    INERTIAS,
    LATE,
    PERIOD,
    H,
    J,
    heading_loops,
    loop_of,
    opened,
    scene,
    turning,
)


@pytest.mark.ci
@pytest.mark.parametrize(
    "skew", [0.0, pytest.param(1.0, marks=pytest.mark.slow), pytest.param(-0.5, marks=pytest.mark.slow)]
)
def test_ten_loops_beside_python_control(skew):
    control = pytest.importorskip("control")
    fleet = heading_loops(10)
    found = lw.linear.margins(fleet, "heading_pid", of=("disk",), skew=skew, about=80.0, method="psi_s", h=H)
    assert found.steady.all()
    frequencies = np.geomspace(1e-3, np.pi / PERIOD, 20_000)
    for i in range(10):
        A, B, C = loop_of(fleet, i)
        margin, gain, phase = control.disk_margins(control.ss(A, B, -C, 0.0, PERIOD), frequencies, skew=skew)
        # python-control looks at a grid of ten thousandths: next to a peak that errs by their square.
        assert found.values["disk"][i] == pytest.approx(margin, rel=1e-5)
        either = np.minimum(found.values["disk_gain_upper"][i], 1.0 / found.values["disk_gain_lower"][i])
        assert 20.0 * np.log10(either) == pytest.approx(gain, rel=1e-4)
        assert np.rad2deg(found.values["disk_phase"][i]) == pytest.approx(phase, rel=1e-4)


def swept(A, B, C, frequencies):
    """1 / the largest structured norm of (S - T)/2 over frequencies, each by SciPy's simplex from two starts."""
    largest = 0.0
    for w in frequencies:
        L = -C @ np.linalg.solve(np.exp(1j * w * PERIOD) * np.eye(len(A)) - A, B)
        S = np.linalg.inv(np.eye(len(L)) + L)
        M = 0.5 * (S - L @ S)

        def norm(x, M=M):
            d = np.exp(np.append(x, 0.0))
            return np.linalg.norm(d[:, None] * M / d, 2)

        starts = np.zeros(len(L) - 1), np.full(len(L) - 1, 0.7)
        largest = max(
            largest, min(minimize(norm, x, method="Nelder-Mead", options={"xatol": 1e-6}).fun for x in starts)
        )
    return 1.0 / largest


@pytest.mark.ci
@pytest.mark.parametrize(("inertia", "delay"), [
    (INERTIAS[0], 0.0), *(pytest.param(*each, marks=pytest.mark.slow) for each in zip(INERTIAS[1:], LATE[1:], strict=True)),
])  # fmt: skip
def test_coupled_axes_beside_a_sweep(inertia, delay):
    found = lw.linear.margins(turning(inertia, delay), of=("disk",), about=80.0, method="psi_s", h=H)
    assert found.steady.all(), found.why
    A, B, C = opened(*GAINS, inertia, round(delay / H))
    at = found.values["disk_frequency"][0]
    grid = np.concatenate([np.geomspace(0.01, np.pi / PERIOD, 60), at * np.linspace(0.98, 1.02, 21)])
    # The grid is a thousandth fine at the peak.
    assert found.values["disk"][0] == pytest.approx(swept(A, B, C, grid), rel=1e-4)


@pytest.mark.ci
def test_a_factor_in_the_disk_is_borne_and_one_beyond_is_not():
    # What the worst disk says of gain alone is within what gain alone bears.
    law = HeadingPID(kp=6.0, ki=0.8, kd=9.0)
    found = lw.linear.margins(scene(law, (5.0, 8.0, J)), of=("gain", "disk"), about=80.0, method="psi_s", h=H)
    assert found.values["gain_lower"] < found.values["disk_gain_lower"] < 1.0
    assert 1.0 < found.values["disk_gain_upper"] < found.values["gain_upper"]
    assert "disk_phase rad" in str(found)
    labels = [axes.get_xlabel() for axes in lw.plots.margins(found)]
    assert labels[2:] == ["disk margin", "disk-based gain margin, a factor", "disk-based phase margin [rad]"]
    assert found.to_dict()["eigenvalues"]["disk"] == found.values["disk"].tolist()


@pytest.mark.ci
def test_what_has_no_disk():
    law = HeadingPID(kp=-6.0, kd=9.0)
    found = lw.linear.margins(scene(law, (5.0, 8.0, J)), of=("disk",), about=10.0, settle=20.0, method="psi_s", h=H)
    assert np.isnan(found.values["disk"]).all()
    fleet = lw.Ensemble(scene(law, (5.0, 8.0, J)), 2)
    says(refused(lw.linear.margins, fleet, of=("disk",), by="runs"), "by", "eigenvalues")
    says(refused(lw.linear.margins, fleet, of=("disk",), skew=2.0), "skew", "-1 to 1")
