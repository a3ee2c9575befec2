# SPDX-License-Identifier: Apache-2.0
"""Stability maps of each method: accurate, bounded, flagged, failed and silently wrong runs over two parameters."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.accuracy.stability.grid import Line, StabilityGrid
from lgvi_warp.accuracy.stability.limits import LIMITS
from lgvi_warp.accuracy.stability.runs import (
    LEAST_DRIVEN,
    REFUSED,
    SHORTEST,
    CellRuns,
    column,
    judged,
    make_references,
    plan_of,
    refusals,
    run_method,
)
from lgvi_warp.accuracy.tradeoff import chosen_methods
from lgvi_warp.common import machine, summaries
from lgvi_warp.common.arguments import listed, whole_number
from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.machine import DTYPES
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.status import Status, failed, stopped
from lgvi_warp.common.summaries import few_digits, percent, plural
from lgvi_warp.criteria.files import Saved, finite_or_none
from lgvi_warp.engine.executors import check_threads
from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring.distance import QUANTITIES, Distance, compared_in
from lgvi_warp.measuring.speed import void
from lgvi_warp.results.provenance import provenance
from lgvi_warp.results.result import Result
from lgvi_warp.runs.request import MOST_STEPS, scene_of
from lgvi_warp.runs.run import run_plan
from lgvi_warp.scene.scene import Scene

METHODS = ("psi", "psi_s", "psi_x", "rk4")
# Name of a map -> its two axes.
GRIDS = {"omega": ("h", "angular_velocity"), "mass": ("h", "added_mass_ratio"), "drag": ("h", "drag_number")}


class Cell(IntEnum):
    """Class of a cell of a stability map: the worst class of the cell's members.

    Attributes:
        ACCURATE: the error is below its bound.
        BOUNDED: the error exceeds its bound, but energy and rotation stay bounded.
        FLAGGED: energy and rotation stay bounded, but the member has the status of a failure, or a warning.
        FAILED: energy or rotation is unbounded or not finite, and the status of a failure or a warning reports it.
        SILENT: energy or rotation is unbounded, and neither a status nor a warning reports it.
    """

    ACCURATE = 0
    BOUNDED = 1
    FLAGGED = 2
    FAILED = 3
    SILENT = 4

    @property
    def text(self) -> str:
        """Short text that explains the class."""
        return TEXTS[self]


# Methods that the answer names.
MOST_NAMED = 3
TEXTS = {
    Cell.ACCURATE: "error below the bound",
    Cell.BOUNDED: "error above it, energy bounded",
    Cell.FLAGGED: "status or warning, energy bounded",
    Cell.FAILED: "unbounded or not finite, flagged",
    Cell.SILENT: "unbounded without any flag",
}


@dataclass(frozen=True, eq=False)
class StabilityMap(Saved):
    """Stability map: a grid over two axes, with the class of each cell for each method.

    Attributes:
        x: horizontal axis, with nx values.
        y: vertical axis, with ny values.
        classes: method -> Cell codes (ny, nx).
        errors: method -> largest error up to error_time (ny, nx) [unit]; infinite if the error could not be measured.
        energies: method -> largest growth of energy divided by energy_bound (ny, nx) [1]; a value above 1 is unbounded.
        statuses: method -> worst Status code (ny, nx); 255 if the program refused to run the cell.
        ratios: method -> name of a limit -> step divided by this analytic limit, for each cell's fastest start (ny, nx)
            [1]; above 1 the step exceeds the limit. Limits: "rotation", "munk", "restoring" and "drag".
        of: name of the quantity whose error is measured.
        error_bound: largest error of an accurate cell [unit].
        error_time: time up to which errors count, rounded up to whole steps [s].
        t1: time up to which energy counts, rounded up to whole steps [s].
        directions: number of starts of each cell.
        judged: kind of the scene, which decides how energies are judged: "conservative", "dissipative" or "driven".
        reference: description of the reference of the errors.
        unverified: number of cells whose reference is not accurate enough; they cannot be classified as accurate.
        provenance: scene, settings, versions and machine.
        refused: method -> reason why it cannot run the scene.
        messages: notes for the user.
        seconds: duration of the computation of the map [s].
        unit: unit of the errors. Default: the unit of `of`.
    """

    x: Line
    y: Line
    classes: dict[str, np.ndarray]
    errors: dict[str, np.ndarray]
    energies: dict[str, np.ndarray]
    statuses: dict[str, np.ndarray]
    ratios: dict[str, dict[str, np.ndarray]]
    of: str
    error_bound: float
    error_time: float
    t1: float
    directions: int
    judged: str
    reference: str
    unverified: int
    provenance: dict[str, Any]
    refused: dict[str, str] = field(default_factory=dict)
    messages: tuple[str, ...] = ()
    seconds: float = 0.0
    unit: str = ""
    study: ClassVar[str] = "stability"

    def __post_init__(self) -> None:
        if not self.unit:  # a map written before `of` could be any quantity
            object.__setattr__(self, "unit", QUANTITIES.get(self.of, "1"))

    @property
    def answer(self) -> str:
        ranked: dict[tuple[float, float], list[str]] = {}
        for method, codes in self.classes.items():
            ranked.setdefault(
                (float((codes <= Cell.BOUNDED).mean()), float((codes == Cell.ACCURATE).mean())), []
            ).append(method)
        best, worst = max(ranked), min(ranked)
        (bounded, accurate), cells = best, plural(len(self.x.values) * len(self.y.values), "cell")
        text = f"Runs with {summaries.listed(ranked[best], MOST_NAMED)} stay bounded without a flag in "
        text += f"{percent(bounded, 3)} % of {cells} (accurate in {percent(accurate, 3)} %)"
        good = np.min([self.limit(method).min() for method in ranked[best]])
        if np.isfinite(good):
            text += f", in every row up to {self.x.name} {few_digits(good, self.x.unit, 3)}"
        elif not bounded:
            codes = np.concatenate([self.statuses[method].ravel() for method in ranked[best]])
            text += f"; the most frequent status is {status_name(int(np.bincount(codes).argmax()))}"
        if len(ranked) > 1:
            text += f"; with {summaries.listed(ranked[worst], MOST_NAMED)} in {percent(worst[0], 3)} %, the least"
        silent = [f"{method} in {count}" for method in self.methods if (count := len(self.silent(method)))]
        return text + (f"; unbounded without a flag: {summaries.listed(silent, MOST_NAMED)}." if silent else ".")

    def _report(self) -> list[str]:
        return report_lines(self)

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods that the map shows."""
        return tuple(self.classes)

    def limit(self, method: str, worst: Cell = Cell.BOUNDED) -> np.ndarray:
        """Find the limit of x in each row: the largest x up to which all cells of the row have class `worst` or better.

        Args:
            method: name of a method of the map.
            worst: worst class that is accepted. Default: Cell.BOUNDED.

        Returns:
            Limit for each y (ny,) [x.unit]; NaN if the first cell of the row is already worse. If the limit is the last
            x, the true limit may lie beyond the map.

        Raises:
            SceneError: for a method that the map does not have.
        """
        good = np.logical_and.accumulate(self._of(method) <= worst, axis=1).sum(axis=1)
        return np.where(good > 0, self.x.values[np.maximum(good - 1, 0)], np.nan)

    def counts(self, method: str) -> dict[str, int]:
        """Count the cells of each class.

        Args:
            method: name of a method of the map.

        Returns:
            Name of the class -> number of cells.

        Raises:
            SceneError: for a method that the map does not have.
        """
        return {cell.name.lower(): int(np.sum(self._of(method) == cell)) for cell in Cell}

    def silent(self, method: str) -> list[tuple[float, float]]:
        """List the silent cells: energy or rotation is unbounded without a status or warning. None should exist.

        Args:
            method: name of a method of the map.

        Returns:
            (x, y) of each cell [x.unit, y.unit].

        Raises:
            SceneError: for a method that the map does not have.
        """
        cells = np.argwhere(self._of(method) == Cell.SILENT)
        return [(float(self.x.values[j]), float(self.y.values[i])) for i, j in cells]

    def _of(self, method: str) -> np.ndarray:
        faults = Faults()
        faults.choice("method", method, self.classes)
        faults.raise_if_any()
        return self.classes[method]

    def _content(self) -> dict[str, Any]:
        last = {"x": self.x.to_dict(), "y": self.y.to_dict()}
        last |= {name: getattr(self, name) for name in (*ARRAYS, "ratios")}
        content = {name: value for name, value in vars(self).items() if name not in last} | last
        content["limits"] = {method: self.limit(method).tolist() for method in self.methods}
        content["legend"] = {str(int(cell)): f"{cell.name.lower()}: {cell.text}" for cell in Cell}
        return dict(finite_or_none(content))

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> StabilityMap:
        kept = {name: value for name, value in content.items() if name not in ("limits", "legend")}
        kept |= {"x": Line.from_dict(content["x"]), "y": Line.from_dict(content["y"])}
        for name, kind in ARRAYS.items():
            kept[name] = {method: _array(values, kind) for method, values in content[name].items()}
        kept["ratios"] = {method: {limit: _array(values, np.float64) for limit, values in by_limit.items()}
                          for method, by_limit in content["ratios"].items()}  # fmt: skip
        return cls(**kept | {"messages": tuple(content["messages"])})

    def rows(self) -> list[dict[str, Any]]:
        rows = []
        for method in self.methods:
            for i, j in np.ndindex(self.classes[method].shape):
                row = {
                    "method": method,
                    self.x.name: self.x.values[j],
                    self.y.name: self.y.values[i],
                    "class": Cell(int(self.classes[method][i, j])).name.lower(),
                    f"error_{self.of}": self.errors[method][i, j],
                    "energy_growth": self.energies[method][i, j],
                    "status": status_name(int(self.statuses[method][i, j])),
                }
                ratios = {f"h_over_{name}_limit": values[i, j] for name, values in self.ratios[method].items()}
                rows.append(row | ratios)
        return rows


# Fields that hold an array (ny, nx) for each method, and its type.
ARRAYS: dict[str, Any] = {"classes": np.int64, "errors": np.float64, "energies": np.float64, "statuses": np.int64}


def _array(values: Any, kind: Any) -> np.ndarray:
    """Convert nested lists to an array (ny, nx); None becomes infinite."""
    array = np.array(values, dtype=object)
    return np.asarray(np.where(array == np.array(None), np.inf, array).astype(kind))


def status_name(code: int) -> str:
    """Name of a status code of the map."""
    return "refused" if code == REFUSED else Status(code).name.lower()


@shows_progress
def stability_map(
    scene: Scene,
    x: Any = "h",
    y: Any = "angular_velocity",
    methods: Sequence[str] | None = None,
    *,
    points: int | tuple[int, int] = 24,
    t1: float | None = None,
    error: float = 1e-2,
    of: Any = "attitude",
    error_time: float | None = None,
    energy_bound: float = 1.0,
    directions: int = 4,
    h: float | None = None,
    dtype: str | None = None,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[float], None] | bool | None = None,
) -> StabilityMap:
    """Run each method from a grid of starts, and classify each cell as accurate, bounded, flagged, failed or silent.

    Classes of a cell:

    * accurate: up to error_time the error is at most `error`; a fine run ten times as accurate is the reference;
    * bounded: not accurate, but energy and rotation stay bounded up to t1;
    * flagged: energy and rotation stay bounded, but a member has the status of a failure, or a warning;
    * failed: energy or rotation is unbounded or not finite, and the status of a failure or a warning reports it;
    * silent: energy or rotation is unbounded, and neither a status nor a warning reports it.

    Energy is bounded if its change (conservative scene) or growth (damped scene) is at most energy_bound times a scale.
    The scale is the largest kinetic energy possible with the start's momenta, plus the largest change of potential
    energy. If a force may supply energy, the energy is compared with the reference's energy, up to error_time.

    Args:
        scene: the scene; its [ensemble] is ignored.
        x: horizontal axis: "h", "angular_velocity", "speed", "added_mass_ratio", "drag_number" or a name of
            scene.parameters(); as a text ("h=0.01:3", "vehicle.mass=50:500:linear"), as (name, low, high), or as a
            lw.studies.Axis. Default "h".
        y: vertical axis, given in the same forms as x. Default "angular_velocity".
        methods: names of the methods. Default: psi, psi_s, psi_x and rk4.
        points: number of cells along both axes, or two numbers for x and y. Default 24.
        t1: time up to which energy is checked [s]. Default: ten periods of the fastest motion at the start.
        error: largest error of an accurate cell, in the unit of `of`; above 0. Default 1e-2.
        of: quantity whose error is measured: a name that statistics accept ("attitude", "position", "depth",
            "euler[1]", ...), or a lw.statistics.Quantity. Default "attitude" [rad].
        error_time: time up to which errors are measured [s]; at least 16 steps if a force may supply energy. Default:
            one period of the fastest motion at the start.
        energy_bound: largest growth of energy of a bounded cell, as a fraction of the scale above [1]. Default 1.
        directions: number of starts of each cell: the scene's own start, and others with velocity and angular velocity
            turned at random. The worst start decides the class. Default 4.
        h: step [s], if neither axis is "h". Default: run.step of the scene.
        dtype: precision. Default: the scene's precision.
        seed: seed of the random turns. Default 0.
        threads: number of threads. Default: all threads of this machine.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the completed fraction, from 0 to 1.

    Returns:
        The map.

    Raises:
        SceneError: if arguments are faulty (one message lists all faults), no method can run the scene, or noise acts.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("sphere")
        >>> found = lw.stability_map(scene, ("h", 0.01, 1.0), ("angular_velocity", 0.1, 10.0), ["psi_s"], points=4, t1=1.0)
        >>> found.classes["psi_s"]
        array([[0, 0, 0, 0],
               [0, 0, 0, 0],
               [0, 0, 1, 2],
               [0, 1, 2, 2]])
    """
    report = callback(progress) or void
    scene = scene_of(scene, "scene")
    dtype = scene.run.dtype if dtype is None else dtype
    names = chosen_methods(methods, METHODS)
    faults = Faults()
    compared, unit_of_error = None, ""
    with faults.including():
        compared = compared_in(of)
        unit_of_error = compared.unit
    faults.positive("error", error, unit_of_error)
    faults.positive("energy_bound", energy_bound, "1")
    for name, value in (("t1", t1), ("error_time", error_time)):
        if value is not None:
            faults.positive(name, value, "s")
    faults.choice("dtype", dtype, DTYPES)
    check_threads(faults, threads)
    grid = None
    with faults.including():
        both = (points, points) if isinstance(points, int) else tuple(listed("points", points, "two numbers"))
        grid = StabilityGrid(scene, x, y, both, directions, whole_number("seed", seed, 0), h)
    faults.raise_if_any()
    assert grid is not None
    assert compared is not None
    error_time, t1 = (None if value is None else float(value) for value in (error_time, t1))
    least = float(grid.h.min())
    for name, value in (("t1", t1), ("error_time", error_time)):
        if value is not None and value > MOST_STEPS * least:
            raise refusal(
                name, value, f"is more than {MOST_STEPS:,} steps of {least:g} s", "give less, or longer steps"
            )
    return map_of(grid, names, compared, dtype, error=error, error_time=error_time, t1=t1, energy_bound=energy_bound,
                  seed=seed, threads=threads, report=report)  # fmt: skip


def map_of(
    grid: StabilityGrid, names: Sequence[str], compared: Distance, dtype: str, *, error: float, error_time: float | None,
    t1: float | None, energy_bound: float, seed: int, threads: int | None = None,
    report: Callable[[float], None] = void, run: Callable[..., Result] = run_plan,
    prepare: Callable[[Plan], Any] = Plan.compile,
) -> StabilityMap:  # fmt: skip
    """Run methods over the cells of a grid, as `stability_map` says."""
    begun = time.perf_counter()
    refused = refusals(grid, names, dtype)
    if len(refused) == len(names):
        raise SceneError([f"method {name}: {why}" for name, why in refused.items()])
    names = tuple(name for name in names if name not in refused)
    period = 2.0 * math.pi / grid.rate
    error_time = error_time or min(period, t1 or period)
    kind = judged(grid, names)
    t1 = error_time if kind == "driven" else max(t1 or 10.0 * period, error_time)
    least = LEAST_DRIVEN if kind == "driven" else 1
    columns = [column(step, members, error_time, t1, least) for step, members in grid.columns()]
    threads = threads or machine.thread_count()
    text = make_references(grid, columns, compared, error, threads, lambda fraction: report(0.4 * fraction), run=run)
    outcomes, messages = {}, []
    for i, name in enumerate(names):
        outcome, why = run_method(grid, columns, name, dtype, compared, kind, threads, run=run, prepare=prepare)
        report(0.4 + 0.6 * (i + 1) / len(names))
        outcomes[name] = outcome
        if why:
            messages.append(f"{name}: refused in {int(_worst(grid, outcome.status == REFUSED).sum())} cells: {why}")
    verified = np.zeros(len(grid.h), bool)
    for step_column in columns:
        verified[step_column.members] = step_column.verified
    classes = {
        name: _worst(grid, cells_of(outcome, verified, error, energy_bound)) for name, outcome in outcomes.items()
    }
    line_x, line_y = grid.lines
    result = StabilityMap(
        x=line_x,
        y=line_y,
        classes=classes,
        errors={name: _worst(grid, outcome.error) for name, outcome in outcomes.items()},
        energies={name: _worst(grid, outcome.growth / energy_bound) for name, outcome in outcomes.items()},
        statuses={name: worst_status(grid, outcome.status) for name, outcome in outcomes.items()},
        ratios=_ratios(grid, list(outcomes)),
        of=compared.name,
        unit=compared.unit,
        error_bound=float(error),
        error_time=float(error_time),
        t1=float(t1),
        directions=grid.shape[2],
        judged=kind,
        reference=text,
        unverified=int(_worst(grid, ~verified).sum()),
        provenance=_provenance(grid, list(outcomes), dtype, seed, energy_bound),
        refused=refused,
        messages=tuple(messages),
        seconds=time.perf_counter() - begun,
    )
    report(1.0)
    return result


def _worst(grid: StabilityGrid, values: np.ndarray) -> np.ndarray:
    """The largest value over the starts of each cell (ny, nx)."""
    return np.max(values.reshape(grid.shape), axis=2)


def worst_status(grid: StabilityGrid, status: np.ndarray) -> np.ndarray:
    """The worst status over the starts of each cell (ny, nx). From worst to best: refused, failed, event, OK."""
    rank = np.where(stopped(status), status - 500, np.where(status == Status.OK, -1000, status)).reshape(grid.shape)
    chosen = np.argmax(rank, axis=2)[:, :, None]
    return np.take_along_axis(status.reshape(grid.shape), chosen, axis=2)[:, :, 0]


def cells_of(runs: CellRuns, verified: np.ndarray, error: float, energy_bound: float) -> np.ndarray:
    """Classify every member of a method's runs (n,); verified: whether its reference is good enough (n,)."""
    unbounded = ~(runs.growth / energy_bound <= 1.0)
    flagged = runs.warned | failed(runs.status)
    masks = [unbounded & ~flagged, unbounded, flagged, verified & (runs.error <= error)]
    return np.select(masks, [Cell.SILENT, Cell.FAILED, Cell.FLAGGED, Cell.ACCURATE], Cell.BOUNDED)


def _ratios(grid: StabilityGrid, methods: Sequence[str]) -> dict[str, dict[str, np.ndarray]]:
    """Method -> limit -> the step divided by the limit, for the fastest start of each cell (ny, nx) [1].

    Limits that a method does not have, and limits of motions that do not occur, are left out.
    """
    numbers = {name: _worst(grid, grid.h * rate) for name, rate in grid.rates().items()}
    ratios: dict[str, dict[str, np.ndarray]] = {}
    for method in methods:
        limits = {name: limit(method) for name, limit in LIMITS.items()}
        ratios[method] = {name: number / limits[name] for name, number in numbers.items()
                         if math.isfinite(limits[name]) and np.any(number)}  # fmt: skip
    return ratios


def _provenance(
    grid: StabilityGrid, methods: Sequence[str], dtype: str, seed: int, energy_bound: float
) -> dict[str, Any]:
    """The scene, the settings, the versions and the machine of a map."""
    content = provenance(plan_of(grid, np.arange(1), methods[0], SHORTEST, "float64", "all"))
    content = {name: content[name] for name in ("scene", "versions", "machine", "checks")}
    content |= {"methods": list(methods), "dtype": dtype, "seed": seed, "energy_bound": energy_bound}
    return content | {"axes": {name: vars(axis) for name, axis in (("x", grid.x), ("y", grid.y))}}


def report_lines(stability: StabilityMap) -> list[str]:
    """Report of the map as lines of text."""
    unit = stability.unit
    lines = [f"note        {message}" for message in stability.messages]
    lines += [
        f"map         {stability.x.label} x {stability.y.label}: {len(stability.x.values)} x {len(stability.y.values)} cells, "
        f"{stability.directions} starts each, {stability.seconds:.0f} s",
        f"accurate    {stability.of} to {stability.error_bound:g} {unit} up to {stability.error_time:.3g} s; "
        "bounded: energy up to "
        f"{stability.t1:.3g} s ({stability.judged})",
        f"reference   {stability.reference}"
        + (f"; not in {stability.unverified} cells" if stability.unverified else ""),
    ]
    if stability.refused:
        lines.append(f"refused     {', '.join(f'{name}: {why}' for name, why in stability.refused.items())}")
    heads = "".join(f"{cell.name.lower():>10}" for cell in Cell)
    lines += ["", f"{'cells':<18}{heads}   limit of {stability.x.name} over {stability.y.name}, least to most"]
    for method in stability.methods:
        limit, numbers = stability.limit(method), stability.counts(method).values()
        good = limit[np.isfinite(limit)]
        span = f"{good.min():.3g} to {good.max():.3g}" if len(good) else "none"
        lines.append(f"{method:<18}" + "".join(f"{number:>10}" for number in numbers) + f"   {span} {stability.x.unit}")
    return lines
