# SPDX-License-Identifier: Apache-2.0
"""Data that a run keeps (samples, statistics or both), and the condition under which it stops early."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.sentences import sentences
from lgvi_warp.common.status import failed, stopped
from lgvi_warp.control.signals import SIGNALS, ordered
from lgvi_warp.engine.keepers.statistics import Gathered
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.settings import read_keep
from lgvi_warp.statistics.base import Statistic, from_list
from lgvi_warp.statistics.ends import check_outcomes, outcomes
from lgvi_warp.statistics.estimates.estimate import Estimate, Estimates
from lgvi_warp.statistics.tracking import check_wanted
from lgvi_warp.statistics.until import StoppingRule, Until, from_dict, watch
from lgvi_warp.statistics.values.quantity import Quantity

# Effective members below which intervals of weighted members are not to be relied on.
FEW = 100
# Samplings whose means are at least as close as those of independent members.
EVENLY_SPREAD = ("latin_hypercube", "sobol", "halton")


def replicates_of(ensemble: Mapping[str, Any]) -> int:
    """Number of independent replicates of an ensemble's design, from its provenance."""
    sampling = ensemble.get("sampling", "random")
    if isinstance(sampling, str) or "indices" in ensemble or ensemble.get("explicit"):
        return 1
    return int(sampling.get(next(iter(sampling)), {}).get("replicates", 1))


@dataclass(frozen=True)
class Observation:
    """Data that a run keeps, and the condition `until` that ends it before the last member; None without a condition."""

    statistics: tuple[Statistic, ...] = ()
    keep: Any = "all"
    until: Until | None = None

    @property
    def samples(self) -> bool:
        """Whether the samples of all members are kept during the run."""
        return isinstance(self.keep, str) and self.keep == "all"

    @property
    def ticks(self) -> bool:
        """Whether a statistic uses the samples at all ticks of a controller."""
        return any(statistic.ticks for statistic in self.statistics)

    @property
    def apart(self) -> bool:
        """Whether each block runs alone: the run may end after any, or the data of all ticks should stay in the caches."""
        return self.until is not None or self.ticks

    def read_at_ticks(self) -> dict[str, tuple[int, ...]]:
        """Fields of the motion that statistics read at the ticks of a controller."""
        entries: dict[str, tuple[int, ...]] = {}
        for quantity in (statistic.quantity for statistic in self.statistics if statistic.ticks):
            few = dict(quantity.entries)
            for name in quantity.fields:
                if name in FIELDS:
                    numbers, known = few.get(name, ()), entries.get(name)
                    whole_field = not numbers or known == ()
                    entries[name] = () if whole_field else tuple(sorted({*numbers, *(known or ())}))
        return entries

    def fields(self, names: Sequence[str]) -> tuple[str, ...]:
        """The sample fields that the kernel must write: those to keep and those that statistics need."""
        wanted = {name for statistic in self.statistics for name in statistic.quantity.fields}
        if self.until is not None:
            wanted |= set(watch_fields(self.until, self.statistics))
        if self.samples:
            wanted |= set(names)
        elif self.keep != "none":
            # Members that are run again have the bits of the run, and so its kernel, which notes these signals.
            wanted |= set(names) & SIGNALS.keys()
        return ordered(wanted)

    def watch(self, times: np.ndarray) -> tuple[tuple[Statistic, ...], StoppingRule | None]:
        """The statistics to gather at times (k,) [s], and the rule of the stopping condition, or None.

        The statistic of the stopping condition is added if it is not among them.
        """
        if self.until is None:
            return self.statistics, None
        watching = watch(self.until, self.statistics, times)
        added = () if any(statistic is watching.statistic for statistic in self.statistics) else (watching.statistic,)
        return (*self.statistics, *added), watching

    def again(self, status: np.ndarray) -> np.ndarray:
        """The members to run again for their samples, from the status (n,) of all members."""
        if isinstance(self.keep, str):
            return np.flatnonzero(failed(status)) if self.keep == "failed" else np.empty(0, np.int64)
        return np.array([i for i in self.keep if i < len(status)], dtype=np.int64)

    def to_dict(self) -> dict[str, Any]:
        """The observation as a table, as in a scene file."""
        content: dict[str, Any] = {"keep": self.keep if isinstance(self.keep, str) else [int(i) for i in self.keep]}
        if self.statistics:
            content["statistics"] = [statistic.to_dict() for statistic in self.statistics]
        content |= {"until": self.until.to_dict()} if self.until else {}
        function_keys = [statistic.key for statistic in self.statistics if of_functions(statistic)]
        return content | ({"functions": function_keys} if function_keys else {})


def of_functions(value: Any) -> bool:
    """Whether a statistic depends on the user's functions or quantities, which its table cannot contain."""
    if isinstance(value, Statistic):
        return any(of_functions(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, list | tuple):
        return any(of_functions(entry) for entry in value)
    return isinstance(value, Quantity) or callable(value)


def observation_of(saved: Mapping[str, Any] | None, statistics: Any = None) -> Observation:
    """Restore an observation from its table; None: from a run that kept only samples.

    statistics: the run's statistics; needed if they depend on functions.
    """
    if saved is None:
        if statistics:
            raise SceneError([f"statistics = {statistics}: the run gathered none. Leave them out"])
        return Observation()
    if statistics is None and saved.get("functions"):
        names = ", ".join(saved["functions"])
        problem = "are of functions that a store does not hold"
        raise SceneError([sentences(f"statistics: {names}", problem, "give statistics=[...] again")])
    keep = saved["keep"] if isinstance(saved["keep"], str) else tuple(saved["keep"])
    until = from_dict(saved["until"]) if "until" in saved else None
    observation = Observation(from_list(saved.get("statistics", ()) if statistics is None else statistics), keep, until)
    table, expected = observation.to_dict(), {name: value for name, value in saved.items() if name != "fields"}
    if table != expected:
        wanted, run_had = table.get("statistics"), expected.get("statistics")
        raise SceneError([f"statistics = {wanted} are not the run's, {run_had}. Give those"])
    return observation


class Observing:
    """An observation during a run: it gathers the statistics at times (k,) [s], and decides whether the run may stop."""

    def __init__(self, observed: Observation, time: np.ndarray, members: int, replicates: int = 1):
        statistics, self._watch = observed.watch(time)
        if self._watch is not None:
            self._watch.doubling = replicates > 1
        self._gathered = Gathered(time, members, statistics, replicates) if statistics else None

    @property
    def keepers(self) -> tuple[Gathered, ...]:
        """The keeper of the statistics, or none if there are no statistics."""
        return (self._gathered,) if self._gathered else ()

    def enough(self, members: int) -> bool:
        """Whether the run may end; called after each block, in block order."""
        watch = self._watch
        return bool(watch and watch.due(members) and watch.reached(self._watched()))

    def _watched(self) -> list[Estimate]:
        return self._gathered.estimates(self._watch.statistic) if self._gathered and self._watch else []

    def read(self, ensemble: Mapping[str, Any], status: np.ndarray) -> tuple[Estimates, tuple[str, ...]]:
        """The statistics by name, and messages about them; status: (m,), of the members that ran."""
        estimates, members = self._gathered.result() if self._gathered else Estimates(), len(status)
        messages = messages_about(estimates, ensemble, status, self._gathered.apart if self._gathered else ())
        return estimates, messages + ((self._watch.report(members, self._watched()),) if self._watch else ())


def watch_fields(until: Until, statistics: Sequence[Statistic]) -> tuple[str, ...]:
    """The sample fields that a stopping condition needs."""
    return watch(Until(until.statistic, until.half_width), statistics, np.zeros(1)).statistic.quantity.fields


def observe(fleet: Ensemble, statistics: Any = None, keep: Any = None, until: Any = None) -> Observation:
    """Make the observation from the arguments of solve; arguments that are None come from the scene's [run]."""
    faults, scene = Faults(), fleet.scene
    settings, events = scene.run, scene.events
    gathered: tuple[Statistic, ...] = ()
    stop: Until | None = None
    keep = settings.keep if keep is None else keep
    with faults.including():
        gathered = from_list(settings.statistics if statistics is None else statistics)
    known = outcomes([event.key for event in events], [event.status for event in events])
    for statistic in gathered:
        with faults.including():
            check_outcomes(f"{statistic.type}.{'at' if statistic.at else 'of'}", statistic.outcomes, known)
    check_wanted(faults, "statistics", {statistic.key: statistic for statistic in gathered}, scene.controller)
    with faults.including():
        condition = settings.until if until is None else until
        stop = None if condition is None or condition is False else from_dict(condition)
    kept: str | list[int] = []
    with faults.including():
        kept = read_keep("keep", keep, fleet.members)
    if stop is not None and not faults:
        with faults.including():
            watch_fields(stop, gathered)
    faults.raise_if_any()
    return Observation(gathered, kept if isinstance(kept, str) else tuple(kept), stop)


def messages_about(
    estimates: Mapping[str, Estimate], ensemble: Mapping[str, Any], status: np.ndarray, apart: Collection[str] = ()
) -> tuple[str, ...]:
    """Messages about statistics: members left out by status (m,), and intervals that do not suit the sampling."""
    if not estimates:
        return ()
    members, messages = len(status), _left_out(estimates, status, apart) + _few_effective(estimates, apart)
    sampling, R = ensemble.get("sampling", "random"), replicates_of(ensemble)
    kind = sampling if isinstance(sampling, str) else next(iter(sampling))
    if R > 1:
        points = members // R
        if kind == "sobol" and points & (points - 1):
            low = 1 << (points.bit_length() - 1)
            text = f"each of {R} replicates has {points} points of a Sobol sequence, which is balanced at powers of two"
            better = f"{low * R} or {2 * low * R} members would have narrower intervals for what they cost"
            messages += (f"{text}: {better}",)
    elif kind in EVENLY_SPREAD:
        text = f"intervals are those of independent members, wider than need be for sampling {kind!r}"
        better = f"with replicates, {{ {kind} = {{ replicates = 16 }} }}, they are those of its own spread"
        messages += (f"{text}: {better}",)
    elif kind != "random" and not any("members" in estimate.arrays for estimate in estimates.values()):
        text = f"intervals are those of independent members, which a {kind} does not give"
        messages += (f"{text}: do not rely on them",)
    return messages


def _few_effective(estimates: Mapping[str, Estimate], apart: Collection[str]) -> tuple[str, ...]:
    """Message that the weights leave few effective members, for estimates over all members."""
    numbers = [
        (float(estimate.count.min()), int(estimate["members"].max()))
        for name, estimate in estimates.items()
        if "members" in estimate.arrays and name not in apart and estimate.settings["type"] != "first_passage"
    ]
    numbers += [
        (float(estimate.count[0] + (estimate["ended"] + estimate["otherwise"])[0]), int(estimate["members"][0]))
        for estimate in estimates.values()
        if "members" in estimate.arrays and estimate.settings["type"] == "outcome"
    ]
    if not numbers or min(numbers)[0] >= FEW:
        return ()
    effective, members = min(numbers)
    text = (
        f"the weights leave an effective number of {effective:.3g} of {members:,} members: intervals hold from {FEW} on"
    )
    return (f"{text}. Run more members, or draw them nearer to where the weights are large",)


def _left_out(estimates: Mapping[str, Estimate], status: np.ndarray, apart: Collection[str]) -> tuple[str, ...]:
    """Message on members that do not count. First passages report theirs; estimates `apart` omit members by design."""
    members = len(status)
    count = {
        estimate: int(estimate.arrays.get("members", estimate.count).min())
        for estimate in estimates.values()
        if estimate.name not in apart and estimate.settings["type"] != "first_passage"
    }
    fewer = [estimate for estimate, number in count.items() if number < members]
    if not fewer:
        return ()
    failures, ended = int(failed(status).sum()), int(stopped(status).sum())
    stopped_early = {estimate: ended if estimate.settings.get("stopped") == "left_out" else 0 for estimate in fewer}
    why = [f"{failures} members from their failure on"] if failures else []
    if any(stopped_early.values()):
        why += [f'{ended} members from the event on that stopped them (stopped = "left_out")']
    if any(count[estimate] < members - failures - stopped_early[estimate] for estimate in fewer):
        weighted = any("members" in estimate.arrays for estimate in fewer)
        why += ["members of no weight, or where" if weighted else "members where"]
        why[-1] += " a number of theirs is not finite"
    text = f"statistics leave out {', and '.join(why)}: {min(count.values())} of {members} count where fewest do"
    return (f"{text} (count of each statistic)",)
