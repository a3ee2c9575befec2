# SPDX-License-Identifier: Apache-2.0
"""Verdict on a difference of two cases: better, worse, equivalent or undecided."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.statistics.estimates.paired import Difference

BETTER, WORSE, EQUIVALENT, UNDECIDED = "better", "worse", "equivalent", "undecided"
VERDICTS = (BETTER, WORSE, EQUIVALENT, UNDECIDED)


def matters_of(matters: Any, metrics: Sequence[str], success: str) -> dict[str, float]:
    """Read the smallest differences that matter, by name; a single number is for success, in points.

    success: name of the comparison of success. Raises SceneError.
    """
    if matters is None:
        return {}
    if not isinstance(matters, Mapping):
        matters = {success: matters}
    faults, known = Faults(), (success, *metrics)
    for name, value in matters.items():
        key = f'matters."{name}"'
        if name not in known:
            faults.add(key, value, "is not a metric of this sweep", closest(str(name), known))
        else:
            faults.number(key, value, "points" if name == success else "unit of the metric", 0.0)
    faults.raise_if_any()
    return {name: float(value) for name, value in matters.items()}


def verdict(difference: Difference, matters: float, real: bool, more_is_better: bool) -> str:
    """Verdict on a difference, given the smallest difference that matters, in its unit.

    Equivalent: the interval lies within +-matters. Better, worse: it lies outside, and p is significant.
    """
    lower, upper = difference.lower, difference.upper
    if not more_is_better:
        lower, upper = -upper, -lower
    if -matters <= lower and upper <= matters:
        return EQUIVALENT
    if real and lower > matters:
        return BETTER
    return WORSE if real and upper < -matters else UNDECIDED
