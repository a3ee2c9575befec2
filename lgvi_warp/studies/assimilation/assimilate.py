# SPDX-License-Identifier: Apache-2.0
"""`assimilate`: members run from measurement to measurement, and a filter moves or weighs them at each."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import Prepared, prepare
from lgvi_warp.common.arguments import listed, names_of, whole_number
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.status import failed, stopped
from lgvi_warp.common.times import of_step, whole_steps
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
from lgvi_warp.studies.assimilation import filters
from lgvi_warp.studies.assimilation.answer import Assimilated
from lgvi_warp.studies.assimilation.members import as_columns, learned_rows, rows_of, states_of
from lgvi_warp.studies.assimilation.series import Series
from lgvi_warp.studies.linear.trim import step_of

METHODS = ("etkf", "enkf", "particles")
MOST_SEED = 2**63
# Particles are resampled where their effective number is below this part of them.
RESAMPLE_BELOW = 0.5


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
    discount: float | None = 0.98,
    threads: int | None = None,
    progress: Callable[[float], None] | bool | None = None,
) -> Assimilated:
    """Let the members of a fleet follow what was measured, and learn numbers of the scene on the way.

    The members are the knowledge before the first measurement: their starts and numbers vary as far as these are not known.
    They run to each time of the series, and a filter brings them to the values measured there. What actuators and controllers
    remember goes on as it is.

    Args:
        fleet: An Ensemble, or a Scene with its [ensemble]; of tens to thousands of members.
        series: One or several lw.studies.Series, what instruments measured.
        learn: Names of numbers that vary and are learned, such as ["current.velocity[0]"]; default none.
        filter: "etkf", the default, an ensemble Kalman filter without draws (Bishop, Etherton & Majumdar 2001); "enkf", with a
            measurement for each member (Burgers, van Leeuwen & Evensen 1998); both without localisation, for spreads that are
            small beside the bends of the motion; "particles", weights and systematic resampling (Kitagawa 1996), for any.
        method: As of `lw.solve`.
        h: Step [s], which divides every time of the series; default that of the scene.
        dtype: As of `lw.solve`.
        seed: Seed of what the filter draws.
        discount: With particles, learned numbers are drawn anew at each resampling, with their mean and spread (Liu & West
            2001); a number between 1/3 and 1, or None to keep them.
        threads: As of `lw.solve`.
        progress: As of `lw.solve`.

    Returns:
        The members after each time, with means, standard deviations and innovations.

    Raises:
        SceneError: If an argument is at fault, or if members fail under a Kalman filter.

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
            faults.add("series", one, "is no Series", "give lw.studies.Series(of, time, values, std)")
    labels = [one.label for one in instruments if isinstance(one, Series)]
    for label in sorted({label for label in labels if labels.count(label) > 1}):
        faults.add("series", label, "is measured by two of them", "give one of them a name: Series(..., name=...)")
    faults.choice("filter", filter, METHODS)
    kept = None if discount is None else faults.number("discount", discount)
    if kept is not None and not 1.0 / 3.0 < kept <= 1.0:
        faults.add("discount", discount, "is not between 1/3 and 1", "give 0.98, or None")
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
    track = _Track(members, instruments, targets, filter, draws, kept)
    report = callback(progress)
    for i, time in enumerate(times):
        track.run_to(float(time), steps)
        track.measure(float(time))
        if report is not None:
            report((i + 1) / len(times))
    return track.answer(times)


def _targets(faults: Faults, fleet: Ensemble, learn: Sequence[str]) -> list[Target]:
    """What is learned: numbers of the scene that vary."""
    targets, known, varied = list[Target](), fleet.scene.parameters(), fleet.varied_names
    if isinstance(learn, str):
        faults.add("learn", learn, "is no list of names", f"give [{learn!r}]")
        return targets
    for name in names_of("learn", learn):
        (target,) = variations.targets(name)
        if target.name not in known:
            faults.choice("learn", target.name, known)
        elif target.name not in varied:
            faults.add("learn", name, "does not vary", "give it a distribution: what is known of it before")
        else:
            targets.append(target)
    return targets


@dataclass
class _Steps:
    """Prepared runs of a scene by their number of steps."""

    scene: Any
    settings: dict[str, Any]
    runs: dict[int, Prepared]

    @functools.cached_property
    def h(self) -> float:
        """The step [s]."""
        return step_of(self.scene, self.settings["h"])

    def run(self, seconds: float) -> Prepared:
        """The run of so many seconds."""
        count = round(seconds / self.h)
        if count not in self.runs:
            save = SaveAt(fields=FIELDS, final=True)
            length = float(count * of_step(self.h))
            self.runs[count] = prepare(Ensemble(self.scene), t1=length, save=save, **self.settings)
        return self.runs[count]


def _check_times(times: np.ndarray, steps: _Steps) -> None:
    """Refuse times that are no whole number of steps."""
    if times[0] <= 0.0:
        raise SceneError(
            ["series.time = 0: is where the members start; give times after it, and what is known there as starts"]
        )
    for time in times:
        if whole_steps(float(time), steps.h) is None:
            near = round(float(time) / steps.h) * steps.h
            problem = f"is no whole number of steps of {steps.h:g} s"
            raise SceneError(
                [f"series.time = {time:.9g}: {problem}; give {near:.9g}, or a step that divides all times"]
            )


@dataclass
class _Track:
    """Members on their way, with what is noted after each measurement."""

    fleet: Ensemble
    instruments: Sequence[Series]
    targets: Sequence[Target]
    filter: str
    rng: np.random.Generator
    discount: float | None
    messages: list[str] = field(default_factory=list)
    notes: dict[str, list[Any]] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = self.fleet.members
        members = self.fleet.select(0, n)
        self.parameters = members.parameters
        self.log_weights = np.zeros(n)
        self.indices, self.fresh = np.array(members.indices), int(np.max(members.indices)) + 1
        self.time, self.effective, self.stopped = 0.0, float(n), 0
        self.states: dict[str, Any] = {name: np.array(getattr(members, name)) for name in FIELDS}
        self.learned = learned_rows(self.targets, members.parameters, n)
        # Set by the first run.
        self.final: Final | None = None
        self.result: Any = None

    def run_to(self, time: float, steps: _Steps) -> None:
        """Run the members to a time [s]."""
        run = steps.run(time - self.time)
        columns = as_columns(self.targets, self.learned, self.parameters)
        if self.final is None:
            varied = {name: values for name, values in self.parameters.items() if len(values) > 1}
            numbers = _merged(varied, columns) or None
            result = run.states(**self.states, parameters=numbers, indices=self.indices, seed=self.fleet.seed)
        else:
            result = run.states(self.final, parameters=columns or None, indices=self.indices, seed=self.fleet.seed)
        self.result, self.final, self.time = result, result.final, time
        self.states = {name: np.asarray(result.samples[name][-1], np.float64) for name in FIELDS}
        self.provenance = result.provenance
        ended = failed(np.asarray(result.status))
        self.stopped = max(self.stopped, int(stopped(np.asarray(result.status)).sum()))
        if ended.any() and self.filter != "particles":
            problem = f"{int(ended.sum())} of {len(ended)} members failed before {time:g} s"
            raise SceneError(
                [f"fleet: {problem}, and a Kalman filter needs all; give a shorter step, or filter='particles'"]
            )
        self.log_weights = np.where(ended, -np.inf, self.log_weights)

    def measure(self, time: float) -> None:
        """Bring the members to what was measured at a time [s], and note what that made of them."""
        predicted, measured, std, now = [], [], [], self._members_now()
        for one in self.instruments:
            values = one.at(time)
            if values is None:
                self._note_innovation(one, None, None)
                continue
            numbers = one.quantity.values(now).T
            if len(numbers) != len(values):
                problem = f"has {len(numbers)} numbers, and {len(values)} were measured"
                raise SceneError([f"series.of = {one.label!r}: {problem}; give a column for each"])
            numbers = one.near(values, numbers)
            self._note_innovation(one, values, numbers)
            there = np.isfinite(values)
            predicted.append(numbers[there])
            measured.append(values[there])
            std.append(one.std[there])
        Y, y, sigma = np.concatenate(predicted), np.concatenate(measured), np.concatenate(std)
        if len(y):
            (self._weigh if self.filter == "particles" else self._move)(Y, y, sigma)
        self._note()

    def _move(self, Y: np.ndarray, y: np.ndarray, sigma: np.ndarray) -> None:
        """Kalman's update of states and learned numbers."""
        n = self.fleet.members
        ensemble, centre = rows_of(self.states, self.learned, np.full(n, 1.0 / n))
        moved = (
            filters.etkf(ensemble, Y, y, sigma)
            if self.filter == "etkf"
            else filters.enkf(ensemble, Y, y, sigma, self.rng)
        )
        self.states, self.learned = states_of(moved, centre)
        assert self.final is not None
        self.final = self.final.changed(**self.states)

    def _weigh(self, Y: np.ndarray, y: np.ndarray, sigma: np.ndarray) -> None:
        """Weights by likelihood; members are drawn anew where few of them count."""
        self.log_weights = self.log_weights + filters.log_likelihood(Y, y, sigma)
        if not np.isfinite(self.log_weights).any():
            problem = f"no member is near what was measured at {self.time:g} s"
            raise SceneError([f"series: {problem}; give more members, a wider spread, or larger std"])
        weights, n = filters.normalised(self.log_weights), self.fleet.members
        effective = filters.effective_number(weights)
        self.effective = effective
        if effective >= RESAMPLE_BELOW * n:
            return
        places = filters.resampled(weights, self.rng)
        self.states = {name: values[places] for name, values in self.states.items()}
        self.learned = self.learned[:, places]
        if len(self.learned) and self.discount is not None:
            self.learned = filters.jittered(self.learned, self.discount, self.rng)
        assert self.final is not None
        self.final = self.final.part(places)
        self.parameters = {name: rows[places] if len(rows) > 1 else rows for name, rows in self.parameters.items()}
        # Copies part ways: each has noise of its own from here on.
        copies = np.concatenate([[False], places[1:] == places[:-1]])
        self.indices = self.indices[places]
        self.indices[copies] = self.fresh + np.arange(int(copies.sum()))
        self.fresh += int(copies.sum())
        self.log_weights = np.zeros(n)

    def _members_now(self) -> Any:
        """The members where they are now, as a result that quantities read."""
        samples = {name: values[None] for name, values in self.states.items()}
        return replace(self.result, samples={**self.result.samples, **samples}, time=self.result.time[-1:])

    def _note_innovation(self, one: Series, values: np.ndarray | None, predicted: np.ndarray | None) -> None:
        rows = self.notes.setdefault(f"innovation {one.label}", [])
        if values is None or predicted is None:
            rows.append((np.full(one.values.shape[1], np.nan),) * 2)
            return
        w = filters.normalised(self.log_weights)
        mean = predicted @ w
        rows.append((values - mean, np.sqrt((predicted - mean[:, None]) ** 2 @ w + one.std**2)))

    def _note(self) -> None:
        """Note means and standard deviations."""
        w = filters.normalised(self.log_weights)
        ensemble, centre = rows_of(self.states, self.learned, w)
        mean = ensemble @ w
        std = np.sqrt(np.maximum((ensemble - mean[:, None]) ** 2 @ w, 0.0))
        self.notes.setdefault("mean", []).append(mean)
        self.notes.setdefault("std", []).append(std)
        self.notes.setdefault("centre", []).append(centre)
        self.notes.setdefault("effective", []).append(self.effective)

    def answer(self, times: np.ndarray) -> Assimilated:
        """The answer, once all measurements are in."""
        mean, std = np.array(self.notes["mean"]), np.array(self.notes["std"])
        states = {name: slice(3 * i, 3 * i + 3) for i, name in enumerate(("position", "velocity", "angular_velocity"))}
        means: dict[str, np.ndarray] = {name: mean[:, at] for name, at in states.items()}
        stds: dict[str, np.ndarray] = {name: std[:, at] for name, at in states.items()}
        means["attitude"], stds["attitude"] = np.array(self.notes["centre"]), std[:, 9:12]
        for name, at, shape in self._learned_places():
            means[name], stds[name] = (rows[:, at].reshape(len(times), *shape) for rows in (mean, std))
        rows = {one.label: self.notes[f"innovation {one.label}"] for one in self.instruments}
        assert self.final is not None
        return Assimilated(
            time=times,
            mean=means,
            std=stds,
            innovations={name: np.array([row[0] for row in each]) for name, each in rows.items()},
            innovation_std={name: np.array([row[1] for row in each]) for name, each in rows.items()},
            effective=np.array(self.notes["effective"]),
            final=self.final,
            parameters=as_columns(self.targets, self.learned, self.parameters),
            weights=filters.normalised(self.log_weights),
            method=self.filter,
            messages=tuple(self.messages + self._remarks()),
            provenance=self.provenance,
        )

    def _learned_places(self) -> list[tuple[str, slice, tuple[int, ...]]]:
        """Name, rows and shape of each number that is learned."""
        places, first = [], 12
        for target in self.targets:
            shape = np.shape(target.of(self.parameters[target.name][0]))
            count = int(np.prod(shape, dtype=int))
            places.append((target.label, slice(first, first + count), shape))
            first += count
        return places

    def _remarks(self) -> list[str]:
        """What the user should know of the filter."""
        remarks, noisy = [], any(isinstance(term, NoisyTerm) for term in self.fleet.scene.terms)
        if self.filter == "particles" and not noisy and not (self.targets and self.discount):
            remarks.append(
                "copies of a particle stay copies: nothing is drawn on the way; add noise, or learn a number"
            )
        if self.stopped:
            problem = (
                f"an event of the scene stopped {self.stopped} of {self.fleet.members} members, which go no further"
            )
            remarks.append(f"{problem}; leave the event out, or narrow what is known before")
        worst = min(self.notes["effective"])
        if self.filter == "particles" and worst < 20.0:
            remarks.append(f"at one time {worst:.1f} members had all the weight: give more members or larger std")
        return remarks


def _merged(varied: Mapping[str, np.ndarray], columns: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers of members by name, with the columns put into them."""
    numbers: dict[str, Any] = {name: np.array(values) for name, values in varied.items()}
    for label, column in columns.items():
        (target,) = variations.targets(label)
        variations.put(numbers, target, np.asarray(column, np.float64), into=target.index is not None)
    return numbers
