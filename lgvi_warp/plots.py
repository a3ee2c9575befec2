# SPDX-License-Identifier: Apache-2.0
"""Pictures of runs and studies with Matplotlib. Each function draws one picture and returns its axes.

    axes = lw.plots.fan(result, "speed")
    lw.plots.paths(result, path="paths.svg")

Each function draws on `ax=` (or `figure=`, if it needs several axes), or else on a new figure. With `path=` it writes a file,
whose ending determines the format.
"""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
