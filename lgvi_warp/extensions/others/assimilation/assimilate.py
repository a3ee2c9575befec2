# SPDX-License-Identifier: Apache-2.0
"""`assimilate`: members run from measurement to measurement, where a filter moves or reweights them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import Prepared, prepare
from lgvi_warp.common import summaries
from lgvi_warp.common.arguments import listed, names_of, whole_number
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.sentences import capital, sentences
from lgvi_warp.common.status import failed, stopped
from lgvi_warp.common.times import of_step, whole_steps
from lgvi_warp.criteria.running import step_of
from lgvi_warp.extensions.others.assimilation import filters
from lgvi_warp.extensions.others.assimilation.answer import Assimilated
from lgvi_warp.extensions.others.assimilation.coordinates import Coordinates
from lgvi_warp.extensions.others.assimilation.members import rows_of, states_of
from lgvi_warp.extensions.others.assimilation.series import Series
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.runs.request import ensemble_of
from lgvi_warp.sampling.final import Final
from lgvi_warp.scene import variations
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.variations import Target
from lgvi_warp.store.layout import units_of_numbers

METHODS = ("etkf", "enkf", "particles")
MOST_SEED = 2**63
# Particles are resampled where their effective number is below this part of them.
RESAMPLE_BELOW = 0.5
# Values farther from their predictions than this many standard deviations are left out: 6 of 10 million good ones.
GATE = 5.0
# Variance of what is known of an adaptive inflation before each measurement: a standard deviation of 0.6, as DART takes it.
INFLATION_VARIANCE = 0.36
# A larger part of the values of an instrument left out says that members, not values, are wrong.
MANY_LEFT_OUT = 0.1


@shows_progress
def assimilate(
    fleet: Scene | Ensemble,
    series: Series | Sequence[Series],
    learn: Sequence[str] = (),
    *,
    filter: str = "etkf",
    method: str | Method | None = None,
    h: float | None = None,
    dtype: str | None = None,
    seed: int = 0,
    discount: float | None = 0.99,
    gate: float | None = GATE,
    inflation: float | str = 1.0,
    threads: int | None = None,
    progress: Callable[[float], None] | bool | None = None,
) -> Assimilated:
    """Assimilate measurements: correct the members of a fleet by measured series, and estimate numbers of the scene.

    The members are the prior: the distribution of their initial states and numbers before the first measurement. They
    run to each time of the series, where a filter updates them by the measured values. The memory of actuators and
    controllers is not updated.

    The filter updates learned numbers in the normal scores of their distribution, z = Phi^-1(F(x)) (Bertino, Evensen &
    Wackernagel 2003). Every updated value is therefore a possible value of the distribution: a log-normal number stays
    positive, and a uniform number within its bounds. Numbers that were given to the members as arrays have no distribution.
    The filter updates their values, or the logarithms of their sizes if all have one sign and the scene refuses the other.

    Args:
        fleet: An Ensemble, or a Scene with its [ensemble], of tens to thousands of members.
        series: One or several lw.studies.Series, the measurements of the instruments.
        learn: Names of varied numbers to estimate, such as ["current.velocity[0]"]; by default none.
        filter: "etkf", the default, is an ensemble Kalman filter without random draws (Bishop, Etherton & Majumdar 2001).
            "enkf" perturbs the measurement for each member (Burgers, van Leeuwen & Evensen 1998). Neither is localised.
            Both suit spreads that are small enough for nearly linear motion. "particles" is a particle filter with
            systematic resampling (Kitagawa 1996), for any spread.
        method: As in `lw.solve`.
        h: Step [s], which divides every time of the series; by default the scene's step.
        dtype: As in `lw.solve`.
        seed: Seed of the filter's random draws.
        discount: With particles and learned numbers, these numbers and the states are redrawn at each resampling with
            unchanged mean and covariance (Liu & West 2001). Give a number between 1/3 and 1, or None for no redrawing; 0.99
            by default.
        gate: Largest accepted distance of a value from its prediction, in standard deviations of the innovation. Other values
            are left out, with a message. For several values of one instrument, a chi-square test of the same probability is
            used. None accepts all values; 5.0 by default.
        inflation: Factor on the covariance of the members before each measurement, at least 1 (default), for Kalman filters
            that become overconfident; or "adaptive" to estimate it from the innovations (Anderson 2009, Miyoshi 2011).
        threads: As in `lw.solve`.
        progress: As in `lw.solve`.

    Returns:
        The members after each time, with means, standard deviations and innovations.

    Raises:
        SceneError: If an argument is invalid, or if members fail under a Kalman filter.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> vary = {"start.velocity": lw.distributions.Normal(std=[0.2, 0.0, 0.0])}
        >>> fleet = lw.Ensemble(scene, members=50, seed=1, vary=vary)
        >>> fixes = lw.studies.Series("position", [1.0, 2.0], [[1.4, 0.0, 0.0], [2.8, 0.0, 0.0]], std=0.1)
        >>> followed = lw.assimilate(fleet, fixes, h=0.1)
        >>> followed.mean["position"].shape
        (2, 3)
    """
    faults, members = Faults(), ensemble_of(fleet)
    draws = np.random.default_rng(whole_number("seed", seed, 0, MOST_SEED))
    instruments = [series] if isinstance(series, Series) else listed("series", series, "lw.studies.Series")
    for one in instruments:
        if not isinstance(one, Series):
            faults.add("series", one, "is not a Series", "give lw.studies.Series(of, time, values, std)")
    labels = [one.label for one in instruments if isinstance(one, Series)]
    for label in sorted({label for label in labels if labels.count(label) > 1}):
        faults.add("series", label, "is measured by two of them", "give one of them a name: Series(..., name=...)")
    known = faults.choice("filter", filter, METHODS)
    kept = None if discount is None else faults.number("discount", discount)
    if kept is not None and not 1.0 / 3.0 < kept <= 1.0:
        faults.add("discount", discount, "is not between 1/3 and 1", "give 0.99, or None")
    bound = np.inf if gate is None else faults.positive("gate", gate, "standard deviations")
    factor = 1.0 if isinstance(inflation, str) else faults.number("inflation", inflation, least=1.0)
    if isinstance(inflation, str):
        faults.choice("inflation", inflation, ["adaptive"])
    if known and filter == "particles" and (factor != 1.0 or isinstance(inflation, str)):
        faults.add("inflation", inflation, "is of Kalman filters, and particles have weights", "leave it out")
    targets = _targets(faults, members, learn)
    faults.raise_if_any()
    if not instruments:
        faults.add("series", series, "names no instrument", "give lw.studies.Series(of, time, values, std)")
    if members.members < 2:
        faults.add("fleet", members.members, "is one member", "give an ensemble: its spread is what is not known")
    faults.raise_if_any()
    settings = dict(method=method, h=h, dtype=dtype, threads=threads)
    steps = _Steps(members.scene, settings, {})
    times = np.unique(np.concatenate([one.time for one in instruments]))
    _check_times(times, steps)
    assert bound is not None
    assert factor is not None
    track = _Track(members, instruments, targets, filter, draws, kept, bound, factor, inflation == "adaptive")
    report = callback(progress)
    for i, time in enumerate(times):
        track.run_to(float(time), steps)
        track.measure(float(time))
        if report is not None:
            report((i + 1) / len(times))
    return track.answer(times)


def _targets(faults: Faults, fleet: Ensemble, learn: Sequence[str]) -> list[Target]:
    """Learned quantities: numbers of the scene that vary."""
    targets, known, varied = list[Target](), fleet.scene.parameters(), fleet.varied_names
    if isinstance(learn, str):
        faults.add("learn", learn, "is not a list of names", f"give [{learn!r}]")
        return targets
    for name in names_of("learn", learn):
        (target,) = variations.targets(name)
        if target.name not in known:
            faults.choice("learn", target.name, known)
        elif target.name not in varied:
            faults.add("learn", name, "does not vary", "give it a distribution: what is known of it before")
        else:
            targets.append(target)
    variations.clashes(faults, [(target.label, (target,)) for target in targets])
    return targets


@dataclass
class _Steps:
    """Prepared runs of a scene, by their number of steps."""

    scene: Any
    settings: dict[str, Any]
    runs: dict[int, Prepared]

    @functools.cached_property
    def h(self) -> float:
        """The step [s]."""
        return step_of(self.scene, self.settings["h"])

    def run(self, seconds: float) -> Prepared:
        """The prepared run of a given length in seconds."""
        count = round(seconds / self.h)
        if count not in self.runs:
            save = SaveAt(fields=FIELDS, final=True)
            length = float(count * of_step(self.h))
            self.runs[count] = prepare(Ensemble(self.scene), t1=length, save=save, **self.settings)
        return self.runs[count]


def _check_times(times: np.ndarray, steps: _Steps) -> None:
    """Refuse times that are not a whole number of steps."""
    if times[0] <= 0.0:
        raise SceneError(
            ["series.time = 0 is where the members start. Give times after it, and what is known there as starts"]
        )
    for time in times:
        if whole_steps(float(time), steps.h) is None:
            near = round(float(time) / steps.h) * steps.h
            problem = f"is not a whole number of steps of {steps.h:g} s"
            raise SceneError(
                [sentences(f"series.time = {time:.9g}", problem, f"give {near:.9g}, or a step that divides all times")]
            )


@dataclass
class _Track:
    """The members during the assimilation, with the records after each measurement."""

    fleet: Ensemble
    instruments: Sequence[Series]
    targets: Sequence[Target]
    filter: str
    rng: np.random.Generator
    discount: float | None
    gate: float
    inflation: float
    adaptive: bool
    messages: list[str] = field(default_factory=list)
    notes: dict[str, list[Any]] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = self.fleet.members
        members = self.fleet.select(0, n)
        self.parameters = members.parameters
        self.log_weights, self.log_likelihood = np.zeros(n), 0.0
        if members.weight is not None and self.filter == "particles":
            with np.errstate(divide="ignore"):
                self.log_weights = np.log(members.weight)
        elif members.weight is not None:
            self.messages.append("members count alike, whatever weights the table gives them; particles have weights")
        self.indices, self.fresh = np.array(members.indices), int(np.max(members.indices)) + 1
        # Members of the beginning from which these come, and numbers that only copies of one member share.
        self.ancestors = self.copies = np.arange(n)
        self.time, self.effective, self.stopped = 0.0, float(n), 0
        self.states: dict[str, Any] = {name: np.array(getattr(members, name)) for name in FIELDS}
        self.coordinates = Coordinates(self.fleet, self.targets, members.parameters)
        self.learned = self.coordinates.at
        self._check_learned()
        self._next_inflation = self.inflation
        self.noisy = any(isinstance(term, NoisyTerm) for term in self.fleet.scene.terms)
        # Set by the first run.
        self.final: Final | None = None
        self.result: Any = None

    def _check_learned(self) -> None:
        """Refuse discrete numbers with a Kalman filter; add a message on numbers that are learned in addition."""
        if self.filter != "particles" and self.coordinates.separate.any():
            names = ", ".join(target.label for target in self.targets)
            problem = "has separate values, between which a Kalman filter cannot move it"
            raise SceneError([f"learn = {names}: one of them {problem}. Give filter='particles'"])
        if more := [target.label for target in self.coordinates.targets if target not in self.targets]:
            self.messages.append(
                f"{', '.join(more)} is learned too: one distribution draws it together with the others"
            )

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The learned numbers of the members by label, (n, ...)."""
        return self.coordinates.values(self.learned, self.parameters)

    def run_to(self, time: float, steps: _Steps) -> None:
        """Run the members to a time [s]."""
        run, noise = steps.run(time - self.time), dict[str, Any](indices=self.indices, seed=self.fleet.seed)
        if self.final is None:
            varied = {name: values for name, values in self.parameters.items() if len(values) > 1}
            result = run.states(**self.states, parameters=varied or None, **noise)
        else:
            try:
                result = run.states(self.final, parameters=self.columns or None, **noise)
            except SceneError as fault:
                problem = f"at {self.time:g} s the filter moved what it learns to where the scene refuses it"
                remedy = "vary it by a distribution without such values, as lw.distributions.LogNormal(sigma=...)"
                raise SceneError([f"learn: {problem} ({fault.faults[0]}). {capital(remedy)}"]) from None
        self.result, self.final, self.time = result, result.final, time
        self.states = {name: np.asarray(result.samples[name][-1], np.float64) for name in FIELDS}
        self.provenance = result.provenance
        ended = failed(np.asarray(result.status))
        self.stopped = max(self.stopped, int(stopped(np.asarray(result.status)).sum()))
        if ended.any() and self.filter != "particles":
            problem = f"{int(ended.sum())} of {len(ended)} members failed before {time:g} s"
            raise SceneError(
                [
                    sentences(
                        "fleet",
                        f"{problem}, and a Kalman filter needs all",
                        "give a shorter step, or filter='particles'",
                    )
                ]
            )
        self.log_weights = np.where(ended, -np.inf, self.log_weights)

    def measure(self, time: float) -> None:
        """Update the members by the measurements at a time [s], and record the result."""
        if self.inflation > 1.0:
            self._inflate()
        w = filters.normalised(self.log_weights)
        if self.filter == "particles":
            self.effective = filters.effective_number(w, self.copies)
        predicted, measured, std, now = [], [], [], self._members_now()
        for one in self.instruments:
            values = one.at(time)
            note = np.full((3, one.values.shape[1]), np.nan)
            rows = self.notes.setdefault(f"innovation {one.label}", [])
            if values is None or not np.isfinite(values).any():
                rows.append((*note, False))
                continue
            numbers = one.quantity.values(now).T
            if len(numbers) != len(values):
                problem = f"has {len(numbers)} numbers, and {len(values)} were measured"
                raise SceneError([sentences(f"series.of = {one.label!r}", problem, "give a column for each")])
            there = np.isfinite(values)
            Y, y, sigma = one.near(values, numbers)[there], values[there], one.std[there]
            w_there = np.where(np.isfinite(Y).all(axis=0), w, 0.0)
            if w_there.sum() <= 0.0 or (self.filter != "particles" and (w_there == 0.0).any()):
                missing = int((w_there == 0.0).sum())
                problem = f"{missing} of {len(w)} members predict no number of it at {time:g} s"
                raise SceneError([sentences(f"series = {one.label!r}", problem, "leave that time out, or give NaN")])
            apart, S = filters.innovation(Y, y, sigma, w_there / w_there.sum())
            z, total, _ = filters.whitened(apart, S)
            note[:, there] = apart, np.sqrt(np.diag(S)), z
            left_out = total > self._bound(len(z))
            rows.append((*note, left_out))
            if not left_out:
                predicted.append(Y)
                measured.append(y)
                std.append(sigma)
        if predicted:
            (self._weigh if self.filter == "particles" else self._move)(
                *map(np.concatenate, (predicted, measured, std))
            )
        self._note()

    def _bound(self, count: int) -> float:
        """The sum of squares of `count` standard normal numbers that is as improbable as one number beyond the gate."""
        from scipy.stats import chi2, norm

        return float(chi2.isf(2.0 * norm.sf(self.gate), count))

    def _take(self, ensemble: np.ndarray, centre: np.ndarray) -> None:
        """Set states and learned numbers."""
        self.states, self.learned = states_of(ensemble, centre)
        assert self.final is not None
        self.final = self.final.changed(**self.states)

    def _inflate(self) -> None:
        """Move members away from their mean by the inflation."""
        n = self.fleet.members
        ensemble, centre = rows_of(self.states, self.learned, np.full(n, 1.0 / n))
        mean = ensemble.mean(axis=1, keepdims=True)
        self._take(mean + np.sqrt(self.inflation) * (ensemble - mean), centre)

    def _move(self, Y: np.ndarray, y: np.ndarray, sigma: np.ndarray) -> None:
        """Kalman update of states and learned numbers."""
        w = np.full(self.fleet.members, 1.0 / self.fleet.members)
        self.log_likelihood += filters.whitened(*filters.innovation(Y, y, sigma, w))[2]
        ensemble, centre = rows_of(self.states, self.learned, w)
        moved = (
            filters.etkf(ensemble, Y, y, sigma)
            if self.filter == "etkf"
            else filters.enkf(ensemble, Y, y, sigma, self.rng)
        )
        self._take(moved, centre)
        if self.adaptive:
            self._next_inflation = filters.estimated_inflation(self.inflation, Y, y, sigma, INFLATION_VARIANCE)

    def _weigh(self, Y: np.ndarray, y: np.ndarray, sigma: np.ndarray) -> None:
        """Update the weights by the likelihood; resample the members if their effective number is small."""
        with np.errstate(divide="ignore"):
            before = np.log(filters.normalised(self.log_weights))
        self.log_weights = before + filters.log_likelihood(Y, y, sigma)
        if not np.isfinite(self.log_weights).any():
            problem = f"no member is near what was measured at {self.time:g} s"
            raise SceneError([sentences("series", problem, "give more members, a wider spread, or larger std")])
        self.log_likelihood += float(np.logaddexp.reduce(self.log_weights))
        weights, n = filters.normalised(self.log_weights), self.fleet.members
        self.effective = filters.effective_number(weights, self.copies)
        if filters.effective_number(weights, np.arange(n)) >= RESAMPLE_BELOW * n:
            return
        places = filters.resampled(weights, self.rng)
        self.states = {name: values[places] for name, values in self.states.items()}
        self.learned = self.learned[:, places]
        assert self.final is not None
        self.final = self.final.part(places)
        self.parameters = {name: rows[places] if len(rows) > 1 else rows for name, rows in self.parameters.items()}
        if len(self.learned) and self.discount is not None:
            self._jitter(self.discount)
        self.ancestors, self.copies = self.ancestors[places], self.copies[places]
        if self.noisy:
            self.copies = np.arange(n)
        elif self.discount is not None and self._all_learned():
            self.copies = np.unique(self.learned, axis=1, return_inverse=True)[1].ravel()
        # Copies part ways: each has noise of its own from here on.
        copies = np.concatenate([[False], places[1:] == places[:-1]])
        self.indices = self.indices[places]
        self.indices[copies] = self.fresh + np.arange(int(copies.sum()))
        self.fresh += int(copies.sum())
        self.log_weights = np.zeros(n)

    def _jitter(self, discount: float) -> None:
        """Redraw states and learned numbers, within groups of members with the same discrete values."""
        n = self.fleet.members
        ensemble, centre = rows_of(self.states, self.learned, np.full(n, 1.0 / n))
        moving = np.concatenate([np.full(len(ensemble) - len(self.learned), True), ~self.coordinates.separate])
        groups = self.coordinates.groups(self.learned)
        for group in range(int(groups.max()) + 1):
            at = np.ix_(moving, groups == group)
            if at[1].size > 1:
                ensemble[at] = filters.jittered(ensemble[at], discount, self.rng)
        self._take(ensemble, centre)

    def _all_learned(self) -> bool:
        """Whether members differ only in states and learned numbers, which are redrawn."""
        learned, shapes = self.coordinates.targets, self.coordinates.shapes
        drawn = [each for law in self.fleet.variations for each in law.targets if each.name in shapes]
        covered = all(any(t.name == each.name and t.index in (None, each.index) for t in learned) for each in drawn)
        names = {name for name in self.fleet.varied_names if name in shapes}
        return covered and bool(learned) and names <= {target.name for target in learned}

    def _members_now(self) -> Any:
        """The members' present states, as a result that quantities can read."""
        samples = {name: values[None] for name, values in self.states.items()}
        return replace(self.result, samples={**self.result.samples, **samples}, time=self.result.time[-1:])

    def _note(self) -> None:
        """Record means and standard deviations."""
        w = filters.normalised(self.log_weights)
        live = w > 0.0
        w = w[live]
        numbers = [values[live].reshape(len(w), -1).T for values in self.columns.values()]
        states = {name: values[live] for name, values in self.states.items()}
        ensemble, centre = rows_of(states, np.concatenate([np.empty((0, len(w))), *numbers]), w)
        mean = ensemble @ w
        std = np.sqrt(np.maximum((ensemble - mean[:, None]) ** 2 @ w, 0.0))
        ancestors = len(np.unique(self.ancestors[live]))
        noted = dict(mean=mean, std=std, centre=centre, effective=self.effective, ancestors=ancestors)
        for name, value in {**noted, "inflation": self.inflation}.items():
            self.notes.setdefault(name, []).append(value)
        self.inflation = self._next_inflation

    def answer(self, times: np.ndarray) -> Assimilated:
        """The result after all measurements."""
        mean, std = np.array(self.notes["mean"]), np.array(self.notes["std"])
        states = {name: slice(3 * i, 3 * i + 3) for i, name in enumerate(("position", "velocity", "angular_velocity"))}
        means: dict[str, np.ndarray] = {name: mean[:, at] for name, at in states.items()}
        stds: dict[str, np.ndarray] = {name: std[:, at] for name, at in states.items()}
        means["attitude"], stds["attitude"] = np.array(self.notes["centre"]), std[:, 9:12]
        first = 12
        for name, values in self.columns.items():
            at, shape = slice(first, first + values[0].size), values.shape[1:]
            means[name], stds[name] = (rows[:, at].reshape(len(times), *shape) for rows in (mean, std))
            first = at.stop
        rows = {one.label: self.notes[f"innovation {one.label}"] for one in self.instruments}
        innovations, deviations, whitened, left_out = (
            {name: np.array([row[part] for row in each]) for name, each in rows.items()} for part in range(4)
        )
        assert self.final is not None
        found = Assimilated(
            time=times,
            mean=means,
            std=stds,
            innovations=innovations,
            innovation_std=deviations,
            whitened=whitened,
            left_out=left_out,
            log_likelihood=self.log_likelihood,
            inflation=np.array(self.notes["inflation"]),
            effective=np.array(self.notes["effective"]),
            ancestors=np.array(self.notes["ancestors"]),
            final=self.final,
            parameters=self.columns,
            weights=filters.normalised(self.log_weights),
            method=self.filter,
            messages=(),
            provenance=self.provenance,
            units=units_of_numbers(self.fleet.scene, self.columns),
        )
        return replace(found, messages=tuple(self.messages + self._remarks() + _doubts(found)))

    def _remarks(self) -> list[str]:
        """Remarks on the filter for the user."""
        remarks = []
        if self.filter == "particles" and not self.noisy and not (self.targets and self.discount):
            remarks.append(
                "copies of a particle stay copies: nothing is drawn on the way. Add noise, or learn a number"
            )
        if self.stopped:
            problem = (
                f"an event of the scene stopped {self.stopped} of {self.fleet.members} members, which go no further"
            )
            remarks.append(f"{problem}. Leave the event out, or narrow what is known before")
        worst = min(self.notes["effective"])
        if self.filter == "particles" and worst < 20.0:
            remarks.append(f"at one time {worst:.1f} members had all the weight: give more members or larger std")
        return remarks


def _doubts(finding: Assimilated) -> list[str]:
    """Messages on values left out by the gate, and on innovations that fail their tests."""
    doubts = []
    for name, test in finding.consistency().items():
        out = finding.left_out[name]
        if out.any():
            measured = int((out | np.isfinite(finding.innovations[name]).any(axis=1)).sum())
            when = summaries.listed(f"{time:g}" for time in finding.time[out])
            text = f"the gate left out {int(out.sum())} of {measured} measurements of {name}, at {when} s"
            many = out.sum() > max(1.0, MANY_LEFT_OUT * measured)
            so_many = (
                "so many say that the members are too sure: widen what is known before, or give noise or inflation; "
            )
            doubts.append(f"{text}; {so_many if many else ''}gate=None takes all")
        if test.verdict not in ("consistent", "nothing to compare"):
            remedy = "the scene lacks something, or std is wrong; consistency() has the numbers"
            doubts.append(f"innovations of {name} are {test.verdict}: {remedy}")
    return doubts
