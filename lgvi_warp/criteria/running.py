# SPDX-License-Identifier: Apache-2.0
"""Arguments of the runs of a study, and the time that they take in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.statistics.base import Statistic


def kept(metrics: Mapping[str, Statistic], controller: Any) -> dict[str, Any]:
    """The arguments of `solve` for what a run keeps whose metrics alone are wanted, all of them at ticks."""
    # Metrics come to ticks by themselves; expressions over the path are of the samples.
    by_samples = controller is not None and not all(metric.ticks for metric in metrics.values())
    save = SaveAt(every=float(controller.period) if by_samples else None, fields=())
    return {"save": save, "statistics": list(metrics.values()), "keep": "none"}


def step_of(scene: Any, h: float | None) -> float:
    """The step of a study [s]; h: None for the scene's."""
    faults, step = Faults(), scene.run.step if h is None else h
    if step is None:
        faults.add("h", h, "is missing", "give the step in seconds: h=0.01, --step 0.01 or [run] step")
    else:
        step = faults.positive("h", step)
    faults.raise_if_any()
    assert step is not None
    return float(step)


def duration_text(seconds: float) -> str:
    """A time [s] in words; NaN for one that was not kept."""
    if np.isnan(seconds):
        return "time not kept"
    for unit, size in (("years", 3.15e7), ("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"
