# SPDX-License-Identifier: Apache-2.0
"""Examples of surveys: gliders through an eddy beside a shoal, and how far off a LAUV is after its legs."""

import re
import runpy
import subprocess
import sys

import numpy as np
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT
from tests.support.refusals import says

LAUV = ROOT / "examples/studies/survey_how_far_off.py"


@pytest.mark.slow
def test_the_survey_tells_how_probable_the_floor_is(tmp_path):
    script = ROOT / "examples/studies/glider_in_an_eddy.py"
    command = [sys.executable, script, tmp_path / "picture.png", "300"]
    told, path = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout.splitlines()
    assert (tmp_path / "picture.png").stat().st_size > 30_000
    assert path.endswith("picture.png")
    value, low, high = (float(x) for x in re.findall(r"(\d+\.\d\d)", told))
    # Ten thousand members: 6.92 %.
    assert low < 6.92 < high
    assert low < value < high


def turned(angle, way):
    """Ways (n, 2) turned by angles (n,) [rad] about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * way[:, 0] - s * way[:, 1], s * way[:, 0] + c * way[:, 1]], axis=1)


@pytest.mark.slow
def test_the_navigation_error_of_a_survey_is_that_of_its_compass_and_log():
    """Dead reckoning again from the true path, tick by tick; and from the legs alone, on a map."""
    script = runpy.run_path(str(LAUV))
    fleet = lw.Ensemble(script["scene"](), 6, seed=1, vary=script["UNSURE"])
    fields = ("position", "velocity", "attitude", "navigation_error")
    result = lw.solve(fleet, h=0.1, t1=5000.0, save=lw.SaveAt(every=0.2, fields=fields))
    assert result.status.counts() == {"mission_done": 6}
    compass, log = (result.parameters[f"{name}.bias"] for name in ("compass", "log"))
    for i in range(6):
        ticks = round(float(result.end_time[i]) / 0.2) + 1
        told = np.einsum("kij,kj->ki", result.attitude[:ticks, i], result.velocity[:ticks, i] + log[i])
        angle = np.full(ticks, float(compass[i]))
        way = 0.2 * turned(angle, told[:, :2])
        reckoned = way.sum(axis=0) - 0.5 * (way[0] + way[-1]) + result.position[0, i, :2]
        error = reckoned - result.position[ticks - 1, i, :2]
        np.testing.assert_allclose(result.navigation_error[ticks - 1, i, :2], error, rtol=0.0, atol=1e-6)
    # Of three legs of 2 km two cancel for the log. Left out are the radius of acceptance, 8 m, the log on the two short legs,
    # a tenth of a long one, and the crab angle in the tide, at most atan(1 / 6), which turns its error on each long leg.
    north, shift = np.array([2000.0, 200.0]), 2000.0 / script["SPEED"] * log[:, :2]
    legs = np.tile(north, (6, 1)) - turned(-compass, np.tile(north, (6, 1))) + shift
    size = np.linalg.norm(result.navigation_error[-1], axis=1)
    left_out = 8.0 * np.abs(compass) + (0.1 + 3.0 / 6.0) * np.linalg.norm(shift, axis=1)
    assert (np.abs(size - np.linalg.norm(legs, axis=1)) < left_out).all()


@pytest.mark.slow
def test_the_survey_of_the_page_says_how_far_off_it_is(tmp_path):
    command = [sys.executable, LAUV, tmp_path / "picture.png", "200"]
    told = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout
    says(
        told,
        "{'mission_done': 200}",
        "norm(navigation_error) depends most on compass.bias",
        "95 % end by mission_done within",
    )
    assert (tmp_path / "picture.png").stat().st_size > 30_000
