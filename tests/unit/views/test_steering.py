# SPDX-License-Identifier: Apache-2.0
"""A summary has the panels that suit its run; commands have their limits and faults, angles go on through a turn."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.views.commands import faults
from tests.conftest import ROOT
from tests.support.made import made, turned
from tests.unit.views.test_fans import turning
from tests.unit.views.test_recording import fleet

AUTOPILOT = lw.Scene.load(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")


def steered(n=40, k=31, scene=AUTOPILOT):
    """A fleet with commands of two fins, which differ between members."""
    result = fleet(n, k, scene=scene)
    waves = 0.2 * np.sin(0.3 * np.arange(k))[:, None, None] + np.linspace(-0.05, 0.05, n)[:, None] * [1.0, -1.0]
    return dataclasses.replace(result, samples=dict(result.samples) | {"command": waves, "actuator": waves})


def all_well(result):
    """The same, of which none ended early."""
    return dataclasses.replace(result, status=0 * result.status, failure_time=np.nan * result.failure_time)


@pytest.mark.parametrize(("result", "titles"), [
    (fleet(), ["12 of 40 members from above", "Depth", "Attitude: medians, bands of 90 %", "Outcomes"]),
    (all_well(fleet()), ["12 of 40 members from above", "Depth", "Attitude: medians, bands of 90 %", "Energy"]),
    (steered(), ["12 of 40 members from above", "Depth", "Commands: medians, bands of 90 %", "Outcomes"]),
    (fleet(1, 12), ["1 member from above", "Depth", "Attitude", "Outcomes"]),
    (steered(1), ["1 member from above", "Depth", "Commands", "Outcomes"]),
])  # fmt: skip
def test_panels_suit_the_run(result, titles):
    assert [axes.get_title() for axes in lw.plots.summary(result)] == titles


def test_what_was_not_kept_is_left_out():
    result = all_well(fleet())
    few = dataclasses.replace(result, samples={"position": result.position})
    assert [axes.get_title() for axes in lw.plots.summary(few)] == ["12 of 40 members from above", "Depth"]
    whole = lw.plots.summary(few)[0].figure
    assert len(whole.axes) == 2
    ended = dataclasses.replace(fleet(), samples={"position": result.position})
    assert [axes.get_title() for axes in lw.plots.summary(ended)][2:] == ["Outcomes"]


def test_commands_have_their_limits_and_faults():
    result = steered()
    axes = lw.plots.summary(result)[2]
    lines = {line.get_label(): line for line in axes.lines}
    going = result.time[:, None] <= np.where(np.isnan(result.failure_time), np.inf, result.failure_time) * (1.0 + 1e-12)
    for i in range(2):
        expected = [np.median(row[mask]) for row, mask in zip(result.samples["command"][..., i], going, strict=True)]
        np.testing.assert_allclose(lines[f"control_fins[{i}]"].get_ydata(), expected, rtol=1e-12)
    # 20 degrees either way, and a rudder that is stuck from 40 s on.
    limits = sorted(line.get_ydata()[0] for line in axes.lines if np.ptp(line.get_ydata()) == 0.0)
    assert limits == pytest.approx([-np.radians(20.0), np.radians(20.0)], rel=1e-5)
    assert list(lines["fault"].get_xdata()) == [40.0, 40.0]
    title = axes.figure.get_suptitle().replace("\n", " ")
    assert "fault stuck_rudder: control_fins[0] times 0 plus 0.1, from 40 s" in title
    assert len(axes.collections) == 2  # a band for each


def test_faults_are_those_that_begin_during_the_run():
    result = steered()
    (fault,) = faults(result)
    assert fault.time == 40.0
    assert faults(dataclasses.replace(result, time=result.time / 2.0)) == []
    parts = AUTOPILOT.to_dict()
    parts["controller"]["faults"] += [{"name": "late", "type": "fault", "of": "compass", "time": float("inf")},
                                      {"type": "fault", "of": "depth_cell", "time": 10.0, "gain": 0.5},
                                      {"name": "ends", "type": "fault", "of": "compass", "kind": ["slow", "freeze"],
                                       "time": 5.0, "until": 7.5}]  # fmt: skip
    result = steered(scene=lw.Scene.from_dict(parts))
    assert [fault.text for fault in faults(result)] == [
        "fault ends: compass[0] slow or freeze, from 5 s, until 7.5 s",
        "fault: depth_cell[0] times 0.5 plus 0, from 10 s",
        "fault stuck_rudder: control_fins[0] times 0 plus 0.1, from 40 s",
    ]
    varied = dict(result.parameters) | {"stuck_rudder.time": np.linspace(30.0, 50.0, 40),
                                        "stuck_rudder.offset": np.linspace(0, 0.1, 40)}  # fmt: skip
    said = faults(dataclasses.replace(result, parameters=varied))[-1]
    assert said.time == 30.0
    assert (
        said.text
        == "fault stuck_rudder: control_fins[0] times 0 plus 0 to 0.1, from 30 s, of the last member from 50 s"
    )
    assert faults(fleet()) == []


def test_yaw_goes_on_through_a_turn():
    result, _ = turning(2.0, np.full(9, np.nan))
    axes = lw.plots.summary(result)[2]
    yaw = next(line for line in axes.lines if line.get_label() == "yaw").get_ydata()
    np.testing.assert_allclose(yaw, np.linspace(0.0, 720.0, 61), atol=1e-6)


TIME, ALL_ROUND = np.linspace(0.0, 60.0, 61), np.linspace(-np.pi, np.pi, 201)
# Headings (61, 201) of members that point all ways at some times, and the times at which they do not.
SCATTERED = {
    # The middle 90 % of a spread of s take 0.9 s of a turn: of 360 degrees t / 60 s these are 270 degrees at 50 s.
    "the longer the more": (ALL_ROUND * TIME[:, None] / 60.0, TIME <= 50.0),
    # One time alone, after a turn and a half, makes no line.
    "but for the end": (
        ALL_ROUND * np.where((TIME == 30.0) | (TIME > 50.0), 0.1, 1.0)[:, None] + 0.2 * TIME[:, None],
        TIME > 50.0,
    ),
}


@pytest.mark.parametrize("name", SCATTERED)
def test_an_angle_of_members_that_point_all_ways_is_left_out(name):
    heading, told = SCATTERED[name]
    path = np.ones((61, 201, 3)) * TIME[:, None, None]
    axes = lw.plots.summary(made(path, TIME, attitude=turned(heading)))[2]
    yaw = next(line for line in axes.lines if line.get_label() == "yaw; gaps: no mean direction").get_ydata()
    np.testing.assert_array_equal(np.isfinite(yaw), told)
    if name == "the longer the more":
        np.testing.assert_allclose(yaw[told], 0.0, atol=1e-6)
