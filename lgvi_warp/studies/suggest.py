"""The cheapest setting that keeps an error, found on a sample, checked on more members, and checked again after a run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.executors import check_threads
from lgvi_warp.engine.plan import Plan
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.runs.result import Result
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.studies import comparison, cost
from lgvi_warp.studies import tradeoff as tradeoffs
from lgvi_warp.studies.compared import Compared, compared_in
from lgvi_warp.studies.comparison import Reference, Sample, Setting
from lgvi_warp.studies.speed import void
from lgvi_warp.studies.tradeoff import PRECISIONS, Trial, chosen_methods, costs, growth_of, growth_text, tried

# A setting is taken where its error on the sample is below the asked one by this factor.
SAFETY = 1.15
# Times that errors are compared at, where the scene does not say: few, so that steps may be long.
TIMES = 5
# Tried first to last: whose lines are seldom the cheapest is left out.
CANDIDATES = tuple(name for name in tradeoffs.CANDIDATES if name not in ("phi", "psi", "psi_w"))
# Members that the choice is checked on.
CHECKED = 1024
# Members that a finished run is checked on.
CONFIRMED = 64
# Settings of the last comparison of costs, and readings of each cost.
FINALISTS = 4
ROUNDS = 7
# Bytes of a member besides its samples: state, parameters, status, and the arrays they are made from.
BYTES_OF_A_MEMBER = 2000


@dataclass(frozen=True)
class Suggestion:
    """The cheapest setting found for an error.

    settings: for lw.solve(fleet, **settings). error: asked, of: of what, expected: the largest over members and path on
    the members checked, all in `unit`; margin = error / expected. us_per_vehicle_second: cost on one core. run_seconds:
    predicted for all members on `threads` cores, without compiling; memory_bytes: predicted for the result and the run.
    members: of the sample that was checked; reference: what against, reference_error: how good that is.
    rivals: (setting, cost, error) of the next best. worst: members with the largest errors, for the check after the run;
    asked: what the error is of, for the same. messages: what the user should know.
    """

    settings: dict[str, Any]
    setting: Setting
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
    rivals: tuple[tuple[Setting, float, float], ...] = ()
    worst: tuple[int, ...] = ()
    asked: Compared | None = field(default=None, repr=False, compare=False)
    messages: tuple[str, ...] = ()

    @property
    def margin(self) -> float:
        """How many times better than asked."""
        return self.error / self.expected if self.expected > 0.0 else math.inf

    def __str__(self) -> str:
        s = self.setting
        lines = [
            *(f"note        {message}" for message in self.messages),
            f"chosen      {s.name}, {s.dtype}, step {s.h:.6g} s: {self.of} to {self.expected:.1e} {self.unit} up to "
            f"{self.t1:g} s, {self.margin:.2g} times better than asked ({self.members} members checked)",
            f"predicted   {self.run_seconds:.2g} s on {self.threads} thread{'s' * (self.threads > 1)}, "
            f"{self.memory_bytes / 1e6:.2g} MB",
            f"reference   {self.reference}: they agree to {self.reference_error:.1e} {self.unit}",
        ]
        for rival, price, error in self.rivals:
            times = price / self.us_per_vehicle_second
            lines.append(f"  next best {rival.name}, {rival.dtype}, step {rival.h:.4g} s: {times:.2f} times the time, "
                         f"{self.of} to {error:.1e} {self.unit}")  # fmt: skip
        return "\n".join(lines)


def suggest(
    fleet: Ensemble | Scene,
    error: float = 1e-3,
    of: Any = "position",
    t1: float | None = None,
    methods: Sequence[str] | None = None,
    members: int = 128,
    threads: int | None = None,
    seconds: float = 30.0,
    progress: Callable[[float], None] | None = None,
) -> Suggestion:
    """Find the cheapest method, step and precision whose error stays below `error` for every member and time up to t1.

    of: any quantity that statistics know, "position" [m], "attitude" [rad], "depth" [m], "position[2]", "speed" [m/s],
    "energy" [J] ..., or a lw.Quantity. t1: [s], by default
    run.duration of the scene. methods: names (default: all that the scene takes). members: of the sample that it searches
    on; what it finds is checked on up to 1024. threads: for the predicted time. seconds: about how long to search,
    compiling aside.

    Raises SceneError naming every fault; where noise acts; and where the reference cannot be known ten times better than
    the error, since errors grow too fast: it says up to which time they can.
    """
    asked = compared_in(of)
    faults = Faults()
    faults.positive("error", error, asked.unit)
    faults.positive("seconds", seconds)
    check_threads(faults, threads)
    faults.raise_if_any()
    names = chosen_methods(methods, CANDIDATES)
    report = progress or void
    sample = Sample(fleet, t1, members, TIMES)
    taken, refused = sample.accepted(names)
    if not taken:
        raise SceneError([f"method {name}: {why}" for name, why in refused.items()])
    if sample.noisy(taken[0]):
        what = f"error = {error:g}: noise acts, whose path differs from step to step, so members have no error"
        raise SceneError([f"{what}; use lgvi-warp tradeoff, which compares statistics"])
    reference = checked_reference(sample, asked, error, 0.4 * seconds, taken)
    report(0.3)
    found = search(
        sample,
        taken,
        reference,
        asked,
        error / SAFETY,
        time.perf_counter() + 0.6 * seconds,
        lambda x: report(0.3 + 0.5 * x),
    )
    if not found:
        what = f"error = {error:g} {asked.unit} of {asked.name}: no step of {', '.join(taken)} kept it"
        raise SceneError([f"{what}; ask for a larger error, a shorter t1, or give more seconds"])
    more = sample.more(CHECKED) if sample.whole.members > sample.members else sample
    if more is not sample:
        reference = checked_reference(more, asked, error, 0.4 * seconds, taken)
    final = [refined(more, one.setting, reference, asked.name, error / SAFETY**0.5) for one in found[:FINALISTS]]
    final = [one for one in final if one.error(asked.name) <= error] or final[:1]
    readings = cost.costs([one.plan for one in final], rounds=ROUNDS)
    prices = [one.us_per_vehicle_second for one in readings]
    text = cost.disagreement(
        [(f"{one.setting.name} {one.setting.dtype}", price) for one, price in zip(final, readings, strict=True)]
    )
    order = sorted(range(len(final)), key=prices.__getitem__)
    best, price = final[order[0]], prices[order[0]]
    whole = sample.whole
    used = min(threads or machine.thread_count(), len(blocks(whole.members)))
    report(1.0)
    return Suggestion(
        settings=best.setting.options(),
        setting=best.setting,
        error=float(error),
        of=asked.name,
        unit=asked.unit,
        expected=best.error(asked.name),
        us_per_vehicle_second=price,
        run_seconds=seconds_of(whole, best.setting, sample.t1) / used,
        threads=used,
        memory_bytes=memory_of(whole, best.setting, sample.t1),
        members=more.members,
        t1=sample.t1,
        reference=reference.text,
        reference_error=reference.error(asked.name),
        rivals=tuple((final[i].setting, prices[i], final[i].error(asked.name)) for i in order[1:]),
        worst=worst_of(best, reference, asked.name),
        asked=asked,
        messages=(text,) if text else (),
    )


def worst_of(one: Trial, reference: Reference, of: str, members: int = CONFIRMED // 2) -> tuple[int, ...]:
    """The members with the largest errors, the largest first."""
    apart = comparison.distances(one.result, reference.result, reference.asked)[of]
    largest = np.max(np.where(np.isnan(apart), 0.0, apart), axis=0)
    return tuple(int(i) for i in np.argsort(-largest)[:members])


def checked_reference(sample: Sample, of: Compared, error: float, seconds: float, taken: Sequence[str]) -> Reference:
    """A reference ten times better than the error up to t1. Raises SceneError."""
    reference = comparison.make_reference(sample, of, goal=error / 30.0, seconds=seconds)
    if reference.error(of.name) > 0.1 * error:
        until = sample.times[reference.reaches(of.name, 0.1 * error)]
        unit = of.unit
        what = f"error = {error:g} {unit} of {of.name} up to {sample.t1:g} s cannot be checked: {reference.text} differ by "
        what += f"{reference.error(of.name):.1e} {unit}; {growth_text(growth_of(sample, taken, reference))}"
        remedy = (
            f"ask for t1 (--duration) up to {until:g} s, " if until > 0.0 else "ask for a shorter t1 (--duration), "
        )
        raise SceneError([f"{what}; {remedy}for a larger error, or give more seconds"])
    return reference


def search(
    sample: Sample,
    methods: Sequence[str],
    reference: Reference,
    asked: Compared,
    target: float,
    deadline: float,
    report: Callable[[float], None],
) -> list[Trial]:
    """For each method and precision the longest step that keeps the target, the cheapest first.

    A step is halved until it does, and then lengthened by the slope of the errors; a method ends where it costs 1.5 times
    what another does.
    """
    of, size_of = asked.name, asked.largest(reference.result)
    # What float32 cannot hold is not asked of it.
    dtypes = [name for name in PRECISIONS if target > 4.0 * comparison.ROUND_OFF[name] * size_of]
    ladders = [(name, dtype) for name in methods for dtype in dtypes or ["float64"]]
    found: list[tuple[float, Trial]] = []
    for i, (method, dtype) in enumerate(ladders):
        report(i / len(ladders))
        if time.perf_counter() > deadline and found:
            break
        m, before, worse = sample.coarsest(2.0), math.inf, 0
        plan = sample.plan(sample.setting(method, m, dtype))
        deadline += plan.compile()
        per_step = step_cost(plan)
        cheapest = min((price for price, _ in found), default=math.inf)
        while per_step / sample.h(m) < 2.0 * cheapest:
            one = tried(sample, sample.setting(method, m, dtype), reference)
            deadline += one.result.compile_seconds
            size = one.error(of)
            if size <= target:
                best = lengthened(sample, one, m, before, reference, of, target)
                # Of a step that iterates, a shorter one is less work; one that fails is other work.
                found.append((step_cost(best.plan) / best.setting.h, best))
                break
            worse = worse + 1 if size > 0.8 * before and before < 0.1 else 0
            if worse >= 2 or m > 10**7 or time.perf_counter() > deadline:
                break
            before = size
            m *= 2
    cheapest = min((price for price, _ in found), default=math.inf)
    return [one for price, one in sorted(found, key=lambda pair: pair[0]) if price < 1.5 * cheapest]


def step_cost(plan: Plan) -> float:
    """Microseconds of one core for one step of one vehicle."""
    return costs([plan], ROUNDS)[0] * plan.grid.h


def lengthened(
    sample: Sample, good: Trial, m: int, before: float, reference: Reference, of: str, target: float
) -> Trial:
    """Between the step that keeps the target and twice it, the longest that does; `before` is the error of the latter."""
    low, high, size = m // 2, m, good.error(of)
    if not math.isfinite(before) or before <= target or low < 1:
        return good
    for _ in range(3):
        slope = math.log(before / max(size, 1e-300)) / math.log(high / low)
        guess = round(low * (before / target) ** (1.0 / max(slope, 0.5)) + 0.5)
        guess = min(max(guess, low + 1), high - 1)
        if guess <= low or guess >= high or high - low < 0.04 * high:
            break
        one = tried(sample, sample.setting(good.setting.method, guess, good.setting.dtype), reference)
        if one.error(of) <= target:
            good, high, size = one, guess, one.error(of)
        elif math.isfinite(one.error(of)):
            low, before = guess, one.error(of)
        else:
            break
    return good


def refined(sample: Sample, setting: Setting, reference: Reference, of: str, target: float) -> Trial:
    """The setting on these members, its step shortened until it keeps the target."""
    one = tried(sample, setting, reference)
    for _ in range(6):
        size = one.error(of)
        if size <= target:
            break
        factor = min((size / target) ** (1.0 / Method(setting.method).order) * 1.02, 2.0) if np.isfinite(size) else 1.5
        m = round(float(sample.spacing) / one.setting.h)
        longer = sample.setting(setting.method, max(m + 1, math.ceil(m * factor)), setting.dtype)
        one = tried(sample, longer, reference)
    return one


def seconds_of(fleet: Ensemble, setting: Setting, t1: float, members: int = 256) -> float:
    """What all members take on one core, the scene's samples included, from the CPU time of a few of them [s]."""
    n = min(members, fleet.members)
    plan = make_plan(fleet.subset(range(n)), setting.resolved(), setting.h, t1, dtype=setting.dtype)
    plan.compile()
    return float(cost.timed([lambda: run_plan(plan, 1)], 2).min()) * fleet.members / n


def memory_of(fleet: Ensemble, setting: Setting, t1: float) -> int:
    """Bytes that a run of all members takes, with the scene's samples."""
    grid = make_plan(fleet.subset([0]), setting.resolved(), setting.h, t1, dtype=setting.dtype).grid
    a_sample = 18 * np.dtype(machine.DTYPES[setting.dtype]).itemsize
    return fleet.members * (len(grid.times) * a_sample + BYTES_OF_A_MEMBER)


def verified(fleet: Ensemble, result: Result, found: Suggestion) -> tuple[float, int]:
    """The error of a finished run, largest over some members and all samples, from half its step; and how many members.

    They are those that had the largest errors in the search, and the first ones. A method of order p at half the step is
    2^p times better, so the difference is the error but for one part in 2^p.
    """
    setting = found.setting
    chosen = list(dict.fromkeys((*found.worst, *range(fleet.members))))[:CONFIRMED]
    part = fleet.subset(chosen)
    plan = make_plan(part, setting.resolved(), setting.h, float(result.time[-1]), dtype=setting.dtype)
    h = result.provenance["step"]
    steps = np.rint(result.time / h).astype(np.int64)
    # In double precision, so that round-off of the run's own is seen as well.
    half = Plan(part, plan.method, TimeGrid(h / 2.0, 2 * steps, result.time), plan.fields, "float64")
    with np.errstate(all="ignore"):
        apart = comparison.distances(comparison.part(result, chosen), run_plan(half, 1), found.asked)
        size = comparison.errors(apart, len(result.time) - 1)[found.of]["path_max"]
    return size / (1.0 - 2.0**-plan.method.order), len(chosen)
