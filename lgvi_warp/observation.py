"""What a run keeps of its members: samples, statistics, or both; and when it has members enough."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp import statistics as kinds
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.errors import Faults
from lgvi_warp.saveat import FIELDS
from lgvi_warp.scene import check_keep
from lgvi_warp.statistics import Estimate, Statistic
from lgvi_warp.statistics.until import Until, Watch, from_dict, watch
from lgvi_warp.status import Status

# Samplings whose means are at least as close as those of independent members.
EVENLY_SPREAD = ("latin_hypercube", "sobol", "halton")


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
            failed = (status != 0) & (status < Status.SURFACE)
            return np.flatnonzero(failed) if self.keep == "failed" else np.empty(0, np.int64)
        return np.array([i for i in self.keep if i < len(status)], dtype=np.int64)

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file."""
        content: dict[str, Any] = {"keep": self.keep if isinstance(self.keep, str) else [int(i) for i in self.keep]}
        if self.statistics:
            content["statistics"] = [one.to_dict() for one in self.statistics]
        return content | ({"until": self.until.to_dict()} if self.until else {})


def watch_fields(until: Until, statistics: Sequence[Statistic]) -> tuple[str, ...]:
    """Sample fields of what is watched. Raises SceneError where it is nothing."""
    return watch(Until(until.statistic, until.half_width), statistics, np.zeros(1)).statistic.quantity.fields


def observe(plan_members: int, settings: Any, given: Any, keep: Any, until: Any) -> Observation:
    """From the arguments of solve, and from the scene's [run] for those that are None. Raises SceneError."""
    faults = Faults()
    found: tuple[Statistic, ...] = ()
    stop: Until | None = None
    keep = settings.keep if keep is None else keep
    with faults.including():
        found = kinds.from_list(settings.statistics if given is None else given)
    with faults.including():
        asked = settings.until if until is None else until
        stop = None if asked is None else from_dict(asked)
    check_keep(faults, "keep", keep, plan_members)
    if stop is not None and not faults:
        with faults.including():
            watch_fields(stop, found)
    faults.raise_if_any()
    chosen = keep if isinstance(keep, str) else tuple(sorted({int(i) for i in keep}))
    return Observation(found, chosen, stop)


def notes(estimates: Mapping[str, Estimate], ensemble: Ensemble, members: int) -> tuple[str, ...]:
    """What a user should know of his statistics."""
    found: tuple[str, ...] = ()
    if not estimates:
        return found
    counts = [one.count for one in estimates.values() if one.settings["type"] != "first_passage"]
    fewest = min((int(count.min()) for count in counts), default=members)
    sampling = getattr(ensemble, "sampling", "random")
    kind = str(getattr(sampling, "kind", sampling))
    if fewest < members:
        text = f"statistics leave members out from their failure on: {fewest} of {members} count where fewest do"
        found += (f"{text} (count of each statistic)",)
    if kind in EVENLY_SPREAD:
        text = f"intervals are those of independent members, wider than need be for sampling {kind!r}"
        found += (f"{text}: repetitions with other seeds show by how much",)
    elif kind != "random":
        text = f"intervals are those of independent members, which a {kind} does not give"
        found += (f"{text}: do not rely on them",)
    return found
