# SPDX-License-Identifier: Apache-2.0
"""The picture of a stability map whose panels do not fill their rows."""

import numpy as np

import lgvi_warp as lw
from lgvi_warp.studies.stability.grid import Line
from lgvi_warp.studies.stability.map import StabilityMap

METHODS = ("psi", "psi_s", "rk4")


def a_map():
    """A map of three methods over two by two cells."""
    x, y = (
        Line("h", "step", "s", True, np.array([0.01, 0.1])),
        Line("omega", "rate", "rad/s", True, np.array([0.1, 1.0])),
    )
    cells = {name: np.zeros((2, 2), np.uint8) for name in METHODS}
    zeros = {name: np.zeros((2, 2)) for name in METHODS}
    ratios = {name: {} for name in METHODS}
    about = ("position", 0.01, 3.0, 10.0, 4, "conservative", "rk8", 0, {})
    return StabilityMap(x, y, cells, zeros, zeros, zeros, ratios, *about, unit="m")


def test_a_panel_with_nothing_below_has_numbers_on_its_axis():
    axes = lw.plots.stability(a_map())
    axes[0].figure.draw_without_rendering()
    numbered = [any(tick.label1.get_visible() for tick in panel.xaxis.get_major_ticks()) for panel in axes]
    assert numbered == [False, True, True]
