"""Speed against accuracy of every method, step, precision and solver, on a sample of an ensemble."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.tables import write_csv
from lgvi_warp.engine.plan import DTYPES, Plan
from lgvi_warp.methods.method import COMPOSITIONS, PROGRAMS, Method
from lgvi_warp.physics import energy as invariants
from lgvi_warp.runs.result import Result
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.studies import comparison, cost
from lgvi_warp.studies.compared import QUANTITIES, Compared, compared_in
from lgvi_warp.studies.comparison import Growth, Reference, Sample, Setting
from lgvi_warp.studies.speed import void

# Tried in this order; a name that this version does not know, or that a scene refuses, is left out.
CANDIDATES = ("kl8(psi_x)", "psi_x", "psi_s", "su4(psi_x)", "kl6(psi_x)", "rk8", "su8_15(psi_x)", "ss6_13(psi_x)",
              "rkn6_11", "rkn6_14", "bm6(psi_x)", "bm4(psi_x)", "rk5", "rk4", "psi_1", "psi", "psi_w", "kl8(psi_s)",
              "kl6(psi_s)", "su4(psi_s)", "phi")  # fmt: skip
# Solvers of equation (24) besides the default, tried for one method that solves it.
SOLVERS: tuple[tuple[str, int | None], ...] = (("quartic", 1), ("cayley", None), ("newton", None))
SOLVED_BY = "psi_s"
PRECISIONS = tuple(name for name in DTYPES if name in ("float64", "float32"))
# Tried last, in sums of two float32.
COMPENSATED = ("psi_x", "psi_s", "su4(psi_x)", "kl6(psi_x)")
# What a ladder of steps goes on for, until it is round-off's.
DECIDING = ("position", "attitude")
# Errors shown are at least so many times the reference's own.
TRUST = 10.0
# A ladder of steps ends where another setting is as good in so many times less time.
HOPELESS = 10.0


@dataclass(frozen=True)
class Measurement:
    """One setting: cost and errors.

    us_per_vehicle_second: microseconds of one core per vehicle and simulated second, without compiling (see cost.py);
    cost_spread: the median of the readings over the least, which it is. compile_seconds:
    to load its kernel, once a process. errors: quantity -> end_max, end_rms, path_max, path_rms, over the members, in
    comparison.QUANTITIES' units; empty where a member failed or noise acts. energy_drift: largest |E(t) - E(0)| [J], NaN
    where a force of the scene takes or gives energy. biases: see comparison.biases. trusted: whether the reference is ten
    times better.
    """

    setting: Setting
    us_per_vehicle_second: float
    compile_seconds: float
    errors: dict[str, dict[str, float]]
    energy_drift: float
    biases: dict[str, float]
    order: int
    trusted: dict[str, bool]
    cost_spread: float = 1.0

    def error(self, of: str = "position", kind: str = "path_max") -> float:
        """One error; infinite where there is none."""
        return self.errors.get(of, {}).get(kind, math.inf)


@dataclass(frozen=True, eq=False)
class Tradeoff:
    """Measurements of settings on a sample of an ensemble, from 0 to t1 [s].

    until: the errors of members are up to this time [s], as far as the reference is good; biases are up to t1.
    reference: what it is, in words; reference_error: quantity -> its own largest error up to `until`. units: of errors.
    growth: how far single trajectories can be predicted. refused: method -> why the scene does not take it.
    messages: what the user should know.
    """

    measurements: tuple[Measurement, ...]
    of: str
    members: int
    t1: float
    until: float
    reference: str
    reference_error: dict[str, float]
    growth: Growth | None
    refused: dict[str, str] = field(default_factory=dict)
    messages: tuple[str, ...] = ()
    seconds: float = 0.0
    units: dict[str, str] = field(default_factory=lambda: dict(QUANTITIES))

    def shown(self, of: str | None = None, kind: str = "path_max") -> list[Measurement]:
        """Measurements with an error of the quantity that the reference is good for, the cheapest first."""
        of = of or self.of
        good = [one for one in self.measurements if np.isfinite(one.error(of, kind)) and one.trusted.get(of)]
        return sorted(good, key=lambda one: one.us_per_vehicle_second)

    def front(self, of: str | None = None, kind: str = "path_max") -> list[Measurement]:
        """The Pareto front: dearer is better. kind: "end_max", "end_rms", "path_max" or "path_rms"."""
        front: list[Measurement] = []
        for one in self.shown(of, kind):
            if not front or one.error(of or self.of, kind) < front[-1].error(of or self.of, kind):
                front.append(one)
        return front

    def to_dict(self) -> dict[str, Any]:
        """Everything, as JSON holds it."""
        content = asdict(replace(self, growth=None))
        if self.growth is not None:
            content["growth"] = {key: value.tolist() if isinstance(value, np.ndarray) else value
                                 for key, value in vars(self.growth).items()}  # fmt: skip
        content["front"] = [asdict(one.setting) for one in self.front()]
        return _finite(content)

    def to_json(self) -> str:
        """Everything as a JSON text; what is not finite is null."""
        return json.dumps(self.to_dict(), indent=1, allow_nan=False)

    def rows(self) -> list[dict[str, Any]]:
        """A flat record for each measurement."""
        on_front = {one.setting for one in self.front()}
        rows = []
        for one in self.measurements:
            row: dict[str, Any] = asdict(one.setting) | {"order": one.order, "front": one.setting in on_front}
            row |= {"us_per_vehicle_second": one.us_per_vehicle_second, "cost_spread": one.cost_spread}
            row |= {"compile_seconds": one.compile_seconds}
            for of in self.units:
                row |= {f"{of}_{kind}": one.error(of, kind) for kind in KINDS}
                row[f"{of}_trusted"] = one.trusted.get(of, False)
            row["energy_drift"] = one.energy_drift
            rows.append(row | {f"bias_{name}": value for name, value in one.biases.items()})
        return rows

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the rows to a CSV file. Returns its path."""
        return write_csv(self.rows(), path)

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write tradeoff.json and tradeoff.csv into a folder. Returns their paths."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        (target / "tradeoff.json").write_text(self.to_json())
        return [target / "tradeoff.json", self.to_csv(target / "tradeoff.csv")]


KINDS = ("end_max", "end_rms", "path_max", "path_rms")


def _finite(value: Any) -> Any:
    """With None for what is not finite."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


@dataclass(eq=False)
class Trial:
    """A setting that was run: its plan, its errors, and the CPU time of the run [s], without compiling."""

    setting: Setting
    plan: Plan
    result: Result
    errors: dict[str, dict[str, float]]
    cpu_seconds: float

    def error(self, of: str) -> float:
        """Largest over members and path; infinite where a member failed."""
        return self.errors[of]["path_max"] if self.errors else math.inf


def tried(sample: Sample, setting: Setting, reference: Reference | None, until: int = -1) -> Trial:
    """Run a setting and compare it. Raises SceneError where the scene refuses it."""
    plan = sample.plan(setting)
    compile_seconds = plan.compile()
    with np.errstate(all="ignore"):
        begun = cost.thread_seconds()
        result = replace(comparison.run_plan(plan, 1), compile_seconds=compile_seconds)
        cpu_seconds = cost.thread_seconds() - begun
        found: dict[str, dict[str, float]] = {}
        if reference is not None and not comparison.failed(result):
            until = until % len(sample.times)
            found = comparison.errors(comparison.distances(result, reference.result, reference.asked), until)
            if not all(np.isfinite(one["path_max"]) for one in found.values()):
                found = {}
    return Trial(setting, plan, result, found, cpu_seconds)


def costs(plans: Sequence[Plan], rounds: int = 5) -> list[float]:
    """Microseconds of one core per vehicle and simulated second of each plan (see cost.py)."""
    return [one.us_per_vehicle_second for one in cost.costs(plans, rounds)]


def known(name: str) -> bool:
    """Whether there is such a method."""
    try:
        Method(name)
    except SceneError:
        return False
    return True


def chosen_methods(methods: Sequence[str] | None, default: Sequence[str] = CANDIDATES) -> tuple[str, ...]:
    """The methods to try. Raises SceneError for a name that is not known."""
    if methods is None:
        return tuple(name for name in default if known(name))
    faults = Faults()
    for name in methods:
        if not known(name):
            some = ", ".join((*PROGRAMS, *(f"{one}(psi_s)" for one in COMPOSITIONS)))
            faults.add("methods", name, "is not known", f"known: {some}")
    if not methods:
        faults.add("methods", methods, "is empty", "name one method or more, or leave it out")
    faults.raise_if_any()
    return tuple(methods)


def tradeoff(
    fleet: Ensemble | Scene,
    t1: float | None = None,
    of: Any = "position",
    methods: Sequence[str] | None = None,
    members: int = 128,
    seconds: float = 45.0,
    progress: Callable[[float], None] | None = None,
) -> Tradeoff:
    """Measure cost and error of methods, steps, precisions and solvers on the first members of a fleet.

    t1: end [s], by default run.duration of the scene. of: the quantity that decides how far the reference is good enough:
    any that statistics know ("position", "attitude", "depth", "position[2]", "speed", "euler", ...), or a lw.Quantity; errors
    of position, attitude, velocity, angular_velocity and energy are measured as well. methods: names (default: all that the
    scene takes). members: of the sample. seconds: about how long to go on; what is left out then is said in the messages.
    progress: called with the fraction of the work done.

    The cost of a step is CPU time of the thread that runs it, the least of several readings, and one number for all steps of
    a method; readings that disagree are told in the messages.
    Errors are against a reference that two independent runs agree on to a tenth of the smallest error shown. Where noise
    acts there are no errors of members, and statistics are compared with those of the finest run.
    Raises SceneError naming every fault, and where no reference can be found.
    """
    asked = compared_in(of)
    faults = Faults()
    faults.positive("seconds", seconds)
    faults.raise_if_any()
    names = chosen_methods(methods)
    begun = time.perf_counter()
    report = progress or void
    sample = Sample(fleet, t1, members)
    taken, refused = sample.accepted(names)
    if not taken:
        raise SceneError([f"method {name}: {why}" for name, why in refused.items()])
    messages: list[str] = []
    reference, finest, until, lost = None, None, len(sample.times) - 1, None
    if sample.noisy(taken[0]):
        messages.append("noise acts, whose path differs from step to step: only statistics are compared")
        finest = tried(sample, sample.setting(taken[0], 32 * sample.coarsest(0.5)), None).result
    else:
        reference = comparison.make_reference(
            sample, asked, seconds=0.3 * seconds, report=lambda part: report(0.2 * part)
        )
        finest = reference.result
        until = trusted_until(reference, asked)
        lost = growth_of(sample, taken, reference)
        if until < len(sample.times) - 1:
            text = (
                f"errors of single members are up to {sample.times[until]:g} s, where the reference still agrees with"
            )
            messages.append(f"{text} itself; beyond, statistics alone mean something")
    deadline = time.perf_counter() + 0.6 * seconds
    trials, left = sweep(
        sample, taken, reference, until, deadline, begun + seconds, lambda part: report(0.2 + 0.6 * part)
    )
    if left:
        messages.append(f"no time for {', '.join(left)}: run again, the kernels are compiled now, or give more seconds")
    measured = measurements(sample, trials, reference, finest, until, asked)
    prices = [
        (f"{one.setting.name} {one.setting.dtype}", cost.Cost(one.us_per_vehicle_second, one.cost_spread))
        for one in measured
    ]
    doubt = cost.disagreement(prices)
    messages += [doubt] if doubt else []
    report(1.0)
    return Tradeoff(
        measurements=tuple(measured),
        of=asked.name,
        members=sample.members,
        t1=sample.t1,
        until=float(sample.times[until]),
        reference=reference.text if reference else "the finest run's statistics, since noise acts",
        reference_error={name: reference.error(name, until) for name in reference.own} if reference else {},
        growth=lost,
        refused=refused,
        messages=tuple(messages),
        seconds=time.perf_counter() - begun,
        units=QUANTITIES | {asked.name: asked.unit},
    )


def growth_of(sample: Sample, taken: Sequence[str], reference: Reference) -> Growth:
    """Growth of errors, by the method of highest order at about the reference's step."""
    method = max(taken, key=lambda name: Method(name).order)
    often = Sample(sample.whole, sample.t1, sample.members)
    m = max(1, round(float(often.spacing) / reference.result.provenance["step"]))
    return comparison.growth(often, often.setting(method, m))


def trusted_until(reference: Reference, of: Compared) -> int:
    """The last sample at which errors below 1e-2 can be measured. Raises SceneError where there is none."""
    until = reference.reaches(of.name, comparison.LOST / (TRUST * TRUST))
    if until < 1:
        apart = reference.own[of.name][1]
        end = reference.result.time[1]
        what = f"no reference: {reference.text} differ by {apart:.2g} {of.unit} after {end:g} s"
        raise SceneError([f"{what}; give a shorter t1 (--duration), or more seconds"])
    return until


def sweep(
    sample: Sample,
    methods: Sequence[str],
    reference: Reference | None,
    until: int,
    deadline: float,
    latest: float,
    report: Callable[[float], None],
) -> tuple[list[Trial], list[str]]:
    """Steps of every method, each half the one before, until its error is round-off's. Returns what was left out too.

    deadline: for running; latest: for beginning with one more method, compiling included.
    """
    plain: tuple[str, int | None] = ("quartic", None)
    ladders = [(name, dtype, plain) for name in methods for dtype in PRECISIONS]
    ladders += [(SOLVED_BY, "float64", one) for one in SOLVERS if SOLVED_BY in methods]
    summed, _ = sample.accepted([name for name in COMPENSATED if name in methods], "float32_compensated")
    ladders += [(name, "float32_compensated", plain) for name in summed]
    trials: list[Trial] = []
    left: list[str] = []
    longest = (deadline - time.perf_counter()) / 40.0
    for i, (method, dtype, solver) in enumerate(ladders):
        report(i / len(ladders))
        if time.perf_counter() > latest:
            left.append(f"{sample.setting(method, 1, dtype, solver).name} {dtype}")
            continue
        m, best, worse = sample.coarsest(1.0), math.inf, 0
        for k in range(20 if reference else 5):
            if time.perf_counter() > deadline:
                name = sample.setting(method, m, dtype, solver).name
                left.append(f"{name} {dtype}" + (" at fine steps" if k else ""))
                break
            one = tried(sample, sample.setting(method, m, dtype, solver), reference, until)
            trials.append(one)
            deadline += one.result.compile_seconds
            m *= 2
            if reference is None:
                continue
            error = max(one.error(of) for of in DECIDING)
            worse = worse + 1 if error > 0.8 * best and best < 0.1 else 0
            best = min(best, error)
            noise = TRUST * max(reference.error(of, until) for of in DECIDING)
            if worse >= 2 or error < noise or one.cpu_seconds > longest or hopeless(one, trials):
                break
    if reference is not None:
        between(sample, trials, reference, until, deadline)
    return trials, left


def hopeless(one: Trial, trials: Sequence[Trial]) -> bool:
    """Whether another setting was better in much less time."""
    error = max(one.error(of) for of in DECIDING)
    rivals = (two for two in trials if HOPELESS * two.cpu_seconds < one.cpu_seconds)
    return math.isfinite(error) and any(max(two.error(of) for of in DECIDING) < error for two in rivals)


def between(sample: Sample, trials: list[Trial], reference: Reference, until: int, deadline: float) -> None:
    """Near the front, add the steps between those tried."""
    found = sorted((one.cpu_seconds, one.error(DECIDING[0]), i) for i, one in enumerate(trials))
    best, near = math.inf, list[Trial]()
    for _, error, i in found:
        if error < best:
            best = error
            near.append(trials[i])
    tried_already = {one.setting for one in trials}
    for one in near:
        m = round(float(sample.spacing) / one.setting.h)
        for step in {round(m / math.sqrt(2.0)), round(m * math.sqrt(2.0))} - {0}:
            setting = replace(one.setting, h=sample.h(step))
            if setting not in tried_already and time.perf_counter() < deadline:
                tried_already.add(setting)
                trials.append(tried(sample, setting, reference, until))


def measurements(
    sample: Sample,
    trials: Sequence[Trial],
    reference: Reference | None,
    finest: Result,
    until: int,
    asked: Compared | None = None,
) -> list[Measurement]:
    """Time the trials and gather what they showed; settings that failed are left out."""
    good = [one for one in trials if not comparison.failed(one.result) and (one.errors or reference is None)]
    compiled: dict[tuple[str, str], float] = {}
    for one in trials:
        key = one.setting.name, one.setting.dtype
        compiled[key] = max(compiled.get(key, 0.0), one.result.compile_seconds)
    found = []
    for one, price in zip(good, cost.costs([trial.plan for trial in good]), strict=True):
        limits = {of: reference.error(of, until) for of in one.errors} if reference else {}
        with np.errstate(all="ignore"):
            biases = comparison.biases(one.result, finest, asked)
            kept = "energy" in invariants.conserved(one.result)
            drift = invariants.drift(one.result)["energy"] if kept else math.nan
        found.append(
            Measurement(
                setting=one.setting,
                us_per_vehicle_second=price.us_per_vehicle_second,
                cost_spread=price.spread,
                compile_seconds=compiled[one.setting.name, one.setting.dtype],
                errors=one.errors,
                energy_drift=drift,
                biases=biases,
                order=one.plan.method.order,
                trusted={of: one.errors[of]["path_max"] >= TRUST * limit for of, limit in limits.items()},
            )
        )
    return found


def report_text(found: Tradeoff) -> str:
    """The trade-off in lines for people."""
    unit = found.units[found.of]
    lines = [f"note        {message}" for message in found.messages]
    lines.append(f"sample      {found.members} members, 0 to {found.t1:g} s, {len(found.measurements)} settings in "
                 f"{found.seconds:.0f} s")  # fmt: skip
    if found.reference_error:
        own = found.reference_error[found.of]
        lines.append(f"reference   {found.reference}: they agree to {own:.1e} {unit} up to {found.until:g} s")
    if found.growth:
        lines.append(f"predictable {growth_text(found.growth)}")
    if found.refused:
        lines.append(f"refused     {', '.join(found.refused)} (why: tradeoff.json)")
    if found.measurements:
        lines.append(f"costs       {cost.agreement_text([one.cost_spread for one in found.measurements])}")
    front = found.front()
    kept = any(np.isfinite(one.energy_drift) for one in front)
    if front:
        header = ("us/vehicle/s", "method", "precision", "step [s]", f"{found.of} [{unit}]", "rms")
        heads = "{:>12}  {:<18}{:<20}{:>10}{:>15}{:>10}".format(*header)
        lines += ["", f"Cheapest settings for each error ({found.of}, largest over members and path):",
                  heads + ("{:>18}".format("energy drift [J]") if kept else "")]  # fmt: skip
    for one in front:
        s = one.setting
        lines.append(f"{one.us_per_vehicle_second:>12.3g}  {s.name:<18}{s.dtype:<20}{s.h:>10.4g}"
                     f"{one.error(found.of):>15.1e}{one.error(found.of, 'path_rms'):>10.1e}"
                     + (f"{one.energy_drift:>18.1e}" if kept else ""))  # fmt: skip
    return "\n".join([*lines, *bias_lines(found)])


def growth_text(found: Growth) -> str:
    """How errors grow, in words."""
    if not np.isfinite(found.rate):
        return "unknown: a difference of 1e-8 rad is lost at once"
    if found.power is not None:
        return (f"errors grow like time to the power {found.power:.1f}, {found.factor:.2g} times in this run: single "
                "trajectories mean something throughout")  # fmt: skip
    until = ", ".join(f"{dtype} to about {t:.3g} s" for dtype, t in found.predictable.items())
    return (f"errors double every {found.doubling:.3g} s (rate {found.rate:.2g} /s, {found.factor:.2g} times in this run). "
            f"One round-off reaches {comparison.LOST:g}: {until}; beyond, compare statistics only")  # fmt: skip


def bias_lines(found: Tradeoff) -> list[str]:
    """Biases of the statistics against the step, of the first method of order 2 in float64 (or of any)."""
    double = [one for one in found.measurements if one.biases and one.setting.dtype == "float64" and one.setting.plain]
    if not double:
        return []
    name = min(double, key=lambda one: abs(one.order - 2)).setting.name
    chosen = sorted((one for one in double if one.setting.name == name), key=lambda one: -one.setting.h)
    columns = [
        "position_mean",
        "position_std",
        "attitude_mean",
        "velocity_mean",
        "energy_mean",
        "angular_momentum_mean",
    ]
    heads = ["position mean", "position std", "attitude mean", "velocity mean", "energy mean", "ang.mom. mean"]
    if found.of not in QUANTITIES and any(f"{found.of}_mean" in one.biases for one in chosen):
        columns, heads = [f"{found.of}_mean", *columns], [f"{found.of} mean", *heads]
    title = f"Bias of statistics up to {found.t1:g} s by {name}, in standard errors of {found.members} members"
    lines = ["", f"{title} (1.4: chance):", "{:>12}".format("step [s]") + "".join(f"{head:>15}" for head in heads)]
    for one in chosen:
        cells = (f"{one.biases[key]:>15.1e}" if key in one.biases else f"{'-':>15}" for key in columns)
        lines.append(f"{one.setting.h:>12.4g}" + "".join(cells))
    return lines
