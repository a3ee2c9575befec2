# SPDX-License-Identifier: Apache-2.0
"""The pilot: a few members at ever finer steps until the bias is small; correlation and cost of the settings.

Noise on a grid is drawn at the finer step of each pair, so that both share one path. The pilot costs at most a tenth of
the predicted cost of plain Monte Carlo.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.methods.method import Method
from lgvi_warp.uncertainty.estimating import bias as biases_of
from lgvi_warp.uncertainty.estimating.bias import AGREE, Bias, StepChange, difference
from lgvi_warp.uncertainty.estimating.choice import Observed
from lgvi_warp.uncertainty.estimating.estimators import REPLICATES, UNSEEN, plain, tail_index
from lgvi_warp.uncertainty.estimating.levels import CALL, Runs, Setting, cube, design, normals
from lgvi_warp.uncertainty.estimating.target import Solved, Sought, Weighted, mean_of
from lgvi_warp.uncertainty.estimating.unseen import FAR, MOST_STRATA, probes, reach_of

# Members of the first stage, and how many stages there are, each of four times the members of the one before.
FIRST, STAGES = 64, (64, 256, 1024)
# Larger first stages, for tails and for probabilities whose error is relative.
TAIL_STAGES, HIT_STAGES = (4096, 16384), (4096, 16384, 65536)
# Members of each rare stratum, enough for two of each replicate; and the indices of noise that a stratum has.
OF_STRATUM, STRATUM_INDICES = 32, 2**20
# Members all over the cube that are looked at for odd ones: the fewest, and the most where these cost at most this part of the
# pilot so far.
LOOKED, LOOK_SHARE = (512, 2048), 0.25
# MeanEstimate of plain Monte Carlo's predicted cost that the pilot may take.
SHARE = 0.1
# Where plain Monte Carlo needs at most so many members, a pilot is not worth its cost.
FEW = 10 * FIRST
# Half the step leaves pairs apart by a half to a 1.4th; where it leaves more, more pairs do better.
STALLED = 0.8
# Conditions and quantiles are smoothed over this part of the numbers' spread to see how a step changes them.
WIDTH = 0.2
# A tail that falls off by a smaller power has no finite variance, with what is known of so many members; where it seems so,
# so many show whether it falls off faster farther out, in smaller parts of the largest.
HEAVY, KNOWN, SURE, PARTS = 1.5, 256, 16384, (32, 128, 512)
# Hits that a probability needs before its spread is known.
HITS = 4


@dataclass
class Pilot:
    """Members of the pilot; their numbers are stored by setting and grid of the noise [s].

    noise: "none", "grid" if settings can share a noise path, "free" if they cannot.
    error: the requested error; a fraction of the value if `relative`.
    single: True if coarse levels may use single precision.
    estimator: the only one that may be chosen; None for any.
    most: processor time that the pilot may take in any case [s].
    heavy_tail: True if a mean is reported even if its variance seems infinite.
    least: minimum number of members of the first stage, for a rare condition.
    """

    runs: Runs
    target: Sought
    noise: str
    error: float
    relative: bool = False
    single: bool = False
    estimator: str | None = None
    most: float = math.inf
    heavy_tail: bool = False
    least: int = 0
    numbers: dict[tuple[Setting, float | None, int], np.ndarray] = field(default_factory=dict)
    reaches: dict[Setting, float] = field(default_factory=dict)
    looked: dict[Setting, int] = field(default_factory=dict)
    messages: list[str] = field(default_factory=list)

    def grid(self, setting: Setting) -> float | None:
        """The grid of the noise of a setting alone, and of its pairs with coarser ones [s]."""
        return setting.h if self.noise == "grid" else None

    def y(self, setting: Setting, grid: float | None, members: int, stratum: int = 0) -> np.ndarray:
        """The numbers of the first members of a stratum (n,)."""
        known = self.numbers.get((setting, grid, stratum), np.empty(0))
        if len(known) < members:
            first, indices = len(known), stratum * STRATUM_INDICES + np.arange(len(known), members)
            points = design(self.runs.seed, self.name(stratum), self.runs.dimensions, first, members - first)
            new = self.runs(setting, grid, points, indices, stratum)
            known = self.numbers[setting, grid, stratum] = np.concatenate([known, new])
        return known[:members]

    def name(self, stratum: int = 0) -> str:
        """Name of the points of a stratum."""
        return f"estimate pilot {stratum}" if stratum else "estimate pilot"

    def samples(self, setting: Setting, grid: float | None, members: int) -> list[Weighted]:
        """The numbers of all strata, each with its probability."""
        return [(each.probability, self.y(setting, grid, OF_STRATUM if k else members, k))
                for k, each in enumerate(self.runs.strata)]  # fmt: skip

    def solved(self, setting: Setting, members: int) -> Solved:
        """The target, solved with one setting."""
        return self.target.solved(self.samples(setting, self.grid(setting), members))

    def variance(self, setting: Setting, members: int) -> float:
        """The variance of one member's contribution, of all strata together."""
        at, samples = self.solved(setting, members), self.samples(setting, self.grid(setting), members)
        least = self.target.least(at)
        with np.errstate(over="ignore", invalid="ignore"):
            if len(samples) == 1:
                return plain(self.target.contributions(samples[0][1], at), least).variance * members
            parts = [(p, self.target.contributions(y, at)) for p, y in samples]
            mean = mean_of(parts, np.asarray)
            return mean_of(parts, lambda z: (z - mean) ** 2) + (UNSEEN * least) ** 2 / members

    def reach(self, setting: Setting) -> float:
        """Possible distance of unseen members' numbers, by spread members and by probes; for means and cvar."""
        if self.target.unbounded and setting not in self.reaches:
            at, known = self.solved(setting, self.first), normals(self._design("estimate pilot", FIRST))
            z = self.target.contributions(self.y(setting, self.grid(setting), FIRST), at)
            others = [self._look(setting), self._probed(setting, known)]
            found = [reach_of(z, known, self.target.contributions(y, at), each) for y, each in others if len(y)]
            self.reaches[setting], self.looked[setting] = max(found, default=0.0), len(others[0][0])
        return self.reaches.get(setting, 0.0)

    def _design(self, name: str, members: int) -> np.ndarray:
        return design(self.runs.seed, name, self.runs.dimensions, 0, members)

    def _look(self, setting: Setting) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (m,) and normals (m, d) of members spread over the whole cube, within a share of the cost so far."""
        cost, (fewest, most) = self.runs.cost(setting, self.grid(setting)), LOOKED
        seconds = max(LOOK_SHARE * self.runs.counted, self.most_seconds(setting, self.first))
        members = int(np.clip(seconds / cost, fewest, most)) // REPLICATES * REPLICATES
        points, indices = self._design("estimate look", members), (MOST_STRATA + 1) * STRATUM_INDICES
        try:
            return self.runs(setting, self.grid(setting), points, indices + np.arange(members)), normals(points)
        except SceneError:
            return np.empty(0), points[:0]

    def _probed(self, setting: Setting, members: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (m,) and normals (m, d) of probes of members (n, d), at the largest distance that is not refused."""
        for distance in FAR if self.runs.dimensions else ():
            far = probes(self.runs.seed, members, distance)
            with contextlib.suppress(SceneError):
                return self.runs(setting, self.grid(setting), cube(far), np.arange(len(far)) % FIRST), far
        return np.empty(0), members[:0]

    @property
    def first(self) -> int:
        """Number of members of the first stage: enough to have some in the tail of a quantile or among the worst."""
        tail = self.target.tail
        for members in (*STAGES, *TAIL_STAGES):
            if members * tail >= HITS:
                return max(members, self.least)
        problem = f"stands on {members * tail:.2g} of {members:,} members of the pilot, too few to know its error"
        remedy = "ask for a level nearer the middle, or for the probability of a limit by lw.rare_event"
        raise refusal("risk", self.runs.question.label, problem, remedy)

    def asked(self, at: Solved) -> float:
        """The requested error, in the unit of the statistic."""
        return self.error * abs(at.value) if self.relative else self.error

    def plain_members(self, setting: Setting, members: int, *, unseen: bool = False) -> float:
        """Number of members that plain Monte Carlo needs; unseen: True includes the effect of unseen members."""
        error, variance = self.asked(self.solved(setting, members)), self.variance(setting, members)
        if not error * error > 0.0:
            return math.inf if variance > 0.0 or self.relative else 1.0
        # n for which variance / n + (extra / n)^2 is the square of the error.
        extra = UNSEEN * self.reach(setting) if unseen else 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            half = 0.5 * np.float64(variance) / error**2
            return float(half + np.hypot(half, extra / error))

    def most_seconds(self, setting: Setting, members: int) -> float:
        """Largest cost of the pilot [s]."""
        return SHARE * self.plain_members(setting, members) * self.runs.cost(setting, self.grid(setting))

    def pair(self, coarse: Setting, fine: Setting, members: int) -> StepChange:
        """Change of the target from one setting to a finer one."""
        grid = self.grid(fine)
        below, above = (self.samples(setting, grid, members) for setting in (coarse, fine))
        at = self.target.solved(above)
        changes = [self._change(b, a, at) for (_, b), (_, a) in zip(below, above, strict=True)]
        parts = [(each.probability, change) for each, change in zip(self.runs.strata, changes, strict=True)]
        half = math.hypot(*(p * change.half for p, change in parts))
        return replace(changes[0], value=sum(p * change.value for p, change in parts), half=half)

    def _change(self, below: np.ndarray, above: np.ndarray, at: Solved) -> StepChange:
        """Change of the contributions of a stratum's members."""
        spread = float(np.std(above[np.isfinite(above)])) if np.isfinite(above).any() else 0.0
        if self.target.smooth and spread > 0.0:
            width = WIDTH * spread
            return difference(self.target.smoothed(below, at, width), self.target.smoothed(above, at, width))
        coarser, finer = self.target.contributions(below, at), self.target.contributions(above, at)
        return difference(coarser, finer, self.target.least(at))

    def check_tail(self, setting: Setting, y: np.ndarray) -> None:
        """Refuse a mean whose variance seems infinite, unless `heavy_tail`; SceneError."""
        if not self.target.unbounded or len(y) < KNOWN or tail_index(y) >= HEAVY:
            return
        y = self.y(setting, self.grid(setting), max(len(y), SURE)) if len(y) < SURE else y
        index = max(tail_index(y, part) for part in PARTS)
        if not index < HEAVY:
            return
        problem = (
            f"has no finite variance, as it seems: its tail falls off with the power {index:.2g} of {len(y)} members"
        )
        if not self.heavy_tail:
            remedy = "ask for a quantile, risk=0.5, or a probability; heavy_tail=True reports the mean nevertheless"
            raise refusal("of", self.runs.question.label, problem, remedy)
        if not any("no finite variance" in message for message in self.messages):
            self.messages.append(f"{self.runs.question.label} {problem}: its interval is not to be trusted")


@dataclass
class Ladder:
    """Steps of one method that were run, the coarsest first; refused: setting -> reason.

    halvings: the differences of successive steps.
    order: order of the method, 1 with noise.
    end: reason of the end: "agree", "apart", "members" (too few to decide about the difference) or "steps".
    """

    settings: list[Setting] = field(default_factory=list)
    halvings: list[StepChange] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    end: str = "steps"
    order: int = 1

    def biases(self) -> list[Bias]:
        """The bias of each step."""
        return biases_of.biases(self.halvings, self.order)

    def settled(self, error: float) -> int:
        """Index of the coarsest step whose bias is at most half of the error, or else of the finest step but one."""
        if len(self.settings) < 2:
            return 0
        found = [i for i, bias in enumerate(self.biases()) if bias.mean_square <= (0.5 * error) ** 2]
        return found[0] if found else len(self.settings) - (1 if self.end == "steps" else 2)


def climb(pilot: Pilot, steps: Sequence[Setting], fixed: Setting | None = None, most: float = math.inf) -> Ladder:
    """Run ever finer steps until two agree or their members are uncorrelated.

    Each step runs 64 members. All steps cost as much as 128 members at the finest, a tenth of 1,280 plain members.

    fixed: a requested setting: the ladder ends one step after it.
    most: cost of a member above which a step gains nothing [s].
    """
    ladder = Ladder(order=Method(steps[0].method).order if pilot.noise == "none" else 1)
    for setting in steps:
        if not runs_at(pilot, setting, ladder):
            continue
        ladder.settings.append(setting)
        if len(ladder.settings) < 2:
            _first_look(pilot, setting)
            continue
        ladder.halvings.append(_compared(pilot, ladder))
        if fixed is None and (end := _ended(pilot, ladder)):
            ladder.end = end
            break
        if pilot.runs.cost(setting, pilot.grid(setting)) > most:
            break
    return ladder


def at_once(pilot: Pilot, own: Setting) -> Ladder | None:
    """A ladder of a given step and half of it, if plain Monte Carlo needs so few members that a pilot does not pay.

    One in 16 of the members estimate the bias. None if more members are needed, or the step is refused.
    """
    ladder, half = Ladder(), replace(own, h=0.5 * own.h)
    if not runs_at(pilot, own, ladder):
        return None
    members = pilot.plain_members(own, pilot.first, unseen=True)
    if members > FEW:
        return None
    some = REPLICATES * math.ceil(max(members, 1.0) / REPLICATES**2)
    some = some if pilot.target.tail == 1.0 else max(some, pilot.first)
    try:
        found = pilot.pair(own, half, some)
    except SceneError:
        return None
    return Ladder([own, half], [found], {}, "agree") if math.isfinite(found.value) else None


def runs_at(pilot: Pilot, setting: Setting, ladder: Ladder) -> bool:
    """True if a setting is accepted and no member fails at it."""
    try:
        y = pilot.y(setting, pilot.grid(setting), pilot.first)
        if pilot.grid(setting) is not None and ladder.settings:
            pilot.y(ladder.settings[-1], pilot.grid(setting), pilot.first)
    except SceneError as error:
        ladder.refused[str(setting)] = error.faults[0]
        return False
    rare = [pilot.y(setting, pilot.grid(setting), OF_STRATUM, k) for k in range(1, len(pilot.runs.strata))]
    y = np.concatenate([y, *rare])
    if np.isnan(y).any():
        ladder.refused[str(setting)] = f"{int(np.isnan(y).sum())} of {len(y)} members fail, or have no finite number"
        return False
    if pilot.target.unbounded and np.isinf(y).any():
        problem = f"is infinite for {int(np.isinf(y).sum())} of {len(y)} members, so that its mean is"
        raise refusal("of", pilot.runs.question.label, problem, "ask for a quantile or a probability")
    return True


def _first_look(pilot: Pilot, setting: Setting) -> None:
    """Take more members at the coarsest step if the error is relative and few members have a number other than 0."""
    varies = pilot.runs.dimensions or pilot.noise != "none"
    if not (pilot.relative and varies) or pilot.target.kind == "quantile":
        return
    for members in (*STAGES, *HIT_STAGES):
        samples = pilot.samples(setting, pilot.grid(setting), members)
        hits = members * mean_of(samples, lambda y: pilot.target.counted(y) != 0.0)
        if hits >= HITS:
            pilot.least = max(pilot.least, members)
            return
    if not hits and pilot.target.unbounded:
        return  # which is refused with the error that it asks for
    hit = "other than 0" if pilot.target.unbounded else "seen"
    problem = f"was {hit} {hits:.0f} times among {members:,} members of the pilot, too seldom to fix their number"
    remedy = "use lw.rare_event, which finds rare events, or give error= in place of relative_error="
    raise refusal("of", pilot.runs.question.label, problem, remedy)


def _compared(pilot: Pilot, ladder: Ladder) -> StepChange:
    """The last halving, with as many members as are needed to decide whether it is small, and worth their cost."""
    for members in (n for n in (*STAGES, *HIT_STAGES) if pilot.first <= n <= max(pilot.first, STAGES[-1])):
        found = pilot.pair(ladder.settings[-2], ladder.settings[-1], members)
        small = AGREE * pilot.asked(pilot.solved(ladder.settings[-1], pilot.first))
        known = found.half <= small or abs(found.value) > max(found.half, small)
        if known or found.apart or not _stalls(ladder, found, small) or _too_dear(pilot, ladder, members):
            break
    return found


def _stalls(ladder: Ladder, answer: StepChange, small: float) -> bool:
    """True if more pairs help as much as a finer step would."""
    return answer.half <= 4.0 * small or bool(ladder.halvings and answer.half > STALLED * ladder.halvings[-1].half)


def _too_dear(pilot: Pilot, ladder: Ladder, members: int) -> bool:
    """True if three times as many additional pairs would cost too much."""
    last = ladder.settings[-1]
    more = 3.0 * members * 1.5 * pilot.runs.cost(last, pilot.grid(last))
    return (pilot.runs.counted + more > pilot.most_seconds(ladder.settings[-2], pilot.first)
            or pilot.runs.seconds > pilot.most)  # fmt: skip


def _ended(pilot: Pilot, ladder: Ladder) -> str:
    """Reason why no finer step is run; "" to continue."""
    halvings, error = ladder.halvings, pilot.asked(pilot.solved(ladder.settings[-1], pilot.first))
    if len(halvings) > 1 and all(each.apart for each in halvings[-2:]):
        return "apart"
    if any(bias.mean_square <= (0.5 * error) ** 2 for bias in ladder.biases()):
        return "agree"
    last = halvings[-1]
    # Near where a step is too long some pairs are far apart: a stall is believed where it comes twice.
    needed = 2 if pilot.noise == "free" else 3
    lately = list(itertools.pairwise(halvings[-needed:]))
    stalls = (
        len(halvings) >= needed and all(b.half > STALLED * a.half for a, b in lately) and abs(last.value) <= last.half
    )
    return "members" if stalls and last.half > AGREE * error else ""


def observed(pilot: Pilot, top: Setting, coarser: Sequence[Setting], members: int) -> Observed:
    """Observations of several settings, with the same members, and noise drawn at the step of the top setting."""
    settings, grid = [top, *coarser], pilot.grid(top)
    y = [pilot.y(setting, grid, members) for setting in settings]
    kept = [i for i, values in enumerate(y) if not np.isnan(values).any()]
    if 0 not in kept:
        raise failing(top, y[0])
    pilot.check_tail(top, y[0])
    at = pilot.solved(top, members)
    for i in kept:
        pilot.y(settings[i], pilot.grid(settings[i]), pilot.first)  # which tells what it costs alone

    def pair(f: int, c: int) -> float:
        # Both costs are known with the draws of the top step, which are as many or more.
        return pilot.runs.cost(settings[kept[f]], grid) + pilot.runs.cost(settings[kept[c]], grid)

    points = design(pilot.runs.seed, pilot.name(), pilot.runs.dimensions, 0, members)
    return Observed(
        [pilot.target.contributions(y[i], at) for i in kept],
        normals(points),
        [pilot.runs.cost(settings[i], pilot.grid(settings[i])) for i in kept],
        pair,
        pilot.target.least(at),
        [settings[i] for i in kept],
        at,
        call=CALL,
        weight=pilot.runs.strata[0].probability,
        reach=pilot.reach(top),
    )


def failing(setting: Setting, y: np.ndarray) -> SceneError:
    """Error for a statistic whose members fail at the finest step."""
    count = int(np.isnan(y).sum())
    problem = f"{count} of {len(y)} members fail, or have no finite number"
    return refusal("setting", str(setting), problem, "fix the failing members (lw.solve says which), or vary less")
