# SPDX-License-Identifier: Apache-2.0
"""Trial runs of settings on a sample: the steps of every method are halved in turn while this gains accuracy."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.common.machine import DTYPES
from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring import comparison
from lgvi_warp.measuring.budget import Budget
from lgvi_warp.measuring.comparison import Candidate, Sample
from lgvi_warp.measuring.reference import Reference
from lgvi_warp.results.result import Result

# Solvers of equation (24) besides the default, tried for one method that solves it.
SOLVERS: tuple[tuple[str, int | None], ...] = (("quartic", 1), ("cayley", None), ("newton", None))
SOLVED_BY = "psi_s"
PRECISIONS = tuple(name for name in DTYPES if name in ("float64", "float32"))
# Methods tried last, with state sums of two float32 numbers.
COMPENSATED = ("psi_x", "psi_s", "su4(psi_x)", "kl6(psi_x)")
# Quantities whose errors decide when a series of halved steps has reached round-off.
DECIDING = ("position", "attitude")
# Errors shown are at least this many times the reference's own.
TRUST = 10.0
# A series of halved steps ends where another setting is as accurate in this many times less time.
HOPELESS = 10.0


@dataclass(eq=False)
class Trial:
    """A setting that was run on a sample.

    plan: plan by which its cost is measured; noise without a noise_step is drawn once per step.
    errors: quantity -> kind -> error; empty if a member failed or there is no reference.
    cpu_seconds: processor time of the run, without compiling [s].
    """

    candidate: Candidate
    plan: Plan
    result: Result
    errors: dict[str, dict[str, float]]
    cpu_seconds: float

    def error(self, of: str) -> float:
        """The largest error over members and path; infinite if a member failed or there is no reference."""
        return self.errors[of]["path_max"] if self.errors else math.inf


def tried(
    sample: Sample, candidate: Candidate, reference: Reference | None, until: int = -1, budget: Budget | None = None
) -> Trial:
    """Run a setting on a sample and measure its errors against the reference, if any. Compiling is not budgeted."""
    plan = sample.plan(candidate)
    with budget.free() if budget else contextlib.nullcontext():
        compile_seconds = sample.kernels.compile(plan)
    with np.errstate(all="ignore"):
        begun = sample.kernels.clock()
        result = replace(sample.kernels.run(plan), compile_seconds=compile_seconds)
        cpu_seconds = sample.kernels.clock() - begun
        errors: dict[str, dict[str, float]] = {}
        if reference is not None and not comparison.failed(result):
            until = until % len(sample.times)
            errors = comparison.errors(comparison.distances(result, reference.result, reference.asked), until)
            if not all(np.isfinite(norms["path_max"]) for norms in errors.values()):
                errors = {}
    return Trial(candidate, sample.plan_to_price(candidate), result, errors, cpu_seconds)


@dataclass
class StepSeries:
    """Steps of one setting, each half of the step before.

    m: number of steps in the sample's spacing.
    best: smallest error of the steps so far; the error is the larger of position [m] and attitude [rad].
    worse: number of successive steps with little gain.
    """

    method: str
    dtype: str
    solver: tuple[str, int | None]
    m: int
    best: float = math.inf
    worse: int = 0
    rungs: int = 0

    def candidate(self, sample: Sample) -> Candidate:
        """The next setting to run."""
        return sample.candidate(self.method, self.m, self.dtype, self.solver)


def trials_of(
    sample: Sample, methods: Sequence[str], reference: Reference | None, until: int, budget: Budget, whole: Budget,
    report: Callable[[float], None], named: bool = False, *,
    solvers: Sequence[tuple[str, int | None]] | None = None, compensated: Sequence[str] | None = None,
) -> tuple[list[Trial], list[str]]:  # fmt: skip
    """Run every method, precision and solver: each first at a coarse step, then in turn at half its last step.

    whole: budget of the study, including compiling; once it is spent, only methods that the user named are compiled.
    named: True if the user named the methods; then each is started, however long its kernel compiles.
    Returns: The trials, and the names of the settings that were left out for lack of time.
    """
    solvers = SOLVERS if solvers is None else solvers
    every = series_of(sample, methods, solvers, COMPENSATED if compensated is None else compensated)
    trials, skipped, begun, waiting = list[Trial](), list[str](), set[str](), list[StepSeries]()
    for i, series in enumerate(every):
        report(0.5 * i / len(every))
        asked = named and series.method not in begun
        if trials and not asked and (whole.over or budget.over):
            skipped.append(series.candidate(sample).text)
            continue
        begun.add(series.method)
        if halved(sample, series, trials, reference, until, budget):
            waiting.append(series)
    while waiting:
        for series in list(waiting):
            report(0.5 + 0.5 * min(1.0, budget.spent / budget.seconds))
            if budget.over:
                waiting.remove(series)
                skipped.append(series.candidate(sample).text + " at fine steps")
            elif not halved(sample, series, trials, reference, until, budget):
                waiting.remove(series)
    if reference is not None:
        trials += between(sample, trials, budget, lambda finer: tried(sample, finer, reference, until, budget))
    return trials, skipped


def series_of(
    sample: Sample, methods: Sequence[str], solvers: Sequence[tuple[str, int | None]], compensated: Sequence[str]
) -> list[StepSeries]:
    """Series of steps for all settings; the default precision of every method comes first."""
    plain: tuple[str, int | None] = ("quartic", None)
    settings = [(name, dtype, plain) for dtype in PRECISIONS for name in methods]
    settings += [(SOLVED_BY, "float64", solved) for solved in solvers if SOLVED_BY in methods]
    summed, _ = sample.accepted([name for name in compensated if name in methods], "float32_compensated")
    settings += [(name, "float32_compensated", plain) for name in summed]
    return [StepSeries(*setting, sample.coarsest(1.0)) for setting in settings]


def halved(
    sample: Sample, series: StepSeries, trials: list[Trial], reference: Reference | None, until: int, budget: Budget
) -> bool:
    """Run the next step of a series; True if another step is worth its cost."""
    trial = tried(sample, series.candidate(sample), reference, until, budget)
    trials.append(trial)
    series.rungs += 1
    finer = sample.allowed(2 * series.m)
    if finer == series.m or series.rungs == (20 if reference else 5):
        return False
    series.m = finer
    if reference is None:
        return True
    error = max(trial.error(of) for of in DECIDING)
    series.worse = series.worse + 1 if error > 0.8 * series.best and series.best < 0.1 else 0
    series.best = min(series.best, error)
    noise = TRUST * max(reference.error(of, until) for of in DECIDING)
    longest = budget.seconds / 40.0
    return not (series.worse >= 2 or error < noise or trial.cpu_seconds > longest or is_dominated(trial, trials))


def is_dominated(trial: Trial, trials: Sequence[Trial]) -> bool:
    """True if another setting was more accurate at a tenth of the cost."""
    error = max(trial.error(of) for of in DECIDING)
    rivals = (rival for rival in trials if HOPELESS * rival.cpu_seconds < trial.cpu_seconds)
    return math.isfinite(error) and any(max(rival.error(of) for of in DECIDING) < error for rival in rivals)


def between(sample: Sample, trials: Sequence[Trial], budget: Budget, run: Callable[[Candidate], Trial]) -> list[Trial]:
    """Run settings near the Pareto front of trials, at steps between those already tried."""
    ranked = sorted((trial.cpu_seconds, trial.error(DECIDING[0]), i) for i, trial in enumerate(trials))
    best, near = math.inf, list[Trial]()
    for _, error, i in ranked:
        if error < best:
            best = error
            near.append(trials[i])
    tried_already, more = {trial.candidate for trial in trials}, list[Trial]()
    for trial in near:
        m = round(float(sample.spacing) / trial.candidate.h)
        for step in {round(m / math.sqrt(2.0)), round(m * math.sqrt(2.0))} - {0}:
            candidate = replace(trial.candidate, h=sample.h(sample.allowed(step)))
            if candidate not in tried_already and not budget.over:
                tried_already.add(candidate)
                more.append(run(candidate))
    return more
