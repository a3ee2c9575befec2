"""What a run keeps of its members: samples, statistics, or both; and when it has members enough."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.status import failed, stopped
from lgvi_warp.engine.keepers.statistics import Gathered
from lgvi_warp.methods.saveat import FIELDS
from lgvi_warp.physics.terms.events import Event
from lgvi_warp.scene.settings import check_keep
from lgvi_warp.statistics import Estimate, Estimates, Quantity, Statistic
from lgvi_warp.statistics.base import from_list
from lgvi_warp.statistics.ends import check_outcomes, outcomes
from lgvi_warp.statistics.until import Until, Watch, from_dict, watch

# Samplings whose means are at least as close as those of independent members.
EVENLY_SPREAD = ("latin_hypercube", "sobol", "halton")


def replicates_of(ensemble: Mapping[str, Any]) -> int:
    """Independent replicates of an ensemble's design, from its provenance; 1 for chosen members: they are no design."""
    sampling = ensemble.get("sampling", "random")
    if isinstance(sampling, str) or "indices" in ensemble or ensemble.get("explicit"):
        return 1
    return int(sampling.get(next(iter(sampling)), {}).get("replicates", 1))


@dataclass(frozen=True)
class Observation:
    """statistics: gathered while the run goes. keep: "all" samples of members, "none", "failed", or indices of members.

    until: when to stop before the last member.
    """

    statistics: tuple[Statistic, ...] = ()
    keep: Any = "all"
    until: Until | None = None

    @property
    def samples(self) -> bool:
        """Whether the samples of every member are kept while the run goes."""
        return isinstance(self.keep, str) and self.keep == "all"

    def fields(self, asked: Sequence[str]) -> tuple[str, ...]:
        """Sample fields that the kernel must write: those to be kept, and those that statistics are of."""
        wanted = {name for one in self.statistics for name in one.quantity.fields}
        if self.until is not None:
            wanted |= set(watch_fields(self.until, self.statistics))
        if self.samples:
            wanted |= set(asked)
        return tuple(name for name in FIELDS if name in wanted)

    def watch(self, times: np.ndarray) -> tuple[tuple[Statistic, ...], Watch | None]:
        """The statistics, with what is watched among them, and the watch. Raises SceneError."""
        if self.until is None:
            return self.statistics, None
        found = watch(self.until, self.statistics, times)
        added = () if any(one is found.statistic for one in self.statistics) else (found.statistic,)
        return (*self.statistics, *added), found

    def again(self, status: np.ndarray) -> np.ndarray:
        """Indices of the members to be run again for their samples, of those whose status is given."""
        if isinstance(self.keep, str):
            return np.flatnonzero(failed(status)) if self.keep == "failed" else np.empty(0, np.int64)
        return np.array([i for i in self.keep if i < len(status)], dtype=np.int64)

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file."""
        content: dict[str, Any] = {"keep": self.keep if isinstance(self.keep, str) else [int(i) for i in self.keep]}
        if self.statistics:
            content["statistics"] = [one.to_dict() for one in self.statistics]
        content |= {"until": self.until.to_dict()} if self.until else {}
        own = [one.key for one in self.statistics if _of_functions(one)]
        return content | ({"functions": own} if own else {})


def _of_functions(value: Any) -> bool:
    """Whether a statistic is of functions or quantities of the user, which its table does not tell."""
    if isinstance(value, Statistic):
        return any(_of_functions(getattr(value, one.name)) for one in fields(value))
    if isinstance(value, list | tuple):
        return any(_of_functions(one) for one in value)
    return isinstance(value, Quantity) or callable(value)


def observation_of(told: Mapping[str, Any] | None, statistics: Any = None) -> Observation:
    """What `to_dict` told. statistics: the run's own, needed where they are of functions. Raises SceneError."""
    if told is None:
        if statistics:
            raise SceneError([f"statistics = {statistics}: the run gathered none; leave them out"])
        return Observation()
    if statistics is None and told.get("functions"):
        names = ", ".join(told["functions"])
        raise SceneError(
            [f"statistics: {names}: are of functions that a store does not hold; give statistics=[...] again"]
        )
    keep = told["keep"] if isinstance(told["keep"], str) else tuple(told["keep"])
    until = from_dict(told["until"]) if "until" in told else None
    found = Observation(from_list(told.get("statistics", ()) if statistics is None else statistics), keep, until)
    made, wanted = found.to_dict(), {name: value for name, value in told.items() if name != "fields"}
    if made != wanted:
        raise SceneError(
            [f"statistics = {made.get('statistics')}: are not the run's, {wanted.get('statistics')}; give those"]
        )
    return found


class Observing:
    """An Observation at work: the keeper of its statistics, when there are members enough, and what it then says.

    time: (k,) [s], of the samples; members: of the whole ensemble; replicates: of its design. Raises SceneError.
    """

    def __init__(self, observed: Observation, time: np.ndarray, members: int, replicates: int = 1):
        statistics, self._watch = observed.watch(time)
        if self._watch is not None:
            self._watch.doubling = replicates > 1
        self._gathered = Gathered(time, members, statistics, replicates) if statistics else None

    @property
    def keepers(self) -> tuple[Gathered, ...]:
        """That of the statistics, if there are any."""
        return (self._gathered,) if self._gathered else ()

    def enough(self, members: int) -> bool:
        """Whether the run may end with so many members: asked in the order of the blocks, after each."""
        watch = self._watch
        return bool(watch and watch.due(members) and watch.reached(self._watched()))

    def _watched(self) -> list[Estimate]:
        return self._gathered.estimates(self._watch.statistic) if self._gathered and self._watch else []

    def read(self, ensemble: Mapping[str, Any], status: np.ndarray) -> tuple[Estimates, tuple[str, ...]]:
        """(statistics, what the user should know of them); ensemble: its provenance; status: of the members that ran."""
        estimates, members = self._gathered.result() if self._gathered else Estimates(), len(status)
        said = notes(estimates, ensemble, status, self._gathered.apart if self._gathered else ())
        return estimates, said + ((self._watch.report(members, self._watched()),) if self._watch else ())


def watch_fields(until: Until, statistics: Sequence[Statistic]) -> tuple[str, ...]:
    """Sample fields of what is watched. Raises SceneError where it is nothing."""
    return watch(Until(until.statistic, until.half_width), statistics, np.zeros(1)).statistic.quantity.fields


def observe(
    plan_members: int, settings: Any, given: Any, keep: Any, until: Any, events: Sequence[Event] = ()
) -> Observation:
    """From the arguments of solve, and from the scene's [run] for those that are None. Raises SceneError.

    events: those of the scene.
    """
    faults = Faults()
    found: tuple[Statistic, ...] = ()
    stop: Until | None = None
    keep = settings.keep if keep is None else keep
    with faults.including():
        found = from_list(settings.statistics if given is None else given)
    known = outcomes([one.key for one in events], [one.status for one in events])
    for one in found:
        with faults.including():
            check_outcomes(f"{one.type}.{'at' if one.at else 'of'}", one.outcomes, known)
    with faults.including():
        asked = settings.until if until is None else until
        stop = None if asked is None or asked is False else from_dict(asked)
    check_keep(faults, "keep", keep, plan_members)
    if stop is not None and not faults:
        with faults.including():
            watch_fields(stop, found)
    faults.raise_if_any()
    chosen = keep if isinstance(keep, str) else tuple(sorted({int(i) for i in keep}))
    return Observation(found, chosen, stop)


def notes(
    estimates: Mapping[str, Estimate], ensemble: Mapping[str, Any], status: np.ndarray, apart: Collection[str] = ()
) -> tuple[str, ...]:
    """What a user should know of his statistics; ensemble: its provenance; status: of the members that ran.

    apart: names of estimates that are not of all members on purpose.
    """
    if not estimates:
        return ()
    members, found = len(status), _left_out(estimates, status, apart)
    sampling, R = ensemble.get("sampling", "random"), replicates_of(ensemble)
    kind = sampling if isinstance(sampling, str) else next(iter(sampling))
    if R > 1:
        points = members // R
        if kind == "sobol" and points & (points - 1):
            low = 1 << (points.bit_length() - 1)
            text = f"each of {R} replicates has {points} points of a Sobol sequence, which is balanced at powers of two"
            found += (f"{text}: {low * R} or {2 * low * R} members would have narrower intervals for what they cost",)
    elif kind in EVENLY_SPREAD:
        text = f"intervals are those of independent members, wider than need be for sampling {kind!r}"
        found += (f"{text}: with replicates, {{ {kind} = {{ replicates = 16 }} }}, they are those of its own spread",)
    elif kind != "random":
        text = f"intervals are those of independent members, which a {kind} does not give"
        found += (f"{text}: do not rely on them",)
    return found


def _left_out(estimates: Mapping[str, Estimate], status: np.ndarray, apart: Collection[str]) -> tuple[str, ...]:
    """That some members do not count, and why; first passages tell of theirs as lost.

    apart: names of estimates that are not of all members on purpose.
    """
    members = len(status)
    of_all = (one for one in estimates.values() if one.name not in apart and one.settings["type"] != "first_passage")
    count = {one: int(one.count.min()) for one in of_all}
    fewer = [one for one, number in count.items() if number < members]
    if not fewer:
        return ()
    failures, ended = int(failed(status).sum()), int(stopped(status).sum())
    out = {one: ended if one.settings.get("stopped") == "left_out" else 0 for one in fewer}
    why = [f"{failures} members from their failure on"] if failures else []
    if any(out.values()):
        why += [f'{ended} members from the event on that stopped them (stopped = "left_out")']
    if any(count[one] < members - failures - out[one] for one in fewer):
        why += ["members where a number of theirs is not finite"]
    text = f"statistics leave out {', and '.join(why)}: {min(count.values())} of {members} count where fewest do"
    return (f"{text} (count of each statistic)",)
