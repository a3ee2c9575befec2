# SPDX-License-Identifier: Apache-2.0
"""Pictures of runs and studies, drawn with Matplotlib: each is a function that returns its axes.

    axes = lw.plots.fan(result, "speed")
    lw.plots.paths(result, path="paths.svg")

Each draws on `ax=` (or `figure=`, where it has several axes) or on a figure of its own, and writes a file where `path=` names
one; the ending chooses the format.
"""

from lgvi_warp.views.plots.bars import sensitivity
from lgvi_warp.views.plots.canvas import figure_class, save_figure
from lgvi_warp.views.plots.costs import scaling, term_cost
from lgvi_warp.views.plots.edges import margins
from lgvi_warp.views.plots.ends import histogram, outcomes, pairs
from lgvi_warp.views.plots.estimates import drawable, statistics
from lgvi_warp.views.plots.fans import compare, fan
from lgvi_warp.views.plots.files import plot, plot_sensitivity, plot_stability, plot_statistics, plot_tradeoff
from lgvi_warp.views.plots.maps import CELLS, stability
from lgvi_warp.views.plots.overview import drift, summary
from lgvi_warp.views.plots.tracks import attitude, paths, phase, plan_view
from lgvi_warp.views.plots.tradeoffs import tradeoff

__all__ = [
    "CELLS",
    "attitude",
    "compare",
    "drawable",
    "drift",
    "fan",
    "figure_class",
    "histogram",
    "margins",
    "outcomes",
    "pairs",
    "paths",
    "phase",
    "plan_view",
    "plot",
    "plot_sensitivity",
    "plot_stability",
    "plot_statistics",
    "plot_tradeoff",
    "save_figure",
    "scaling",
    "sensitivity",
    "stability",
    "statistics",
    "summary",
    "term_cost",
    "tradeoff",
]
