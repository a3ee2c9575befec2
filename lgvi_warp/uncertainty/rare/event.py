# SPDX-License-Identifier: Apache-2.0
"""The event of `rare_event`: a quantity above 0, conditions as in a sweep, or the name of an event of the scene."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.status import failed
from lgvi_warp.criteria.running import kept
from lgvi_warp.criteria.success import Success, success_of
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.quantities import OfInterest, quantities
from lgvi_warp.statistics.base import TYPES, Statistic
from lgvi_warp.statistics.member_metrics import metric_of, names_a_statistic
from lgvi_warp.statistics.metrics.nearest import COUNTS, LEAST, named
from lgvi_warp.statistics.tracking import check_wanted
from lgvi_warp.statistics.values.functional import functional
from lgvi_warp.statistics.values.quantity import Quantity

# Limit of a member that failed, and of one that did what nothing is nearer to: that ended so, or never settled.
FAILED, SURE = np.inf, np.finfo(float).max
EXAMPLE = 'give "max(depth) - 40.0", {"peak depth": {"above": 12.0}}, the name of an event, or a function of a Result'
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
# "peak depth above 12", "max(depth) - 40.0" and "40.0 - max(depth)".
ABOVE_OR_BELOW = re.compile(rf"(.+?)\s+(above|below)\s+({NUMBER})")
# What others write for these words.
OVER = re.compile(
    r">=?|over|exceeds|exceeding|beyond|more than|greater than|at least|larger than|higher than|deeper than"
)
SAID_OTHERWISE = re.compile(
    rf"(.+?)(?:\s+|\s*(?=[<>]))({OVER.pattern}|<=?|under|less than|smaller than|lower than|at most|shallower than|above|below)"
    rf"(?:\s*({NUMBER})(?:\s*[a-zA-Z/]+)?)?"
)
LESS, MORE = re.compile(rf"(.*\S)\s*([+-])\s*({NUMBER[5:]})"), re.compile(rf"({NUMBER})\s*-\s*(\S.*)")


@dataclass(frozen=True)
class RareCondition:
    """Condition of a rare event: a quantity or any of several metrics between two bounds, or a status.

    label: text of the condition. of: the quantity, None for metrics. limits: name of the quantity or of each metric ->
    (above, below). metrics: metrics by name. statuses: statuses that count as the event, too.
    """

    label: str
    of: OfInterest | None
    limits: Mapping[str, tuple[float, float]]
    metrics: Mapping[str, Statistic] = field(default_factory=dict)
    statuses: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Texts of the conditions, in the order of the limits; empty if a status also counts as the event."""
        return () if self.statuses else tuple(_words(name, *ends) for name, ends in self.limits.items())

    def arguments(self, scene: Any, h: float | None = None) -> dict[str, Any]:
        """Arguments of `prepare` for the condition; h: step of the run [s], None for the scene's step."""
        if self.of is not None:
            return {"of": self.of, "failed": "nan"}
        faults = Faults()
        check_wanted(faults, "limit", self.metrics, scene.controller)
        faults.raise_if_any()
        known = kept(self.metrics, scene.controller)
        save = known["save"]
        if scene.controller is None:  # there are no ticks: metrics look at samples
            save = SaveAt(every=scene.run.save_every or h or scene.run.step, fields=())
        return {"save": save, "statistics": known["statistics"]}

    def distances(self, answer: Any) -> tuple[np.ndarray, np.ndarray]:
        """Distances of members beyond the bounds of each limit (k, n), and a mask of failed ones (n,).

        answer: Return value of the prepared run.
        """
        if self.of is None:
            status = np.asarray(answer.status)
            numbers = [answer.statistics[f"each {name}"].value[0, 0] for name in self.limits]
            lost = failed(status)
        else:
            values = np.asarray(answer)
            if values.ndim != 1:
                raise refusal("limit", self.label, f"is {values.shape[1]} numbers", "name one of its entries")
            numbers, lost = [values], np.isnan(values)
        beyond = [between(values, *ends) for values, ends in zip(numbers, self.limits.values(), strict=True)]
        if self.of is None and self.statuses:
            ended = Success(self.statuses).passed(status, {})
            beyond = [np.where(ended, SURE, each) for each in beyond]
        return np.stack(beyond), lost


def between(values: np.ndarray, above: float, below: float) -> np.ndarray:
    """Distance of numbers from the nearer of two bounds, negative outside; NaN is outside."""
    inside = np.minimum(values - above, below - values)
    return np.asarray(np.clip(np.nan_to_num(inside, nan=-SURE), -SURE, SURE))


def condition_of(limit: Any, scene: Any) -> RareCondition:
    """Read the requested event."""
    if isinstance(limit, RareCondition):
        return limit
    if isinstance(limit, Mapping):
        return _of_conditions(dict(limit))
    if isinstance(limit, str):
        return _of_text(limit.strip(), scene)
    if isinstance(limit, Quantity) or callable(limit):
        (quantity,) = quantities(limit)
        of = limit if isinstance(limit, Quantity) else _bounded(limit)
        return RareCondition(f"{quantity.label} above 0", of, {quantity.label: (0.0, np.inf)})
    raise refusal("limit", limit, "is not an event", EXAMPLE)


def _bounded(function: Callable[..., Any]) -> Callable[..., Any]:
    """Make infinite numbers of a function of a Result finite, so that only NaN means a failed member."""

    @functools.wraps(function)
    def bounded(*arguments: Any) -> Any:
        values = function(*arguments)
        return np.clip(values, -SURE, SURE) if np.asarray(values).dtype.kind == "f" else values

    return bounded


def has_bound(text: str) -> bool:
    """True if a text contains a bound of its quantity."""
    return any(pattern.fullmatch(text) for pattern in (ABOVE_OR_BELOW, LESS, MORE))


def _of_text(text: str, scene: Any) -> RareCondition:
    if event := next((event for event in scene.events if event.key == text), None):
        return _of_event(event)
    if found := ABOVE_OR_BELOW.fullmatch(text):
        return _of_conditions({found[1]: {found[2]: float(found[3])}})
    if text.partition(" ")[0] in ("outcome", "end_time"):
        problem, remedy = (
            "is there or not: nothing says how near a member is to it",
            'give the name of the event, "floor"',
        )
        raise refusal("limit", text, problem, remedy)
    if found := SAID_OTHERWISE.fullmatch(text):
        side = "above" if found[2] == "above" or OVER.fullmatch(found[2]) else "below"
        problem = "is not an event in the words that are read"
        raise refusal("limit", text, problem, f'write "{found[1]} {side} {found[3] or "12.0"}"')
    if text.partition(" ")[0] in TYPES:
        raise refusal("limit", text, "is a metric without a bound", f'write "{text} above 12.0"')
    if found := LESS.fullmatch(text):
        bound = float(found[3]) if found[2] == "-" else -float(found[3])
        return _of_conditions({found[1]: {"above": bound}})
    if found := MORE.fullmatch(text):
        return _of_conditions({found[2]: {"below": float(found[1])}})
    try:
        quantities(text)
    except SceneError as error:
        known = ", ".join(event.key for event in scene.events)
        problem = "is neither a quantity nor an event of the scene" + (f" ({known})" if known else ", which has none")
        raise refusal("limit", text, problem, EXAMPLE) from error
    return _of_conditions({text: {"above": 0.0}})


def _of_event(event: Any) -> RareCondition:
    if event.type not in COUNTS:
        problem = f"is an event whose distance is not known here ({event.type})"
        raise refusal("limit", event.key, problem, "give a quantity, or a function of a Result, that grows towards it")
    key, metric = metric_of("limit", named(event))
    # At the event the distance is 0, and before it no less than this.
    return RareCondition(event.key, None, {key: (-np.inf, LEAST)}, {key: metric})


def _of_conditions(conditions: dict[str, Any]) -> RareCondition:
    """Read conditions as in a sweep, any of which is the event."""
    names = [name for name in conditions if name != "status"]
    if not names:
        problem = "is a status, which is there or not: nothing says how near a member is to it"
        remedy = 'give the name of the event, as rare_event(fleet, "floor"), or a number that grows towards it'
        raise refusal("limit", conditions, problem, remedy)
    words = [name for name in names if str(name).partition(" ")[0] not in TYPES]
    metrics: dict[str, Statistic] = {}
    if not (single := len(conditions) == 1 and bool(words)):
        for name in names:
            _refuse_end(name)
            key, metric = metric_of("limit", name)
            metrics[key] = metric
            conditions[key] = conditions.pop(name)
    # A status that is not named is none of the event.
    success = success_of({"status": "ok"} | conditions, [*(words if single else metrics)])
    label = " or ".join([*(_words(name, *ends) for name, ends in success.limits.items()),
                         *(conditions["status"] if isinstance(conditions.get("status"), list | tuple)
                           else [conditions["status"]] if "status" in conditions else [])])  # fmt: skip
    statuses = success.status if "status" in conditions else ()
    if single:
        quantities(words[0])
        return RareCondition(label, words[0], success.limits)
    return RareCondition(label, None, success.limits, metrics, statuses)


def _refuse_end(name: Any) -> None:
    """Refuse a number at the end together with other conditions, since these concern the whole path."""
    if not isinstance(name, str) or names_a_statistic(name):
        return
    of = functional("limit", name)
    if not of.over_path:
        problem = "is a number at the end, which is an event by itself alone, and not beside other conditions"
        raise refusal("limit", of.label, problem, f'give "max({of.label})" or "min({of.label})", or ask for each alone')


def _words(name: str, above: float, below: float) -> str:
    ends = [f"above {above:g}"] * bool(np.isfinite(above)) + [f"below {below:g}"] * bool(np.isfinite(below))
    return f"{name} {' and '.join(ends)}"
