# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy of every method, step, precision and solver, measured on a sample of an ensemble."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import listed
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.sentences import capital
from lgvi_warp.common.summaries import few_digits
from lgvi_warp.criteria.files import Saved, finite_or_none, with_missing_as
from lgvi_warp.measuring import comparison, cost
from lgvi_warp.measuring.budget import Budget
from lgvi_warp.measuring.comparison import Candidate, Sample
from lgvi_warp.measuring.distance import QUANTITIES, Distance, compared_in
from lgvi_warp.measuring.reference import LOST, Growth, Reference, make_reference, measured_growth, time_over
from lgvi_warp.measuring.speed import void
from lgvi_warp.measuring.trials import TRUST, Trial, trials_of, tried
from lgvi_warp.methods.method import COMPOSITIONS, PROGRAMS, Method
from lgvi_warp.physics import energy as invariants
from lgvi_warp.results.result import Result
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

# Tried in this order; those that a scene refuses are left out.
CANDIDATES = ("kl8(psi_x)", "psi_x", "psi_s", "su4(psi_x)", "kl6(psi_x)", "rk8", "su8_15(psi_x)", "ss6_13(psi_x)",
              "rkn6_11", "rkn6_14", "bm6(psi_x)", "bm4(psi_x)", "rk5", "rk5_ck", "rk4", "rkw3", "psi_1", "psi", "psi_w",
              "kl8(psi_s)", "kl6(psi_s)", "su4(psi_s)", "phi")  # fmt: skip
# Part of a trade-off's time that its reference gets.
SHARE = 0.3
# How errors of members are reduced to a number.
KINDS = ("end_max", "end_rms", "path_max", "path_rms")


@dataclass(frozen=True)
class Measurement:
    """Cost and errors of one setting.

    Attributes:
        setting: method, step, precision and solver.
        us_per_vehicle_second: microseconds of one core per vehicle and simulated second, without compiling.
        compile_seconds: time to compile or load the setting's kernel, spent once per process [s].
        errors: quantity -> {"end_max": ..., "end_rms": ..., "path_max": ..., "path_rms": ...}, as in `error`, in the
            units of Tradeoff.units; empty if a member failed or the errors of members cannot be measured.
        energy_drift: largest |E(t) - E(0)| [J]; NaN if a force of the scene supplies or removes energy.
        biases: statistic, such as "position_mean" -> its difference from the reference's statistic, in standard errors.
        order: order of the method.
        trusted: quantity -> True if the setting's error is at least ten times the error of the reference.
        cost_spread: median of several readings of the cost, divided by the smallest reading. The smallest is the cost.
    """

    setting: Candidate
    us_per_vehicle_second: float
    compile_seconds: float
    errors: dict[str, dict[str, float]]
    energy_drift: float
    biases: dict[str, float]
    order: int
    trusted: dict[str, bool]
    cost_spread: float = 1.0

    def error(self, of: str = "position", kind: str = "path_max") -> float:
        """Return one error of this setting.

        Args:
            of: name of the quantity. Default "position".
            kind: "end_max" or "end_rms": maximum or root mean square of the members' errors at the end; "path_max" or
                "path_rms": the same over the members and all times. Default "path_max".

        Returns:
            The error, in the unit of the quantity; infinite if it was not measured.
        """
        return self.errors.get(of, {}).get(kind, math.inf)


@dataclass(frozen=True, eq=False)
class Tradeoff(Saved):
    """Trade-off of cost and error: measurements of settings on a sample of an ensemble, from time 0 to t1.

    Attributes:
        measurements: one measurement for each setting that ran and did not fail.
        of: name of the quantity whose error decides up to which time the reference is trusted.
        members: size of the sample.
        t1: end time [s]; biases are measured up to t1.
        until: time up to which the reference is trusted [s]; errors of members are measured up to this time.
        reference: description of the accurate runs from which errors are measured.
        reference_error: quantity -> the reference's own largest error up to `until`; empty if errors are not measured.
        growth: growth of small differences between two starts; None if errors are not measured.
        refused: method -> reason why it cannot run the scene.
        messages: notes for the user.
        seconds: duration of the measurement [s].
        units: quantity -> unit of its errors.
        missing: method that the user named -> reason why it has no measurement.
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
    missing: dict[str, str] = field(default_factory=dict)
    study: ClassVar[str] = "tradeoff"

    @property
    def answer(self) -> str:
        front, count = self.front(), len(self.measurements)
        if not count:
            return f"No setting of a method has a measurement up to {self.t1:g} s."
        if not front:
            why = (
                f"the reference is too inaccurate for their errors in {self.of}"
                if self.reference_error
                else "noise acts"
            )
            return f"No setting of {count} is the most accurate: {why}."
        if len(front) == 1:
            return f"For {self.of} {self._text(front[0])} is the cheapest and the most accurate setting of {count}."
        between = f"; {len(front) - 2} of {count} lie between" if len(front) > 2 else ""
        return (
            f"For {self.of} the cheapest is {self._text(front[0])}, the most accurate {self._text(front[-1])}{between}."
        )

    def _text(self, measured: Measurement) -> str:
        """Text of a setting with its error and its cost."""
        s, unit = measured.setting, self.units[self.of]
        error, price = few_digits(measured.error(self.of), unit, 2), measured.us_per_vehicle_second
        return f"{s.text} at {s.h:.4g} s ({error}, {price:.3g} us/vehicle/s)"

    def _report(self) -> list[str]:
        return report_lines(self)

    def shown(self, of: str | None = None, kind: str = "path_max") -> list[Measurement]:
        """List the measurements whose error the reference can resolve, the cheapest first.

        Args:
            of: name of the quantity. Default: the `of` of the trade-off.
            kind: "end_max", "end_rms", "path_max" or "path_rms", as in `Measurement.error`. Default "path_max".

        Returns:
            Measurements in order of rising cost.

        Raises:
            SceneError: if the trade-off has no errors of this quantity or kind.
        """
        of, faults = self.of if of is None else of, Faults()
        faults.choice("of", of, (self.of, *self.units))
        faults.choice("kind", kind, KINDS)
        faults.raise_if_any()
        good = [entry for entry in self.measurements if np.isfinite(entry.error(of, kind)) and entry.trusted.get(of)]
        return sorted(good, key=lambda measurement: measurement.us_per_vehicle_second)

    def front(self, of: str | None = None, kind: str = "path_max") -> list[Measurement]:
        """List the measurements on the Pareto front: each is more accurate than all cheaper measurements.

        Args:
            of: name of the quantity. Default: the `of` of the trade-off.
            kind: "end_max", "end_rms", "path_max" or "path_rms", as in `Measurement.error`. Default "path_max".

        Returns:
            Measurements in order of rising cost and falling error.
        """
        front: list[Measurement] = []
        for measurement in self.shown(of, kind):
            if not front or measurement.error(of or self.of, kind) < front[-1].error(of or self.of, kind):
                front.append(measurement)
        return front

    def _content(self) -> dict[str, Any]:
        return finite_or_none(asdict(self) | {"front": [asdict(measurement.setting) for measurement in self.front()]})

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Tradeoff:
        # Errors and times that were not finite were infinite, other numbers NaN.
        growth = content["growth"]
        if growth is not None:
            times = {name: with_missing_as(growth[name], math.inf) for name in ("doubling", "predictable")}
            curves = {name: np.array(with_missing_as(growth[name], math.nan)) for name in ("times", "curve")}
            growth = Growth(**growth | times | curves | {"rate": with_missing_as(growth["rate"], math.nan)})
        measured = tuple(_measurement(row) for row in content["measurements"])
        values = {name: entry for name, entry in content.items() if name != "front"}
        values |= {"measurements": measured, "growth": growth, "messages": tuple(content["messages"])}
        return cls(**values | {"reference_error": with_missing_as(content["reference_error"], math.inf)})

    def rows(self) -> list[dict[str, Any]]:
        on_front = {measurement.setting for measurement in self.front()}
        rows = []
        for measurement in self.measurements:
            row: dict[str, Any] = asdict(measurement.setting)
            row |= {"order": measurement.order, "front": measurement.setting in on_front}
            row |= {"us_per_vehicle_second": measurement.us_per_vehicle_second, "cost_spread": measurement.cost_spread}
            row |= {"compile_seconds": measurement.compile_seconds}
            for of in self.units:
                row |= {f"{of}_{kind}": measurement.error(of, kind) for kind in KINDS}
                row[f"{of}_trusted"] = measurement.trusted.get(of, False)
            row["energy_drift"] = measurement.energy_drift
            rows.append(row | {f"bias_{name}": value for name, value in measurement.biases.items()})
        return rows


def _measurement(row: dict[str, Any]) -> Measurement:
    numbers = {name: with_missing_as(row[name], math.nan) for name in ("energy_drift", "biases")}
    errors = with_missing_as(row["errors"], math.inf)
    return Measurement(**row | numbers | {"setting": Candidate(**row["setting"]), "errors": errors})


def chosen_methods(methods: Sequence[str] | None, default: Sequence[str] = CANDIDATES) -> tuple[str, ...]:
    """The names of the methods to try: those given, if all are known, or the default ones."""
    if methods is None:
        return tuple(default)
    faults, names = Faults(), listed("methods", methods, "methods")
    for name in names:
        try:
            Method(name)
        except SceneError:
            some = ", ".join((*PROGRAMS, *(f"{composition}(psi_s)" for composition in COMPOSITIONS)))
            faults.add("methods", name, "is not known", f"known: {some}")
    if not names:
        faults.add("methods", methods, "is empty", "name one method or more, or leave it out")
    faults.raise_if_any()
    return tuple(names)


@shows_progress
def tradeoff(
    fleet: Ensemble | Scene,
    t1: float | None = None,
    of: Any = "position",
    methods: Sequence[str] | None = None,
    members: int = 128,
    seconds: float = 45.0,
    progress: Callable[[float], None] | bool | None = None,
) -> Tradeoff:
    """Measure cost and error of methods, steps, precisions and solvers on the first members of a fleet.

    The cost of a step is the smallest of several readings of its thread's CPU time; all steps of a method share this
    cost. A message reports readings that disagree. Errors are differences from one of two fine runs, which agree to a
    tenth of the smallest error shown. If noise acts, all runs share one noise path, drawn at the scene's noise_step or,
    without a noise_step, at a shorter interval than any step tried. If no path can be shared, or the path is too rough
    for errors of members, only statistics are compared, with the statistics of the finest run.

    Args:
        fleet: the ensemble, or a Scene with one.
        t1: end time [s]. Default: run.duration of the scene.
        of: quantity whose error decides whether the reference is accepted: a name that statistics accept ("position",
            "attitude", "depth", "position[2]", "speed", "euler", ...), or a lw.statistics.Quantity. Errors of position,
            attitude, velocity, angular_velocity and energy are always measured. Default "position".
        methods: names of the methods to try. `missing` of the result lists named methods without a measurement.
            Default: all methods that can run the scene.
        members: number of members in the sample. Default 128.
        seconds: processor time to spend [s]; compiling kernels may take as long again. Every method first runs at one
            coarse step size; then its step sizes are halved in turn. The messages list what is left out. Default 45.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the completed fraction, from 0 to 1.

    Returns:
        Measurements of every setting, with their Pareto front.

    Raises:
        SceneError: if arguments are faulty (one message lists all faults), or if no reference can be found.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> found = lw.tradeoff(fleet, t1=1.0, methods=["rk4"], members=2, seconds=2.0)
        >>> found.front()[0].setting.method
        'rk4'
    """
    compared = compared_in(of)
    faults = Faults()
    faults.positive("seconds", seconds)
    faults.raise_if_any()
    names = chosen_methods(methods)
    sample = Sample(fleet, t1, members)
    return tradeoff_on(sample, compared, names, seconds, callback(progress) or void, methods is not None)


def tradeoff_on(
    sample: Sample, compared: Distance, names: Sequence[str], seconds: float, report: Callable[[float], None],
    named: bool, *, make_reference: Callable[..., Reference] = make_reference,
    grown: Callable[..., Growth] | None = None,
) -> Tradeoff:  # fmt: skip
    """Measure methods on a sample, as `tradeoff` says; named: True if the user named them."""
    begun, whole = time.perf_counter(), Budget(seconds)
    taken, refused = sample.accepted(names)
    if not taken:
        raise SceneError([f"method {name}: {why}" for name, why in refused.items()])
    messages: list[str] = []
    reference: Reference | None = None
    until, growth, noise = len(sample.times) - 1, None, sample.noise(taken[0])
    if noise == "free":
        messages.append("noise acts, whose path differs from step to step: only statistics are compared")
        finest = tried(sample, sample.candidate(taken[0], 32 * sample.coarsest(0.5)), None).result
    else:
        reference = make_reference(sample, compared, seconds=SHARE * seconds, report=lambda part: report(0.2 * part))
        sample, finest = reference.sample, reference.result
        if noise == "grid":
            messages.append(noise_text(sample))
    if reference and noise == "grid" and reaches_nothing(reference, compared):
        apart = reference.error(compared.name)
        messages.append(f"{reference.text} differ by {apart:.1e}: only statistics are compared")
        reference = None
    if reference:
        until = trusted_until(reference, compared, seconds)
        growth = (grown or growth_of)(sample, taken, reference)
        if until < len(sample.times) - 1:
            text = f"errors of single members are up to {sample.times[until]:g} s, where the reference still agrees"
            messages.append(f"{text} with itself; beyond it only statistics are meaningful")
    budget = Budget(0.6 * seconds)
    trials, skipped = trials_of(
        sample, taken, reference, until, budget, whole, lambda part: report(0.2 + 0.6 * part), named
    )
    if skipped:
        messages.append(
            f"no time for {', '.join(skipped)}: run again, the kernels are compiled now, or give more seconds"
        )
    measured = measurements(sample, trials, reference, finest, until, compared)
    doubt = cost.disagreement([(measurement.setting.text, measurement.cost_spread) for measurement in measured])
    messages += [doubt] if doubt else []
    report(1.0)
    return Tradeoff(
        measurements=tuple(measured),
        of=compared.name,
        members=sample.members,
        t1=sample.t1,
        until=float(sample.times[until]),
        reference=reference.text if reference else "the finest run's statistics, since noise acts",
        reference_error={name: reference.error(name, until) for name in reference.own} if reference else {},
        growth=growth,
        refused=refused,
        messages=tuple(messages),
        seconds=time.perf_counter() - begun,
        units=QUANTITIES | {compared.name: compared.unit},
        missing=without_reading(names, trials, measured, refused, seconds) if named else {},
    )


def without_reading(
    names: Sequence[str], trials: Sequence[Trial], measured: Sequence[Measurement], refused: dict[str, str],
    seconds: float,
) -> dict[str, str]:  # fmt: skip
    """The methods that the user named but that have no measurement, and the reasons."""

    def why(name: str) -> str:
        least = min(trial.candidate.h for trial in trials if trial.candidate.method == name)
        return (
            f"members failed at every step down to {least:.4g} s; for shorter ones give more seconds than {seconds:g}"
        )

    missing = set(names) - {measurement.setting.method for measurement in measured}
    return {name: refused.get(name) or why(name) for name in names if name in missing}


def growth_of(
    sample: Sample, taken: Sequence[str], reference: Reference, *, measure: Callable[..., Growth] = measured_growth
) -> Growth:
    """Measure the growth of errors by the method of highest order, at about the reference's step."""
    method = max(taken, key=lambda name: Method(name).order)
    often = sample if sample.draws else Sample(sample.whole, sample.t1, sample.members, kernels=sample.kernels)
    m = max(1, round(float(often.spacing) / reference.result.provenance["step"]))
    return measure(often, often.candidate(method, m))


def noise_text(sample: Sample) -> str:
    """Sentence on how the runs of a comparison share their noise."""
    every = f"{sample.h(sample.draws):.4g} s"
    return f"noise acts: all runs see one path of it, drawn every {every}; errors by paths are of order 1"


def reaches_nothing(reference: Reference, of: Distance) -> bool:
    """True if a reference is too rough for errors of members even at the first time."""
    return reference.reaches(of.name, LOST / (TRUST * TRUST)) < 1


def trusted_until(reference: Reference, of: Distance, seconds: float) -> int:
    """Index of the last sample at which errors below 1e-2 can be measured; SceneError if there is none.

    seconds: time budget of the whole trade-off, for the message [s].
    """
    until = reference.reaches(of.name, LOST / (TRUST * TRUST))
    if reaches_nothing(reference, of):
        apart = reference.own[of.name][1]
        end = reference.result.time[1]
        problem = f"no reference: {reference.text} differ by {apart:.2g} {of.unit} after {end:g} s"
        if reference.more:
            cause, remedy = time_over(seconds, reference.more, SHARE)
            raise SceneError([f"{cause}. {capital(remedy)}. There is {problem}. Or give a shorter t1 (--duration)"])
        raise SceneError([f"{problem}, and agree no better with shorter steps. Give a shorter t1 (--duration)"])
    return until


def measurements(
    sample: Sample, trials: Sequence[Trial], reference: Reference | None, finest: Result, until: int,
    distance: Distance | None = None,
) -> list[Measurement]:  # fmt: skip
    """Cost, errors, drifts and biases of the trials that did not fail. Without a reference there are no errors."""
    good = [trial for trial in trials if not comparison.failed(trial.result) and (trial.errors or reference is None)]
    compiled: dict[tuple[str, str], float] = {}
    for trial in trials:
        key = trial.candidate.name, trial.candidate.dtype
        compiled[key] = max(compiled.get(key, 0.0), trial.result.compile_seconds)
    measured = []
    for trial, price in zip(good, sample.kernels.costs([trial.plan for trial in good]), strict=True):
        limits = {of: reference.error(of, until) for of in trial.errors} if reference else {}
        with np.errstate(all="ignore"):
            biases = comparison.biases(trial.result, finest, distance)
            kept = "energy" in invariants.conserved(trial.result)
            drift = invariants.drift(trial.result)["energy"] if kept else math.nan
        measured.append(
            Measurement(
                setting=trial.candidate,
                us_per_vehicle_second=price.us_per_vehicle_second,
                cost_spread=price.spread,
                compile_seconds=compiled[trial.candidate.name, trial.candidate.dtype],
                errors=trial.errors,
                energy_drift=drift,
                biases=biases,
                order=trial.plan.method.order,
                trusted={of: trial.errors[of]["path_max"] >= TRUST * limit for of, limit in limits.items()},
            )
        )
    return measured


def report_lines(tradeoff: Tradeoff) -> list[str]:
    """Report of the trade-off as lines of text."""
    unit = tradeoff.units[tradeoff.of]
    lines = [f"missing     {name}: {why}" for name, why in tradeoff.missing.items()]
    lines += [f"note        {message}" for message in tradeoff.messages]
    lines.append(f"sample      {tradeoff.members} members, 0 to {tradeoff.t1:g} s, {len(tradeoff.measurements)} settings in "
                 f"{tradeoff.seconds:.0f} s")  # fmt: skip
    if tradeoff.reference_error:
        apart = tradeoff.reference_error[tradeoff.of]
        lines.append(f"reference   {tradeoff.reference}: they agree to {apart:.1e} {unit} up to {tradeoff.until:g} s")
    if tradeoff.growth:
        lines.append(f"predictable {growth_text(tradeoff.growth)}")
    if tradeoff.refused:
        lines.append(f"refused     {', '.join(tradeoff.refused)} (why: tradeoff.json)")
    if tradeoff.measurements:
        spreads = [measurement.cost_spread for measurement in tradeoff.measurements]
        lines.append(f"costs       {cost.agreement_text(spreads)}")
    front = tradeoff.front()
    kept = any(np.isfinite(measurement.energy_drift) for measurement in front)
    if front:
        header = ("us/vehicle/s", "method", "precision", "step [s]", f"{tradeoff.of} [{unit}]", "rms")
        heads = "{:>12}  {:<18}{:<20}{:>10}{:>15}{:>10}".format(*header)
        without = f"; nothing of {', '.join(tradeoff.missing)}" if tradeoff.missing else ""
        lines += ["", f"Cheapest settings for each error ({tradeoff.of}, largest over members and path{without}):",
                  heads + ("{:>18}".format("energy drift [J]") if kept else "")]  # fmt: skip
    for measurement in front:
        s = measurement.setting
        lines.append(f"{measurement.us_per_vehicle_second:>12.3g}  {s.name:<18}{s.dtype:<20}{s.h:>10.4g}"
                     f"{measurement.error(tradeoff.of):>15.1e}{measurement.error(tradeoff.of, 'path_rms'):>10.1e}"
                     + (f"{measurement.energy_drift:>18.1e}" if kept else ""))  # fmt: skip
    return [*lines, *bias_lines(tradeoff)]


def growth_text(growth: Growth) -> str:
    """Sentence on the growth of errors."""
    if not np.isfinite(growth.rate):
        return "unknown: a difference of 1e-8 rad grows beyond measure at once"
    if growth.power is not None:
        return (f"errors grow like time to the power {growth.power:.1f}, {growth.factor:.2g} times in this run: single "
                "trajectories are meaningful throughout")  # fmt: skip
    until = ", ".join(f"{dtype} to about {t:.3g} s" for dtype, t in growth.predictable.items())
    return (f"errors double every {growth.doubling:.3g} s (rate {growth.rate:.2g} /s, {growth.factor:.2g} times in this run). "
            f"One round-off reaches {LOST:g}: {until}; beyond, compare statistics only")  # fmt: skip


def bias_lines(tradeoff: Tradeoff) -> list[str]:
    """A table of the statistics' biases against the step.

    The table is for one method in float64 with the default solver: the first method whose order is 2 or nearest to 2.
    """
    double = [entry for entry in tradeoff.measurements
              if entry.biases and entry.setting.dtype == "float64" and entry.setting.plain]  # fmt: skip
    if not double:
        return []
    name = min(double, key=lambda measurement: abs(measurement.order - 2)).setting.name
    chosen = [measurement for measurement in double if measurement.setting.name == name]
    chosen.sort(key=lambda measurement: -measurement.setting.h)
    means = ("attitude", "velocity", "energy", "angular_momentum")
    columns = ["position_mean", "position_std", *(f"{name}_mean" for name in means)]
    heads = [column.replace("angular_momentum", "ang.mom.").replace("_", " ") for column in columns]
    if tradeoff.of not in QUANTITIES and any(f"{tradeoff.of}_mean" in measurement.biases for measurement in chosen):
        columns, heads = [f"{tradeoff.of}_mean", *columns], [f"{tradeoff.of} mean", *heads]
    title = f"Bias of statistics up to {tradeoff.t1:g} s by {name}, in standard errors of {tradeoff.members} members"
    lines = ["", f"{title} (1.4: chance):", "{:>12}".format("step [s]") + "".join(f"{head:>15}" for head in heads)]
    for measurement in chosen:
        cells = (f"{measurement.biases[key]:>15.1e}" if key in measurement.biases else f"{'-':>15}" for key in columns)
        lines.append(f"{measurement.setting.h:>12.4g}" + "".join(cells))
    return lines
