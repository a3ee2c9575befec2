# SPDX-License-Identifier: Apache-2.0
"""Picture of the outcomes of members over the two inputs that best explain them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.results.outcomes import outcomes
from lgvi_warp.results.varied import varied
from lgvi_warp.statistics.estimates.given_data import explained
from lgvi_warp.views.choice import mixed
from lgvi_warp.views.plots.canvas import legend_below, mark, panel, widen, wrapped
from lgvi_warp.views.plots.picture import FilePath

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

# Most members that are drawn.
MOST_POINTS = 2000
CONFIDENCE = 0.95


def inputs_by_outcome(result: Result, *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw the outcomes of members over the two inputs that best explain who had the most frequent outcome."""
    inputs, status = varied(result), np.asarray(result.status)
    codes = outcomes(result)
    if len(codes) < 2 or not inputs:
        raise NothingToDraw("all members ended alike, or nothing varies: no input tells them apart")
    most = max(codes, key=lambda code: int((status == code).sum()))
    parts = explained(inputs, np.where(status == most, 1.0, 0.0), CONFIDENCE)
    shares = {name: part.share for name, part in parts.items()}
    first, *others = sorted(inputs, key=lambda name: -np.nan_to_num(shares[name], nan=-1.0))
    members = np.sort(np.argsort(mixed(np.arange(result.members)), kind="stable")[:MOST_POINTS])
    upward = inputs[others[0]] if others else np.arange(result.members)
    words = {name: f"{name}: explains {100.0 * max(shares[name], 0.0):.3g} % of the variance" for name in inputs}
    with panel(ax, path, (8.0, 6.0)) as axes:
        for code in codes:
            group = members[status[members] == code]
            label = f"{code.name.lower()} ({int((status == code).sum()):,})"
            axes.scatter(inputs[first][group], upward[group], s=14, alpha=0.8, label=label, **mark(code))
        axes.set(xlabel=words[first], ylabel=words[others[0]] if others else "member index")
        axes.set_title(wrapped(f"Inputs that best explain the outcome {most.name.lower()}", axes.figure))
        widen(axes.xaxis)
        legend_below(axes, ncols=3)
    return axes
