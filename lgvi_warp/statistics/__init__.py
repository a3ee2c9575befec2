"""Statistics over members, gathered while a run goes: one module for each kind, a table of them for scene files."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from lgvi_warp.errors import Faults, SceneError, closest, shown
from lgvi_warp.statistics.angles import CircularMean, MeanAttitude
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.counts import Exceedance, FirstPassage, Histogram
from lgvi_warp.statistics.estimate import Estimate, Estimates
from lgvi_warp.statistics.moments import Covariance, Mean
from lgvi_warp.statistics.order import Extremes, Quantiles
from lgvi_warp.statistics.outcomes import EndTime, Outcome
from lgvi_warp.statistics.path import PathMaximum, PathMean, PathMinimum, PathRange, PathRms, PathTime
from lgvi_warp.statistics.quantity import Quantity

TYPES: dict[str, type[Statistic]] = {
    kind.type: kind
    for kind in (
        Mean, Covariance, Extremes, Quantiles, Histogram, Exceedance, FirstPassage, CircularMean, MeanAttitude, PathMaximum,
        PathMinimum, PathRange, PathMean, PathRms, PathTime, Outcome, EndTime,
    )
}  # fmt: skip


def from_list(given: Any, key: str = "statistics", *, whole: bool = True) -> tuple[Statistic, ...]:
    """Statistics from tables of a scene file or Statistic objects. Raises SceneError naming every fault.

    whole: each must say what it is of, and have a name of its own.
    """
    if isinstance(given, str | Mapping | Statistic) or not isinstance(given, Sequence):
        example = 'write [[run.statistics]] and type = "mean" below, or statistics=[lw.Mean("position")]'
        raise SceneError([f"{key} = {shown(given)}: is no list; {example}"])
    faults, found = Faults(), list[Statistic]()
    for i, one in enumerate(given):
        with faults.including():
            found.append(_one(f"{key}[{i}]", one))
    if whole and not faults:
        names: list[str] = []
        for one in found:
            with faults.including():
                names += [part.key for part in one.parts()]
        for name in sorted({name for name in names if names.count(name) > 1}):
            faults.add(
                key, name, f"is the name of {names.count(name)} statistics", "give each a name of its own: name=..."
            )
    faults.raise_if_any()
    return tuple(found)


def _one(where: str, given: Any) -> Statistic:
    """A statistic from its table, or as it is. Raises SceneError naming every fault."""
    if isinstance(given, Statistic):
        return given
    if not isinstance(given, Mapping):
        raise SceneError(
            [f'{where} = {shown(given)}: is no statistic; write type = "mean", or give lw.Mean("position")']
        )
    word = given.get("type", "")
    kind = TYPES.get(word) if isinstance(word, str) else None
    if kind is None:
        raise SceneError([f"{where}.type = {shown(word)}: is not known; {closest(str(word), TYPES)}"])
    faults = Faults()
    table = {name: value for name, value in given.items() if name != "type"}
    faults.keys(where, table, [one.name for one in dataclasses.fields(kind)])
    faults.raise_if_any()
    try:
        return kind(**table)
    except SceneError as error:
        raise error.prefixed(f"{where}: ") from None


__all__ = [
    "TYPES",
    "CircularMean",
    "Covariance",
    "EndTime",
    "Estimate",
    "Estimates",
    "Exceedance",
    "Extremes",
    "FirstPassage",
    "Histogram",
    "Mean",
    "MeanAttitude",
    "Outcome",
    "PathMaximum",
    "PathMean",
    "PathMinimum",
    "PathRange",
    "PathRms",
    "PathTime",
    "Quantiles",
    "Quantity",
    "Statistic",
    "from_list",
]
