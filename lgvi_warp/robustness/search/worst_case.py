# SPDX-License-Identifier: Apache-2.0
"""`worst_case`: search for the numbers within bounds at which a quantity is worst."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.calls.prepared import prepare
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.near import near_names
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.common.summaries import few_digits, listed, plural
from lgvi_warp.criteria.files import Saved, finite_or_none, with_missing_as
from lgvi_warp.results.quantities import OfInterest
from lgvi_warp.robustness.search.box import LEAST, POPULATION, SearchBox, least_peak, search
from lgvi_warp.robustness.search.numbers import MOST_NAMED, Numbers
from lgvi_warp.runs.request import scene_of
from lgvi_warp.sampling.designs.table import Table
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.statistics.base import Statistic

WORST = ("largest", "smallest")


@dataclass(frozen=True)
class WorstCase(Saved):
    """Worst member that a search found. The true worst case may be worse.

    Attributes:
        parameters: values of the searched numbers for this member, by name.
        value: the quantity for this member; infinite if it failed. The search ends at the first failed member.
        of: name of the quantity.
        worst: "largest" or "smallest": which values of the quantity count as worst.
        at_bounds: name of a number -> bound at which the number lies: "low", "high", or "" for neither.
        restarts: (r,), worst value found by each of the r evolutions; if they differ, a longer search may find worse.
        runs: number of members that were run.
        fleet: ensemble of this one member, to run it again; None if the answer was read from a file. The file
            worst_case.csv holds the same member: lw.Ensemble(scene, sampling=lw.designs.Table("worst_case.csv")).
        of_metric: True if the quantity is a metric, which may be infinite without a failed member; by default False.
        points: number of members that were spread evenly over the box of bounds.
        units: unit of the quantity and of each searched number, by name.
    """

    study: ClassVar[str] = "worst_case"

    parameters: Mapping[str, float]
    value: float
    of: str
    worst: str
    at_bounds: Mapping[str, str]
    restarts: np.ndarray
    runs: int
    fleet: Ensemble | None
    of_metric: bool = False
    points: int = 0
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def unseen(self) -> float:
        """Fraction of the box that a peak must fill to be hit with probability 95 %; 1 without points."""
        return least_peak(self.points)

    def _content(self) -> dict[str, Any]:
        return finite_or_none({item.name: getattr(self, item.name) for item in fields(self) if item.name != "fleet"})

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        # What is not finite is a member that failed, or never got there.
        worse = math.inf if content["worst"] == "largest" else -math.inf
        restarts = np.array(with_missing_as(content["restarts"], worse), np.float64)
        value = math.inf if content["value"] is None else content["value"]
        return cls(**content | {"value": value, "restarts": restarts, "fleet": None})

    def rows(self) -> Iterator[dict[str, Any]]:
        yield dict(self.parameters)

    @property
    def answer(self) -> str:
        sides = {"low": " (its lower bound)", "high": " (its upper bound)", "": ""}
        numbers = [
            f"{name} {few_digits(value, self.units.get(name, ''), 4)}{sides[self.at_bounds[name]]}"
            for name, value in self.parameters.items()
        ]
        where = f"at {listed(numbers, MOST_NAMED)}, in {plural(self.runs, 'run')}."
        if math.isfinite(self.value):
            return (
                f"The {self.worst} {self.of} found is {few_digits(self.value, self.units.get(self.of, ''), 4)} {where}"
            )
        return f"{f'{self.of} is infinite, or a member fails,' if self.of_metric else 'A member fails'} {where}"

    def _report(self) -> list[str]:
        if not math.isfinite(self.value):
            return []
        bound = "a lower bound of the largest" if self.worst == "largest" else "an upper bound of the smallest"
        restarts = ", ".join(f"{value:.6g}" for value in self.restarts)
        peak = f"; a separate peak in {self.unseen:.2g} of the box or more would be found with probability 95 %"
        seen = peak if self.points else ""
        return [f"bound       {bound}; restarts: {restarts}{seen}"]


@shows_progress
@near_names(prepare)
def worst_case(
    fleet: Scene | Ensemble,
    within: Mapping[str, Any],
    of: OfInterest | Statistic | Mapping[str, Any],
    *,
    worst: str = "largest",
    budget: int = 20_000,
    restarts: int = 3,
    seed: int = 0,
    progress: Callable[[float], None] | bool | None = None,
    **settings: Any,
) -> WorstCase:
    """Search for the worst case of a quantity within bounds of the scene's numbers.

    Differential evolution runs several times from different starts; each generation is an ensemble. The corners of the
    box of bounds follow, if they are few, then a local search from the worst point. The rest of the budget goes to
    Sobol points over the whole box and local searches from the worst of them. All members get the same noise. A peak
    may be missed; with probability 95 %, it fills at most the fraction `unseen` of the box.

    Args:
        fleet: A Scene, or an Ensemble, whose scene is used. Numbers that are not searched keep the scene's values.
        within: Numbers to search, by name, with their bounds: (low, high), such as {"vehicle.buoyancy": (297.0,
            302.0)}; or (low, high, "log") to search on a logarithmic scale.
        of: A quantity with one number, as in `lw.prepare`: "max(depth)", a Quantity, a function of a Result; or a
            metric, as in `lw.sweep`: "overshoot depth", lw.metrics.SettlingTime("depth", within=0.5).
        worst: Worst value: "largest", the default, or "smallest". A failed member is worst of all and ends the search.
        budget: Number of members that may be run; 20,000 by default.
        restarts: Number of runs of differential evolution; 3 by default. A small budget allows fewer runs.
        seed: Seed of the search; 0 by default.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the used fraction of the budget.
            None, the default: nothing is shown.
        **settings: As in `lw.prepare`: method, h, t1, save, dtype, threads, ...

    Returns:
        The worst member.

    Raises:
        SceneError: If an argument is wrong.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> within = {"vehicle.buoyancy": (300.0, 310.0)}
        >>> worst = lw.worst_case(scene, within, "depth", worst="smallest", budget=400, h=0.1, t1=2.0)
        >>> worst.parameters
        {'vehicle.buoyancy': 310.0}
    """
    scene = scene_of(fleet)
    faults = Faults()
    if isinstance(fleet, Ensemble) and fleet.weights(0, 1) is not None:
        problem = "has members with weights, which a search within bounds has no use for"
        faults.add("fleet", fleet.sampling.kind, problem, "give the scene alone")
    faults.choice("worst", worst, WORST)
    box = None
    with faults.including():
        box = SearchBox.of("within", within, scene)
    least = max(LEAST, POPULATION * (len(box.names) if box else 1))
    if not is_whole(budget, least, 2**31):
        faults.add("budget", budget, "is less than a generation", f"give {least} or more")
    faults.raise_if_any()
    assert box is not None
    numbers_of = Numbers(scene, list(box.names), "of", of, {**settings, "common_noise": True})
    sign, report = -1.0 if worst == "largest" else 1.0, callback(progress) or (lambda share: None)

    def cost(inside: np.ndarray) -> np.ndarray:
        values = numbers_of(lambda run: run(box.values(inside)))
        return np.where(np.isnan(values), -np.inf, sign * values)

    best = search(
        cost, len(box.names), budget, seed, restarts, good_enough=-np.finfo(float).max,
        report=lambda count: report(min(1.0, count / budget)), spend=True)  # fmt: skip
    numbers = box.values(best.at[None])[0]
    sides = {
        name: "low" if value == low else "high" if value == high else ""
        for name, value, low, high in zip(box.names, numbers, box.low, box.high, strict=True)
    }
    parameters = dict(zip(box.names, map(float, numbers), strict=True))
    member = Ensemble(scene, None, 0, None, Table(values={name: [value] for name, value in parameters.items()}))
    # A search by the sign; a failure is infinite whatever is worst.
    value = math.inf if math.isinf(best.cost) else sign * best.cost
    label, of_metric = numbers_of.label, numbers_of.of_metric
    units = numbers_of.units(box.names)
    return WorstCase(
        parameters, value, label, worst, sides, sign * best.restarts, best.runs, member, of_metric, best.points, units
    )
