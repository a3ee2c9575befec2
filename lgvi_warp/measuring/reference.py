# SPDX-License-Identifier: Apache-2.0
"""Reference of errors (two precise runs that agree), and growth of small differences."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.measuring.budget import Budget, rounded_up
from lgvi_warp.measuring.comparison import Candidate, Sample, agreement, distances
from lgvi_warp.measuring.distance import Distance, compared_in
from lgvi_warp.methods import saveat
from lgvi_warp.methods.method import Method
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.results.result import Result
from lgvi_warp.scene.ensemble import Ensemble

# Error at which a trajectory is no longer meaningful [m or rad].
LOST = 1e-2
ROUND_OFF = {"float64": 2.0**-53, "float32": 2.0**-24}
# Methods for the reference, the best first; neighbours share as little as possible.
PRECISE = ("kl8(psi_x)", "rk8", "kl8(psi_s)", "kl6(psi_x)", "kl6(psi_s)", "rk5", "su4(psi_x)", "su4(psi_s)", "rk4", "psi_x",
           "psi_s", "psi_w", "psi_1", "psi")  # fmt: skip
# The same where noise acts, which leaves nothing to a high order.
PRECISE_IN_NOISE = ("rk4", "psi_x", "psi_s", "psi_w", "phi")
# Angle between the two starts [rad].
NUDGE = 1e-8
# A fitted power of time above this is an exponential sampled at few times.
STEEPEST = 3.0


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference of errors: the finer of two runs with different steps and, if possible, different methods.

    text: description of the two methods and their steps.
    own: quantity -> (k,), largest difference of the two runs over all members up to each time [its unit].
    asked: quantity of the errors, if it is not in QUANTITIES.
    more: predicted time that would have sufficed, if the time was spent before the runs agreed [s]; infinite if no
        prediction is possible; 0 if the runs do not agree better with more time.
    """

    result: Result
    text: str
    own: dict[str, np.ndarray]
    sample: Sample
    asked: Distance | None = None
    methods: tuple[str, ...] = ()
    more: float = 0.0

    def error(self, of: str, until: int = -1) -> float:
        """The reference's own error: the largest difference of the two runs up to the sample `until`."""
        return float(self.own[of][until])

    def reaches(self, of: str, error: float) -> int:
        """Index of the last sample up to which the reference's own error stays below a bound."""
        return int(np.searchsorted(self.own[of], error, side="right")) - 1


def extrapolated(sample: Sample, method: str, m: int) -> Result:
    """Run a method; if its order is below four and no noise acts, extrapolate from three steps.

    Richardson extrapolation from the steps h, h/2 and h/4 removes the error terms in h^2 and h^3.
    """
    if Method(method).order >= 4 or sample.draws:
        return sample.run(sample.candidate(method, m))
    runs = [sample.run(sample.candidate(method, k * m)) for k in (1, 2, 4)]
    samples = {}
    for name in FIELDS:
        a, b, c = (run.samples[name] for run in runs)
        ab, bc = b + (b - a) / 3.0, c + (c - b) / 3.0
        samples[name] = bc + (bc - ab) / 7.0
    return replace(runs[-1], samples=samples, compile_seconds=sum(run.compile_seconds for run in runs))


def paired(names: Sequence[str]) -> tuple[str, str]:
    """The two methods of a reference."""
    first, second = names[0], names[min(1, len(names) - 1)]
    return first, second if Method(second).order >= Method(first).order - 2 else first


def make_reference(
    sample: Sample, of: str | Distance = "position", goal: float = 0.0, seconds: float = 15.0,
    methods: Sequence[str] | None = None, report: Callable[[float], None] | None = None,
) -> Reference:  # fmt: skip
    """Refine two high-order runs together until they agree to a goal, no longer agree better, or the time is spent.

    If noise acts, both runs share one path, drawn at each step of the finer run. Each refinement draws another path;
    `Reference.sample` has the path of the best refinement. The caller judges whether the runs agree well enough.

    seconds: processor time to spend, without compiling [s].
    """
    compared = compared_in(of)
    of = compared.name
    fixed = sample.fixed_draws
    if fixed:
        sample = sample.on_grid(fixed)
    names = list(methods or sample.accepted(PRECISE, most=2)[0])
    if not names:
        raise SceneError(
            [f"method: the scene takes none of {', '.join(PRECISE)}. Name one that it takes: methods=[...]"]
        )
    noisy = sample.noise(names[0]) == "grid"
    if noisy and not methods:
        names = sample.accepted(PRECISE_IN_NOISE, most=2)[0]
    first, second = (names[0], names[-1]) if methods else paired(names)
    budget = Budget(seconds)
    best: Reference | None = None
    worse, m, gain = 0, sample.coarsest(0.5), 1.0
    # In noise half the step halves the difference, but for the chance of another path.
    stalled = 0.9 if noisy else 0.5
    if noisy:
        # 3 2^k draws, which many steps divide; at first sixteen in the longest step that is tried.
        m = 3 * 2 ** math.ceil(math.log2(max(8.0 * m / 3.0, 1.0)))
    # In noise each halving of the step gains one of the error, without an end.
    for _ in range(10 if noisy else 30):
        finer = max(m + 1, round(1.5 * m))
        if fixed:
            m, finer = (*saveat.divisors(fixed)[-2:-1], fixed)[0], fixed
        elif noisy:
            finer = 2 * m
            sample = sample.on_grid(finer)
        for name, steps in ((first, m), (second, finer)):
            with budget.free():
                sample.kernels.compile(sample.plan(sample.candidate(name, steps)))
        before = budget.spent
        with np.errstate(all="ignore"):
            runs = extrapolated(sample, first, m), extrapolated(sample, second, finer)
            disagreement = agreement(*runs, compared)
        end, last = disagreement[of][-1], budget.spent - before
        if best is None or end < best.error(of):
            worse = worse + 1 if best and end > stalled * best.error(of) and end < LOST else 0
            gain = best.error(of) / max(end, 1e-300) if best else 1.0
            text = f"{second} at h = {sample.h(finer):.4g} s against {first} at h = {sample.h(m):.4g} s"
            best = Reference(runs[1], text, disagreement, sample, compared, (first, second))
        else:
            worse += best.error(of) < LOST
        if report:
            report(min(1.0, budget.spent / seconds))
        if best.error(of) <= goal or worse >= 2 or fixed:
            break
        if budget.spent + 2.0 * last > seconds:
            best = replace(best, more=budget.spent + more_seconds(best.error(of), goal, gain, last))
            break
        m *= 2
    assert best is not None
    return best


def more_seconds(error: float, goal: float, gain: float, last: float) -> float:
    """Predict the processor time of refining two runs to a goal [s]; infinite if no prediction is possible.

    last: processor time of the last two runs [s]; each refinement takes twice as long as the one before.
    """
    if not (math.isfinite(error) and goal > 0.0 and 1.5 < gain < math.inf):
        return math.inf
    halvings = math.ceil(math.log(error / goal) / math.log(gain))
    return 2.0 * last * (2.0**halvings - 1.0)


def time_over(seconds: float, more: float, share: float) -> tuple[str, str]:
    """Text for a search that used up its time, and the time that would suffice: (cause, remedy)."""
    cause = f"{seconds:g} s were over"
    if not math.isfinite(more):
        return cause, "give more seconds"
    return cause, f"seconds={rounded_up(max(more / share, 2.0 * seconds)):g} would do"


@dataclass(frozen=True)
class Growth:
    """Growth of a small difference between two starts.

    Attributes:
        rate: slope of the logarithm of the difference over time, by least squares [1/s].
        doubling: time in which the difference doubles, ln 2 / rate [s]; infinite if growth is not exponential.
        power: exponent p if t^p fits the growth better than an exponential; otherwise None.
        factor: final difference divided by the initial difference.
        predictable: dtype -> time at which round-off has grown to 1e-2, extrapolated beyond the run, or infinite [s].
        times: the k times of the curve (k,) [s].
        curve: difference at each time (k,) divided by the initial difference: root mean square over members, with
            differences in position [m] and attitude [rad] combined.
    """

    rate: float
    doubling: float
    power: float | None
    factor: float
    predictable: dict[str, float]
    times: np.ndarray
    curve: np.ndarray


def measured_growth(sample: Sample, candidate: Candidate) -> Growth:
    """Measure growth by two runs whose starts differ by 1e-8 rad in attitude."""
    fleet = sample.ensemble
    start = fleet.select(0, fleet.members)
    turn = np.random.default_rng(0).normal(size=(fleet.members, 3))
    turn *= NUDGE / np.linalg.norm(turn, axis=1, keepdims=True)
    varied = {k: v for k, v in start.parameters.items() if len(v) == fleet.members and len(v) > 1}
    runs = []
    for R in (start.attitude, start.attitude @ notation.matrix_from_rotation_vector(turn)):
        nudged = Ensemble.from_states(fleet.scene, start.position, R, start.velocity, start.angular_velocity, varied)
        nudged.indices, nudged.seed = fleet.indices, fleet.seed
        runs.append(sample.run(candidate, nudged))
    apart = distances(runs[0], runs[1])
    both = np.hypot(apart["position"], apart["attitude"]) / NUDGE
    alive = np.isfinite(both)
    curve = np.sqrt(np.sum(np.where(alive, both, 0.0) ** 2, axis=1) / np.maximum(alive.sum(axis=1), 1))
    good = np.isfinite(curve) & (curve > 0.0) & (curve < 0.1 / NUDGE)
    return fitted(sample.times[good], curve[good], sample.t1)


def fitted(times: np.ndarray, curve: np.ndarray, t1: float) -> Growth:
    """Fit an exponential and a power of time to the growth of a difference."""
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
