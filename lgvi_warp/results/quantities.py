# SPDX-License-Identifier: Apache-2.0
"""Quantities of interest: one or a few numbers of each member of a result, given as a text or a function."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.real_numbers import NotReal, real_results
from lgvi_warp.common.status import failed
from lgvi_warp.common.times import rows_at
from lgvi_warp.control.signals import ordered
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.physics.terms.events import Event
from lgvi_warp.physics.terms.events import from_list as events_of
from lgvi_warp.results.result import Result
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.ends import Ends, check_outcomes, outcomes
from lgvi_warp.statistics.member_metrics import gathered_name, metric_of, names_a_statistic, numbers_of_members
from lgvi_warp.statistics.outcomes import EndTime
from lgvi_warp.statistics.paths.member_values import MemberValues
from lgvi_warp.statistics.values.functional import Functional, functional
from lgvi_warp.statistics.values.quantity import KNOWN, Quantity

REMEDY = 'write "position[2]", "depth", "norm(velocity)", "max(depth)", "iae depth", or give a function of a Result'

OfInterest = str | Quantity | Statistic | Mapping[str, Any] | Callable[..., Any]


@dataclass(frozen=True)
class OfResult:
    """A quantity of interest of a result: a `Functional`, or a function of a Result.

    "position[2]" is the value at the end; max(...), min(...), mean(...) and range(...) are taken over the samples of
    the path; norm(...) is the length of a vector.

    of: The functional or function.
    looks_at_members: Whether the function may use other data of the members than their parameters.
    """

    label: str
    of: Functional | Callable[[Result], Any]
    looks_at_members: bool = False

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the required samples; all fields for a function, because the samples that it uses are not known."""
        return self.of.quantity.fields if isinstance(self.of, Functional) else FIELDS

    @property
    def unit(self) -> str:
        """Unit of the quantity; "" if unknown."""
        return self.of.unit if isinstance(self.of, Functional) else ""

    @property
    def over_path(self) -> bool:
        """Whether the quantity needs the samples at all times."""
        return isinstance(self.of, Functional) and self.of.over_path

    @property
    def is_function(self) -> bool:
        """Whether the quantity is a function of a Result."""
        return not isinstance(self.of, Functional)

    @property
    def is_plain(self) -> bool:
        """Whether the quantity reads only samples and parameters of a Result."""
        return type(self) is OfResult and not self.is_function

    @property
    def may_be_infinite(self) -> bool:
        """Whether an infinite number is a valid value of the quantity."""
        return False

    def gathered(self, events: Sequence[Event]) -> dict[str, Statistic]:
        """Statistics that a run must gather for the quantity, by the name of the estimate."""
        return {}

    def values(self, result: Result, members: Any = None) -> np.ndarray:
        """Compute the numbers of the quantity for each member.

        members: Members from lw.Ensemble.select, for a Quantity that uses them; by default the result's own parameters
            and first samples.
        Returns: float64 array, shape (n, m).
        """
        if isinstance(self.of, Functional):
            numbers = self.of(*samples_of(result, slice(None) if self.over_path else slice(-1, None), members))
            return numbers if self.over_path else numbers[-1]
        faults = Faults()
        try:
            numbers = real_results(self.of(result)).astype(np.float64)
        except NotReal as error:
            faults.add(self.label, "...", error.what, "return an array of real numbers")
        faults.raise_if_any()
        if numbers.ndim not in (1, 2) or len(numbers) != result.members:
            remedy = f"return an array of shape ({result.members},) or ({result.members}, m)"
            faults.add(self.label, "...", f"gave an array of shape {numbers.shape}", remedy)
            faults.raise_if_any()
        return numbers.reshape(result.members, -1)

    def labels(self, count: int) -> list[str]:
        """Name each number of the quantity."""
        if isinstance(self.of, Functional):
            return list(self.of.labels)
        return [self.label] if count == 1 else [f"{self.label}[{i}]" for i in range(count)]


# How texts of how and when members ended begin.
ENDS = ("outcome ", "end_time ")


@dataclass(frozen=True)
class EndQuantity(OfResult):
    """Outcome or end time of members, or a quantity at their end or at a time.

    "outcome floor" is 1 for members that ended at the floor, else 0. "end_time floor" is the time of this end, and
    "depth at floor" the depth at this end; both are NaN for other members. "depth at 30" is the depth at 30 s.

    kind: "outcome", "end_time" or "at".
    outcome: Name of the outcome; "" for a time.
    when: The time [s].
    """

    kind: str = "at"
    outcome: str = ""
    when: float | None = None

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the required samples."""
        return super().fields if self.kind == "at" else ("position",)

    @property
    def unit(self) -> str:
        """Unit of the quantity."""
        return {"outcome": "1", "end_time": "s"}.get(self.kind, super().unit)

    def gathered(self, events: Sequence[Event]) -> dict[str, Statistic]:
        """Statistics that a run must gather if several events have the status of this one.

        In this case the status does not identify the event.
        """
        if not self.outcome:
            return {}
        check_outcomes(
            "of", [self.outcome], outcomes([event.key for event in events], [event.status for event in events])
        )
        named = {event.key: event.status for event in events}.get(self.outcome)
        alone = named is None or sum(event.status == named for event in events) == 1
        return {} if alone else {f"each end_time {self.outcome}": EndTime(self.outcome, then=MemberValues())}

    def values(self, result: Result, members: Any = None) -> np.ndarray:
        """Compute the numbers of the quantity for each member, float64, (n, m)."""
        if self.when is not None:
            rows = rows_at(result.time, self.when)
            if not len(rows):
                raise refusal("of", self.label, "names no sample time", "keep one there: save=lw.SaveAt(at=[...])")
            return self._numbers(result, slice(rows[0], rows[0] + 1), members)
        so = self._so(result)
        if self.kind == "outcome":
            return so[:, None].astype(np.float64)
        numbers = (
            result.end_time[:, None] if self.kind == "end_time" else self._numbers(result, slice(-1, None), members)
        )
        return np.where(so[:, None], numbers, np.nan)

    def _so(self, result: Result) -> np.ndarray:
        """Mask of members with this outcome, (n,)."""
        events = events_of(result.provenance["scene"].get("events", ()))
        status, named = np.asarray(result.status), {event.key: event.status for event in events}
        if self.outcome in named and result.event is not None:
            return np.asarray(result.event) == 1 + list(named).index(self.outcome)
        for name in self.gathered(events):
            if name in result.statistics:
                return ~np.isnan(result.statistics[name].value[0, 0])
            problem = f"is one of several events of the status {named[self.outcome].name.lower()}"
            raise refusal("of", self.label, problem, "gather lw.statistics.Outcome, or ask lw.uq or lw.prepare for it")
        if self.outcome in named:
            return np.asarray(status == named[self.outcome])
        return Ends(status, np.zeros_like(status), result.end_time).are(self.outcome)

    def _numbers(self, result: Result, when: slice, members: Any) -> np.ndarray:
        """The quantity at one sample time, (n, m)."""
        assert isinstance(self.of, Functional)
        return self.of(*samples_of(result, when, members))[0]

    def labels(self, count: int) -> list[str]:
        """Name each number of the quantity."""
        if self.kind != "at":
            return [self.label]
        end = self.label.partition(" at ")[2]
        return [f"{label} at {end}" for label in super().labels(count)]


@dataclass(frozen=True)
class MetricQuantity(OfResult):
    """Metric of a control loop, one number per member: infinite if it is never reached, NaN for a failed member.

    metric: The statistic that keeps the numbers of all members.
    """

    metric: Any = None

    @classmethod
    def named(cls, key: str, entry: Any) -> MetricQuantity:
        """Make the quantity from a metric's name or object, as in a sweep; key: name of the argument, for messages."""
        label, metric = metric_of(key, entry)
        return cls(label, functional(key, "position"), metric=metric)

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the required samples; the data of the metric itself are gathered separately."""
        return ("position",)

    @property
    def unit(self) -> str:
        """Unit of the quantity; "" for a metric."""
        return ""

    @property
    def of_samples(self) -> bool:
        """Whether the metric uses the saved samples instead of every tick."""
        return not self.metric.ticks

    @property
    def may_be_infinite(self) -> bool:
        """Always true: a settling time is infinite if a member never settles."""
        return True

    def gathered(self, events: Sequence[Event]) -> dict[str, Statistic]:
        """The metric as the statistic to gather."""
        return {gathered_name(self.label): self.metric}

    def values(self, result: Result, members: Any = None) -> np.ndarray:
        """Look up the numbers of the members, float64, (n, 1)."""
        if gathered_name(self.label) not in result.statistics:
            problem = "is a metric that the run has not gathered by member"
            raise refusal(
                "of",
                self.label,
                problem,
                "ask lw.prepare or lw.uq for it, or gather it then=lw.statistics.MemberValues()",
            )
        numbers = numbers_of_members(result.statistics, self.label)
        return np.where(failed(np.asarray(result.status)), np.nan, numbers)[:, None]

    def labels(self, count: int) -> list[str]:
        """Name of the quantity."""
        return [self.label]


def _of_ends(text: str) -> EndQuantity | None:
    """Parse a text that names an outcome or a time; None if it names neither. Raises SceneError."""
    kind, _, outcome = text.partition(" ")
    if f"{kind} ".startswith(ENDS) and outcome.strip():
        return EndQuantity(text, functional("of", "position"), kind=kind, outcome=outcome.strip())
    name, _, end = (part.strip() for part in text.partition(" at "))
    if not end:
        return None
    function = functional("of", name)
    if function.over_path:
        raise refusal("of", text, "is taken over the whole path, which has no time", f"give {name!r} alone")
    label = f"{function.label} at {end}"
    try:
        when = float(end)
    except ValueError:
        return EndQuantity(label, function, outcome=end)
    if not 0.0 <= when < np.inf:
        raise refusal("of", text, "is at no time of a run", "give a time from 0 [s]")
    return EndQuantity(label, function, when=when)


class _Samples(dict[str, np.ndarray]):
    """Samples of a result as an argument of functions of (samples, members)."""

    def __init__(self, fields: Mapping[str, np.ndarray], time: np.ndarray, result: Result):
        super().__init__(fields)
        self.time, self.terms, self._result = time, result.terms, result

    @property
    def events(self) -> tuple[Event, ...]:
        """The events of the scene."""
        return events_of(self._result.provenance["scene"].get("events", ()))


def samples_of(result: Result, when: slice = slice(None), members: Any = None) -> tuple[Any, Any]:
    """The (samples, members) of a result, as arguments of a Quantity's function."""
    fields = {name: result.samples[name][when] for name in ordered(result.samples)}
    start = {name: result.samples[name][0] for name in fields}
    known = SimpleNamespace(parameters=result.parameters, starts=result.starts, count=result.members, **start)
    return _Samples(fields, result.time[when], result), known if members is None else members


def unit_of(of: OfInterest) -> str:
    """Unit of a quantity of interest; "" if it has none, or if it is unknown."""
    try:
        (each,) = quantities(of)
    except SceneError:
        return ""
    metric = getattr(each, "metric", None)
    return each.unit if metric is None else getattr(metric, "unit", metric.quantity.unit)


def quantities(of: OfInterest | Sequence[OfInterest]) -> tuple[OfResult, ...]:
    """Convert one or several quantities of interest to `OfResult`.

    of: A text such as "max(depth)", "outcome floor", "end_time floor", "depth at 30" or "iae depth", a Quantity, a
        metric, a function of a Result or of (samples, members), an `OfResult`, or a sequence of these.
    """
    items = None if isinstance(of, OfResult | Statistic) or callable(of) else items_of(of)
    requests = [of] if items is None else items
    faults = Faults()
    results: list[OfResult] = []
    for request in requests:
        if isinstance(request, OfResult):
            results.append(request)
        elif names_a_metric(request):
            with faults.including():
                results.append(MetricQuantity.named("of", request))
        elif callable(request) and not isinstance(request, Quantity) and not _of_samples(request):
            results.append(OfResult(getattr(request, "__name__", type(request).__name__), request))
        elif isinstance(request, str | Quantity) or callable(request):
            with faults.including():
                if isinstance(request, str) and (of_ends := _of_ends(request)) is not None:
                    results.append(of_ends)
                    continue
                function = functional("of", request)
                results.append(OfResult(function.label, function, not isinstance(request, str)))
        else:
            faults.add("of", request, "is not a quantity", REMEDY)
    metrics = [result.label for result in results if isinstance(result, MetricQuantity)]
    for name in sorted({name for name in metrics if metrics.count(name) > 1}):
        faults.add("of", name, "is the name of another metric", 'give it a name of its own: name="..."')
    if not requests:
        faults.add("of", of, "names nothing", REMEDY)
    faults.raise_if_any()
    return tuple(results)


def names_a_metric(request: Any) -> bool:
    """Whether a request is a metric. A text about the members' ends is not, and "energy" is the energy at the end."""
    a_quantity = isinstance(request, str) and request in KNOWN
    return names_a_statistic(request) and not names_an_end(request) and not a_quantity


def names_an_end(request: Any) -> bool:
    """Whether a request is the outcome or the end time of members."""
    return isinstance(request, str) and request.startswith(ENDS)


def _of_samples(function: Callable[..., Any]) -> bool:
    """Whether a function takes (samples, members), as for statistics, and not a Result."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return False
    wanted = [parameter for parameter in parameters if parameter.default is parameter.empty]
    return sum(item.kind in (item.POSITIONAL_ONLY, item.POSITIONAL_OR_KEYWORD) for item in wanted) == 2
