# SPDX-License-Identifier: Apache-2.0
"""`margins`: how much gain and delay the loop of each member bears, by eigenvalues and by runs in lanes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import listed
from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.methods.method import Method
from lgvi_warp.physics.control.delay import MOST_PERIODS
from lgvi_warp.physics.control.loop_gain import FACTOR, with_factor
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.studies.linear.bench import Bench, Motion, calm
from lgvi_warp.studies.linear.edges import edges
from lgvi_warp.studies.linear.linearize import check_parts
from lgvi_warp.studies.linear.sampled_loop import DELAY, SampledLoop, delayed
from lgvi_warp.studies.linear.trim import step_of
from lgvi_warp.studies.members import ensemble_of

OF, WAYS = ("gain", "delay"), ("eigenvalues", "runs")
# Members whose margins are sought together.
GROUP = 2048
# Width of the last brackets, in the logarithm of the factor: of eigenvalues, and of runs, which judge to some 0.4 %.
NARROW = {"eigenvalues": 1e-6, "runs": 2e-3}
# The envelope of a loop that settles shrinks at least so much from the second third of a run to the last.
SHRINKS = 0.97
# What swings by less than this part of its first third has settled: what is left is round-off.
SETTLED = 1e-6
# Looks of a run below which its thirds show no envelope.
LEAST_LOOKS = 30
PERCENTILES = (0.0, 5.0, 25.0, 50.0, 75.0, 95.0, 100.0)
UNITS = {"gain_lower": "", "gain_upper": "", "delay": "s"}


@dataclass(frozen=True)
class Margins:
    """Margins of a loop by member.

    Each is NaN for a member whose loop does not settle as it is, or that failed.

    Attributes:
        loop: key of the law; "all laws" for the whole controller.
        values: by name, (n,): "gain_lower" and "gain_upper", between which the factors on the demand lie that the loop bears
            (0 and infinite where it bears all that were asked); "delay", the largest delay [s] beside the loop's own, in whole
            steps.
        by_runs: the same, as runs show them; without those that were not asked.
        steady: (n,), whether the loop settles as it is.
        step: step of the runs [s], to which delays are known.
    """

    loop: str
    values: Mapping[str, np.ndarray]
    by_runs: Mapping[str, np.ndarray]
    steady: np.ndarray
    step: float

    @property
    def members(self) -> int:
        """The number of members, n."""
        return len(self.steady)

    def percentiles(self, of: Sequence[float] = PERCENTILES) -> dict[str, np.ndarray]:
        """How margins are distributed over the members that settle as they are.

        Args:
            of: percentages (k,), in [0, 100].

        Returns:
            By name, (k,): each the margin of a member; NaN where no member settles.
        """
        columns = self._columns()
        quantiles = np.asarray(of) / 100.0
        return {
            name: np.quantile(v[self.steady], quantiles, method="inverted_cdf")
            if self.steady.any()
            else np.full(len(quantiles), np.nan)
            for name, v in columns.items()
        }

    def curve(self, name: str, by: str | None = None) -> tuple[np.ndarray, np.ndarray]:
        """The distribution of a margin for a picture: how many members have less.

        Args:
            name: "gain_lower", "gain_upper" or "delay".
            by: "eigenvalues" or "runs"; None, the default, for the first of them that was asked.

        Returns:
            (margins of the members that settle as they are, rising; the part of them with at most that much).
        """
        columns = self._columns() if by is None else {"eigenvalues": self.values, "runs": self.by_runs}[by]
        values = np.sort(columns[name][self.steady])
        return values, np.arange(1, len(values) + 1) / max(1, len(values))

    def worst(self, count: int = 10, name: str | None = None) -> np.ndarray:
        """The members that bear least.

        Args:
            count: how many (default 10).
            name: by which margin; None, the default, for the first of "gain_upper" and "delay" that was asked.

        Returns:
            Indices (count,), the least first; members that do not settle as they are before all others.
        """
        columns = self._columns()
        chosen = name or ("gain_upper" if "gain_upper" in columns else "delay")
        values = columns[chosen] * (-1.0 if chosen == "gain_lower" else 1.0)
        return np.argsort(np.where(self.steady, values, -np.inf), kind="stable")[:count]

    def _columns(self) -> Mapping[str, np.ndarray]:
        return self.values or self.by_runs

    def __str__(self) -> str:
        lines = [f"{self.loop}: margins of {self.members} members"]
        lost = int((~self.steady).sum())
        if lost:
            lines.append(f"{lost} of them do not settle as they are; the others:")
        lines.append(f"{'':16}" + "".join(f"{f'{p:g} %':>10}" for p in PERCENTILES))
        for name, row in self.percentiles().items():
            lines.append(f"{f'{name} {UNITS[name]}'.strip():16}" + "".join(f"{value:10.4g}" for value in row))
        return "\n".join(lines)


def margins(
    fleet: Ensemble | Scene,
    loop: str | None = None,
    of: Sequence[str] = OF,
    *,
    by: Sequence[str] = ("eigenvalues",),
    about: float = 60.0,
    seconds: float = 240.0,
    tilt: float = 1e-3,
    most: float = 100.0,
    longest: float = 10.0,
    method: str | Method | None = None,
    h: float | None = None,
) -> Margins:
    """Find how much gain and delay the loop of each member bears.

    By eigenvalues: those of the sampled loop about the motion that the member has after `about` seconds. It is affine in the
    factor on the law's demand, and each delay within a period is linearised: so all brackets are halved without a run.

    By runs: every member has a factor, or a delay, of its own in a lane; each run divides all brackets at once. From the same
    motion, turned by `tilt`, a loop settles if what its rates and commands swing shrinks from the second to the last
    third of the run. The error is not judged: a slow integral hides a small fast limit cycle in it.

    Where the answer changes more than once, the edge is one of them.

    Args:
        fleet: An Ensemble, or a Scene whose [ensemble] is meant; without waves and noise.
        loop: Key of the law, such as "heading_pid"; None, the default, for all laws together.
        of: "gain", "delay", or both, the default. A delay is that of all commands.
        by: "eigenvalues", the default, "runs", or both.
        about: Time after which the loop is looked at [s]; 60 by default.
        seconds: Length of the runs [s]; 240 by default.
        tilt: Angle by which they begin aside, about each axis of the body [rad]; 0.001 by default.
        most: Largest factor, and one over the least; 100 by default.
        longest: Longest delay that is added [s]; 10 by default.
        method: As of `lw.solve`; default that of the scene.
        h: Step [s]; default that of the scene.

    Returns:
        The margins of each member.

    Raises:
        SceneError: If an argument or the scene is at fault.
    """
    ensemble = ensemble_of(fleet)
    scene: Any = ensemble.scene
    of, by = (tuple(listed(key, each, "names")) for key, each in (("of", of), ("by", by)))
    faults = Faults()
    for word in of:
        faults.choice("of", word, OF)
    for word in by:
        faults.choice("by", word, WAYS)
    for name, value in {"about": about, "seconds": seconds, "longest": longest, "tilt": tilt}.items():
        faults.positive(name, value)
    faults.number("most", most, "", 1.0)
    if scene.controller is None:
        faults.add("fleet", "the scene", "has no controller", "give [controller]")
    elif loop is not None and loop not in (keys := [law.key for law in scene.controller.laws]):
        faults.add("loop", loop, "is no law of the controller", closest(loop, keys))
    elif not faults and seconds < LEAST_LOOKS * scene.controller.period:
        least = LEAST_LOOKS * scene.controller.period
        faults.add(
            "seconds", seconds, f"is less than {LEAST_LOOKS} looks", f"give {least:g} or more, to see an envelope"
        )
    faults.raise_if_any()
    calm(scene, "margins")
    if "eigenvalues" in by:
        check_parts(scene.controller, 'margins by="eigenvalues"')
    h = step_of(scene, h)
    study = Study(ensemble, loop, about, seconds, tilt, method, h)
    parts = []
    for first in range(0, ensemble.members, GROUP):
        places = np.arange(first, min(first + GROUP, ensemble.members))
        parts.append(_group(study.at(places), of, by, most, longest))
    steady = np.concatenate([part[0] for part in parts])
    values, by_runs = (
        {name: np.concatenate([part[i][name] for part in parts]) for name in parts[0][i]} for i in (1, 2)
    )
    return Margins(loop or "all laws", values, by_runs, steady, study.bench.plan.grid.h)


class Study:
    """Members whose factor and delay are their own.

    Args:
        fleet: the members.
        loop: key of the law; None for all laws.
        about: time after which loops are looked at [s].
        seconds: length of the runs [s].
        tilt: angle by which runs begin aside [rad].
        method: as of `lw.solve`.
        h: step [s].

    Attributes:
        bench: what makes the steps.
        begin: steps until loops are looked at.
        steps: steps of a run.
    """

    def __init__(
        self, fleet: Ensemble, loop: str | None, about: float, seconds: float, tilt: float, method: Any, h: float
    ):
        scene: Any = fleet.scene
        controller, period = scene.controller, float(scene.controller.period)
        # With some delay in the scene, commands may be delayed in any lane.
        laws = with_factor(controller.laws, loop)
        acted = replace(controller, laws=laws, delay=controller.delay if controller.delay > 0.0 else period)
        looks = [max(1, round(time / period)) for time in (about, seconds)]
        inside = fleet.in_scene(replace(scene, controller=acted, events=()), (FACTOR, DELAY))
        self.own_delay = "controller.delay" in fleet.varied_names
        self.fleet, self.tilt, self.nominal = fleet, tilt, float(controller.delay)
        self.bench = Bench(inside, method, h, sum(looks) * period, period, (*FIELDS, "command"))
        self.begin, self.steps = (count * self.bench.every for count in looks)
        actuators = controller.actuators.values()
        self.limits = np.concatenate([np.maximum(term.limit, 1e-12) for term in actuators])

    def at(self, places: np.ndarray) -> Loops:
        """The loops of some members.

        Args:
            places: (n,), which members.

        Returns:
            Their loops, at their steady motions.
        """
        return Loops(self, places)


class Loops:
    """Loops at their steady motions, to be asked whether they settle with other numbers.

    Args:
        study: the members.
        places: (n,), which of them.

    Attributes:
        delay: (n,), their own delays, in steps.
        motion: their motions after `study.begin` steps; NaN where a member failed.
    """

    def __init__(self, study: Study, places: np.ndarray):
        self.study, self.places, bench = study, places, study.bench
        n, h = len(places), bench.plan.grid.h
        delay = study.fleet.subset(places).parameters(0, n)[DELAY] if study.own_delay else study.nominal
        self.delay = np.broadcast_to(np.rint(np.asarray(delay) / h).astype(np.int64), (n,))
        numbers = {FACTOR: np.ones(n), DELAY: self.delay * h}
        self.motion: Motion = bench.run(places, None, 0, study.begin, numbers)

    def settle(self, factor: np.ndarray, steps: np.ndarray, some: np.ndarray) -> np.ndarray:
        """Whether loops settle, by a run.

        Args:
            factor: (m,), factors on the demand.
            steps: (m,), delays in steps.
            some: (m,), which of the members.

        Returns:
            (m,).
        """
        bench, k0, k1 = self.study.bench, self.study.begin, self.study.begin + self.study.steps
        m, third = len(some), self.study.steps // (3 * bench.every)
        numbers = {FACTOR: factor, DELAY: steps * bench.plan.grid.h}
        by = np.zeros((m, 12))
        by[:, 3:6] = self.study.tilt
        motion = delayed(bench, self.motion.of(some), k0, steps).moved(by)
        highest, lowest = np.full((3, m, 3 + len(self.study.limits)), -np.inf), None
        lowest = -highest
        first = bench.plan.due(k0, k0)[1]

        def watch(sample: int, values: Mapping[str, np.ndarray]) -> None:
            signals = np.concatenate([values["angular_velocity"], values["command"] / self.study.limits], axis=2)
            window = np.minimum((sample - first + np.arange(len(signals))) // max(1, third), 2)
            for w in np.unique(window):
                at = window == w
                highest[w] = np.fmax(highest[w], signals[at].max(axis=0))
                lowest[w] = np.fmin(lowest[w], signals[at].min(axis=0))

        after = bench.run(self.places[some], motion, k0, k1, numbers, watch)
        swing = highest - lowest
        well = np.isfinite(after.position).all(axis=1)
        for each in (swing[..., :3], swing[..., 3:]):
            size = np.linalg.norm(each, axis=2)
            well &= (size[2] < SHRINKS * size[1]) | (size[1] < SETTLED * size[0])
        return well


Group = tuple[np.ndarray, dict[str, np.ndarray], dict[str, np.ndarray]]


def _group(loops: Loops, of: Sequence[str], by: Sequence[str], most: float, longest: float) -> Group:
    """(whether each settles as it is, margins by eigenvalues, margins by runs)."""
    bench, n = loops.study.bench, len(loops.places)
    alive = np.isfinite(loops.motion.position).all(axis=1)
    every, unity, delays_now = np.flatnonzero(alive), np.ones(n), loops.delay
    h = bench.plan.grid.h
    last = np.minimum(round(longest / h), (MOST_PERIODS - 1) * bench.every - delays_now)
    answers: dict[str, dict[str, np.ndarray]] = {way: {} for way in WAYS}
    steady = alive.copy()
    ways: dict[str, Any] = {}
    if "eigenvalues" in by and len(every):
        sampled = SampledLoop(bench, loops.places[every], loops.motion.of(every), loops.study.begin)
        where = np.cumsum(alive) - 1
        ways["eigenvalues"] = lambda factor, steps, some: sampled.stable(factor, steps, where[some])
    if "runs" in by and len(every):
        ways["runs"] = loops.settle
    for holds in ways.values():
        steady[every] &= holds(unity[every], delays_now[every], every)
    for way, holds in ways.items():
        known = answers["eigenvalues"]
        start = np.where(steady, 1.0, np.nan)
        if "gain" in of:
            guesses = [known.get(name, np.full(n, np.nan)) for name in ("gain_lower", "gain_upper")]

            def factors(values: np.ndarray, both: np.ndarray, holds: Any = holds) -> np.ndarray:
                return np.asarray(holds(values, delays_now[both % n], both % n))

            ends = np.repeat((1.0 / most, most), n)
            brackets = edges(factors, np.tile(start, 2), ends, np.concatenate(guesses), NARROW[way])
            with np.errstate(invalid="ignore"):
                middle = np.sqrt(brackets[:, 0] * brackets[:, 1])
            answers[way]["gain_lower"], answers[way]["gain_upper"] = np.split(middle, 2)
        if "delay" in of:

            def delays(values: np.ndarray, some: np.ndarray, holds: Any = holds) -> np.ndarray:
                return np.asarray(holds(unity[some], delays_now[some] + values.astype(np.int64), some))

            guess = np.rint(known["delay"] / h) if "delay" in known else np.full(n, np.nan)
            brackets = edges(delays, start - 1.0, last.astype(float), guess, 1.0, whole=True)
            held = np.where(np.isinf(brackets[:, 1]), np.inf, brackets[:, 0])
            answers[way]["delay"] = np.where(steady, held * h, np.nan)
    if not ways:
        names = (("gain_lower", "gain_upper") if "gain" in of else ()) + (("delay",) if "delay" in of else ())
        answers = {way: {name: np.full(n, np.nan) for name in names} for way in by} | {
            w: {} for w in WAYS if w not in by
        }
    return steady, answers["eigenvalues"], answers["runs"]
