# SPDX-License-Identifier: Apache-2.0
"""Fans of angles: ends are marked about the direction that the members had when they ended."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.views.plots.words import in_words
from tests.support.made import made, turned


def turning(turns, end, k=61):
    """Members whose heading makes so many turns in a minute, each until its end (n,) [s], where it stays."""
    time, end = np.linspace(0.0, 60.0, k), np.asarray(end, dtype=float)
    n = len(end)
    spread = np.linspace(-0.3, 0.3, n)
    heading = 2.0 * np.pi * turns * np.minimum(time[:, None], np.where(np.isnan(end), np.inf, end)) / 60.0 + spread
    status = np.where(np.isnan(end), Status.OK, Status.FLOOR)
    position = np.ones((k, n, 3)) * np.arange(n)[:, None]
    return made(position, time, status=status, end=end, attitude=turned(heading)), heading[-1]


# The first go on, the last end one after another; or all end: once the last has, there is no mean direction any more.
ENDS = ([*np.full(20, np.nan), *np.linspace(5.0, 55.0, 21)], np.linspace(20.0, 50.0, 31))


@pytest.mark.parametrize("end", ENDS, ids=["some end", "all end"])
@pytest.mark.parametrize("turns", [-2.2, 0.4, 1.4, 3.0])
def test_a_member_that_ended_is_marked_on_the_turn_on_which_it_ended(turns, end):
    """A mark is where the line of its member ended."""
    result, heading = turning(turns, end)
    axes = lw.plots.fan(result, "euler[2]")
    (marks,) = [drawn for drawn in axes.collections if drawn.get_label().startswith("floor")]
    when, angle = np.asarray(marks.get_offsets()).T
    order, ended = np.argsort(when), np.isfinite(end)
    np.testing.assert_allclose(when[order], np.asarray(end)[ended])
    np.testing.assert_allclose(angle[order], heading[ended], atol=1e-9)


def test_a_direction_is_known_though_all_that_are_drawn_have_ended():
    """A few of more members than are drawn turn on, and none of these is drawn."""
    end = np.full(4000, 10.0)
    drawn = lw.select_members(turning(2.5, end)[0]).members
    end[np.setdiff1d(np.arange(1000, 3000), drawn)[:10]] = np.nan
    result, _ = turning(2.5, end)
    assert not np.isin(np.flatnonzero(np.isnan(end)), lw.select_members(result).members).any()
    axes = lw.plots.fan(result, "euler[2]")
    median = next(line for line in axes.lines if line.get_label() == "median").get_ydata()
    np.testing.assert_allclose(np.diff(median[11:]), 2.0 * np.pi * 2.5 / 60.0, atol=1e-9)


@pytest.mark.parametrize(("output", "words"), [
    ("position[1]", "east"), ("max(position[2])", "max(depth)"), ("mean euler[2] at floor", "mean yaw at floor"),
    ("own.position[1]", "own.position[1]"), ("velocity[0]", "velocity[0]"), ("start.position[1]", "start.position[1]"),
    ("quantiles position[0]", "quantiles north")])  # fmt: skip
def test_components_have_names(output, words):
    assert in_words(output) == words


def test_an_attitude_is_of_a_member_that_goes_on():
    """The members that reach farthest come first in the choice, and one of them failed at once."""
    result, _ = turning(1.0, [0.0, np.nan, np.nan, 0.0])
    axes = lw.plots.attitude(result)
    path = next(line for line in axes.lines if line.get_label() == "forward (x)")
    assert np.isfinite(np.asarray(path.get_data_3d())).all()
    assert path.get_data_3d()[0].size == 61


def test_a_folder_that_is_not_there_is_named(tmp_path):
    result, _ = turning(1.0, [np.nan, np.nan])
    path = tmp_path / "nowhere" / "a.png"
    for write in (lambda: lw.plots.fan(result, path=path), lambda: lw.record(result, path.with_suffix(".rrd"))):
        with pytest.raises(FileNotFoundError) as missing:
            write()
        assert missing.value.filename == str(path.parent)
        assert "no such folder" in str(missing.value)
