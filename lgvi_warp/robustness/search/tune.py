# SPDX-License-Identifier: Apache-2.0
"""`tune_gains`: numbers of a controller that minimise the risk of a fleet."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
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
from lgvi_warp.robustness.search.constraints import BROKEN, Constraint, constraints_of, margins_of, penalised
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
    """Tuned numbers, such as gains: the numbers with the lowest risk that a search found.

    Attributes:
        parameters: tuned numbers by name.
        before: the scene's own values of these numbers.
        cost: risk over the members of the search. It is optimistic, since the numbers were chosen with these members.
        fresh_cost: risk over fresh members, which the search did not use; NaN if no fresh members can be drawn.
        fresh_before: risk of the scene's own numbers, over the same fresh members.
        of: name of the quantity that is the cost.
        risk: description of the risk, such as "mean".
        members: number of members that the search used.
        fresh: number of fresh members.
        at_bounds: names of the tuned numbers that lie at their bounds; these bounds may be too narrow.
        restarts: (r,), lowest risk found by each of the r runs of differential evolution.
        runs: number of members that were run.
        units: unit of the quantity and of each tuned number, by name.
        constraints: text, such as "disk above 0.5" -> dict. "worst": value of the member of the search that is closest
            to the bound or violates it most; "fresh_worst": the same for fresh members; "fresh_before": the same for
            fresh members with the scene's own numbers; "fresh_broken": number of fresh members that violate the bound.
            A value is NaN if a member has no value.
        messages: notes for the user on effects that margins in the constraints neglect.
        feasible: True if all members of the search satisfy all constraints.
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
    constraints: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    messages: tuple[str, ...] = ()
    feasible: bool = True

    @property
    def optimism(self) -> float:
        """Risk over fresh members minus risk over the members of the search."""
        return self.fresh_cost - self.cost

    def _content(self) -> dict[str, Any]:
        content = {item.name: getattr(self, item.name) for item in fields(self)}
        # Of a margin infinity is an answer, and none is another.
        bounds = {text: {name: str(value) if math.isinf(value) else value for name, value in each.items()}
                  for text, each in self.constraints.items()}  # fmt: skip
        return dict(finite_or_none(content | {"constraints": bounds}))

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        # A risk that is not finite is of members that fail; without fresh members there is none.
        costs = {name: with_missing_as(content[name], math.inf if content["fresh"] or name == "cost" else math.nan)
                 for name in ("cost", "fresh_cost", "fresh_before")}  # fmt: skip
        restarts = np.array(with_missing_as(content["restarts"], math.inf), np.float64)
        bounds = {text: {name: math.nan if value is None else float(value) for name, value in each.items()}
                  for text, each in content.get("constraints", {}).items()}  # fmt: skip
        read = {"restarts": restarts, "at_bounds": tuple(content["at_bounds"]), "constraints": bounds}
        return cls(**content | costs | read | {"messages": tuple(content.get("messages", ()))})

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
        kept = "".join(f"; {text}: {_least_kept(each, self.fresh)}" for text, each in self.constraints.items())
        risk, where = f"{self.risk} of {self.of}", f"with {listed(numbers, MOST_NAMED)}{kept}."
        if not self.feasible:
            return f"No numbers were found for which all members keep the constraints; the nearest has {risk} {seen} {where}"
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
        return [*lines, *(f"margins     {text}" for text in self.messages)]


def _least_kept(numbers: Mapping[str, float], fresh: int) -> str:
    """Text on the members that keep or violate a constraint."""
    words = ["none" if math.isnan(value) else f"{value:.4g}" for value in (numbers["worst"], numbers["fresh_worst"])]
    if not fresh:
        return f"at worst {words[0]}"
    broken = int(numbers["fresh_broken"])
    return f"at worst {words[1]} in fresh members" + (f", {broken:,} of {fresh:,} break it" if broken else "")


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
    constraints: Sequence[str] = (),
    progress: Callable[[float], None] | bool | None = None,
    **settings: Any,
) -> Tuned:
    """Tune numbers, such as gains, to minimise the risk over a fleet.

    A candidate is one set of values of these numbers. Every candidate runs on the same members, with the same noise, so
    a generation of candidates is one ensemble. The best candidate is then run on fresh members.

    Args:
        fleet: An Ensemble, whose members are drawn from distributions; or a Scene, whose [ensemble] is used.
        over: Numbers to tune, by name, with their bounds: (low, high), or (low, high, "log") to search on a logarithmic
            scale, such as {"heading_pid.kp": (0.1, 10.0, "log")}.
        minimise: The cost, one number of each member: a quantity, as in `lw.prepare`; or a metric, as in `lw.sweep`,
            such as "iae depth" or lw.metrics.SettlingTime("depth", within=0.5).
        risk: How the members' costs are reduced to one number: "mean", the default; a quantile's level, such as 0.95;
            or `lw.metrics.CVaR(0.05)`, the mean cost of the worst 5 %. A member that fails has an infinite cost.
        budget: Number of members that the search may run, over all candidates; 100,000 by default.
        fresh: Number of fresh members; None, the default: four times the number of members of the fleet.
        restarts: Number of independent runs of differential evolution; 1 by default.
        seed: Seed of the search; 0 by default.
        constraints: Bounds that every member must satisfy: on a margin of all laws together, "disk above 0.5", or of
            one law, "phase heading_pid above 0.6", with the names of `lw.linear.margins`; on a metric, "overshoot depth
            below 0.3"; on a quantity, "max(depth) below 12.0". Candidates that satisfy all bounds are preferred. A loop
            that does not settle violates every bound on its margins. By default no constraints.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the used fraction of the budget.
            None, the default: nothing is shown.
        **settings: As in `lw.prepare`: method, h, t1, save, dtype, threads, ...

    Returns:
        The numbers, with their risk over the members of the search and over fresh members.

    Raises:
        SceneError: If an argument is wrong.

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
    measure, bounds = risk_of(faults, risk), constraints_of(faults, constraints, scene.controller)
    box = _checked_box(faults, ensemble, over, budget)
    if fresh is not None and (not isinstance(fresh, int) or fresh < 0):
        faults.add("fresh", fresh, "is not a number of members", "give a whole number, 0 for none")
    if ensemble.weights(0, 1) is not None:
        faults.add("fleet", "...", "has members with weights, and a risk counts them alike", "leave the weights out")
    faults.raise_if_any()
    assert box is not None
    more = [one.name for one in bounds if not one.margin]
    numbers_of = Numbers(scene, None, "minimise", minimise, settings, more)
    costs, report = _Costs(numbers_of, ensemble, box, bounds, settings), callback(progress) or (lambda share: None)

    def cost(inside: np.ndarray) -> np.ndarray:
        candidates = box.values(inside)
        each = costs(candidates)
        risks = np.asarray(measure(each[0]))
        return penalised(risks, bounds, costs.bounded(candidates, each[1:], np.isfinite(risks))) if bounds else risks

    optimum = search(
        cost, len(box.names), budget // n, seed, restarts, report=lambda count: report(min(1.0, n * count / budget))
    )
    best = box.values(optimum.at[None])
    before = np.array([[single_number(scene, name)[1] for name in box.names]])
    drawn = ensemble.sampling.kind == "random" and bool(ensemble.vary) and not ensemble.explicit()
    count = (4 * n if fresh is None else fresh) if drawn else 0
    searched = costs.judged(best, measure) if bounds else (optimum.cost, [])
    fresh_costs, kept = np.full(2, np.nan), [[np.full(1, np.nan)] * len(bounds)] * 2
    if count:
        strangers = _Costs(numbers_of, ensemble.with_seed(ensemble.seed + 1, count), box, bounds, settings)
        judged = [strangers.judged(numbers, measure) for numbers in (best, before)]
        fresh_costs, kept = np.array([risk for risk, _ in judged]), [values for _, values in judged]
    table = {
        one.text: {
            "worst": one.worst(values),
            "fresh_worst": one.worst(fresh_values),
            "fresh_before": one.worst(before_values),
            "fresh_broken": float((one.slack(fresh_values) < 0.0).sum()) if count else math.nan,
        }
        for one, values, fresh_values, before_values in zip(bounds, searched[1], *kept, strict=True)
    }
    edges = zip(box.names, best[0], box.low, box.high, strict=True)
    return Tuned(
        parameters=dict(zip(box.names, map(float, best[0]), strict=True)),
        before=dict(zip(box.names, map(float, before[0]), strict=True)),
        cost=searched[0],
        fresh_cost=float(fresh_costs[0]),
        fresh_before=float(fresh_costs[1]),
        of=numbers_of.label,
        risk=str(measure),
        members=n,
        fresh=count,
        at_bounds=tuple(name for name, value, low, high in edges if value in (low, high)),
        restarts=np.where(optimum.restarts < BROKEN, optimum.restarts, np.inf),
        runs=n * optimum.runs + 2 * count + n * bool(bounds),
        units=numbers_of.units(box.names),
        constraints=table,
        messages=costs.messages,
        feasible=all((one.slack(values) >= 0.0).all() for one, values in zip(bounds, searched[1], strict=True)),
    )


def _checked_box(faults: Faults, ensemble: Ensemble, over: Any, budget: Any) -> SearchBox | None:
    """The box of numbers to search, none of which may vary by member; None if it is faulty."""
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
    """Name of the array of a number; all forms of an attitude share one name."""
    array = name.split("[")[0]
    return "attitude" if array.removeprefix("start.") in ATTITUDES else array


class _Costs:
    """Costs of candidates (k, d) by member, and the c constrained numbers except margins: (1 + c, k, members)."""

    def __init__(
        self, numbers_of: Numbers, fleet: Ensemble, box: SearchBox, constraints: Sequence[Constraint],
        settings: Mapping[str, Any],
    ):  # fmt: skip
        n = fleet.members
        self._scene, self._constraints, self._settings = fleet.scene, constraints, settings
        self.messages: tuple[str, ...] = ()
        self._numbers_of, self._members = numbers_of, fleet.select(0, n)
        self._found = {name: single_number(fleet.scene, name)[0] for name in box.names}
        self._starts = {target.name: every_number(fleet.scene)[target.name] for target in self._found.values()
                        if target.name.startswith("start.")}  # fmt: skip
        varied = {name: self._members.parameters[name] for name in fleet.varied()}
        self._varied = {name: np.broadcast_to(v, (n, *v.shape[1:])) for name, v in varied.items()}

    def _members_with(self, candidates: np.ndarray) -> tuple[np.ndarray, dict[str, Any], dict[str, np.ndarray]]:
        """Members (k n,) of candidates: their indices in the fleet, states and parameters."""
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
        return every, states, parameters

    def __call__(self, candidates: np.ndarray) -> np.ndarray:
        members = self._members
        every, states, parameters = self._members_with(candidates)

        def called(run: Prepared) -> Any:
            indices = None if run.common_noise else members.indices[every]
            return run.states(**states, parameters=parameters, indices=indices, seed=members.seed)

        numbers = self._numbers_of(called).reshape(len(candidates), members.count, -1)
        numbers[..., 0] = np.where(np.isnan(numbers[..., 0]), np.inf, numbers[..., 0])
        return np.moveaxis(numbers, 2, 0)

    def bounded(self, candidates: np.ndarray, numbers: np.ndarray, good: np.ndarray) -> list[np.ndarray]:
        """Numbers that the constraints bound, each (k, members); margins only where `good` (k,), else NaN."""
        others, found = iter(numbers), dict[str, np.ndarray]()
        if good.any() and any(one.margin for one in self._constraints):
            _, states, parameters = self._members_with(candidates[good])
            found, self.messages = margins_of(
                self._constraints, Ensemble.from_states(self._scene, **states, parameters=parameters), self._settings
            )
        rows = []
        for one in self._constraints:
            column = np.full((len(candidates), self._members.count), np.nan)
            if one.name in found:
                column[good] = found[one.name].reshape(-1, self._members.count)
            rows.append(column if one.margin else next(others))
        return rows

    def judged(
        self, candidate: np.ndarray, measure: Callable[[np.ndarray], np.ndarray]
    ) -> tuple[float, list[np.ndarray]]:
        """The risk of one candidate (1, d), and the numbers that the constraints bound, each (members,)."""
        each = self(candidate)
        risks = np.asarray(measure(each[0]))
        return float(risks[0]), [values[0] for values in self.bounded(candidate, each[1:], np.isfinite(risks))]
