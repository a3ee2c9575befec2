# SPDX-License-Identifier: Apache-2.0
"""Success of a member: conditions on its final status and its metrics; probability of success with its interval."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, closest, refusal
from lgvi_warp.common.status import Status, failed
from lgvi_warp.statistics.estimates import intervals

# Words for how a member ended, beside the names of statuses: at the end of the run; there or stopped by an event.
OK, NOT_FAILED = "ok", "not_failed"
# Ways to form the interval of a probability.
INTERVALS = ("wilson", "clopper_pearson")


class Probability(NamedTuple):
    """A probability (the fraction of the members) with its confidence interval."""

    value: float
    lower: float
    upper: float


def probability(hits: int, count: int, confidence: float, interval: str) -> Probability:
    """Probability of an event that `hits` of `count` members meet; interval: one of `INTERVALS`."""
    if interval == "wilson":
        ends = intervals.wilson(np.array(hits / max(count, 1)), np.array(count), confidence)
    else:
        ends = intervals.clopper_pearson(np.array(hits), np.array(count), confidence)
    return Probability(hits / count if count else np.nan, float(ends[0]), float(ends[1]))


def none_text(hits: int, count: int, confidence: float) -> str:
    """Text of the one-sided limit if all of `count` members passed, or none; "" if only some passed."""
    if not count or 0 < hits < count:
        return ""
    verb = "fails" if hits else "passes"
    return f"none of {count:,} {verb}: at most {100.0 * intervals.none_of(count, confidence):.3g} % do, at {confidence:.0%}"


@dataclass(frozen=True)
class Success:
    """Conditions of success, all of which a member must fulfil. NaN fulfils no condition; a failed member never passes.

    status: accepted final statuses: "ok" (neither failed nor stopped), "not_failed", or an outcome such as "floor".
    limits: name of a metric -> (above, below): lower and upper limit of its value.
    """

    status: tuple[str, ...] = (OK,)
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def passed(self, status: np.ndarray, numbers: Mapping[str, np.ndarray]) -> np.ndarray:
        """Mask of the members that pass (n,), from their statuses (n,) and their metrics, name -> (n,)."""
        ended = np.zeros(len(status), bool)
        known = {OK: status == 0, NOT_FAILED: ~failed(status)}
        for word in self.status:
            ended |= known.get(word, status == Status.__members__.get(word.upper(), 0))
        for name, (above, below) in self.limits.items():
            ended &= (numbers[name] > above) & (numbers[name] < below)
        return ended & ~failed(status)

    def to_dict(self) -> dict[str, Any]:
        """The table of a sweep file that gives these conditions."""
        limits = {
            name: {word: value for word, value in zip(("above", "below"), ends, strict=True) if np.isfinite(value)}
            for name, ends in self.limits.items()
        }
        return {"status": self.status[0] if len(self.status) == 1 else list(self.status), **limits}


def success_of(conditions: Any, metrics: Sequence[str]) -> Success:
    """Read conditions: a `Success`, or {"status": "ok", "overshoot depth": {"below": 1.0}}; None means "ok" only.

    metrics: names of the sweep's metrics.
    """
    if conditions is None:
        return Success()
    if isinstance(conditions, Success):
        conditions = conditions.to_dict()
    if not isinstance(conditions, Mapping):
        remedy = 'write [success] and "overshoot depth" = { below = 1.0 } below'
        raise refusal("success", conditions, "is not a table", remedy)
    faults = Faults("success.")
    words = conditions.get("status", OK)
    statuses = tuple(items_of(words) or (words,))
    known = (OK, NOT_FAILED, *(status.name.lower() for status in Status if status.stopped))
    for word in statuses:
        faults.choice("status", word, known)
    limits: dict[str, tuple[float, float]] = {}
    for name, table in conditions.items():
        if name == "status":
            continue
        if name not in metrics:
            remedy = closest(name, metrics) if metrics else "give metrics=[...]"
            faults.add(f'"{name}"', "...", "is not a metric of this sweep", remedy)
        elif not isinstance(table, Mapping) or not table or not table.keys() <= {"above", "below"}:
            faults.add(
                f'"{name}"', table, "is not a condition", "write { below = 1.0 } or { above = 0.0, below = 1.0 }"
            )
        else:
            ends = [faults.number(f'"{name}".{word}', table[word], "unit of the metric") if word in table else end
                    for word, end in (("above", -np.inf), ("below", np.inf))]  # fmt: skip
            if not any(end is None for end in ends):
                limits[name] = (float(ends[0]), float(ends[1]))  # type: ignore[arg-type]
    faults.raise_if_any()
    return Success(statuses, limits)
