# SPDX-License-Identifier: Apache-2.0
"""Pictures of runs and studies, drawn with Matplotlib: each is a function that returns its axes.

    axes = lw.plots.fan(result, "speed")
    lw.plots.paths(result, path="paths.svg")

Each draws on `ax=` (or `figure=`, where it has several axes) or on a figure of its own, and writes a file where `path=` names
one; the ending chooses the format.
"""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
