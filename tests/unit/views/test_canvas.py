# SPDX-License-Identifier: Apache-2.0
"""Pictures that are drawn side by side, in threads, have each their own sizes of text."""

import threading

import matplotlib as mpl
from matplotlib.figure import Figure

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
