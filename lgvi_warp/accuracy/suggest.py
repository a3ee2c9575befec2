# SPDX-License-Identifier: Apache-2.0
"""The cheapest setting that keeps a given error: found on a sample, checked on more members and after the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.accuracy import tradeoff as tradeoffs
from lgvi_warp.accuracy.tradeoff import chosen_methods, growth_of, growth_text, noise_text
from lgvi_warp.common import machine
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.sentences import capital
from lgvi_warp.common.summaries import few_digits, plural
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.executors import check_threads
from lgvi_warp.engine.plan import Plan, choose_plan
from lgvi_warp.measuring import comparison, cost
from lgvi_warp.measuring.budget import Budget, rounded_up
from lgvi_warp.measuring.comparison import Candidate, Sample
from lgvi_warp.measuring.distance import Distance, compared_in
from lgvi_warp.measuring.kernels import KERNELS, Kernels
from lgvi_warp.measuring.ladders import ROUNDS, SHORT, Ladders
from lgvi_warp.measuring.reference import Growth, Reference, make_reference, time_over
from lgvi_warp.measuring.speed import void
from lgvi_warp.measuring.trials import Trial, tried
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.results.result import Result
from lgvi_warp.runs.default_method import is_damped
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.uncertainty.estimating.estimate import drawn
from lgvi_warp.uncertainty.estimating.mean_setting import MeanSetting, mean_settings

# A setting is accepted where its error on the sample is below the error asked for by this factor.
SAFETY = 1.15
# Number of times that errors are compared at, where the scene gives none: few, so that steps may be long.
TIMES = 5
# Methods in the order in which they are tried; those that are seldom the cheapest are left out.
CANDIDATES = tuple(name for name in tradeoffs.CANDIDATES if name not in ("phi", "psi", "psi_w"))
# Tried as well for drag by its exact flow, and where damping limits the step.
STIFFLY_DAMPED = ("psi_x", "rkw3")
# Number of members that the choice is checked on, and how many times as many times, where steps become no shorter than this.
CHECKED, DENSER, SHORTER = 1024, 4, 1.1
# The largest errors that tell how errors fall off: a 64th of the members, at least 8; below 40 members none tell.
TAIL, FEWEST_IN_TAIL, FEWEST = 64, 8, 40
# Chance that another fleet, as large and drawn alike, has a larger error than is expected.
CHANCE = 0.1
# Number of members that a finished run is checked on.
CONFIRMED = 64
# Part of a search's time that a reference gets.
SHARE = 0.4
# Number of settings in the last comparison of costs.
FINALISTS = 4
# Bytes of a member besides its samples: state, parameters, status, and the arrays they are made from.
BYTES_OF_A_MEMBER = 2000
# Members that are timed for the time of all.
TIMED_MEMBERS = 256


@dataclass(frozen=True)
class Suggestion:
    """Cheapest setting found for an error, with its predicted cost.

    Attributes:
        settings: arguments for `lw.solve(fleet, **settings)`: method, h and dtype.
        setting: the same setting as a Candidate.
        error: requested error [`unit`].
        of: name of the quantity whose error is limited.
        unit: unit of that quantity.
        expected: expected largest error over all members of the fleet and their paths [`unit`], extrapolated from the
            largest errors of the checked members. One in ten fleets of this size and distribution has a larger error.
        us_per_vehicle_second: microseconds of one core per vehicle and simulated second.
        run_seconds: predicted run time of all members on `threads` threads, without compiling [s].
        threads: number of threads that `run_seconds` assumes.
        memory_bytes: predicted memory of the run and of its result [bytes].
        members: number of members that the setting was checked on.
        t1: end time of the checked runs [s].
        reference: description of the two fine runs from which errors are measured.
        reference_error: largest difference between these two runs [`unit`].
        rivals: (setting, us_per_vehicle_second, expected error) of each of the next best settings.
        worst: indices of the members with the largest errors, the largest first. A check of a finished run uses them.
        asked: the quantity whose error is limited, as the object that a check of a finished run needs.
        messages: notes for the user.
    """

    settings: dict[str, Any]
    setting: Candidate
    error: float
    of: str
    unit: str
    expected: float
    us_per_vehicle_second: float
    run_seconds: float
    threads: int
    memory_bytes: int
    members: int
    t1: float
    reference: str
    reference_error: float
    rivals: tuple[tuple[Candidate, float, float], ...] = ()
    worst: tuple[int, ...] = ()
    asked: Distance | None = field(default=None, repr=False, compare=False)
    messages: tuple[str, ...] = ()

    @property
    def margin(self) -> float:
        """Requested error divided by the expected error; infinite if the expected error is 0."""
        return self.error / self.expected if self.expected > 0.0 else math.inf

    @property
    def answer(self) -> str:
        """The answer in one sentence. The text of `str` ends with this sentence."""
        s, asked, expected = self.setting, *(few_digits(each, self.unit, 2) for each in (self.error, self.expected))
        chosen = f"{s.text} with step {s.h:.6g} s is the cheapest setting found"
        return f"{chosen} that keeps {self.of} to {asked} up to {self.t1:g} s: {expected} is expected."

    def __str__(self) -> str:
        lines = [
            *(f"note        {message}" for message in self.messages),
            f"checked     {plural(self.members, 'member')}, {self.margin:.2g} times better than requested",
            f"predicted   {self.run_seconds:.2g} s on {self.threads} thread{'s' * (self.threads > 1)}, "
            f"{self.memory_bytes / 1e6:.2g} MB",
            f"reference   {self.reference}: they agree to {self.reference_error:.1e} {self.unit}",
        ]
        for rival, price, error in self.rivals:
            times = price / self.us_per_vehicle_second
            lines.append(f"  next best {rival.name}, {rival.dtype}, step {rival.h:.4g} s: {times:.2f} times the time, "
                         f"{self.of} to {error:.1e} {self.unit}")  # fmt: skip
        return "\n".join([*lines, self.answer])


@shows_progress
def suggest(
    fleet: Ensemble | Scene,
    error: float = 1e-3,
    of: Any = "position",
    t1: float | None = None,
    methods: Sequence[str] | None = None,
    members: int = 128,
    threads: int | None = None,
    seconds: float = 30.0,
    progress: Callable[[float], None] | bool | None = None,
) -> Suggestion:
    """Find the cheapest method, step and precision whose error stays below a given error in every member up to t1.

    The search runs a sample of members. Its best settings are then checked on up to 1024 members. A Pareto tail
    extrapolates these members' largest errors to the size of the fleet; if the result is too large, the step is
    shortened. If noise acts, all runs of the search share one noise path, drawn at the scene's noise_step or, without a
    noise_step, at a shorter interval than any step tried. A later run with the setting draws noise at its own steps.

    Args:
        fleet: the ensemble, or a Scene with one.
        error: largest allowed error over all members and times, in the unit of `of`; above 0. Default 1e-3.
        of: quantity whose error is limited: a name that statistics accept, such as "position" [m], "attitude" [rad],
            "depth" [m], "position[2]" [m], "speed" [m/s] or "energy" [J]; or a lw.statistics.Quantity. For a mean, such
            as "mean position[0]", the bias of the mean at t1 is limited, and reported with its interval as by
            `lw.estimate`. Default "position".
        t1: end time [s]. Default: run.duration of the scene.
        methods: names of the methods to try. Default: a few that suit the scene's terms; if these fail, all others.
        members: number of members in the sample that the search runs. Default 128.
        threads: number of threads of the predicted run. Default: all threads of this machine.
        seconds: approximate processor time of the search, without compiling [s]. Default 30.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the completed fraction, from 0 to 1.

    Returns:
        The cheapest setting, its expected error, its predicted time and memory, and the next best settings.

    Raises:
        SceneError: if arguments are faulty (one message lists all faults), if a source of noise is not a NoisyTerm, or
            if no reference is ten times more accurate than `error` up to t1; the message then suggests a shorter t1.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> suggestion = lw.suggest(fleet, error=1e-3, t1=2.0, methods=["rk4"], members=4, seconds=5.0)
        >>> suggestion.settings["method"], suggestion.expected < 1e-3
        ('rk4', True)
        >>> result = lw.solve(fleet, t1=2.0, **suggestion.settings)
    """
    compared = compared_in(of)
    faults = Faults()
    faults.positive("error", error, compared.unit)
    faults.positive("seconds", seconds)
    check_threads(faults, threads)
    faults.raise_if_any()
    names = chosen_methods(methods, CANDIDATES)
    report = callback(progress) or void
    sample = Sample(fleet, t1, members, TIMES)
    if compared.mean and compared.functional is not None and compared.functional.size == 1 and redrawn(sample.whole):
        return suggestion_of_mean(sample, compared, error, methods and names, seconds, report, threads)
    return suggestion_on(sample, compared, error, names, seconds, report, methods is not None, threads=threads)


def suggestion_on(
    sample: Sample, compared: Distance, error: float, names: Sequence[str], seconds: float,
    report: Callable[[float], None], named: bool, *, threads: int | None = None,
    make_reference: Callable[..., Reference] = make_reference,
) -> Suggestion:  # fmt: skip
    """Search a sample for the cheapest setting, as `suggest` says; named: True if the user named the methods."""
    taken, refused = sample.accepted(names)
    if not taken:
        raise SceneError([f"method {name}: {why}" for name, why in refused.items()])
    if sample.noise(taken[0]) == "free":
        problem = f"error = {error:g}: noise acts, whose path differs from step to step, so members have no error"
        raise SceneError([f"{problem}. Use lgvi-warp tradeoff, which compares statistics"])

    def reference_on(sample: Sample) -> Reference:
        return checked_reference(sample, compared, error, seconds, taken, make_reference=make_reference)

    reference = reference_on(sample)
    sample = reference.sample
    report(0.3)
    ladders = Ladders(sample, reference, compared, error / SAFETY, Budget((1.0 - SHARE) * seconds), named)
    candidates = searched(ladders, taken, compared, error, seconds, report)
    times = times_to_check(sample, candidates)
    if times > 1 or sample.whole.members > sample.members:
        reference = reference_on(sample.more(CHECKED, times))
    finalists = checked(candidates, reference, compared.name, error)
    prices = reference.sample.kernels.costs([trial.plan for trial, _ in finalists], ROUNDS)
    priced = list(zip(finalists, prices, strict=True))
    doubt = cost.disagreement([(trial.candidate.text, price.spread) for (trial, _), price in priced])
    priced.sort(key=lambda pair: pair[1].us_per_vehicle_second)
    (best, expected), price = priced[0]
    notes = [doubt] if doubt else []
    notes += [noise_text(reference.sample)] if reference.sample.draws else []
    notes += [f"{name} is left out: {why}" for name, why in refused.items() if named]
    if expected > error:
        notes.append(f"no step was found that keeps {error:g} {compared.unit}: {expected:.1e} is expected of the best")
    ensemble = sample.whole
    used = min(threads or machine.thread_count(), len(blocks(ensemble.members)))
    report(1.0)
    return Suggestion(
        settings=best.candidate.options(),
        setting=best.candidate,
        error=float(error),
        of=compared.name,
        unit=compared.unit,
        expected=expected,
        us_per_vehicle_second=price.us_per_vehicle_second,
        run_seconds=seconds_of(ensemble, best.candidate, sample.t1, kernels=sample.kernels) / used,
        threads=used,
        memory_bytes=memory_of(ensemble, best.candidate, sample.t1),
        members=reference.sample.members,
        t1=sample.t1,
        reference=reference.text,
        reference_error=reference.error(compared.name),
        rivals=tuple((rival.candidate, its.us_per_vehicle_second, apart) for (rival, apart), its in priced[1:]),
        worst=worst_of(best, reference, compared.name),
        asked=compared,
        messages=tuple(notes),
    )


def redrawn(fleet: Ensemble) -> bool:
    """True if other members can be drawn from the distributions of a fleet."""
    try:
        drawn(fleet)
    except SceneError:
        return False
    return True


def suggestion_of_mean(
    sample: Sample, compared: Distance, error: float, methods: Sequence[str] | None, seconds: float,
    report: Callable[[float], None], threads: int | None,
) -> Suggestion:  # fmt: skip
    """The cheapest setting whose mean has a bias below an error, by the ladders of `lw.estimate`."""

    def candidate(each: MeanSetting) -> Candidate:
        return Candidate(each.setting.method, each.setting.h, each.setting.dtype)

    def run_seconds(each: MeanSetting) -> float:
        return seconds_of(ensemble, candidate(each), sample.t1, kernels=sample.kernels)

    ensemble = sample.whole
    kept = mean_settings(ensemble, compared.name, error, sample.t1, methods, report, seconds, threads)[:FINALISTS]
    prices = {each.setting: run_seconds(each) for each in kept}
    best, *others = sorted(kept, key=lambda each: prices[each.setting])
    us = {setting: 1e6 * price / (sample.t1 * ensemble.members) for setting, price in prices.items()}
    setting = candidate(best)
    used = min(threads or machine.thread_count(), len(blocks(ensemble.members)))
    return Suggestion(
        settings=setting.options(),
        setting=setting,
        error=float(error),
        of=compared.name,
        unit=compared.unit,
        expected=best.largest,
        us_per_vehicle_second=us[best.setting],
        run_seconds=prices[best.setting] / used,
        threads=used,
        memory_bytes=memory_of(ensemble, setting, sample.t1),
        members=best.members,
        t1=sample.t1,
        reference=f"{best.reference} on {best.members} members drawn anew",
        reference_error=best.beyond,
        rivals=tuple((candidate(each), us[each.setting], each.largest) for each in others),
        asked=compared,
        messages=("for a mean, the bias at the end is reported with its 95 % interval, as by lw.estimate",),
    )


def searched(
    ladders: Ladders, taken: Sequence[str], compared: Distance, error: float, seconds: float,
    report: Callable[[float], None],
) -> list[Candidate]:  # fmt: skip
    """Cheapest settings that keep the target on a sample: from the short list or, if that fails, from all methods."""
    few = list(taken) if ladders.named else short_list(ladders.sample, taken)
    ladders.climb(few, lambda part: report(0.3 + 0.4 * part))
    if not ladders.named:
        stiff = [name for name in STIFFLY_DAMPED if name in taken and name not in few and ladders.limited_by_damping]
        ladders.climb(stiff)
        others = [name for name in taken if name not in (*few, *stiff)]
        ladders.climb(others, lambda part: report(0.7 + 0.1 * part), new_kernels=not ladders.priced)
    if ladders.priced:
        return [trial.candidate for trial in ladders.cheapest()[:FINALISTS]]
    problem = f"error = {error:g} {compared.unit} of {compared.name}: no step of {', '.join(taken)} kept it"
    if ladders.budget.over:
        cause = f"{seconds:g} s were over before a step was short enough. Try seconds={rounded_up(4.0 * seconds):g}"
        raise SceneError([f"{cause}. {problem}. Or ask for a larger error or a shorter t1"])
    raise SceneError([f"{problem}. Ask for a larger error or a shorter t1"])


def checked(candidates: Sequence[Candidate], reference: Reference, of: str, error: float) -> list[tuple[Trial, float]]:
    """Settings that keep the error on the reference's sample, with shortened steps if needed, and the errors expected.

    If no setting keeps it, the first setting is returned.
    """
    sample = reference.sample

    def shortened(candidate: Candidate) -> tuple[Trial, float]:
        return refined(sample, candidate, reference, of, error / SAFETY**0.5, sample.whole.members)

    trials = [shortened(candidate) for candidate in candidates]
    # Where the sample did not show what float32 rounds off, no shorter step mends it.
    missed = [candidate for candidate, (_, apart) in zip(candidates, trials, strict=True) if apart > error]
    trials += [shortened(replace(candidate, dtype="float64")) for candidate in missed if candidate.dtype == "float32"]
    return [(trial, apart) for trial, apart in trials if apart <= error] or trials[:1]


def errors_of(trial: Trial, reference: Reference, of: str) -> np.ndarray:
    """Largest error over the path of each member of a trial (n,) [its unit]."""
    apart = comparison.distances(trial.result, reference.result, reference.asked)[of]
    return np.asarray(np.max(np.where(np.isnan(apart), 0.0, apart), axis=0))


def worst_of(trial: Trial, reference: Reference, of: str, members: int = CONFIRMED // 2) -> tuple[int, ...]:
    """The members of a trial that have the largest errors."""
    return tuple(int(i) for i in np.argsort(-errors_of(trial, reference, of))[:members])


def largest_in_fleet(errors: np.ndarray, members: int) -> float:
    """Extrapolate the largest error of a sample of the fleet to the whole fleet.

    The largest errors fall as a power of their rank (Hill 1975). This gives the error that a fleet exceeds with
    probability CHANCE (Weissman 1978). A bounded tail falls faster: then the result is too large, never too small.
    """
    n = len(errors)
    falling = np.sort(errors)[::-1]
    k = max(FEWEST_IN_TAIL, n // TAIL)
    if n < FEWEST or falling[k] <= 0.0:
        return float(falling[0])
    exponent = float(np.mean(np.log(falling[:k] / falling[k])))
    return float(max(falling[0], falling[k] * (k * max(members, n) / (n * CHANCE)) ** exponent))


def checked_reference(
    sample: Sample, of: Distance, error: float, seconds: float, taken: Sequence[str], *,
    make_reference: Callable[..., Reference] = make_reference, grown: Callable[..., Growth] = growth_of,
) -> Reference:  # fmt: skip
    """Make a reference that is ten times more accurate than the error up to the end; SceneError if none is found."""
    reference = make_reference(sample, of, goal=error / 30.0, seconds=SHARE * seconds)
    apart = reference.error(of.name)
    if apart <= 0.1 * error:
        return reference
    problem = f"error = {error:g} {of.unit} of {of.name} up to {sample.t1:g} s cannot be checked"
    differ = f"{reference.text} differ by {apart:.1e} {of.unit}"
    if reference.more:
        cause, remedy = time_over(seconds, reference.more, SHARE)
        raise SceneError(
            [f"{cause}. {capital(remedy)}. {problem} yet: {differ}. Or ask for a larger error or a shorter t1"]
        )
    until = sample.times[reference.reaches(of.name, 0.1 * error)]
    remedy = f"ask for t1 (--duration) up to {until:g} s" if until > 0.0 else "ask for a shorter t1 (--duration)"
    grows = growth_text(grown(reference.sample, taken, reference))
    raise SceneError(
        [
            f"{problem}: {differ}, and agree no better with shorter steps; {grows}. {capital(remedy)}, or for a larger error"
        ]
    )


def short_list(sample: Sample, taken: Sequence[str]) -> list[str]:
    """The methods to try first, chosen by the terms of the scene."""
    if sample.noise(taken[0]) != "none":
        names = SHORT["noisy"]
    elif not is_damped(sample.ensemble):
        names = SHORT["conservative"]
    else:
        splits = [name for name in STIFFLY_DAMPED if name in taken and not Method(name).tableau]
        exact = any(sample.plan(sample.candidate(name, 1)).kernel_choice.drag for name in splits)
        names = (*SHORT["damped"], *(splits if exact else ()))
    return [name for name in names if name in taken] or list(taken)


def times_to_check(sample: Sample, candidates: Sequence[Candidate]) -> int:
    """Factor by which some settings allow more times of comparison; 1 if noise acts."""
    steps = [round(float(sample.spacing) / candidate.h) for candidate in candidates]
    grid = sample.draws or sample.fixed_draws
    allowed = [n for n in range(1, DENSER + 1) if not grid and all(n * -(-m // n) <= SHORTER * m for m in steps)]
    return max(allowed, default=1)


def refined(
    sample: Sample, candidate: Candidate, reference: Reference, of: str, target: float, members: int
) -> tuple[Trial, float]:
    """Run a setting on a sample; shorten its step up to six times, until the extrapolated error keeps the target.

    Returns: The last trial, and the expected largest error in the fleet.
    """
    m = sample.allowed(math.ceil(float(sample.spacing) / candidate.h * (1.0 - 1e-9)))
    order = 1 if sample.draws else Method(candidate.method).order
    for left in reversed(range(7)):
        trial = tried(sample, sample.candidate(candidate.method, m, candidate.dtype), reference)
        size = largest_in_fleet(errors_of(trial, reference, of), members) if trial.errors else math.inf
        if size <= target or m == sample.draws or not left:
            break
        factor = min((size / target) ** (1.0 / order) * 1.02, 2.0) if np.isfinite(size) else 1.5
        m = sample.allowed(max(m + 1, math.ceil(m * factor)))
    return trial, size


def seconds_of(
    fleet: Ensemble, candidate: Candidate, t1: float, *, kernels: Kernels = KERNELS,
    timed: Callable[..., np.ndarray] = cost.timed,
) -> float:  # fmt: skip
    """Predict the CPU time of a run of all members from a run of a few: samples included, compiling excluded [s]."""
    n = min(TIMED_MEMBERS, fleet.members)
    plan = make_plan(fleet.subset(range(n)), candidate.resolved(), candidate.h, t1, dtype=candidate.dtype)
    kernels.compile(plan)
    return float(timed([lambda: kernels.run(plan)], 2).min()) * fleet.members / n


def memory_of(fleet: Ensemble, candidate: Candidate, t1: float) -> int:
    """Predict the memory of a run of all members, including the scene's samples [bytes]."""
    grid = make_plan(fleet.subset([0]), candidate.resolved(), candidate.h, t1, dtype=candidate.dtype).grid
    a_sample = 18 * np.dtype(machine.DTYPES[candidate.dtype]).itemsize
    return fleet.members * (len(grid.times) * a_sample + BYTES_OF_A_MEMBER)


def verified(
    fleet: Ensemble, result: Result, suggestion: Suggestion, *, run: Callable[[Plan, int], Result] = run_plan
) -> tuple[float, int]:
    """Measure the error of a finished run by running some of its members again with half the step.

    The members with the largest errors in the search are run first, then the first members. At half the step the error
    of a method of order p is 2^p times smaller, so the difference is the error up to one part in 2^p. With noise both
    runs share one path, drawn at each shorter step. Errors then have order 1, and the changes by successive halvings
    are independent, so their squares add up.

    Returns: The largest error over these members and all samples, and how many members they are.
    """
    candidate = suggestion.setting
    chosen = list(dict.fromkeys((*suggestion.worst, *range(fleet.members))))[:CONFIRMED]
    checked_fleet = fleet.subset(chosen)
    plan = make_plan(checked_fleet, candidate.resolved(), candidate.h, float(result.time[-1]), dtype=candidate.dtype)
    h = result.provenance["step"]
    steps = np.rint(result.time / h).astype(np.int64)
    # In double precision, so that the error contains the run's round-off too.
    done, share = comparison.part(result, chosen), 1.0 - 2.0**-plan.method.order
    if any(isinstance(term, NoisyTerm) for term, _ in plan.kernel_choice.laws):
        checked_fleet, share = comparison.drawn_every(checked_fleet, h / 2.0, own_grid=False), math.sqrt(1.0 - 2.0**-2)
        grid_of_run = TimeGrid(h, steps, result.time)
        done = run(choose_plan(checked_fleet, plan.method, grid_of_run, plan.fields, candidate.dtype), 1)
    half = choose_plan(checked_fleet, plan.method, TimeGrid(h / 2.0, 2 * steps, result.time), plan.fields, "float64")
    with np.errstate(all="ignore"):
        apart = comparison.distances(done, run(half, 1), suggestion.asked)
        size = comparison.errors(apart, len(result.time) - 1)[suggestion.of]["path_max"]
    return size / share, len(chosen)
