"""When a run has members enough: a statistic's interval is as narrow as was asked for."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError, closest
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimate import Estimate
from lgvi_warp.statistics.moments import Covariance, Mean
from lgvi_warp.statistics.naming import canonical
from lgvi_warp.statistics.order import Quantiles
from lgvi_warp.statistics.quantity import KNOWN

# Looks are made at every block until this share of the members is a block, then whenever so many came to them.
GROWTH = 0.05


@dataclass(frozen=True)
class Until:
    """Run blocks of members until a statistic's interval is narrow enough, the ensemble's members at most.

    statistic: the name of one of the run's statistics, such as "mean position"; one component of it, "mean position[2]";
    one level of it, "quantiles depth 0.95" or "quantiles position[2] 0.95"; one entry of a covariance, "covariance
    position[0], position[2]": as the command prints them. A mean of any quantity is gathered if it is not among them.
    half_width: in the statistic's unit, above 0; every component and level of what is named must keep it. at: sample
    time [s], by default the end; "all": at every sample time. members: no look before so many (a small sample may look
    narrower than it is). The run stops at a block's end; looks are made in the order of the blocks, so members and bits do
    not depend on threads; with replicates of a design, at powers of two of members. docs/statistics.md says what stopping
    does to coverage.

    Raises SceneError naming every fault.
    """

    statistic: str
    half_width: float
    at: Any = None
    members: int = 1024

    def __post_init__(self) -> None:
        faults = Faults("until.")
        if not isinstance(self.statistic, str):
            faults.add("statistic", self.statistic, "is no name", 'give "mean position[2]"')
        faults.positive("half_width", self.half_width, "in the unit of the statistic")
        if self.at is not None and self.at != "all":
            faults.number("at", self.at, "s", least=0.0)
        if isinstance(self.members, bool) or not isinstance(self.members, Integral) or self.members < 2:
            faults.add("members", self.members, "is no whole number from 2", "give 1024")
        faults.raise_if_any()
        object.__setattr__(self, "members", int(self.members))

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file."""
        defaults = {"at": None, "members": 1024}
        return {name: value for name, value in vars(self).items() if name not in defaults or value != defaults[name]}


def from_dict(given: Any) -> Until:
    """An Until, or one from a table of a scene file. Raises SceneError."""
    if isinstance(given, Until):
        return given
    faults = Faults()
    example = 'write [run.until] and statistic = "mean position[2]", half_width = 0.01'
    if not isinstance(given, dict):
        faults.add("until", given, "is no table", example)
    else:
        faults.keys("until", given, Until.__dataclass_fields__)
        for name in ("statistic", "half_width"):
            if name not in given:
                faults.add(f"until.{name}", "", "is missing", example)
    faults.raise_if_any()
    return Until(**given)


@dataclass
class Watch:
    """An Until at work on a run's statistics: which, and which of its numbers.

    doubling: looks at powers of two of members only. With replicates a design is balanced there, and the spread of a few
    estimates comes out small by chance too often for many looks.
    """

    until: Until
    statistic: Statistic
    name: str
    # Dimension -> index: which entries along it are watched, all along others.
    entry: Mapping[str, int]
    rows: np.ndarray
    looked: int = 0
    doubling: bool = False

    def due(self, members: int) -> bool:
        """Whether to look, with so many members done."""
        if members < self.until.members or members < self.looked * (1.0 + GROWTH):
            return False
        if self.doubling and members & (members - 1):
            return False
        self.looked = members
        return True

    def reached(self, estimates: Sequence[Estimate]) -> bool:
        """Whether what is watched is narrow enough."""
        return self.widest(estimates) <= self.until.half_width

    def report(self, members: int, estimates: Sequence[Estimate]) -> str:
        """How it ended, for the user."""
        widest = self.widest(estimates)
        word = "reached" if widest <= self.until.half_width else "not reached"
        asked = f"half width {self.until.half_width:g} of {self.until.statistic}"
        return f"{asked}: {word} with {members} members, {widest:.3g}"

    def widest(self, estimates: Sequence[Estimate]) -> float:
        """The largest half width of what is watched; infinite where a number has none."""
        estimate = next(one for one in estimates if one.name == self.name)
        half = estimate.half_width
        dims = estimate.dims["value"]
        if "time" in dims and half.shape[0] > 1:
            half = half[self.rows]
        for dim, i in self.entry.items():
            if dim in dims:
                half = np.take(half, [i], axis=dims.index(dim))
        return float(np.max(np.where(np.isnan(half), np.inf, half)))


def watch(until: Until, statistics: Sequence[Statistic], times: np.ndarray) -> Watch:
    """Find what is to be watched; a Mean that is not among the statistics is made. Raises SceneError."""
    faults = Faults("until.")
    rows = np.array([len(times) - 1])
    if until.at == "all":
        rows = np.arange(len(times))
    elif until.at is not None:
        rows = np.flatnonzero(np.abs(times - until.at) <= 1e-9 * max(1.0, times[-1]))
        if not len(rows):
            faults.add("at", until.at, "is no sample time", "give a time at which samples are kept, or leave it out")
    known = _named(statistics)
    found = known.get(until.statistic)
    if found is None and isinstance(until.statistic, str):
        alike = (one for name, one in known.items() if canonical(name) == canonical(until.statistic))
        found = next(alike, None) or _mean(until.statistic)
    if found is None:
        hint = closest(until.statistic, known or KNOWN)
        if known and not hint.startswith("did you mean"):  # of all names, those of whole statistics say enough
            hint = closest(until.statistic, dict.fromkeys(name for _, name, _ in known.values()))
        faults.add("statistic", until.statistic, "is none of the run's statistics", hint)
    faults.raise_if_any()
    assert found is not None
    if found[0].type == "extremes":
        faults.add("statistic", until.statistic, "has no interval", "watch a quantile")
    faults.raise_if_any()
    return Watch(until, *found, rows)


Named = tuple[Statistic, str, dict[str, int]]


def _named(statistics: Sequence[Statistic]) -> dict[str, Named]:
    """What can be watched, by every name of it: the statistic that gathers it, the estimate's name, and which entry."""
    every = [(whole, one) for whole in statistics for one in whole.parts()]
    found: dict[str, Named] = {one.key: (whole, one.key, {}) for whole, one in every}
    for whole, one in every:
        for name, entry in _entries(one).items():
            found.setdefault(name, (whole, one.key, entry))
    return found


def _entries(one: Statistic) -> dict[str, dict[str, int]]:
    """The names of one statistic, of its components, of their levels, and of the entries of a covariance."""
    found: dict[str, dict[str, int]] = {one.key: {}}
    for i, label in enumerate(one.quantity.labels):
        index = re.search(r"\[[^\]]*\]", label)
        found[f"{one.key}{index[0] if index else f'[{i}]'}"] = found[f"{one.type} {label}{one.at_text}"] = {
            "component": i,
            "component_2": i,
        }
    if isinstance(one, Quantiles):
        for name, entry in list(found.items()):
            for j, level in enumerate(one.levels):
                found[f"{name} {level!r}"] = found[f"{name} {level:g}"] = entry | {"level": j}
    if isinstance(one, Covariance):
        pairs = itertools.product(enumerate(one.quantity.labels), repeat=2)
        found |= {f"{one.type} {a}, {b}": {"component": i, "component_2": j} for (i, a), (j, b) in pairs}
    return found


def _mean(name: str) -> Named | None:
    """A mean that is not among the statistics."""
    mean = re.fullmatch(r"mean (.+)", name)
    if mean is None:
        return None
    try:
        added = Mean(mean[1])
    except SceneError:
        return None
    return added, added.key, {}
