# SPDX-License-Identifier: Apache-2.0
"""Stopping rule of a run: the run ends when a statistic's interval is narrow enough."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.declared import declared, from_table, positive, read, text, whole
from lgvi_warp.common.errors import Faults, SceneError, among, closest, refusal
from lgvi_warp.common.times import rows_at
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimates.estimate import Estimate
from lgvi_warp.statistics.estimates.naming import canonical
from lgvi_warp.statistics.moments import Covariance, Mean
from lgvi_warp.statistics.order import Quantiles
from lgvi_warp.statistics.values.functional import quantity

# After a look, the number of members grows by at least this fraction before the next one.
GROWTH = 0.05


def _time_or_all(faults: Faults, key: str, value: Any) -> Any:
    return value if among(value, ("all",)) else faults.number(key, value, "s", least=0.0)


@dataclass(frozen=True)
class Until:
    """Stopping rule: run blocks of members until a statistic's interval is narrow enough, or all members have run.

    The run stops at the end of a block. Intervals are checked in the order of the blocks, so neither the number of
    members nor any bit of the result depends on threads. If the design has replicates, intervals are checked when the
    number of members is a power of two. docs/guide/statistics_accuracy.md gives the effect of this rule on coverage.

    Args:
        statistic: name of one of the run's statistics, as the terminal prints it: "mean position"; of one component,
            "mean position[2]"; of one level, "quantiles depth 0.95" or "quantiles position[2] 0.95"; or of one entry of
            a covariance, "covariance position[0], position[2]". A mean that the run does not compute is added.
        half_width: largest allowed half width of the interval, in the statistic's unit, above 0. The interval of every
            component and level that the name covers must be this narrow.
        at: sample time at which the interval is checked [s]; by default the end; "all": every sample time.
        members: minimum number of members, from 2; by default 1024, since the interval of a small sample may be too
            narrow.

    Raises:
        SceneError: if arguments are faulty; the message lists all faults.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=100_000, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> until = lw.Until("mean depth", half_width=0.05)
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, statistics=[lw.statistics.Mean("depth")], keep="none", until=until)
        >>> result.members < 100_000
        True
    """

    statistic: str = text("is not a name", 'give "mean position[2]"')
    half_width: float = positive(unit="in the unit of the statistic")
    at: Any = declared(_time_or_all, None)
    members: int = whole(2, "is not a whole number from 2", "give 1024", 1024)

    def __post_init__(self) -> None:
        faults = Faults("until.")
        read(self, faults)
        faults.raise_if_any()
        object.__setattr__(self, "members", int(self.members))

    def to_dict(self) -> dict[str, Any]:
        """Return the rule as a table of a scene file."""
        defaults = {"at": None, "members": 1024}
        return {name: value for name, value in vars(self).items() if name not in defaults or value != defaults[name]}


def from_dict(table: Any) -> Until:
    """Return the stopping rule of a table, or the rule itself."""
    example = 'write [run.until] and statistic = "mean position[2]", half_width = 0.01'
    return from_table(Until, "until", table, example, statistic=example, half_width=example)


@dataclass
class StoppingRule:
    """A stopping rule bound to the statistics of a run.

    doubling: True checks only at powers of two of members, at which a design of replicates is balanced. With more
        checks, the spread of a few estimates would be small by chance too often.
    """

    until: Until
    statistic: Statistic
    name: str
    # Dimension -> index of the watched entry; all entries along other dimensions.
    entry: Mapping[str, int]
    rows: np.ndarray
    looked: int = 0
    doubling: bool = False

    def due(self, members: int) -> bool:
        """Return True if the interval is to be checked now, and record the check."""
        if members < self.until.members or members < self.looked * (1.0 + GROWTH):
            return False
        if self.doubling and members & (members - 1):
            return False
        self.looked = members
        return True

    def reached(self, estimates: Sequence[Estimate]) -> bool:
        """Return True if the watched intervals are narrow enough."""
        return self.widest(estimates) <= self.until.half_width

    def report(self, members: int, estimates: Sequence[Estimate]) -> str:
        """Return a sentence for the user on whether the rule was satisfied."""
        widest = self.widest(estimates)
        word = "reached" if widest <= self.until.half_width else "not reached"
        goal = f"half width {self.until.half_width:g} of {self.until.statistic}"
        return f"{goal}: {word} with {members} members, {widest:.3g}"

    def widest(self, estimates: Sequence[Estimate]) -> float:
        """Return the largest half width of the watched intervals; infinite if an interval is missing."""
        estimate = next(candidate for candidate in estimates if candidate.name == self.name)
        half = estimate.half_width
        dims = estimate.dims["value"]
        if "time" in dims and half.shape[0] > 1:
            half = half[self.rows]
        for dim, i in self.entry.items():
            if dim in dims:
                half = np.take(half, [i], axis=dims.index(dim))
        return float(np.max(np.where(np.isnan(half), np.inf, half)))


def watch(until: Until, statistics: Sequence[Statistic], times: np.ndarray) -> StoppingRule:
    """Bind a stopping rule to the statistics of a run with sample times (k,) [s]; a missing mean is added to them."""
    faults = Faults("until.")
    rows = np.array([len(times) - 1])
    if until.at == "all":
        rows = np.arange(len(times))
    elif until.at is not None:
        rows = rows_at(times, until.at)
        if not len(rows):
            faults.add("at", until.at, "is not a sample time", "give a time at which samples are kept, or leave it out")
    target = None
    with faults.including():
        target = _target(until.statistic, _named(statistics))
    faults.raise_if_any()
    assert target is not None
    if target[0].type in ("extremes", "each"):
        raise refusal("until.statistic", until.statistic, "has no interval", "watch a quantile")
    return StoppingRule(until, *target, rows)


Named = tuple[Statistic, str, dict[str, int]]


def _named(statistics: Sequence[Statistic]) -> dict[str, Named]:
    """Names that can be watched -> the statistic, the name of its estimate, and the index of the entry."""
    pairs = [(outer, inner) for outer in statistics for inner in outer.parts()]
    names: dict[str, Named] = {inner.key: (outer, inner.key, {}) for outer, inner in pairs}
    for outer, inner in pairs:
        for name, entry in _names_of_entries(inner).items():
            names.setdefault(name, (outer, inner.key, entry))
    return names


def _names_of_entries(statistic: Statistic) -> dict[str, dict[str, int]]:
    """Names of a statistic and of its components, levels and entries of a covariance, with their indices."""
    entries: dict[str, dict[str, int]] = {statistic.key: {}}
    for i, label in enumerate(statistic.quantity.labels):
        index = re.search(r"\[[^\]]*\]", label)
        entry = {"component": i, "component_2": i}
        entries[f"{statistic.key}{index[0] if index else f'[{i}]'}"] = entries[
            f"{statistic.type} {label}{statistic.at_text}"
        ] = entry
    if isinstance(statistic, Quantiles):
        for name, entry in list(entries.items()):
            for j, level in enumerate(statistic.levels):
                entries[f"{name} {level!r}"] = entries[f"{name} {level:g}"] = entry | {"level": j}
    if isinstance(statistic, Covariance):
        pairs = itertools.product(enumerate(statistic.quantity.labels), repeat=2)
        entries |= {f"{statistic.type} {a}, {b}": {"component": i, "component_2": j} for (i, a), (j, b) in pairs}
    return entries


def _target(name: str, known: Mapping[str, Named]) -> Named:
    """Target that a name selects: a known one, or a mean that is added."""
    alike = (known[spelling] for spelling in known if canonical(spelling) == canonical(name))
    if (target := known.get(name) or next(alike, None)) is not None:
        return target
    hint, of = closest(name, known), name.removeprefix("mean ")
    if of != name:
        try:
            quantity("until.statistic", of)
        except SceneError:
            if not hint.startswith("did you mean"):
                raise
        else:
            added = Mean(of)
            return added, added.key, {}
    if not hint.startswith("did you mean"):  # list the statistics alone, not their components
        estimates = dict.fromkeys(estimate for _, estimate, _ in known.values())
        hint = closest(name, estimates) if known else 'give a mean, such as "mean depth", or statistics'
    raise refusal("until.statistic", name, "is not a statistic of the run", hint)
