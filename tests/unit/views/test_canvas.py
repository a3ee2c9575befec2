# SPDX-License-Identifier: Apache-2.0
"""Common parts of all pictures: sizes of text, also side by side in threads; legends; and what their help says."""

import inspect
import threading

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

import lgvi_warp as lw
from lgvi_warp.views.plots import canvas


def test_pictures_in_two_threads_keep_their_sizes_of_text():
    small, large = Figure(figsize=(5.0, 4.0)), Figure(figsize=(20.0, 4.0))
    before = dict(mpl.rcParams)
    assert canvas.text_size(small) != canvas.text_size(large)
    inside, labelled, labels = threading.Event(), threading.Event(), {}

    def draw_large():
        with canvas.drawing(large, None, True):
            inside.set()
            labelled.wait(1.0)
            labels["large"] = large.subplots().set_xlabel("time [s]")

    thread = threading.Thread(target=draw_large)
    with canvas.drawing(small, None, True):
        thread.start()
        inside.wait(0.2)  # were the thread not to wait, its settings would be in force now
        labels["small"] = small.subplots().set_xlabel("time [s]")
        labelled.set()
    thread.join()
    assert labels["small"].get_fontsize() == canvas.text_size(small)
    assert labels["large"].get_fontsize() == canvas.text_size(large)
    assert dict(mpl.rcParams) == before


@pytest.mark.parametrize(("entries", "columns"), [(1, 1), (4, 4), (5, 3), (7, 4), (9, 3)])
def test_rows_of_a_legend_are_as_full_as_each_other(entries, columns):
    axes = Figure(figsize=(12.0, 5.0)).subplots()
    for i in range(entries):
        axes.plot([0.0, 1.0], [0.0, i], label=f"{i}")
    canvas.legend_below(axes, ncols=4)
    axes.figure.draw_without_rendering()
    places = [round(text.get_window_extent().x0) for text in axes.get_legend().get_texts()]
    assert len(set(places)) == columns


@pytest.mark.parametrize("name", lw.plots.__all__)
def test_help_tells_every_argument_and_the_errors_of_all(name):
    draw = getattr(lw.plots, name)
    told = inspect.getdoc(draw)
    assert [argument for argument in inspect.signature(draw).parameters if f"\n    {argument}: " not in told] == []
    assert "OSError: " in told
