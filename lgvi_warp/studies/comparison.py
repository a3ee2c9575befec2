"""Runs of a sample of an ensemble by different settings, and how far apart they are: members, statistics, growth."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.status import failed as failed_members
from lgvi_warp.common.status import stop_time
from lgvi_warp.engine.plan import Plan
from lgvi_warp.methods import saveat
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import FIELDS, TimeGrid
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics import notation
from lgvi_warp.runs.result import Result
from lgvi_warp.runs.run import run_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.studies.compared import QUANTITIES, Compared, compared_in

# An error at which a trajectory says nothing any more [m or rad].
LOST = 1e-2
ROUND_OFF = {"float64": 2.0**-53, "float32": 2.0**-24}
# Samples that runs are compared at.
SAMPLES = 20
# For the reference, the best first; the first two that a scene takes share as little as can be.
PRECISE = ("kl8(psi_x)", "rk8", "kl8(psi_s)", "kl6(psi_x)", "kl6(psi_s)", "rk5", "su4(psi_x)", "su4(psi_s)", "rk4", "psi_x",
           "psi_s", "psi_w", "psi_1", "psi")  # fmt: skip


@dataclass(frozen=True)
class Setting:
    """How to solve: method by name, step h [s], dtype, solver of equation (24), its Newton steps (None: to tolerance)."""

    method: str
    h: float
    dtype: str = "float64"
    solver: str = "quartic"
    iterations: int | None = None

    @property
    def plain(self) -> bool:
        """Whether the solver is the default one."""
        return (self.solver, self.iterations) == ("quartic", None)

    @property
    def name(self) -> str:
        """Method and solver, without step and dtype."""
        if self.plain:
            return self.method
        return f"{self.method} {self.solver}" + ("" if self.iterations is None else f" {self.iterations}")

    def options(self) -> dict[str, Any]:
        """For lw.solve(fleet, **options)."""
        method: Any = self.method if self.plain else self.resolved()
        return {"method": method, "h": self.h, "dtype": self.dtype}

    def resolved(self) -> Method:
        """The Method. Raises SceneError."""
        return Method(self.method, self.solver, self.iterations)


class Sample:
    """The first members of an ensemble from 0 to t1 [s], at times that runs of every step have in common.

    Steps are spacing / m for whole m: spacing is run.save_every of the scene, where it divides t1, or t1 / samples.
    Raises SceneError without a duration.
    """

    def __init__(self, fleet: Ensemble | Scene, t1: float | None = None, members: int = 128, samples: int = SAMPLES):
        whole = fleet if isinstance(fleet, Ensemble) else Ensemble.from_scene(fleet)
        settings = whole.scene.run
        t1 = settings.duration if t1 is None else t1
        faults = Faults()
        if t1 is None:
            faults.add("t1", t1, "is missing", "give the end in seconds: t1=150.0 or [run] duration")
        else:
            faults.positive("t1", t1)
        faults.raise_if_any()
        assert t1 is not None
        self.whole, self.t1, self.samples = whole, float(t1), samples
        self.ensemble = whole if whole.members <= members else whole.subset(range(members))
        self.members = self.ensemble.members
        end = saveat._exact(self.t1)
        every = settings.save_every
        divides = every is not None and every <= self.t1 and (end / saveat._exact(every)).denominator == 1
        self.spacing = saveat._exact(every) if divides and every is not None else end / samples
        count = int(end / self.spacing)
        self.index = np.unique(np.linspace(0, count, min(count, samples) + 1).round().astype(np.int64))
        self.times = np.array([float(int(i) * self.spacing) for i in self.index])
        start = self.ensemble.select(0, self.members)
        self.rate = float(max(np.nanmax(np.linalg.norm(start.angular_velocity, axis=1)), 2.0 * math.pi / self.t1))

    def more(self, members: int) -> Sample:
        """The same with more members."""
        return Sample(self.whole, self.t1, members, self.samples)

    def coarsest(self, angle: float) -> int:
        """m of the largest step that turns by at most this angle [rad]."""
        return max(1, math.ceil(float(self.spacing) * self.rate / angle))

    def h(self, m: int) -> float:
        """The step [s]."""
        return float(self.spacing / m)

    def setting(self, method: str, m: int, dtype: str = "float64", solver: Any = ("quartic", None)) -> Setting:
        """A setting with the step spacing / m."""
        return Setting(method, self.h(m), dtype, *solver)

    def plan(self, setting: Setting, ensemble: Ensemble | None = None) -> Plan:
        """Its plan. Raises SceneError where the scene refuses the method."""
        m = round(float(self.spacing / Fraction(setting.h)))
        grid = TimeGrid(setting.h, self.index * m, self.times)
        return Plan(ensemble or self.ensemble, setting.resolved(), grid, FIELDS, setting.dtype)

    def run(self, setting: Setting, ensemble: Ensemble | None = None) -> Result:
        """Its result at the common times, on one thread."""
        return run_plan(self.plan(setting, ensemble), 1)

    def accepted(self, methods: Sequence[str], dtype: str = "float64") -> tuple[list[str], dict[str, str]]:
        """Methods that the scene takes, and for each other one the reason. Names that are not known are left out."""
        good, refused = [], {}
        for name in methods:
            try:
                Method(name)
            except SceneError:
                continue
            try:
                self.plan(self.setting(name, 1, dtype))
                good.append(name)
            except SceneError as error:
                refused[name] = str(error)
        return good, refused

    def noisy(self, method: str) -> bool:
        """Whether random numbers act, which differ from step to step."""
        laws = self.plan(self.setting(method, 1)).model.laws
        return any(getattr(module, "NOISE", False) for _, module in laws)


def failed(result: Result) -> bool:
    """Whether some member failed, events not counted."""
    return bool(failed_members(result.status).any())


def distances(result: Result, reference: Result, asked: Compared | None = None) -> dict[str, np.ndarray]:
    """Quantity -> (k, n), how far apart they are; NaN from where an event stopped a member in either.

    asked: one more than those of QUANTITIES.
    """
    pairs = {name: (getattr(result, name).astype(np.float64), getattr(reference, name)) for name in FIELDS}
    found = {name: np.linalg.norm(a - b, axis=-1) for name, (a, b) in pairs.items() if name in ("position", "velocity")}
    found["angular_velocity"] = np.linalg.norm(np.subtract(*pairs["angular_velocity"]), axis=-1)
    chord = np.linalg.norm(np.subtract(*pairs["attitude"]), axis=(-2, -1))
    found["attitude"] = 2.0 * np.arcsin(np.minimum(chord / math.sqrt(8.0), 1.0))
    found["energy"] = np.abs(result.energy - reference.energy)
    found = {name: found[name] for name in QUANTITIES}
    if asked is not None and asked.name not in found:
        found[asked.name] = asked.distance(result, reference)
    gone = reference.time[:, None] >= np.minimum(stop_time(result), stop_time(reference))
    return {name: np.where(gone, np.nan, values) for name, values in found.items()}


def errors(apart: dict[str, np.ndarray], until: int) -> dict[str, dict[str, float]]:
    """Quantity -> end_max, end_rms, path_max, path_rms over the members that go on, up to the sample `until`."""
    found = {}
    for name, values in apart.items():
        values = values[: until + 1]
        rows = np.flatnonzero(np.isfinite(values).any(axis=1))
        end = values[rows[-1]] if len(rows) else np.zeros(1)
        numbers = {"end_max": np.nanmax(end), "end_rms": np.sqrt(np.nanmean(end**2))}
        numbers |= {"path_max": np.nanmax(values), "path_rms": np.sqrt(np.nanmean(values**2))}
        found[name] = {key: float(value) for key, value in numbers.items()}
    return found


@dataclass(frozen=True, eq=False)
class Reference:
    """What errors are measured from: the finer of two runs that share no step, at best no method, and how far they agree.

    own: quantity -> (k,), largest difference of the two up to each time, over the members. wall_seconds: what it took.
    asked: what errors are asked of, where that is none of QUANTITIES.
    """

    result: Result
    text: str
    own: dict[str, np.ndarray]
    wall_seconds: float
    asked: Compared | None = None

    def error(self, of: str, until: int = -1) -> float:
        """Its own error up to a sample (the last by default)."""
        return float(self.own[of][until])

    def reaches(self, of: str, error: float) -> int:
        """The last sample up to which its own error is at most this."""
        return int(np.searchsorted(self.own[of], error, side="right")) - 1


def extrapolated(sample: Sample, method: str, m: int) -> Result:
    """A run; of methods of low order three, from which the leading powers of the step are taken out."""
    if Method(method).order >= 4:
        return sample.run(sample.setting(method, m))
    runs = [sample.run(sample.setting(method, k * m)) for k in (1, 2, 4)]
    samples = {}
    for name in FIELDS:
        a, b, c = (one.samples[name] for one in runs)
        ab, bc = b + (b - a) / 3.0, c + (c - b) / 3.0
        samples[name] = bc + (bc - ab) / 7.0
    return replace(runs[-1], samples=samples, compile_seconds=sum(one.compile_seconds for one in runs))


def agreement(a: Result, b: Result, asked: Compared | None = None) -> dict[str, np.ndarray]:
    """Quantity -> (k,), the largest distance up to each time; infinite where a member failed. asked: as of `distances`."""
    if failed(a) or failed(b):
        names = dict.fromkeys([*QUANTITIES, *([asked.name] if asked else [])])
        return {name: np.where(a.time > 0.0, np.inf, 0.0) for name in names}
    found = {}
    for name, values in distances(a, b, asked).items():
        most = np.max(np.where(np.isnan(values), 0.0, values), axis=1)
        found[name] = np.maximum.accumulate(np.where(np.isfinite(most), most, np.inf))
    return found


def make_reference(
    sample: Sample,
    of: str | Compared = "position",
    goal: float = 0.0,
    seconds: float = 15.0,
    methods: Sequence[str] | None = None,
    report: Callable[[float], None] | None = None,
) -> Reference:
    """Refine two high-order runs together until they agree to the goal, agree no better, or the time is spent.

    seconds: about how long, compiling aside. methods: two names in place of the scene's best ones. Raises SceneError
    where there are none; how well the runs agree is for the caller to judge.
    """
    asked = compared_in(of)
    of = asked.name
    names = list(methods or sample.accepted(PRECISE)[0][:2])
    if not names:
        raise SceneError(
            [f"method: the scene takes none of {', '.join(PRECISE)}; name one that it takes: methods=[...]"]
        )
    if not methods and len(names) == 2 and Method(names[1]).order < Method(names[0]).order - 2:
        names = names[:1]
    first, second = names[0], names[-1]
    begun = time.perf_counter()
    best: Reference | None = None
    worse, m = 0, sample.coarsest(0.5)
    for _ in range(30):
        finer = max(m + 1, round(1.5 * m))
        with np.errstate(all="ignore"):
            runs = extrapolated(sample, first, m), extrapolated(sample, second, finer)
            own = agreement(*runs, asked)
        end = own[of][-1]
        if best is None or end < best.error(of):
            worse = worse + 1 if best and end > 0.5 * best.error(of) and end < LOST else 0
            text = f"{second} at h = {sample.h(finer):.4g} s against {first} at h = {sample.h(m):.4g} s"
            best = Reference(runs[1], text, own, time.perf_counter() - begun, asked)
        else:
            worse += best.error(of) < LOST
        begun += sum(one.compile_seconds for one in runs)
        # The coarser runs of an extrapolation take 3/4 of the finest one's time.
        last, spent = 1.75 * sum(one.run_seconds for one in runs), time.perf_counter() - begun
        if report:
            report(min(1.0, spent / seconds))
        if best.error(of) <= goal or worse >= 2 or spent + 2.0 * last > seconds:
            break
        m *= 2
    assert best is not None
    return best


@dataclass(frozen=True)
class Growth:
    """How a small difference grows.

    rate: of the logarithm, by least squares [1/s]; doubling: ln 2 / rate [s], infinite where there is no exponential.
    power: of a fit t^power, where that fits better than an exponential, else None. factor: growth over the run.
    predictable: dtype -> time at which one round-off has grown to 1e-2 [s], beyond the run by the fit; may be infinite.
    times [s] and curve: (k,) growth, the root mean square over members of position [m] and attitude [rad].
    """

    rate: float
    doubling: float
    power: float | None
    factor: float
    predictable: dict[str, float]
    times: np.ndarray
    curve: np.ndarray


NUDGE = 1e-8
# Powers of time above this are an exponential seen at few times.
STEEPEST = 3.0


def growth(sample: Sample, setting: Setting) -> Growth:
    """From runs whose starts differ by 1e-8 rad in attitude."""
    fleet = sample.ensemble
    members = fleet.select(0, fleet.members)
    turn = np.random.default_rng(0).normal(size=(fleet.members, 3))
    turn *= NUDGE / np.linalg.norm(turn, axis=1, keepdims=True)
    states = (members.position, members.velocity, members.angular_velocity)
    varied = {k: v for k, v in members.parameters.items() if len(v) == fleet.members and len(v) > 1}
    runs = []
    for R in (members.attitude, members.attitude @ notation.matrix_from_rotation_vector(turn)):
        one = Ensemble.from_states(fleet.scene, states[0], R, *states[1:], varied)
        one.indices, one.seed = fleet.indices, fleet.seed
        runs.append(sample.run(setting, one))
    apart = distances(runs[0], runs[1])
    both = np.hypot(apart["position"], apart["attitude"]) / NUDGE
    alive = np.isfinite(both)
    curve = np.sqrt(np.sum(np.where(alive, both, 0.0) ** 2, axis=1) / np.maximum(alive.sum(axis=1), 1))
    good = np.isfinite(curve) & (curve > 0.0) & (curve < 0.1 / NUDGE)
    return fitted(sample.times[good], curve[good], sample.t1)


def fitted(times: np.ndarray, curve: np.ndarray, t1: float) -> Growth:
    """Growth from the curve of a difference, 1 at the start."""
    later = times > 0.0
    if later.sum() < 2:
        return Growth(np.nan, np.nan, None, np.nan, dict.fromkeys(ROUND_OFF, 0.0), times, curve)
    t, logs = times[later], np.log(curve[later])
    (rate, at0), misfit = np.polyfit(t, logs, 1, full=True)[:2]
    (power, _), misfit_power = np.polyfit(np.log(t), logs, 1, full=True)[:2]
    algebraic = rate <= 0.0 or (power < STEEPEST and misfit_power.sum() <= misfit.sum())
    predictable = {}
    for dtype, size in ROUND_OFF.items():
        beyond = np.flatnonzero(curve * size > LOST)
        end = np.inf if algebraic else max(t[-1], (math.log(LOST / size) - at0) / rate)
        predictable[dtype] = float(times[beyond[0]]) if len(beyond) else float(end)
    doubling = np.inf if algebraic else math.log(2.0) / rate
    return Growth(
        float(rate), float(doubling), float(power) if algebraic else None, float(curve[-1]), predictable, times, curve
    )


def statistics(result: Result, asked: Compared | None = None) -> dict[str, np.ndarray]:
    """What means and spreads are taken of: (k, n, components). Of the attitude, the vertical in body axes.

    asked: one more than those of QUANTITIES, but for angles, which have no such mean.
    """
    found = {name: getattr(result, name).astype(np.float64) for name in ("position", "velocity", "angular_velocity")}
    found["attitude"] = result.attitude[..., 2, :].astype(np.float64)
    found["energy"] = result.energy[..., None]
    found["linear_momentum"] = invariants.linear_momentum(result)
    found["angular_momentum"] = invariants.angular_momentum(result)
    if asked is not None and asked.name not in found and asked.unit != "rad":
        found[asked.name] = asked.values(result)
    return found


def biases(result: Result, reference: Result, asked: Compared | None = None) -> dict[str, float]:
    """Name of mean or std -> its difference in standard errors of the sample, rms over components and times after 0.

    Two samples that have nothing in common but their law differ by about 1.4. Empty for one member.
    """
    n = result.members
    if n < 2 or failed(result):
        return {}
    found = {}
    mine, theirs = statistics(result, asked), statistics(reference, asked)
    for name, b in theirs.items():
        a, b = mine[name][1:], b[1:]
        spread = b.std(axis=1, ddof=1)
        # What does not vary, but for round-off, has no standard error.
        real = spread > 1e-9 * np.maximum(np.abs(b).max(axis=1), 1e-12)
        if not real.any():
            continue
        for what, change, size in (
            ("mean", a.mean(axis=1) - b.mean(axis=1), 1.0 / math.sqrt(n)),
            ("std", a.std(axis=1, ddof=1) - spread, 1.0 / math.sqrt(2.0 * (n - 1))),
        ):
            found[f"{name}_{what}"] = float(np.sqrt(np.mean((change[real] / (spread[real] * size)) ** 2)))
    return found


def part(result: Result, members: Sequence[int]) -> Result:
    """Some members of a result."""
    at = np.asarray(members)
    if result.store is not None:
        from lgvi_warp.runs.store.open import chosen

        return chosen(result, members)
    return result.part(at)
