# SPDX-License-Identifier: Apache-2.0
"""No word lies over data or over another word, in the pictures of twelve scenes of all kinds."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import lgvi_warp as lw
from tests.support.made import made
from tests.support.readable import unread
from tests.unit.views.test_recording import SCENE, fleet
from tests.unit.views.test_seen import RUNS
from tests.views.test_plots import few, solved  # noqa: F401  (a fixture)

OF_A_RUN = ("summary", "fan", "paths", "plan_view", "phase", "outcomes", "histogram", "pairs")
# Scenes that no kernel runs for.
QUICK = [name for name in RUNS if name in ("some of each outcome", "173 of 400 failed", "one vehicle, two samples",
                                          "one vehicle, 600 samples", "a grid of 1,000")]  # fmt: skip


def unread_of(result):
    """Unreadable parts of a run's pictures."""
    drawn = {name: np.ravel(getattr(lw.plots, name)(result))[0].figure for name in OF_A_RUN}
    angle = lw.plots.fan(result, "euler[2]").figure
    return {name: found for name, figure in (drawn | {"fan of yaw": angle}).items() if (found := unread(figure))}


@pytest.mark.ci
@pytest.mark.parametrize("name", QUICK)
def test_words_stand_beside_data(name):
    assert unread_of(RUNS[name]()) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in RUNS if name not in QUICK])
def test_words_stand_beside_data_of_runs(name):
    assert unread_of(RUNS[name]()) == {}


@pytest.mark.ci
def test_words_of_statistics_stand_beside_data(solved):  # noqa: F811
    assert unread(lw.plots.statistics(solved)[0].figure) == []


def test_a_word_over_data_is_seen():
    """The test of the test: a label on a line, and one on another."""
    axes = Figure().subplots()
    axes.plot([0.0, 1.0], [0.0, 1.0])
    assert unread(axes.figure) == []
    axes.text(0.5, 0.5, "over the line", ha="center")
    axes.text(0.1, 0.8, "beside it")
    axes.text(0.12, 0.8, "and over that")
    assert len(unread(axes.figure)) == 2


def station():
    """Members that hold their place to a hundredth of a millimetre, at a depth of 5 m."""
    time = np.linspace(0.0, 60.0, 61)
    angle = np.linspace(0.0, 6.0, 61)[:, None] + np.arange(8.0)
    position = np.stack([2e-5 * np.cos(angle), 2e-5 * np.sin(angle), 5.0 + 1e-11 * angle], axis=-1)
    return made(position, time)


@pytest.mark.ci
def test_numbers_that_hardly_differ_have_ticks_that_can_be_read():
    assert unread_of(station()) == {}


def test_a_comparison_draws_the_floor_of_each_scene():
    shallow = fleet(9, 31)
    free = fleet(9, 31, scene=lw.Scene.named("remus_100"))
    deeper = fleet(9, 31, scene=lw.Scene.named("remus_100", events=[{"type": "floor", "depth": 18.0}]))
    axes = lw.plots.compare({"shallow": shallow, "free": free, "deeper": deeper})
    said = {text.get_text() for text in axes.texts}
    assert said == {"surface", "floor\nof shallow", "floor\nof deeper"}
    assert unread(axes.figure) == []
    both = {text.get_text() for text in lw.plots.compare({"a": shallow, "b": shallow}).texts}
    assert both == {"surface", "floor"}
    assert SCENE.events
