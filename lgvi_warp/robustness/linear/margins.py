# SPDX-License-Identifier: Apache-2.0
"""`margins`: gain, delay, phase and disk margins of each member's loop, by eigenvalues and by runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common.arguments import listed, names_of, whole_number
from lgvi_warp.common.errors import Faults, among, closest, refusal
from lgvi_warp.common.near import near_names
from lgvi_warp.common.summaries import few_digits, plural
from lgvi_warp.control.delay import MOST_PERIODS
from lgvi_warp.criteria.files import Saved
from lgvi_warp.criteria.running import step_of
from lgvi_warp.methods.method import Method
from lgvi_warp.robustness.linear.bench import COORDINATES, calm
from lgvi_warp.robustness.linear.disk import disks
from lgvi_warp.robustness.linear.edges import edges
from lgvi_warp.robustness.linear.linearize import (
    AS_LINEAR,
    OF_MEAN_ZERO,
    RANDOM,
    check_parts,
    chosen_places,
    of_the_mean,
)
from lgvi_warp.robustness.linear.loops import IDLE, LEAST_TICKS, UNSETTLED, Loops, Study
from lgvi_warp.robustness.linear.peaks import OF_THE_DEMAND, peaks
from lgvi_warp.robustness.linear.phase import phases
from lgvi_warp.robustness.linear.sampled_loop import SampledLoop
from lgvi_warp.runs.request import ensemble_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

OF, WAYS = ("gain", "delay", "phase", "disk", "peak"), ("eigenvalues", "runs")
# Those of a linear model alone.
LINEAR = ("phase", "disk", "peak")
# Members whose margins are sought together.
GROUP = 2048
# Width of the last brackets, in the logarithm of the factor: of eigenvalues, and of runs, which judge to some 0.4 %.
NARROW = {"eigenvalues": 1e-6, "runs": 2e-3}
PERCENTILES = (0.0, 5.0, 25.0, 50.0, 75.0, 95.0, 100.0)
UNITS = {"delay": "s", "phase": "rad", "frequency": "rad/s"}
GAINS = ("gain_lower", "gain_upper")
# Margins beside the gain in the words of the answer.
NAMED = {"delay": "{} more delay", "phase": "{} of phase", "disk": "a disk margin of {}"}
DISKS = ("disk", "disk_gain_lower", "disk_gain_upper", "disk_phase", "disk_frequency")
# Names of margins, by what is asked for.
NAMES = {"gain": GAINS, "delay": ("delay",), "phase": ("phase", "phase_frequency"), "disk": DISKS, "peak": ()}
# What is asked for, by the name of a margin.
WORD_OF = {name: word for word, each in NAMES.items() for name in each} | {
    f"{name}_peak": "peak" for name in OF_THE_DEMAND
}


def unit_of(name: str) -> str:
    """The unit of a margin; "" if it has none."""
    return UNITS.get(name, UNITS.get(name.rsplit("_", 1)[-1], ""))


def _named(key: str, name: str, columns: Mapping[str, Any]) -> Any:
    """Column with the name that the user gave."""
    if not among(name, columns):
        raise refusal(key, name, "is not known", closest(name, columns))
    return columns[name]


def _percentages(of: Any) -> np.ndarray:
    """Read percentages (k,)."""
    faults = Faults()
    found = [faults.number(f"of[{i}]", each, "%", 0.0, 100.0) for i, each in enumerate(listed("of", of, "percentages"))]
    faults.raise_if_any()
    return np.array(found, float)


@dataclass(frozen=True)
class Margins(Saved):
    """Margins of each member's loop.

    The margins of a member are NaN if its unchanged loop does not settle; `why` gives the reason.

    Attributes:
        loop: key of the law; "all laws" for the whole controller.
        values: margins from eigenvalues, name -> (n,). "gain_lower", "gain_upper": smallest and largest factor on the
            demand that the loop tolerates; 0 and infinite if it tolerates all tried factors. "delay": largest tolerated
            extra delay [s], in whole steps; infinite if it tolerates the longest tried delay. "phase",
            "phase_frequency": phase margin [rad] and its crossover frequency [rad/s]; infinite and NaN if no gain
            crosses 1. "disk": disk margin of all components of the demand at once; the factors ("disk_gain_lower",
            "disk_gain_upper") and phases ("disk_phase" [rad]) that it guarantees; its frequency ("disk_frequency"
            [rad/s]). "sensitivity_peak", "complementary_peak" and one for each number in `to`, such as
            "position[2]_peak": peak gains, with "..._frequency" [rad/s].
        by_runs: the same margins computed by runs, if requested.
        why: (n,), reason why a member has no margins: "does not settle"; "at its limit: thrusters[3]" if a command
            stays at its limit; "moves nothing" if the demand has no effect; or "failed". "" if the member has margins.
        step: step of the runs [s]; delays are multiples of this step.
        messages: notes for the user, such as that the step was shortened to fit the period.
        members: number of members, n.
        steady: True for members whose unchanged loop settles, (n,).
        reasons: number of members without margins, by reason.

    Methods:
        percentiles: Percentiles of each margin over the members that settle.
        curve: Cumulative distribution of a margin over the members.
        worst: Members with the smallest margins.
    """

    study: ClassVar[str] = "margins"

    loop: str
    values: Mapping[str, np.ndarray]
    by_runs: Mapping[str, np.ndarray]
    why: np.ndarray
    step: float
    messages: tuple[str, ...] = ()

    @property
    def steady(self) -> np.ndarray:
        """Mask of the members whose unchanged loop settles, (n,)."""
        return np.asarray(self.why == "")

    @property
    def reasons(self) -> dict[str, int]:
        """Number of members without margins, by reason."""
        return dict(Counter(each for each in self.why.tolist() if each).most_common())

    @property
    def members(self) -> int:
        """The number of members, n."""
        return len(self.why)

    def _content(self) -> dict[str, Any]:
        # Lists by name: None for NaN, "inf" for infinity.

        def plain(value: float) -> float | str | None:
            return value if np.isfinite(value) else None if np.isnan(value) else str(value)

        ways = {
            way: {name: [plain(v) for v in column.tolist()] for name, column in columns.items()}
            for way, columns in zip(WAYS, (self.values, self.by_runs), strict=True)
            if columns
        }
        return {"loop": self.loop, "step": self.step, "why": self.why.tolist(), "messages": list(self.messages), **ways}

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        values, by_runs = (
            {name: np.array([np.nan if v is None else float(v) for v in column]) for name, column in columns.items()}
            for columns in (content.get(way, {}) for way in WAYS)
        )
        why = np.array(content["why"], dtype=object)
        return cls(str(content["loop"]), values, by_runs, why, float(content["step"]), tuple(content["messages"]))

    def rows(self) -> Iterator[dict[str, Any]]:
        by_runs = {f"{name}_by_runs": column for name, column in self.by_runs.items()}
        for member, why in enumerate(self.why.tolist()):
            columns = {name: float(column[member]) for name, column in (*self.values.items(), *by_runs.items())}
            yield {"member": member, "why": why, **columns}

    def percentiles(self, of: Sequence[float] = PERCENTILES) -> dict[str, np.ndarray]:
        """Compute percentiles of the margins over the members whose unchanged loop settles.

        Args:
            of: percentages (k,), in [0, 100].

        Returns:
            Percentiles of each margin, name -> (k,). A percentile is one member's margin; NaN if no member has margins.
        """
        quantiles = _percentages(of) / 100.0
        known = {name: v[~np.isnan(v)] for name, v in self._columns().items()}
        return {
            name: np.quantile(v, quantiles, method="inverted_cdf") if len(v) else np.full(len(quantiles), np.nan)
            for name, v in known.items()
        }

    def curve(self, name: str, by: str | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Compute the cumulative distribution of a margin over the members, for a plot.

        Args:
            name: "gain_lower", "gain_upper", "delay", "disk" or another of `values`.
            by: "eigenvalues" or "runs"; None, the default: "eigenvalues" if these margins were computed, else "runs".

        Returns:
            (margins of the members whose unchanged loop settles, sorted; fraction of these members up to each margin).
        """
        ways = dict(zip(WAYS, (self.values, self.by_runs), strict=True))
        columns = self._columns() if by is None else _named("by", by, ways)
        values = np.sort(_named("name", name, columns)[self.steady])
        return values, np.arange(1, len(values) + 1) / max(1, len(values))

    def worst(self, count: int = 10, name: str | None = None) -> np.ndarray:
        """Find the members with the smallest margins.

        Args:
            count: number of members; 10 by default.
            name: name of the margin; None, the default, takes the first of "gain_upper", "delay", "phase", "disk" and
                "sensitivity_peak" that was computed. For "gain_lower" and for peaks, the largest value is the worst.

        Returns:
            Indices (count,), the worst first. Members whose unchanged loop does not settle come before all others.
        """
        columns = self._columns()
        chosen = name or next(word for word in ("gain_upper", *NAMED, "sensitivity_peak") if word in columns)
        values = _named("name", chosen, columns) * (-1.0 if chosen.endswith(("lower", "peak")) else 1.0)
        return np.argsort(np.where(self.steady, values, -np.inf), kind="stable")[: whole_number("count", count, 0)]

    @property
    def reasons_text(self) -> str:
        """Text of the reasons why members have no margins, the most frequent reason first."""
        return "; ".join(f"{count:,}: {why}" for why, count in self.reasons.items())

    def _columns(self) -> Mapping[str, np.ndarray]:
        return self.values or self.by_runs

    @property
    def answer(self) -> str:
        every, bad = plural(self.members, "member"), f" ({self.reasons_text})" if self.reasons else ""
        if not self.steady.any():
            return f"The loop of {self.loop} has no margins in any of {every}{bad}."
        texts = []
        worst = {name: np.fmax.reduce(v) if name.endswith(("lower", "peak")) else np.fmin.reduce(v)
                 for name, column in self._columns().items() for v in [column[self.steady]]}  # fmt: skip
        if "gain_upper" in worst:
            ends = (few_digits(worst[name], "", 4) for name in GAINS)
            texts.append("{} to {} times its gain".format(*ends))
        texts += [f.format(few_digits(worst[name], unit_of(name), 4)) for name, f in NAMED.items() if name in worst]
        if np.isfinite(worst.get("phase", np.nan)):
            where = self.values["phase_frequency"][np.nanargmin(self.values["phase"])]
            texts = [text.replace("of phase", f"of phase at {few_digits(where, 'rad/s', 4)}") for text in texts]
        texts = [text.replace("inf rad of phase", "any phase (its gain crosses 1 nowhere)") for text in texts]
        peaks = [f"{name} up to {few_digits(value, '', 4)}" for name, value in worst.items() if name.endswith("_peak")]
        said = [f"tolerates {' or '.join(texts)}"] * bool(texts) + [f"has {' and '.join(peaks)}"] * bool(peaks)
        good, some = int(self.steady.sum()), f"{int(self.steady.sum()):,} of {every}" if bad else every
        least = f"; member {self.worst(self.members)[self.members - good]} has the least margin" if good > 1 else ""
        taken = "".join(
            f", with {text.removeprefix(AS_LINEAR)}" for text in self.messages if text.startswith(AS_LINEAR)
        )
        return f"The loop of {self.loop} {' and '.join(said)} in {some}{bad}{taken}{least}."

    def _report(self) -> list[str]:
        lines = [f"{self.loop}: margins of {self.members} members"]
        if self.reasons:
            lines.append(f"{sum(self.reasons.values())} of them have none ({self.reasons_text}); the others:")
        width = max(22, *(len(f"{name} {unit_of(name)}") + 1 for name in self._columns()))
        lines.append(f"{'':{width}}" + "".join(f"{f'{p:g} %':>10}" for p in PERCENTILES))
        for name, row in self.percentiles().items():
            lines.append(f"{f'{name} {unit_of(name)}'.strip():{width}}" + "".join(f"{value:10.4g}" for value in row))
        return [*lines, *(text for text in self.messages if not text.startswith(AS_LINEAR))]


@near_names()
def margins(
    fleet: Ensemble | Scene,
    loop: str | None = None,
    of: Sequence[str] = ("gain", "delay"),
    *,
    by: Sequence[str] = ("eigenvalues",),
    about: float = 60.0,
    settle: float = 1200.0,
    seconds: float = 240.0,
    tilt: float = 1e-3,
    most: float = 100.0,
    longest: float = 10.0,
    skew: float = 0.0,
    to: Sequence[str] = (),
    method: str | Method | None = None,
    h: float | None = None,
) -> Margins:
    """Compute the gain, delay and phase margins of each member's loop.

    A member's loop is examined about its motion after `about` seconds. This motion must be steady: over one period,
    velocities, rates, the vertical, commands and quantities held at a set-point change by less than 1e-6, and no
    command is at its limit. While it is not steady, the time is doubled, up to `settle`. A run that starts from the
    motion, turned by `tilt`, must return to it. If one of these conditions fails, the member has no margins; see `why`.

    By eigenvalues: margins follow from the eigenvalues of the linearised sampled loop about that motion. The loop is
    affine in the factor on the law's demand, and each delay within a period is linearised, so bisection needs no runs.
    Neutral modes that no law observes are ignored.

    By runs: every member runs with its own factor or delay, and each run halves the brackets of all members' margins.
    The runs start from the same motion, turned by `tilt`. A loop settles if two conditions hold. The swing of its rates
    and commands shrinks from the second to the last third of the run, and is smaller than in the first third. In the
    last third no command is at its limit, the body stays within 10 `tilt` of the motion, and it turns by less than 10
    `tilt` within a period. If the swing shrinks only slightly, a run 1.5 times as long decides. Tracking errors are not
    examined: slow integral action hides small fast limit cycles. If the loop gains and loses stability several times as
    the factor or delay grows, the margin is at one of these changes.

    Noise and drift of sensors are set to 0, their mean; by eigenvalues, so is rounding. Faults are off; see `messages`.

    The phase margin is the smallest phase shift, lag or lead, of all components of the law's demand that makes the loop
    unstable. For one component it follows from the crossovers of the gain; for several, from the crossovers of the
    characteristic loci of the sampled loop (MacFarlane, Postlethwaite 1977, Int. J. Control 25(1)). The margin is
    infinite if no gain crosses 1 between 1e-5 of the Nyquist frequency and the Nyquist frequency.

    The disk margin is computed for the sampled loop, opened at all components of the law's demand. The loop remains
    stable if each component has its own complex factor, at any frequency, in the disk (1 + (1 - skew) d / 2) / (1 - (1
    + skew) d / 2), |d| < margin (Seiler, Packard, Gahinet 2020, IEEE Control Systems 40(5)). The margin is 1 / (largest
    structured singular value of S + (skew - 1) / 2), with the sensitivity S.

    A peak gain is the largest gain over frequency from a disturbance of the law's demand to an output. Outputs are the
    total demand (S, the sensitivity), the law's response (T), and the numbers of the motion in `to`. With several
    components the gain is the largest singular value, and the peak is the H-infinity norm. The peak is infinite if the
    gain grows towards frequency 0. The largest peak of all members is the ensemble's worst-case gain.

    Args:
        fleet: An Ensemble, or a Scene whose [ensemble] is used; without waves and noise.
        loop: Key of the law, such as "heading_pid"; None, the default, for all laws together.
        of: Some of "gain", "delay", "phase", "disk" and "peak"; "gain" and "delay" by default. "delay" delays all
            commands; "phase", "disk" and "peak" are computed by eigenvalues only.
        by: Ways to compute the margins: "eigenvalues", the default, "runs", or both.
        about: Time at which the loop is examined [s]; 60 by default.
        settle: Time by which a member must be steady [s]; 1200 by default.
        seconds: Length of the runs [s]; 240 by default.
        tilt: Angle by which the start of a run is turned about each axis of the body [rad]; 0.001 by default.
        most: Largest factor that is tried; the smallest factor tried is 1 / most. 100 by default.
        longest: Longest delay that is added [s]; 10 by default.
        skew: Skew of the disk, from -1 to 1. With 0, the default, the disk contains the inverse of each of its factors.
            With 1, the margin follows from the sensitivity S alone.
        to: Numbers of the motion for which peak gains are also computed, such as "position[2]" [m], "rotation[1]" [rad,
            body axes], "velocity" [m/s] or "angular_velocity" [rad/s], as in `linearize`; none by default.
        method: As in `lw.solve`; the scene's method by default.
        h: Step [s]; the scene's step by default.

    Returns:
        The margins of each member.

    Raises:
        SceneError: If an argument is wrong, or the scene does not allow margins.

    Examples:
        >>> import lgvi_warp as lw
        >>> law = lw.control.HeadingPID(kp=2.0, kd=4.0)
        >>> controller = lw.Controller(period=0.1, guidance=[lw.control.SetPoint(heading=0.0)], laws=[law])
        >>> vehicle = lw.Vehicle(50.0, inertia=[4.0, 5.0, 6.0], buoyancy=490.3325)
        >>> drag = lw.terms.Drag(linear=[20.0, 20.0, 20.0, 8.0, 8.0, 8.0])
        >>> scene = lw.Scene(vehicle, terms=[lw.terms.ControlWrench(), drag], controller=controller)
        >>> bearable = lw.linear.margins(lw.Ensemble(scene, 2), "heading_pid", method="rk4", h=0.02)
        >>> bearable.values["gain_upper"].round(1), bearable.values["delay"]
        (array([30., 30.]), array([6.62, 6.62]))
    """
    ensemble = ensemble_of(fleet)
    scene: Any = ensemble.scene
    of, by = tuple(names_of("of", of)), tuple(names_of("by", by))
    faults = Faults()
    for word in of:
        faults.choice("of", word, OF)
    for word in by:
        faults.choice("by", word, WAYS)
    for name, value in {"about": about, "settle": settle, "seconds": seconds, "longest": longest, "tilt": tilt}.items():
        faults.positive(name, value)
    faults.number("most", most, "", 1.0)
    faults.number("skew", skew, "", -1.0, 1.0)
    if set(LINEAR) & set(of) and "eigenvalues" not in by:
        problem = "has no phase and disk margins and no peaks, which are of a linear model"
        faults.add("by", by, problem, 'add "eigenvalues"')
    outputs = _outputs(faults, to, of)
    _check_loop(faults, scene.controller, loop, seconds)
    faults.raise_if_any()
    calm(scene, "margins")
    linear = "eigenvalues" in by
    scene, zeros, messages = of_the_mean(scene, OF_MEAN_ZERO if linear else RANDOM)
    check_parts(scene.controller, 'margins by="eigenvalues"' if linear else "margins", None if linear else RANDOM)
    for name in ensemble.varied_names.intersection(zeros):
        faults.add(name, "...", "varies, where margins take it as 0", "leave it out of what varies")
    faults.raise_if_any()
    ensemble = ensemble.in_scene(scene) if messages else ensemble
    study = Study(ensemble, loop, about, settle, seconds, tilt, method, step_of(scene, h))
    of_way = {"eigenvalues": of, "runs": [word for word in of if word not in LINEAR]}
    peak_names = [f"{name}_{of_peak}" for name in (*OF_THE_DEMAND, *outputs) for of_peak in ("peak", "frequency")]
    each_names = NAMES | {"peak": tuple(peak_names)}
    names = {way: [name for word in of_way[way] for name in each_names[word]] for way in by}
    n = ensemble.members
    answers: Answers = {way: {name: np.full(n, np.nan) for name in names.get(way, ())} for way in WAYS}
    why: np.ndarray = np.full(n, "", dtype=object)
    for first in range(0, n, GROUP):
        places = np.arange(first, min(first + GROUP, n))
        groups, why[places] = study.loops(places)
        for loops in groups:
            why[loops.places], of_loops = _group(loops, of, by, most, longest, skew, outputs)
            for way in by:
                for name, column in of_loops[way].items():
                    answers[way][name][loops.places] = column
    grid = study.bench.plan.grid
    return Margins(
        loop or "all laws", answers["eigenvalues"], answers["runs"], why, grid.h, (*grid.messages, *messages)
    )


def _check_loop(faults: Faults, controller: Any, loop: str | None, seconds: float) -> None:
    """Check that a controller has the law, and that a run has enough ticks."""
    if controller is None:
        faults.add("controller", None, "is not in the scene, and margins are those of a loop", "give [controller]")
    elif loop is not None and loop not in (keys := [law.key for law in controller.laws]):
        faults.add("loop", loop, "is not a law of the controller", closest(loop, keys))
    elif not faults and seconds < LEAST_TICKS * controller.period:
        least = LEAST_TICKS * controller.period
        faults.add(
            "seconds", seconds, f"is less than {LEAST_TICKS} ticks", f"give {least:g} or more, to see an envelope"
        )


def _outputs(faults: Faults, to: Any, of: Sequence[str]) -> dict[str, int]:
    """Indices in the motion of the numbers in `to`, by name."""
    places = chosen_places(faults, "to", listed("to", to, "names"), COORDINATES)
    if places and "peak" not in of:
        faults.add("to", to, "is asked without peaks", 'add "peak" to `of`')
    return {COORDINATES[i]: i for i in places}


# Margins (n,) by name, by way.
Answers = dict[str, dict[str, np.ndarray]]


def _group(
    loops: Loops,
    of: Sequence[str],
    by: Sequence[str],
    most: float,
    longest: float,
    skew: float,
    outputs: Mapping[str, int],
) -> tuple[np.ndarray, Answers]:
    """Reasons why loops have no margins (n,), and margins, by eigenvalues and by runs, by name."""
    bench, n, delays_now = loops.study.bench, len(loops.places), loops.delay
    every, unity, h = np.arange(n), np.ones(n), bench.plan.grid.h
    last = np.minimum(round(longest / h), (MOST_PERIODS - 1) * bench.every - delays_now)
    answers: Answers = {way: {} for way in WAYS}
    why: np.ndarray = np.where(loops.return_to_it(), "", UNSETTLED).astype(object)
    ways: dict[str, Any] = {"runs": loops.settle} if "runs" in by else {}
    if "eigenvalues" in by:
        apart = loops.study.components if set(LINEAR) & set(of) else ()
        sampled = SampledLoop(bench, loops.places, loops.motion, loops.begin, apart)
        ways = {"eigenvalues": sampled.stable} | ways
        why[(why == "") & ~sampled.moves] = IDLE
        why[(why == "") & ~sampled.stable(unity, delays_now, every)] = UNSETTLED
        if apart:
            answers["eigenvalues"] = _of_frequencies(
                sampled, delays_now, why == "", of, skew, loops.study.period, outputs
            )
    start = np.where(why == "", 1.0, np.nan)
    for way, holds in ways.items():
        known = answers["eigenvalues"]
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
            brackets = edges(delays, start - 1.0, last.astype(float), guess, 1.0, whole_numbers=True)
            held = np.where(np.isinf(brackets[:, 1]), np.inf, brackets[:, 0])
            answers[way]["delay"] = np.where(why == "", held * h, np.nan)
    return why, answers


def _of_frequencies(
    sampled: SampledLoop, delays: np.ndarray, settled: np.ndarray, of: Sequence[str], skew: float, period: float,
    outputs: Mapping[str, int],
) -> dict[str, np.ndarray]:  # fmt: skip
    """Phase margins, disk margins and peak gains, name -> (n,); delays in steps; NaN for loops that do not settle."""
    values: dict[str, np.ndarray] = {}
    for opened in sampled.opened(delays, np.flatnonzero(settled)):
        found = phases(sampled.observed(opened), period) if "phase" in of else {}
        found |= disks(opened, skew, period) if "disk" in of else {}
        found |= peaks(opened, list(outputs.values()), list(outputs), period) if "peak" in of else {}
        for name, column in found.items():
            values.setdefault(name, np.full(len(delays), np.nan))[opened.some] = column
    return values
