# SPDX-License-Identifier: Apache-2.0
"""Runs of a stability map: references, every method's runs, and their errors and energies."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.accuracy.stability.grid import StabilityGrid
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.status import Status, failed, stop_time
from lgvi_warp.engine.plan import Plan, choose_plan
from lgvi_warp.measuring import comparison
from lgvi_warp.measuring.distance import Distance, compared_in
from lgvi_warp.measuring.reference import PRECISE, paired
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.results.result import Result
from lgvi_warp.runs.run import run_plan

# Number of times at which errors are measured, and energies.
ERROR_SAMPLES, ENERGY_SAMPLES = 8, 64
# The two runs of a reference agree to the error bound divided by this.
TRUST = 10.0
# Largest turn in the first step of a reference [rad], and largest number of times that its step is halved.
FINE, HALVINGS = 0.2, 6
# Least number of steps of driven scenes: in two steps even the worst method does not blow up.
LEAST_DRIVEN = 16
# Distance from a rotation at which a matrix no longer counts as one.
SKEWED = 0.1
# Status of members that the program refused to run.
REFUSED = 255
# One step so short that no method refuses it for its length.
SHORTEST = TimeGrid(1e-9, np.array([0, 1]), np.array([0.0, 1e-9]))


@dataclass
class CellRuns:
    """Outcomes of a method's runs, per member (n,).

    error: largest error up to the error time [unit of the quantity]; infinite if it could not be measured.
    growth: largest growth of energy divided by the energy available [1].
    status: Status codes; REFUSED if the program refused to run the member.
    """

    error: np.ndarray
    growth: np.ndarray
    status: np.ndarray
    warned: np.ndarray


@dataclass(eq=False)
class Column:
    """One step h [s], the members that take it (k,), and their reference.

    error_steps: numbers of the steps at which errors are measured. steps: the same for energies, including error_steps.
    verified: True for each member whose reference is accurate enough (k,).
    """

    h: float
    members: np.ndarray
    error_steps: np.ndarray
    steps: np.ndarray
    reference: Result | None = None
    verified: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    def grid(self, finer: int = 1, to_the_end: bool = True) -> TimeGrid:
        """Steps and sample times of a run with steps of h / finer."""
        steps = self.steps if to_the_end else self.error_steps
        return TimeGrid(self.h / finer, steps * finer, steps * self.h)


def column(h: float, members: np.ndarray, error_time: float, t1: float, least: int = 1) -> Column:
    """The column of the members that share a step, with both times [s] rounded up to whole steps."""
    short, long = (max(least, math.ceil(t / h * (1.0 - 1e-12))) for t in (error_time, t1))
    errors = np.unique(np.linspace(0, short, ERROR_SAMPLES + 1).round().astype(np.int64))
    more = np.linspace(0, max(long, short), ENERGY_SAMPLES + 1).round().astype(np.int64)
    return Column(h, members, errors, np.union1d(errors, more))


def plan_of(
    grid: StabilityGrid, members: np.ndarray, method: str, times: TimeGrid, dtype: str, checks: str = "safe"
) -> Plan:
    """The plan of a run of some members."""
    return choose_plan(grid.fleet(members), Method(method), times, FIELDS, dtype, checks=checks)


def refusals(grid: StabilityGrid, names: Sequence[str], dtype: str) -> dict[str, str]:
    """Methods that cannot run the scene at any step, and the reasons."""
    refused = {}
    for name in names:
        try:
            plan_of(grid, np.arange(len(grid.h)), name, SHORTEST, dtype)
        except SceneError as error:
            refused[name] = str(error)
    return refused


def judged(grid: StabilityGrid, names: Sequence[str]) -> str:
    """Criterion for energies: "conservative" (kept), "dissipative" (lost) or "driven" (a force may supply energy)."""
    laws = plan_of(grid, np.arange(1), names[0], SHORTEST, "float64").kernel_choice.laws
    if any(getattr(module, "NOISE", False) for _, module in laws):
        raise SceneError(["terms: noise acts, whose path differs from step to step. Leave it out for a stability map"])
    flows = [getattr(module, "FLOW", "none") for _, module in laws]
    if any(flow not in ("none", "steady") for flow in flows):
        return "driven"
    if any(flow == "steady" for flow in flows) and not all(_carried(term, module) for term, module in laws):
        return "driven"
    rest = [(term, module) for term, module in laws
            if not getattr(module, "POTENTIAL", False) and not hasattr(module, "flow")]  # fmt: skip
    if any(hasattr(module, "law") or not term.dissipative for term, module in rest):
        return "driven"
    return "dissipative" if rest else "conservative"


def _carried(term: Any, module: Any) -> bool:
    """True if a steady current supplies no energy through a law: a level current with weight, buoyancy or drag."""
    if getattr(module, "FLOW", "none") == "steady":
        return not np.any(np.asarray(term.velocity)[2:])
    return getattr(module, "SEPARABLE", False) or not hasattr(module, "law")


def make_references(
    grid: StabilityGrid, columns: Sequence[Column], of: Any, error: float, threads: int, report: Callable[[float], None],
    *, run: Callable[..., Result] = run_plan,
) -> str:  # fmt: skip
    """Compute every column's reference at the error times; its error is below `error` by the factor TRUST."""
    compared = compared_in(of)
    first, second = precise_pair(grid)
    rates = np.max(list(grid.rates().values()), axis=0)
    done = 0
    with ThreadPoolExecutor(threads) as pool:
        jobs = [
            pool.submit(_reference, grid, step_column, (first, second), rates, compared, error / TRUST, run)
            for step_column in columns
        ]
        for job in as_completed(jobs):
            job.result()
            done += 1
            report(done / len(jobs))
    return f"{second} against {first}, steps that turn by {FINE:g} rad or less, halved until they agree"


def precise_pair(grid: StabilityGrid, *, refused: Callable[..., dict[str, str]] = refusals) -> tuple[str, str]:
    """Names of the two most accurate methods that can run the scene."""
    names = list(itertools.islice((name for name in PRECISE if not refused(grid, [name], "float64")), 2))
    if not names:
        raise SceneError([f"method: the scene takes none of {', '.join(PRECISE)} for a reference"])
    return paired(names)


def _reference(
    grid: StabilityGrid, column: Column, names: tuple[str, str], rates: np.ndarray, of: Distance, goal: float,
    run: Callable[..., Result],
) -> None:  # fmt: skip
    """Compute a column's reference by two methods; halve the steps of members on which they do not agree yet."""
    n = len(column.members)
    column.verified = np.zeros(n, bool)
    open_ = np.arange(n)
    finer = max(1, math.ceil(column.h * float(rates[column.members].max()) / FINE))
    for _ in range(HALVINGS):
        members = column.members[open_]
        try:
            with np.errstate(all="ignore"):
                a, b = (run(plan_of(grid, members, name, column.grid(k, to_the_end=False), "float64"), 1)
                        for name, k in zip(names, (finer, math.ceil(1.5 * finer)), strict=True))  # fmt: skip
                apart = comparison.distances(a, b, of)[of.name]
                good = ~failed(a.status) & ~failed(b.status) & np.isfinite(b.attitude).all(axis=(0, 2, 3))
                good &= np.max(np.nan_to_num(apart, posinf=np.inf), axis=0) <= goal
        except SceneError:
            # The step is too long for a stage that goes backward.
            finer *= 2
            continue
        column.reference = joined(column.reference, b, open_)
        column.verified[open_] = good
        open_ = open_[~good]
        finer *= 2
        if len(open_) == 0:
            break


def joined(result: Result | None, part: Result, at: np.ndarray) -> Result:
    """Replace members of a result, if there is one, by those of another."""
    if result is None:
        return part
    for name, values in part.samples.items():
        result.samples[name][:, at] = values
    result.status[at], result.failure_time[at] = part.status, part.failure_time
    # A cached energy belongs to the old samples.
    vars(result).pop("energy", None)
    return result


def run_method(
    grid: StabilityGrid, columns: Sequence[Column], method: str, dtype: str, of: Distance, judged: str, threads: int,
    *, plan_of: Callable[..., Plan] = plan_of, run: Callable[..., Result] = run_plan,
    prepare: Callable[[Plan], Any] = Plan.compile,
) -> tuple[CellRuns, str]:  # fmt: skip
    """Run a method over all columns.

    Returns: Outcomes of the runs, and the reason why the program refused some of them; "" if it refused none.
    """
    n = len(grid.h)
    findings = CellRuns(np.full(n, np.inf), np.zeros(n), np.full(n, REFUSED), np.zeros(n, bool))
    why: list[str] = []
    rows = grid.shape[2]
    prepare(plan_of(grid, np.arange(n), method, SHORTEST, dtype, "all"))

    def column_of(column: Column, at: np.ndarray) -> None:
        members = column.members[at]
        try:
            plan = plan_of(grid, members, method, column.grid(), dtype, "all")
        except SceneError as error:
            why.append(str(error))
            if len(at) > rows:
                # Perhaps only some cells are refused: try both halves, each of whole cells.
                half = len(at) // rows // 2 * rows
                column_of(column, at[:half])
                column_of(column, at[half:])
            return
        with np.errstate(all="ignore"):
            judge(run(plan, 1), column, at, findings, of, judged)

    with ThreadPoolExecutor(threads) as pool:
        jobs = [pool.submit(column_of, step_column, np.arange(len(step_column.members))) for step_column in columns]
        for job in jobs:
            job.result()
    return findings, why[0] if why else ""


def judge(result: Result, column: Column, at: np.ndarray, runs: CellRuns, of: Distance, judged: str) -> None:
    """Record the errors, energies, statuses and warnings of a run of some members of a column."""
    members = column.members[at]
    runs.status[members] = np.asarray(result.status)
    warnings = getattr(result, "warnings", None)
    if warnings is not None:
        runs.warned[members] = np.asarray(warnings) != 0
    early = np.searchsorted(column.steps, column.error_steps)
    if column.reference is not None:
        reference = column.reference.part(at)
        apart = comparison.distances(_at_times(result, early), reference, of)[of.name]
        # Distances end at an event; NaN without an event means that the member was lost.
        stopped = np.isfinite(np.minimum(stop_time(result), stop_time(reference)))
        lost = failed(result.status) | (np.isnan(apart).any(axis=0) & ~stopped)
        largest = np.max(np.nan_to_num(apart, posinf=np.inf), axis=0)
        runs.error[members] = np.where(lost, np.inf, largest)
        if judged == "driven":
            energy, size = reference.energy, np.max(invariants.kinetic_energy(reference), axis=0)
            change = np.max(np.abs(result.energy[early] - energy), axis=0)
            runs.growth[members] = _with_rotation(change / np.maximum(size, 1e-300), result)
            return
    growth = invariants.energy_growth(result, dissipative=judged == "dissipative")
    runs.growth[members] = _with_rotation(growth, result)


def _at_times(result: Result, rows: np.ndarray) -> Result:
    samples = {name: values[rows] for name, values in result.samples.items()}
    return replace(result, time=result.time[rows], samples=samples)


def _with_rotation(growth: np.ndarray, result: Result) -> np.ndarray:
    """Larger of energy growth and R's distance from a rotation, divided by SKEWED (n,); infinite if not finite."""
    R = result.attitude.astype(np.float64)
    skewed = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(0, 2, 3)) / SKEWED
    worst = np.maximum(growth, skewed)
    return np.where(np.isfinite(worst) & (np.asarray(result.status) != Status.NON_FINITE), worst, np.inf)
