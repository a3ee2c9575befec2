# SPDX-License-Identifier: Apache-2.0
"""`tune_gains`: numbers of a controller for which the risk of a fleet is least."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.calls.prepared import Prepared, prepare
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.near import near_names
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.common.summaries import few_digits, listed, plural
from lgvi_warp.criteria.files import Saved, finite_or_none, with_missing_as
from lgvi_warp.criteria.risk import risk_of
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.results.quantities import OfInterest
from lgvi_warp.robustness.search.box import LEAST, POPULATION, SearchBox, search
from lgvi_warp.robustness.search.numbers import MOST_NAMED, Numbers
from lgvi_warp.runs.request import ensemble_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.names import numbers_of as every_number
from lgvi_warp.scene.names import single_number
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.start import ATTITUDES, resolve_attitude
from lgvi_warp.statistics.base import Statistic


@dataclass(frozen=True)
class Tuned(Saved):
    """Tuned numbers: those of least risk that a search found.

    Attributes:
        parameters: the numbers by name.
        before: those of the scene.
        cost: their risk over the members that the search used: too good, since the numbers were chosen by them.
        fresh_cost: their risk over members that the search did not see; NaN where none can be drawn.
        fresh_before: that of the scene's numbers, over the same fresh members.
        of: name of the quantity.
        risk: what the risk is, in words.
        members: number of members that the search used.
        fresh: number of fresh members.
        at_bounds: names of the numbers that lie at their bounds: these may be too narrow.
        restarts: (r,), the least risk of each evolution.
        runs: number of members that were run.
        units: unit of the quantity and of the numbers, by name.
    """

    study: ClassVar[str] = "tune_gains"

    parameters: Mapping[str, float]
    before: Mapping[str, float]
    cost: float
    fresh_cost: float
    fresh_before: float
    of: str
    risk: str
    members: int
    fresh: int
    at_bounds: tuple[str, ...]
    restarts: np.ndarray
    runs: int
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def optimism(self) -> float:
        """Difference between the risk of fresh members and that seen in the search."""
        return self.fresh_cost - self.cost

    def _content(self) -> dict[str, Any]:
        return dict(finite_or_none({item.name: getattr(self, item.name) for item in fields(self)}))

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        # A risk that is not finite is of members that fail; without fresh members there is none.
        costs = {name: with_missing_as(content[name], math.inf if content["fresh"] or name == "cost" else math.nan)
                 for name in ("cost", "fresh_cost", "fresh_before")}  # fmt: skip
        restarts = np.array(with_missing_as(content["restarts"], math.inf), np.float64)
        return cls(**content | costs | {"restarts": restarts, "at_bounds": tuple(content["at_bounds"])})

    def rows(self) -> Iterator[dict[str, Any]]:
        for name, value in self.parameters.items():
            yield {"name": name, "value": value, "before": self.before[name], "at_bounds": name in self.at_bounds}

    @property
    def answer(self) -> str:
        numbers = [
            f"{name} {few_digits(value, self.units.get(name, ''), 4)} (was {self.before[name]:.4g})"
            for name, value in self.parameters.items()
        ]
        after, before, seen = (
            few_digits(cost, self.units.get(self.of, ""), 4) if math.isfinite(cost) else "infinite, as members fail,"
            for cost in (self.fresh_cost, self.fresh_before, self.cost)
        )
        risk, where = f"{self.risk} of {self.of}", f"with {listed(numbers, MOST_NAMED)}."
        if not self.fresh:
            return f"{risk} is {seen} over the {plural(self.members, 'member')} of the search {where}"
        change = f"{'falls' if self.fresh_cost < self.fresh_before else 'rises'} from {before} to {after}"
        if self.fresh_cost == self.fresh_before:
            change = f"stays {after}"
        return f"{risk} {change} over {plural(self.fresh, 'fresh member')} {where}"

    def _report(self) -> list[str]:
        lines = [
            f"search      {self.cost:.6g} over its {plural(self.members, 'member')} (optimism {self.optimism:.3g}); "
            f"{plural(self.runs, 'run')}"
        ]
        if self.at_bounds:
            lines.append(f"bounds      may be too narrow, they are reached: {', '.join(self.at_bounds)}")
        return lines


@shows_progress
@near_names(prepare)
def tune_gains(
    fleet: Ensemble | Scene,
    over: Mapping[str, Any],
    minimise: OfInterest | Statistic | Mapping[str, Any],
    *,
    risk: Any = "mean",
    budget: int = 100_000,
    fresh: int | None = None,
    restarts: int = 1,
    seed: int = 0,
    progress: Callable[[float], None] | bool | None = None,
    **settings: Any,
) -> Tuned:
    """Tune numbers, such as gains, to minimise the risk over a fleet.

    Every candidate meets the same members, with the same noise: a generation is an ensemble of candidates times members. Then
    it is tried on fresh ones.

    Args:
        fleet: The members, drawn by distributions; or a Scene, whose [ensemble] is meant.
        over: (low, high), or (low, high, "log"), of each number by name: {"heading_pid.kp": (0.1, 10.0, "log")}.
        minimise: The cost, one number of each member: a quantity, as of `lw.prepare`; or a metric, as of `lw.sweep`:
            "iae depth", lw.metrics.SettlingTime("depth", within=0.5).
        risk: "mean", the default; the level of a quantity's quantile, such as 0.95; or `lw.metrics.CVaR(0.05)`, the mean of
            the worst 5 %. A member that fails has an infinite cost.
        budget: Number of members that the search may run, those of all candidates together; 100,000 by default.
        fresh: Number of fresh members; None, the default, for four times those of the fleet.
        restarts: Number of evolutions; 1 by default.
        seed: Seed of the search; 0 by default.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the part of the budget that is used.
            None, the default, for nobody.
        **settings: As of `lw.prepare`: method, h, t1, save, dtype, threads, ...

    Returns:
        The numbers, with their risk over the members of the search and over fresh ones.

    Raises:
        SceneError: If an argument is at fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> controller = lw.Controller(
        ...     period=0.1,
        ...     guidance=[lw.control.SetPoint(heading=0.5)],
        ...     laws=[lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0)],
        ...     allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 0]])],
        ... )
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]}, controller=controller)
        >>> best = lw.tune_gains(scene, {"heading_pid.kp": (0.5, 3.0)}, lw.metrics.IAE("heading"), budget=500, h=0.05, t1=10.0)
        >>> print(f"{best.parameters['heading_pid.kp']:.1f}")
        3.0
    """
    ensemble = ensemble_of(fleet)
    scene: Any = ensemble.scene
    n, faults = ensemble.members, Faults()
    measure = risk_of(faults, risk)
    box = _checked_box(faults, ensemble, over, budget)
    if fresh is not None and (not isinstance(fresh, int) or fresh < 0):
        faults.add("fresh", fresh, "is not a number of members", "give a whole number, 0 for none")
    if ensemble.weights(0, 1) is not None:
        faults.add("fleet", "...", "has members with weights, and a risk counts them alike", "leave the weights out")
    faults.raise_if_any()
    assert box is not None
    numbers_of = Numbers(scene, None, "minimise", minimise, settings)
    costs, report = _Costs(numbers_of, ensemble, box), callback(progress) or (lambda share: None)
    optimum = search(
        lambda inside: np.asarray(measure(costs(box.values(inside)))), len(box.names), budget // n, seed, restarts,
        report=lambda count: report(min(1.0, n * count / budget)))  # fmt: skip
    best = box.values(optimum.at[None])
    before = np.array([[single_number(scene, name)[1] for name in box.names]])
    drawn = ensemble.sampling.kind == "random" and bool(ensemble.vary) and not ensemble.explicit()
    count = (4 * n if fresh is None else fresh) if drawn else 0
    fresh_costs = np.full(2, np.nan)
    if count:
        strangers = _Costs(numbers_of, ensemble.with_seed(ensemble.seed + 1, count), box)
        fresh_costs = np.array([float(measure(strangers(numbers))[0]) for numbers in (best, before)])
    edges = zip(box.names, best[0], box.low, box.high, strict=True)
    return Tuned(
        parameters=dict(zip(box.names, map(float, best[0]), strict=True)),
        before=dict(zip(box.names, map(float, before[0]), strict=True)),
        cost=optimum.cost,
        fresh_cost=float(fresh_costs[0]),
        fresh_before=float(fresh_costs[1]),
        of=numbers_of.label,
        risk=str(measure),
        members=n,
        fresh=count,
        at_bounds=tuple(name for name, value, low, high in edges if value in (low, high)),
        restarts=optimum.restarts,
        runs=n * optimum.runs + 2 * count,
        units=numbers_of.units(box.names),
    )


def _checked_box(faults: Faults, ensemble: Ensemble, over: Any, budget: Any) -> SearchBox | None:
    """The numbers to be searched, of which none may vary; None after a fault of theirs."""
    box = None
    with faults.including():
        box = SearchBox.of("over", over, ensemble.scene)
    varied = {_array_of(name) for name in ensemble.varied_names}
    for name in box.names if box else ():
        if _array_of(name) in varied:
            faults.add(f'over."{name}"', over[name], "varies by member too", "leave it out of one of them")
    least = ensemble.members * max(LEAST, POPULATION * (len(box.names) if box else 1))
    if not is_whole(budget, least, 2**31):
        faults.add("budget", budget, "is less than a generation of all members", f"give {least} or more")
    return box


def _array_of(name: str) -> str:
    """The array that a number is of; all forms of an attitude are one."""
    array = name.split("[")[0]
    return "attitude" if array.removeprefix("start.") in ATTITUDES else array


class _Costs:
    """Costs of candidates (k, d), of each member: (k, members)."""

    def __init__(self, numbers_of: Numbers, fleet: Ensemble, box: SearchBox):
        n = fleet.members
        self._numbers_of, self._members = numbers_of, fleet.select(0, n)
        self._found = {name: single_number(fleet.scene, name)[0] for name in box.names}
        self._starts = {target.name: every_number(fleet.scene)[target.name] for target in self._found.values()
                        if target.name.startswith("start.")}  # fmt: skip
        varied = {name: self._members.parameters[name] for name in fleet.varied()}
        self._varied = {name: np.broadcast_to(v, (n, *v.shape[1:])) for name, v in varied.items()}

    def __call__(self, candidates: np.ndarray) -> np.ndarray:
        members, k = self._members, len(candidates)
        n = members.count
        every = np.tile(np.arange(n), k)
        states: Any = {name: getattr(members, name)[every] for name in FIELDS}
        parameters = {name: v[every] for name, v in self._varied.items()}
        starts = {name: np.tile(value, (k * n,) + (1,) * value.ndim) for name, value in self._starts.items()}
        for (name, target), column in zip(self._found.items(), np.repeat(candidates, n, axis=0).T, strict=True):
            if target.name in starts:
                entry: Any = (..., *(target.index or ()))
                starts[target.name][entry] = column
            else:
                parameters[name] = column
        for name, values in starts.items():
            form = name.removeprefix("start.")
            states |= {"attitude": resolve_attitude({form: values})} if form in ATTITUDES else {form: values}

        def called(run: Prepared) -> Any:
            indices = None if run.common_noise else members.indices[every]
            return run.states(**states, parameters=parameters, indices=indices, seed=members.seed)

        costs = self._numbers_of(called)
        return np.where(np.isnan(costs), np.inf, costs).reshape(k, n)
