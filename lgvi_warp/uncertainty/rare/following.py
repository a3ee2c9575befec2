# SPDX-License-Identifier: Apache-2.0
"""Update an event's numbers from interval to interval of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.calls.runner import samples_for
from lgvi_warp.common.errors import refusal
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.quantities import EndQuantity, OfResult, quantities
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.paths.member_values import MemberValues
from lgvi_warp.statistics.values.functional import Functional, functional
from lgvi_warp.uncertainty.rare.event import RareCondition

# How the number of a run comes from those of its pieces: greatest, least, sum; None where it is that at the end.
Combine = Callable[[np.ndarray, np.ndarray], np.ndarray] | None
OF_PATH: Mapping[str, Combine] = {"max": np.fmax, "min": np.fmin}
OF_METRICS: Mapping[str, Combine] = {
    "max_error": np.fmax, "cross_track": np.fmax, "nearest": np.fmin, "iae": np.add, "ise": np.add
}  # fmt: skip
REMEDY = (
    'give a number at the end, its max or min over the path, "max_error depth", or the name of an event; or by="chains"'
)


@dataclass(frozen=True)
class Followed:
    """A number updated over time; above, below: bounds between which it means the event."""

    combine: Combine
    above: float
    below: float

    @property
    def lasting(self) -> bool:
        """True if the event has happened once the number is between the bounds."""
        if self.combine is None:
            return False
        return bool(np.isinf(self.above) if self.combine is np.fmin else np.isinf(self.below))


def followed(condition: RareCondition) -> tuple[Followed, ...]:
    """Updates of each number of an event. Raises SceneError if intervals of a run do not determine a number."""
    if condition.of is not None:
        (quantity,) = quantities(condition.of)
        return tuple(Followed(_of_quantity(quantity), *ends) for ends in condition.limits.values())
    return tuple(Followed(_of_metric(name, condition.metrics[name]), *ends) for name, ends in condition.limits.items())


def _of_quantity(quantity: OfResult) -> Combine:
    if isinstance(quantity, EndQuantity):
        raise refusal("limit", quantity.label, "is of a time of its own, which splitting does not know", REMEDY)
    if not isinstance(quantity.of, Functional):
        problem = "is a function of a whole Result, where splitting sees pieces of a run"
        raise refusal("limit", quantity.label, problem, REMEDY)
    return _of_path(quantity.label, quantity.of)


def _of_path(label: str, of: Functional) -> Combine:
    """Update of a functional; refused if it cannot be combined over intervals, as the norm of a vector's maxima."""
    if not of.over_path:
        return None
    name = of.functions[-1]
    if name not in OF_PATH:
        raise refusal("limit", label, "is of the whole path, which pieces of a run do not tell", REMEDY)
    return OF_PATH[name]


def _of_metric(name: str, metric: Statistic) -> Combine:
    if isinstance(metric, MemberValues):
        return _of_path(name, functional("limit", name))
    if metric.type not in OF_METRICS:
        raise refusal("limit", name, "is of the whole path, which pieces of a run do not tell", REMEDY)
    return OF_METRICS[metric.type]


def looks_of(condition: RareCondition, scene: Any, settings: Mapping[str, Any]) -> SaveAt:
    """The samples that each interval of a run uses, from the settings of `prepare`."""
    own = settings.get("save")
    if isinstance(own, SaveAt) and own.at is not None:
        raise refusal("save", "SaveAt(at=...)", "names times of a whole run, which goes in pieces", "give every=")
    if condition.of is not None:
        return samples_for(scene, quantities(condition.of), own) or SaveAt()
    asked: SaveAt = condition.arguments(scene, settings.get("h"))["save"] if own is None else own
    return asked
