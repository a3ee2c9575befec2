# SPDX-License-Identifier: Apache-2.0
"""Arguments of the runs of a study, and texts of durations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.statistics.base import Statistic


def kept(metrics: Mapping[str, Statistic], controller: Any) -> dict[str, Any]:
    """Arguments of `solve` for a run that stores only its metrics, all of them at ticks."""
    # Metrics come to ticks by themselves; expressions over the path are of the samples.
    by_samples = controller is not None and not all(metric.ticks for metric in metrics.values())
    save = SaveAt(every=float(controller.period) if by_samples else None, fields=())
    return {"save": save, "statistics": list(metrics.values()), "keep": "none"}


def step_of(scene: Any, h: float | None) -> float:
    """The step of a study [s]; h: the requested step, or None for the scene's step."""
    faults, step = Faults(), scene.run.step if h is None else h
    if step is None:
        faults.add("h", h, "is missing", "give the step in seconds: h=0.01, --step 0.01 or [run] step")
    else:
        step = faults.positive("h", step)
    faults.raise_if_any()
    assert step is not None
    return float(step)


def duration_text(seconds: float) -> str:
    """Text of a duration [s]; NaN means that it was not recorded."""
    if np.isnan(seconds):
        return "time not kept"
    for unit, size in (("years", 3.15e7), ("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"
