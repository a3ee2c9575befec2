"""The runs behind a stability map: references, every method's columns, and what energies say of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.status import Status, failed, stop_time
from lgvi_warp.engine import plan
from lgvi_warp.engine.plan import Plan
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import FIELDS, TimeGrid
from lgvi_warp.physics import energy as invariants
from lgvi_warp.runs.result import Result
from lgvi_warp.runs.run import run_plan
from lgvi_warp.studies import comparison
from lgvi_warp.studies.compared import Compared, compared_in
from lgvi_warp.studies.comparison import PRECISE
from lgvi_warp.studies.stability.grid import Grid

# Times that errors are taken at, and that energies are looked at.
ERROR_SAMPLES, ENERGY_SAMPLES = 8, 64
# A reference agrees with another run to the error bound over this.
TRUST = 10.0
# Of a reference: it turns by this at most in its first step [rad], and its step is halved so often to agree.
FINE, HALVINGS = 0.2, 6
# What is judged by the reference's energy makes so many steps: in two even the worst method does not blow up.
LEAST_DRIVEN = 16
# A matrix this far from a rotation is none any more.
SKEWED = 0.1
# The status of members whose column the program refused to run.
REFUSED = 255
# One step so short that no method refuses it for its length.
SHORTEST = TimeGrid(1e-9, np.array([0, 1]), np.array([0.0, 1e-9]))


@dataclass
class Found:
    """What a method's runs showed, by member."""

    error: np.ndarray
    growth: np.ndarray
    status: np.ndarray
    warned: np.ndarray


@dataclass(eq=False)
class Column:
    """One step and the members that take it, with the times that its runs are sampled at, and the reference there."""

    h: float
    members: np.ndarray
    error_steps: np.ndarray
    steps: np.ndarray
    reference: Result | None = None
    verified: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    def grid(self, finer: int = 1, whole: bool = True) -> TimeGrid:
        """The steps and samples; `finer`: of h over this many."""
        steps = self.steps if whole else self.error_steps
        return TimeGrid(self.h / finer, steps * finer, steps * self.h)


def column(h: float, members: np.ndarray, error_time: float, t1: float, least: int = 1) -> Column:
    """The column of these members: both times rounded up to whole steps, `least` of them or more."""
    short, long = (max(least, math.ceil(t / h * (1.0 - 1e-12))) for t in (error_time, t1))
    errors = np.unique(np.linspace(0, short, ERROR_SAMPLES + 1).round().astype(np.int64))
    more = np.linspace(0, max(long, short), ENERGY_SAMPLES + 1).round().astype(np.int64)
    return Column(h, members, errors, np.union1d(errors, more))


def plan_of(grid: Grid, members: np.ndarray, method: str, times: TimeGrid, dtype: str) -> Plan:
    """A run of some members. Raises SceneError where the method cannot do it."""
    checks = "all" if "all" in plan.CHECKS else "safe"
    return Plan(grid.fleet(members), Method(method), times, FIELDS, dtype, checks=checks)


def refusals(grid: Grid, names: Sequence[str], dtype: str) -> dict[str, str]:
    """Methods that the scene does not take at any step, and why."""
    refused = {}
    for name in names:
        try:
            plan_of(grid, np.arange(len(grid.h)), name, SHORTEST, dtype)
        except SceneError as error:
            refused[name] = str(error)
    return refused


def judged(grid: Grid, names: Sequence[str]) -> str:
    """Whether energy is kept, only lost, or given by what acts. Raises SceneError where noise acts."""
    laws = plan_of(grid, np.arange(1), names[0], SHORTEST, "float64").model.laws
    if any(getattr(module, "NOISE", False) for _, module in laws):
        raise SceneError(["terms: noise acts, whose path differs from step to step; leave it out for a stability map"])
    flows = [getattr(module, "FLOW", "none") for _, module in laws]
    if any(flow not in ("none", "steady") for flow in flows):
        return "driven"
    if any(flow == "steady" for flow in flows) and not all(_carried(term, module) for term, module in laws):
        return "driven"
    rest = [
        (term, module)
        for term, module in laws
        if not getattr(module, "POTENTIAL", False) and not hasattr(module, "flow")
    ]
    if any(hasattr(module, "law") or not term.dissipative for term, module in rest):
        return "driven"
    return "dissipative" if rest else "conservative"


def _carried(term: Any, module: Any) -> bool:
    """Whether a steady current, if level, gives no energy, relative to the water, through this: weight, buoyancy, drag."""
    if getattr(module, "FLOW", "none") == "steady":
        return not np.any(np.asarray(term.velocity)[2:])
    return getattr(module, "SEPARABLE", False) or not hasattr(module, "law")


def make_references(
    grid: Grid, columns: Sequence[Column], of: Any, error: float, threads: int, report: Callable[[float], None]
) -> str:
    """Give every column the states at its error times; says by which methods."""
    asked = compared_in(of)
    first, second = _precise(grid)
    rates = np.max(list(grid.rates().values()), axis=0)
    done = 0
    with ThreadPoolExecutor(threads) as pool:
        jobs = [pool.submit(_reference, grid, one, (first, second), rates, asked, error / TRUST) for one in columns]
        for job in as_completed(jobs):
            job.result()
            done += 1
            report(done / len(jobs))
    return f"{second} against {first}, steps that turn by {FINE:g} rad or less, halved until they agree"


def _precise(grid: Grid) -> tuple[str, str]:
    """The two best methods that the scene takes; the best twice where the second is of much lower order."""
    names: list[str] = []
    for name in PRECISE:
        try:
            Method(name)
            plan_of(grid, np.arange(len(grid.h)), name, SHORTEST, "float64")
        except SceneError:
            continue
        names.append(name)
        if len(names) == 2:
            break
    if not names:
        raise SceneError([f"method: the scene takes none of {', '.join(PRECISE)} for a reference"])
    close = len(names) == 2 and Method(names[1]).order >= Method(names[0]).order - 2
    return names[0], names[1] if close else names[0]


def _reference(
    grid: Grid, column: Column, names: tuple[str, str], rates: np.ndarray, of: Compared, goal: float
) -> None:
    """Fill in a column's reference: two methods, halving the steps of the members that they do not yet agree on."""
    n = len(column.members)
    column.verified = np.zeros(n, bool)
    open_ = np.arange(n)
    finer = max(1, math.ceil(column.h * float(rates[column.members].max()) / FINE))
    for _ in range(HALVINGS):
        members = column.members[open_]
        try:
            with np.errstate(all="ignore"):
                a, b = (run_plan(plan_of(grid, members, name, column.grid(k, whole=False), "float64"), 1)
                        for name, k in zip(names, (finer, math.ceil(1.5 * finer)), strict=True))  # fmt: skip
                apart = comparison.distances(a, b, of)[of.name]
                good = ~failed(a.status) & ~failed(b.status) & np.isfinite(b.attitude).all(axis=(0, 2, 3))
                good &= np.max(np.nan_to_num(apart, posinf=np.inf), axis=0) <= goal
        except SceneError:
            # Too long for a stage that goes backward.
            finer *= 2
            continue
        column.reference = _joined(column.reference, b, open_)
        column.verified[open_] = good
        open_ = open_[~good]
        finer *= 2
        if len(open_) == 0:
            break


def _joined(whole: Result | None, part: Result, at: np.ndarray) -> Result:
    """The part's members in the place of those of the whole."""
    if whole is None:
        return part
    for name, values in part.samples.items():
        whole.samples[name][:, at] = values
    whole.status[at], whole.failure_time[at] = part.status, part.failure_time
    # Energies that were asked for already are of the old samples.
    vars(whole).pop("energy", None)
    return whole


def run_method(
    grid: Grid, columns: Sequence[Column], method: str, dtype: str, of: Compared, judged: str, threads: int
) -> tuple[Found, str]:  # fmt: skip
    """Run a method over all columns; also the reason where the program refused some."""
    n = len(grid.h)
    found = Found(np.full(n, np.inf), np.zeros(n), np.full(n, REFUSED), np.zeros(n, bool))
    why: list[str] = []
    rows = grid.shape[2]
    plan_of(grid, np.arange(n), method, SHORTEST, dtype).compile()

    def column_of(column: Column, at: np.ndarray) -> None:
        members = column.members[at]
        try:
            run = plan_of(grid, members, method, column.grid(), dtype)
        except SceneError as error:
            why.append(str(error))
            if len(at) > rows:
                # Only some cells of it are refused: halves of whole cells.
                half = len(at) // rows // 2 * rows
                column_of(column, at[:half])
                column_of(column, at[half:])
            return
        with np.errstate(all="ignore"):
            _judge(run_plan(run, 1), column, at, found, of, judged)

    with ThreadPoolExecutor(threads) as pool:
        jobs = [pool.submit(column_of, one, np.arange(len(one.members))) for one in columns]
        for job in jobs:
            job.result()
    return found, why[0] if why else ""


def _judge(result: Result, column: Column, at: np.ndarray, found: Found, of: Compared, judged: str) -> None:
    """Note what the run of some members of a column showed."""
    members = column.members[at]
    found.status[members] = np.asarray(result.status)
    warnings = getattr(result, "warnings", None)
    if warnings is not None:
        found.warned[members] = np.asarray(warnings) != 0
    early = np.searchsorted(column.steps, column.error_steps)
    if column.reference is not None:
        reference = comparison.part(column.reference, at.tolist())
        apart = comparison.distances(_at_times(result, early), reference, of)[of.name]
        # Beyond an event there is no error; a member that was frozen has none at all.
        stopped = np.isfinite(np.minimum(stop_time(result), stop_time(reference)))
        lost = failed(result.status) | (np.isnan(apart).any(axis=0) & ~stopped)
        largest = np.max(np.nan_to_num(apart, posinf=np.inf), axis=0)
        found.error[members] = np.where(lost, np.inf, largest)
        if judged == "driven":
            energy, size = reference.energy, np.max(invariants.kinetic_energy(reference), axis=0)
            change = np.max(np.abs(result.energy[early] - energy), axis=0)
            found.growth[members] = _with_rotation(change / np.maximum(size, 1e-300), result)
            return
    found.growth[members] = _with_rotation(
        invariants.energy_growth(result, dissipative=judged == "dissipative"), result
    )


def _at_times(result: Result, rows: np.ndarray) -> Result:
    return replace(
        result, time=result.time[rows], samples={name: values[rows] for name, values in result.samples.items()}
    )


def _with_rotation(growth: np.ndarray, result: Result) -> np.ndarray:
    """Also how far R is from a rotation, over SKEWED; infinite where a number of the state is not finite."""
    R = result.attitude.astype(np.float64)
    skewed = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(0, 2, 3)) / SKEWED
    worst = np.maximum(growth, skewed)
    return np.where(np.isfinite(worst) & (np.asarray(result.status) != Status.NON_FINITE), worst, np.inf)
