# SPDX-License-Identifier: Apache-2.0
"""The opposite of a sweep's success: the event that a member does not pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.common.status import failed
from lgvi_warp.criteria.success import Success
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.member_metrics import metric_of
from lgvi_warp.statistics.metrics.nearest import COUNTS, LEAST, named
from lgvi_warp.uncertainty.rare.event import RareCondition

# How far a member is beyond all numbers that ended otherwise than success asks; divided by their spreads it stays finite.
FAR = 1e300


@dataclass(frozen=True)
class FailingCondition(RareCondition):
    """The event that a member does not pass; success: the conditions to pass.

    metrics: those that success limits, and distances to events that prevent success, which guide the chains.
    endings: name of a distance metric -> (key, status) of its event.
    """

    success: Success = field(default_factory=Success)
    endings: Mapping[str, tuple[str, int]] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        limits = self.success.limits
        return tuple(_words(name, *limits[name]) if name in limits else self.endings[name][0] for name in self.metrics)

    def distances(self, answer: Any) -> tuple[np.ndarray, np.ndarray]:
        """Distances of members beyond each way to fail (k, n), and a mask of failed ones (n,)."""
        status = np.asarray(answer.status)
        numbers = {name: answer.statistics[f"each {name}"].value[0, 0] for name in self.metrics}
        limits = self.success.limits
        beyond = {name: _outside(numbers[name], *limits[name]) if name in limits else LEAST - numbers[name]
                  for name in self.metrics}  # fmt: skip
        # Whoever ended otherwise than success asks has no need to be beyond a number: it counts as the event that ended it,
        # and where that has no distance as every condition.
        badly = ~Success(self.success.status).passed(status, {})
        for name, (_, ending) in self.endings.items():
            beyond[name] = np.where(status == ending, FAR, beyond[name])
        otherwise = badly & ~np.isin(status, [ending for _, ending in self.endings.values()])
        return np.stack([np.where(otherwise, FAR, each) for each in beyond.values()]), failed(status)


def _outside(values: np.ndarray, above: float, below: float) -> np.ndarray:
    """Distance of numbers outside two bounds, positive if they are not between them; NaN counts as outside."""
    # A number at a bound does not pass, so that the event begins at the number next to it.
    low, high = np.nextafter(above, np.inf), np.nextafter(below, -np.inf)
    return np.asarray(np.clip(np.nan_to_num(np.maximum(low - values, values - high), nan=FAR), -FAR, FAR))


def failing_of(success: Success, metrics: Mapping[str, Statistic], scene: Any) -> FailingCondition:
    """The event that a member of a scene does not pass; metrics: the sweep's, by name. Raises SceneError."""
    known, endings = {name: metrics[name] for name in success.limits}, dict[str, tuple[str, int]]()
    ended = [event for event in scene.events if not Success(success.status).passed(np.array([event.status]), {})[0]]
    for event in ended:
        if event.type in COUNTS:
            name, metric = metric_of("success", named(event))
            known.setdefault(name, metric)
            endings[name] = event.key, int(event.status)
    if not known:
        problem = (
            "limits no metric, and no event of the scene whose distance is known ends it: nothing says how near one is"
        )
        raise refusal("success", success.to_dict(), problem, 'limit a metric, "peak depth" = { below = 12.0 }')
    words = [_words(name, *ends) for name, ends in success.limits.items()]
    return FailingCondition(
        " or ".join([*words, f"not {'/'.join(success.status)}"]), None, {}, known, (), success, endings
    )


def _words(name: str, above: float, below: float) -> str:
    ends = [f"{above:g} or less"] * bool(np.isfinite(above)) + [f"{below:g} or more"] * bool(np.isfinite(below))
    return f"{name} {' or '.join(ends)}"
