# SPDX-License-Identifier: Apache-2.0
"""Runs of a sweep: cases, grid, members and metrics; its cells, and their settings."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.calls.predict import Prediction, predict
from lgvi_warp.calls.solve import solve
from lgvi_warp.common import machine
from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.identity import UNKNOWN
from lgvi_warp.criteria.memory import key_of
from lgvi_warp.criteria.running import duration_text, kept
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.result import Result
from lgvi_warp.robustness.sweeps.cases import Case, cases_of, check_rare, ensemble_of, grid_of, known_names, points_of
from lgvi_warp.robustness.sweeps.record import Record
from lgvi_warp.scene import variations
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.functions import Own, ToldApart, functions_of
from lgvi_warp.scene.names import all_by_key
from lgvi_warp.scene.scene import Scene
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.member_metrics import metric_of, numbers_of_members
from lgvi_warp.statistics.metrics.actuator_metrics import ElectricalEnergy, TimeToFailure
from lgvi_warp.statistics.tracking import check_wanted

# Most cells, cases times points of the grid, of a sweep.
MOST_CELLS = 10_000
# Name of the metric that every sweep has.
END = "time_to_failure"


@dataclass(frozen=True)
class Setup:
    """The planned runs of a sweep: cells and the settings of their runs."""

    scene: Scene
    cases: tuple[Case, ...]
    axes: dict[str, list[Any]]
    members: Ensemble
    metrics: dict[str, Statistic]
    settings: dict[str, Any]
    vary: dict[Any, Any]
    identities: ToldApart = field(default_factory=ToldApart)

    @property
    def cells(self) -> list[tuple[Case, dict[str, Any]]]:
        """Cases and points of the grid, in the order in which they are run."""
        return [(case, point) for case in self.cases for point in points_of(self.axes)]

    @property
    def first_point(self) -> dict[str, Any]:
        """The first point of the grid."""
        return {name: values[0] for name, values in self.axes.items()}

    def fleet(self, case: Case, point: Mapping[str, Any]) -> tuple[Ensemble, list[str]]:
        """The members of a cell, and names of quantities that do not vary in it."""
        scene = case.of(self.scene).with_numbers(point)
        numbers = {**case.set, **point}
        if isinstance(case.vehicle, Mapping):
            numbers |= {f"vehicle.{name}": value for name, value in case.vehicle.items()}
        return ensemble_of(scene, numbers, self.vary, self.members)

    def key(self, fleet: Ensemble) -> str:
        """The key of a cell's record."""
        scene = fleet.scene.to_dict()
        scene.pop("ensemble", None)
        tables = [metric.to_dict() for metric in self.metrics.values()]
        functions = {place: self.identities.name(function) for place, function in self.functions(fleet).items()}
        versions = machine.versions()
        return key_of({"scene": scene, "ensemble": fleet.to_dict(), "metrics": tables, "functions": functions,
                       "settings": self.settings, "versions": versions})  # fmt: skip

    def functions(self, fleet: Ensemble) -> dict[str, Own]:
        """The user's functions on which a cell's numbers depend, by their place."""
        return functions_of(fleet, self.metrics.values())

    def unknown(self, fleet: Ensemble) -> list[str]:
        """The places of functions that have no identity, so that another call cannot recognise them."""
        functions = self.functions(fleet).items()
        return [place for place, function in functions if self.identities.name(function)[0] == UNKNOWN]

    def note_functions(self) -> None:
        """Identify the functions of all cases before any case runs, since their contents may change during runs."""
        for case in self.cases:
            with contextlib.suppress(SceneError):  # the case will say so itself
                self.key(self.fleet(case, self.first_point)[0])

    def kept(self, fleet: Ensemble) -> dict[str, Any]:
        """Arguments of `solve` for a run that stores only metrics, all of them at ticks."""
        return kept(self.metrics, fleet.scene.controller)

    def run(self, fleet: Ensemble, *, simulate: Callable[..., Any] = solve, **more: Any) -> Record:
        """Run a cell by `solve`, or by a function with the same arguments; more: further arguments."""
        faults = Faults()
        check_wanted(faults, "metrics", self.metrics, fleet.scene.controller)
        faults.raise_if_any()
        result = simulate(fleet, until=False, **self.kept(fleet), **self.settings, **more)
        numbers = {name: numbers_of_members(result.statistics, name) for name in self.metrics}
        return Record(np.asarray(result.status), numbers, tuple(result.messages))


@dataclass(frozen=True, eq=False)
class SweepCell:
    """A case at a point of the grid, and its members; None if it was refused before members were drawn."""

    index: int
    case: Case
    point: dict[str, Any]
    key: str
    fleet: Ensemble | None
    fixed: tuple[str, ...]

    @property
    def name(self) -> str:
        """The case and the point, as text."""
        at = ", ".join(f"{name} = {value}" for name, value in self.point.items())
        return f"{self.case.name} at {at}" if at else self.case.name


def setup_of(
    scene: Any, cases: Any, grid: Any, vary: Any, members: Any, seed: Any, sampling: Any, metrics: Any,
    settings: Mapping[str, Any], rare: Any = None, *, predict: Callable[..., Prediction] = predict) -> Setup:  # fmt: skip
    """Plan the runs of a sweep; `settings` are arguments of solve, all others are as in `sweep`."""
    faults = Faults()
    base, together = _base(scene, vary)
    parts: dict[str, Any] = {"cases": (), "axes": {}, "metrics": {}}
    metrics = electrical(metrics, base.scene)
    for name, read, value in (("cases", cases_of, cases), ("axes", grid_of, grid), ("metrics", metrics_of, metrics)):
        with faults.including():
            parts[name] = read(value)
    for name in ("save", "statistics", "keep", "until", "store", "blocks"):
        if name in settings:
            faults.add(name, "...", "is what a sweep decides", "leave it out")
    check_rare(faults, rare)
    faults.raise_if_any()
    parts["cases"] = tuple(replace(case, rare=rare) if case.rare is None else case for case in parts["cases"])
    assert isinstance(base.scene, Scene)
    fleet = _fleet(base, members, seed, sampling, together, parts["cases"])
    if fleet.weights(0, 1) is not None:
        problem = "has members with weights, and a sweep counts them alike"
        raise refusal(
            "sampling", fleet.sampling.kind, problem, "leave weights out, or ask lw.solve for statistics of a case"
        )
    setup = Setup(base.scene, members=fleet, settings=dict(settings), vary=together, **parts)
    count = len(setup.cases) * math.prod(len(values) for values in setup.axes.values())
    if count > MOST_CELLS:
        problem = too_many_text(setup, count, predict=predict)
        raise refusal("grid", f"{count:,} cells", problem, f"give at most {MOST_CELLS:,} cells, or vary a number")
    return setup


def too_many_text(setup: Setup, count: int, *, predict: Callable[..., Prediction] = predict) -> str:
    """Text of a problem: `count` cells are too many, with the time that they would take."""
    try:
        prediction = _prediction(setup, None, predict)
    except SceneError:
        return f"are {setup.members.members:,} members each"
    duration = duration_text(prediction.advance * count)
    return f"are {setup.members.members:,} members each and would take {duration} on this machine"


def _prediction(setup: Setup, threads: int | None, predict: Callable[..., Prediction]) -> Prediction:
    """Predicted cost of the first cell."""
    fleet, _ = setup.fleet(setup.cases[0], setup.first_point)
    return predict(fleet, threads=threads, **setup.kept(fleet), **setup.settings)


def plan_text(setup: Setup, threads: int | None = None, *, predict: Callable[..., Prediction] = predict) -> str:
    """Predicted cost of a sweep, as lines of text, from a trial of its first cell."""
    prediction, count = _prediction(setup, threads, predict), len(setup.cells)
    points, duration = count // len(setup.cases), duration_text((prediction.advance + prediction.set_up) * count)
    lines = [f"cells       {count:,}: {len(setup.cases)} cases at {points:,} points of the grid",
             f"members     {setup.members.members:,} of each, the same in all",
             f"time        about {duration}, and {prediction.compile:.1f} s for each kernel",
             f"memory      {prediction.memory / 1e6:,.0f} MB",
             f"disk        {8 * len(setup.metrics) * setup.members.members * count / 1e6:,.1f} MB"]  # fmt: skip
    if asking := sum(bool(case.rare) for case, _ in setup.cells):
        # As many members as a probability of 1e-5 takes to 10 %, at most.
        share = prediction.advance / max(1, setup.members.members)
        lines.append(f"rare        {asking:,} rare failures beside it, each up to some {duration_text(1e5 * share)}")
    return "\n".join(lines)


def _fleet(
    scene: Any, members: Any, seed: Any, sampling: Any, vary: Mapping[Any, Any], cases: Sequence[Case]
) -> Ensemble:
    """The members of the sweep's base scene; entries of `vary` that exist only in some cases do not vary in it."""
    base, known = scene.scene, known_names(scene.scene)
    elsewhere = [name for name in vary if any(target.name not in known for target in variations.targets(name))]
    if elsewhere:
        of_cases = set[str]()
        for case in cases:
            with contextlib.suppress(SceneError):  # the case will say so itself
                of_cases |= known_names(case.of(base))
        elsewhere = [name for name in elsewhere if all(target.name in of_cases for target in variations.targets(name))]
    here = {name: distribution for name, distribution in vary.items() if name not in elsewhere}
    return Ensemble(
        base, scene.members if members is None else members, scene.seed if seed is None else seed, here,
        scene.sampling if sampling is None else sampling)  # fmt: skip


def _base(scene: Any, vary: Any) -> tuple[Ensemble, dict[Any, Any]]:
    """The base ensemble of a sweep, and everything that varies."""
    if isinstance(scene, str | os.PathLike):
        scene = Scene.load(scene)
    if isinstance(scene, Scene):
        scene = Ensemble.from_scene(scene)
    if not isinstance(scene, Ensemble):
        raise refusal("scene", scene, "is neither a scene nor an ensemble", "give lw.Scene.load(path)")
    if scene.explicit() or scene.to_dict().get("indices") is not None:
        problem = "has members that were given or chosen one by one"
        raise refusal("scene", "...", problem, "give an Ensemble that draws its members, or a table as its sampling")
    if vary is not None and not isinstance(vary, Mapping):
        remedy = 'give {"vehicle.mass": lw.distributions.Normal(...)}'
        raise refusal("vary", vary, "does not map names to distributions", remedy)
    return scene, {**scene.vary, **all_by_key("vary.", scene.scene, vary or {})}


def electrical(entries: Any, scene: Any) -> Any:
    """The metrics; "energy" becomes the electrical energy if the scene accounts for it, instead of mechanical work."""
    if (listed := items_of(entries)) is None:
        return entries
    accounted = any(term.accounts for term in scene.terms)
    return [ElectricalEnergy(name="energy") if accounted and entry == "energy" else entry for entry in listed]


def metrics_of(entries: Any) -> dict[str, Statistic]:
    """Metrics by name, each with one number of every member; "time_to_failure" is added."""
    if (listed := items_of(entries)) is None:
        raise refusal("metrics", entries, "is not a list", 'give ["overshoot depth", lw.metrics.IAE("heading")]')
    faults, metrics = Faults(), dict[str, Statistic]()
    for i, entry in enumerate((*listed, TimeToFailure())):
        with faults.including():
            name, metric = metric_of(f"metrics[{i}]", entry)
            if name in metrics and name != END:
                remedy = 'give it a name of its own: name="..."'
                faults.add(f"metrics[{i}]", name, "is the name of another metric", remedy)
            metrics.setdefault(name, metric)
    faults.raise_if_any()
    return metrics


def rerun_members_of(
    setup: Setup, cell: SweepCell, indices: Sequence[int], save: SaveAt | None, threads: int | None
) -> Result:
    """Run only some members of a cell again, with bit-identical results; save: None for the scene's samples."""
    from lgvi_warp.engine.keepers.observation import Observation
    from lgvi_warp.runs.request import Request

    if cell.fleet is None:
        raise refusal("case", cell.name, "was refused", "run a member of another one")
    # The plan of a run that keeps all samples, of which these members alone are run.
    observed = Observation(tuple(setup.metrics.values()))
    of_all = Request(cell.fleet, save=save, **setup.settings, observed=observed, threads=threads)
    of_some = replace(of_all, observed=replace(observed, keep=tuple(int(i) for i in indices)))
    _, result = of_some.again(of_all.plan(), np.zeros(cell.fleet.members, np.uint8))
    assert result is not None
    return result
