# SPDX-License-Identifier: Apache-2.0
"""The examples of controllers run as scripts, print three lines, draw their picture, and show what they say."""

import re
import subprocess
import sys

import pytest

from tests.conftest import ROOT


def printed(name, folder):
    """The three lines that an example prints; its picture is there."""
    picture = folder / f"{name}.png"
    command = [sys.executable, ROOT / "examples" / f"{name}.py", picture]
    run = subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder)
    assert picture.stat().st_size > 10_000
    first, second, last = run.stdout.splitlines()
    assert last == str(picture)
    return first, second


def number(text, before):
    """The first number in front of these words."""
    return float(re.search(rf"([-+\d.]+) ?{before}", text)[1])


@pytest.mark.slow
def test_depth_is_kept_whatever_the_ballast(tmp_path):
    first, second = printed("controllers/depth_keeping", tmp_path)
    assert "{'ok': 500}" in first
    assert abs(number(first, "m off")) < number(first, r"m$")
    assert 0.0 < number(second, "% of that time") < number(second, "% of the vehicles") < 50.0


@pytest.mark.slow
def test_waves_along_the_hull_change_the_pitch_and_not_the_depth(tmp_path):
    origin, hull = printed("controllers/depth_in_waves", tmp_path)
    assert 0.6 < number(hull, "deg$") / number(origin, "deg$") < 0.85
    assert abs(number(hull, "m, pitch") / number(origin, "m, pitch") - 1.0) < 0.05


@pytest.mark.slow
def test_reallocation_keeps_the_place_when_a_thruster_dies(tmp_path):
    unknown, known = printed("controllers/dead_thruster", tmp_path)
    assert number(known, "cm off") < 0.1 * number(unknown, "cm off")
    assert number(known, "deg off") < 0.1 * number(unknown, "deg off")


@pytest.mark.slow
def test_moments_before_forces_keep_the_vehicle_upright(tmp_path):
    picture = tmp_path / "saturated_thrusters.png"
    command = [sys.executable, ROOT / "examples" / "controllers" / "saturated_thrusters.py", picture]
    lines = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout.splitlines()
    tilts, ends = ([number(line, f"{unit}") for line in lines[:3]] for unit in ("deg", "cm off"))
    assert lines[3] == str(picture)
    assert tilts[2] < 0.3 * min(tilts[:2])
    assert max(ends) < 20.0


@pytest.mark.slow
def test_an_integral_takes_the_vehicle_back_to_the_legs(tmp_path):
    plain, integral = printed("controllers/waypoints", tmp_path)
    assert number(integral, "m off") < 0.5 * number(plain, "m off")


@pytest.mark.slow
def test_a_loop_fails_by_its_estimate_and_not_by_its_law(tmp_path):
    picture = tmp_path / "lost_bottom.png"
    command = [sys.executable, ROOT / "examples" / "controllers" / "lost_bottom.py", picture, "50"]
    lines = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout.splitlines()
    well, silent, turned = lines[:3]
    assert lines[3] == str(picture)
    assert number(well, "m off the true") < 2.0
    for lost in (silent, turned):
        assert number(lost, "m off the true") > 2.0 * number(lost, "m off the believed")
    # 600 m times the sine of 2 degrees, less what lies before the end of the line.
    assert 15.0 < number(turned, "m off the true") < 21.0
    assert number(turned, "m off the believed") < 1.0


@pytest.mark.slow
def test_gains_for_the_worst_cost_less_there_and_more_on_average(tmp_path):
    mean, worst = printed("sweeps/tune_worst_5_percent", tmp_path)
    assert number(worst, "m s2 in the worst") < 0.9 * number(mean, "m s2 in the worst")
    assert number(worst, "m s2 on average") > number(mean, "m s2 on average")


@pytest.mark.slow
def test_the_likeliest_hit_of_the_floor_is_run_again(tmp_path):
    pytest.importorskip("rerun")
    picture = tmp_path / "floor.png"
    command = [sys.executable, ROOT / "examples" / "estimates" / "autopilot_hits_the_floor.py", picture]
    run = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path)
    *told, again, recording, last = run.stdout.splitlines()
    (answer,) = (line for line in told if line.startswith("Probability of "))
    assert 1e-6 < float(answer.rpartition(" (95 %")[0].rpartition(": ")[2]) < 3e-5
    assert again.startswith("again: {'floor': 1}, after ")
    assert recording == str(picture.with_suffix(".rrd"))
    assert picture.with_suffix(".rrd").stat().st_size > 10_000
    assert last == str(picture)
    assert picture.stat().st_size > 10_000


@pytest.mark.slow
def test_a_rudder_that_jams_in_a_turn_is_the_worst_fault(tmp_path):
    """Errors do not fall with the duration of a lag or a delay, and the last line names the worst."""
    command = [sys.executable, ROOT / "examples" / "studies" / "faults_that_end.py", "40"]
    *lines, last = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout.splitlines()
    errors = {line.partition(":")[0]: number(line, "rad s") for line in lines}
    assert len(errors) == 24
    assert last.startswith("Worst of 24: stuck for 10 s from")
    for kind in ("stuck", "slow", "delay"):
        assert errors[f"{kind} for 10 s from 2 s"] > errors[f"{kind} for 1 s from 2 s"]
    assert errors["stuck for 10 s from 2 s"] > 2.0 * errors["slow for 10 s from 2 s"]
