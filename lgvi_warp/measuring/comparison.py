# SPDX-License-Identifier: Apache-2.0
"""Runs of a sample of an ensemble with different settings, and differences of their members and statistics."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, cast

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.status import failed as failed_members
from lgvi_warp.common.status import stop_time
from lgvi_warp.common.times import exact, whole_steps
from lgvi_warp.engine.plan import Plan, choose_plan
from lgvi_warp.measuring.distance import QUANTITIES, Distance
from lgvi_warp.measuring.kernels import KERNELS, Kernels
from lgvi_warp.methods import saveat
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.results.result import Result
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

# Number of times that runs are compared at.
SAMPLES = 20


@dataclass(frozen=True)
class Candidate:
    """Setting of a run: method, step, precision and solver.

    Attributes:
        method: name of the method.
        h: step [s].
        dtype: precision, such as "float64" or "float32".
        solver: solver of equation (24), docs/theory/rotation.md: "quartic", "cayley", "newton" or "moser_veselov".
        iterations: number of the solver's Newton steps; None: the solver iterates until its tolerance is met.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.studies.Candidate("rk4", 0.1).options()
        {'method': 'rk4', 'h': 0.1, 'dtype': 'float64'}
    """

    method: str
    h: float
    dtype: str = "float64"
    solver: str = "quartic"
    iterations: int | None = None

    @property
    def plain(self) -> bool:
        """True if the solver of equation (24) is the default one."""
        return (self.solver, self.iterations) == ("quartic", None)

    @property
    def name(self) -> str:
        """Text with the method and the solver, without the step and the precision."""
        if self.plain:
            return self.method
        return f"{self.method} {self.solver}" + ("" if self.iterations is None else f" {self.iterations}")

    @property
    def text(self) -> str:
        """Text with the method, the solver and the precision, without the step."""
        return f"{self.name} {self.dtype}"

    def options(self) -> dict[str, Any]:
        """Convert the setting to arguments of `lw.solve`.

        Returns:
            method, h [s] and dtype, for `lw.solve(fleet, **options)`.
        """
        method: Any = self.method if self.plain else self.resolved()
        return {"method": method, "h": self.h, "dtype": self.dtype}

    def resolved(self) -> Method:
        """Build the method with its solver.

        Returns:
            The method, for the argument `method` of `lw.solve`.

        Raises:
            SceneError: if the method or the solver does not exist.
        """
        return Method(self.method, self.solver, self.iterations)


class Sample:
    """The first members of an ensemble from 0 to t1, compared at times that all steps reach exactly.

    Steps are spacing / m for whole m. The spacing is run.save_every of the scene if it divides t1, else t1 / samples.
    If noise is drawn on a grid, m divides the number of draws in the spacing, so that all runs share one noise path.

    samples: maximum number of sample times after 0.
    kernels: object that compiles and runs plans and measures their cost.
    whole, ensemble: the fleet, and the members of the sample.
    spacing: a Fraction [s].
    index, times: the times as multiples of the spacing (k,), and in seconds (k,) [s].
    rate: largest angular rate at the start, at least one turn in t1 [rad/s].
    draws: number of noise draws in the spacing; 0 if runs draw once per step.
    fixed_draws: largest number of draws that the noise_steps of the scene allow; 0 if no term has a noise_step.
    """

    def __init__(
        self, fleet: Ensemble | Scene, t1: float | None = None, members: int = 128, samples: int = SAMPLES, *,
        kernels: Kernels = KERNELS,
    ):  # fmt: skip
        ensemble = fleet if isinstance(fleet, Ensemble) else Ensemble.from_scene(fleet)
        settings = ensemble.scene.run
        t1 = settings.duration if t1 is None else t1
        faults = Faults()
        if t1 is None:
            faults.add("t1", t1, "is missing", "give the end in seconds: t1=150.0 or [run] duration")
        else:
            faults.positive("t1", t1)
        if ensemble.weights(0, 1) is not None:
            problem = "has members with weights, and errors are compared over members that count alike"
            faults.add("fleet", ensemble.sampling.kind, problem, "leave the weights out")
        faults.raise_if_any()
        assert t1 is not None
        self.whole, self.t1, self.samples, self.kernels = ensemble, float(t1), samples, kernels
        self.ensemble = ensemble if ensemble.members <= members else ensemble.subset(range(members))
        self._drawn_once_a_step = self.ensemble
        self.members = self.ensemble.members
        end = exact(self.t1)
        every = settings.save_every
        count = samples if every is None or every > self.t1 else whole_steps(self.t1, every) or samples
        self.spacing = end / count
        self.index = np.unique(np.linspace(0, count, min(count, samples) + 1).round().astype(np.int64))
        self.times = np.array([float(int(i) * self.spacing) for i in self.index])
        start = self.ensemble.select(0, self.members)
        self.rate = float(max(np.nanmax(np.linalg.norm(start.angular_velocity, axis=1)), 2.0 * math.pi / self.t1))
        self.draws, self.fixed_draws = 0, self._fixed_draws()

    def more(self, members: int, times: int = 1) -> Sample:
        """The same sample with more members, and with `times` times as many sample times."""
        return Sample(self.whole, self.t1, members, self.samples * times, kernels=self.kernels)

    def on_grid(self, draws: int) -> Sample:
        """The same sample with noise on a grid that all its runs share."""
        sample = copy.copy(self)
        sample.draws = draws
        sample.ensemble = drawn_every(self._drawn_once_a_step, self.h(draws))
        return sample

    def _fixed_draws(self) -> int:
        """Largest number of draws in the spacing that fits every noise_step of the scene; 0 if no term has one."""
        faults, counts = Faults(), [0]
        for term in self.ensemble.scene.terms:
            if isinstance(term, NoisyTerm) and term.noise_step is not None:
                count = whole_steps(float(self.spacing), float(term.noise_step))
                if not count:
                    problem = f"does not divide the {float(self.spacing):g} s between the times of the comparison"
                    remedy = "give run.save_every a multiple of it"
                    faults.add(f"{term.key}.noise_step", term.noise_step, problem, remedy)
                counts.append(count or 0)
        faults.raise_if_any()
        return math.gcd(*counts)

    def allowed(self, m: int) -> int:
        """The next number of steps, m or larger, that noise on a grid allows."""
        if not self.draws:
            return m
        return next((count for count in saveat.divisors(self.draws) if count >= m), self.draws)

    def coarsest(self, angle: float) -> int:
        """The smallest number of steps at which no member turns by more than `angle` per step at the start [rad]."""
        return self.allowed(max(1, math.ceil(float(self.spacing) * self.rate / angle)))

    def h(self, m: int) -> float:
        """The step spacing / m [s]."""
        return float(self.spacing / m)

    def candidate(self, method: str, m: int, dtype: str = "float64", solver: Any = ("quartic", None)) -> Candidate:
        """Build a setting with the step spacing / m; solver: (name, iterations)."""
        return Candidate(method, self.h(m), dtype, *solver)

    def plan(self, candidate: Candidate, ensemble: Ensemble | None = None) -> Plan:
        """Make the plan of a run at the sample's times."""
        m = round(float(self.spacing / Fraction(candidate.h)))
        grid = TimeGrid(candidate.h, self.index * m, self.times)
        return choose_plan(ensemble or self.ensemble, candidate.resolved(), grid, FIELDS, candidate.dtype)

    def plan_to_price(self, candidate: Candidate) -> Plan:
        """Make the plan of a setting as it runs outside the comparison, to measure its cost."""
        sample = self.on_grid(round(float(self.spacing) / candidate.h)) if self.draws else self
        return sample.plan(candidate)

    def run(self, candidate: Candidate, ensemble: Ensemble | None = None) -> Result:
        """Run a setting."""
        return self.kernels.run(self.plan(candidate, ensemble))

    def accepted(
        self, methods: Sequence[str], dtype: str = "float64", most: int | None = None
    ) -> tuple[list[str], dict[str, str]]:
        """Sort methods into those that can run the scene, at most `most`, and those that cannot: name -> reason."""
        good, refused, tableaux = list[str](), dict[str, str](), dict[Any, str]()
        for name in methods:
            if len(good) == most:
                break
            try:
                tableau = self.plan(self.candidate(name, 1, dtype)).spec.explicit
                if tableau in tableaux:
                    refused[name] = f"method {name}: in this scene it is {tableaux[tableau]}"
                    continue
                good.append(name)
                if tableau is not None:
                    tableaux[tableau] = name
            except SceneError as error:
                refused[name] = str(error)
        return good, refused

    def noise(self, method: str) -> str:
        """Kind of noise: "none"; "grid", whose path runs may share; or "free", whose path differs with the step."""
        laws = self.plan(self.candidate(method, 1)).kernel_choice.laws
        noisy = [term for term, module in laws if getattr(module, "NOISE", False)]
        if not noisy:
            return "none"
        return "grid" if all(isinstance(term, NoisyTerm) for term in noisy) else "free"


def drawn_every(fleet: Ensemble, noise_step: float, own_grid: bool = True) -> Ensemble:
    """Draw the noise of an ensemble on a grid; if own_grid, terms with their own noise_step keep it."""

    def on_grid(term: Any) -> Any:
        noisy = isinstance(term, NoisyTerm) and not (own_grid and term.noise_step is not None)
        return replace(term, noise_step=noise_step) if noisy else term

    drawn, scene = copy.copy(fleet), cast(Scene, fleet.scene)
    drawn.scene = replace(scene, terms=[on_grid(term) for term in scene.terms])
    return drawn


def failed(result: Result) -> bool:
    """True if some member failed. Members stopped by an event did not fail."""
    return bool(failed_members(result.status).any())


def distances(result: Result, reference: Result, distance: Distance | None = None) -> dict[str, np.ndarray]:
    """Quantity -> distance of two results at each time (k, n); NaN after an event stopped the member in one of them."""
    apart = {name: getattr(result, name).astype(np.float64) - getattr(reference, name) for name in FIELDS}
    chord = np.linalg.norm(apart.pop("attitude"), axis=(-2, -1))
    lengths = {name: np.linalg.norm(difference, axis=-1) for name, difference in apart.items()}
    lengths["attitude"] = 2.0 * np.arcsin(np.minimum(chord / math.sqrt(8.0), 1.0))
    lengths["energy"] = np.abs(result.energy - reference.energy)
    lengths = {name: lengths[name] for name in QUANTITIES}
    if distance is not None and distance.name not in lengths:
        lengths[distance.name] = distance.distance(result, reference)
    gone = reference.time[:, None] >= np.minimum(stop_time(result), stop_time(reference))
    return {name: np.where(gone, np.nan, values) for name, values in lengths.items()}


def errors(apart: dict[str, np.ndarray], until: int) -> dict[str, dict[str, float]]:
    """Reduce distances to norms over members and times up to `until`, leaving out members that were stopped.

    Returns: Quantity -> {"end_max", "end_rms", "path_max", "path_rms"}.
    """
    norms = {}
    for name, values in apart.items():
        values = values[: until + 1]
        rows = np.flatnonzero(np.isfinite(values).any(axis=1))
        end = values[rows[-1]] if len(rows) else np.zeros(1)
        numbers = {"end_max": np.nanmax(end), "end_rms": np.sqrt(np.nanmean(end**2))}
        numbers |= {"path_max": np.nanmax(values), "path_rms": np.sqrt(np.nanmean(values**2))}
        norms[name] = {key: float(value) for key, value in numbers.items()}
    return norms


def agreement(a: Result, b: Result, distance: Distance | None = None) -> dict[str, np.ndarray]:
    """Quantity -> largest distance of two results over all members, up to each time (k,); inf if a member failed."""
    if failed(a) or failed(b):
        names = dict.fromkeys([*QUANTITIES, *([distance.name] if distance else [])])
        return {name: np.where(a.time > 0.0, np.inf, 0.0) for name in names}
    running_maxima = {}
    for name, values in distances(a, b, distance).items():
        largest = np.max(np.where(np.isnan(values), 0.0, values), axis=1)
        running_maxima[name] = np.maximum.accumulate(np.where(np.isfinite(largest), largest, np.inf))
    return running_maxima


def quantities_of(result: Result, asked: Distance | None = None) -> dict[str, np.ndarray]:
    """Quantity -> values (k, n, components) for means and standard deviations; attitude: the vertical in body axes."""
    values = {name: getattr(result, name).astype(np.float64) for name in ("position", "velocity", "angular_velocity")}
    values["attitude"] = result.attitude[..., 2, :].astype(np.float64)
    values["energy"] = result.energy[..., None]
    values["linear_momentum"] = invariants.linear_momentum(result)
    values["angular_momentum"] = invariants.angular_momentum(result)
    if asked is not None and asked.name not in values and asked.unit != "rad":
        values[asked.name] = asked.values(result)
    return values


def biases(result: Result, reference: Result, distance: Distance | None = None) -> dict[str, float]:
    """Compare means and standard deviations of two results.

    Each difference is measured in standard errors of the sample: its root mean square over components and times after
    0. Two independent samples of the same distribution differ by about 1.4.
    Returns: "NAME_mean" and "NAME_std" -> difference; empty if there is only one member or if a member failed.
    """
    n = result.members
    if n < 2 or failed(result):
        return {}
    deviations = {}
    mine, theirs = quantities_of(result, distance), quantities_of(reference, distance)
    for name, b in theirs.items():
        a, b = mine[name][1:], b[1:]
        spread = b.std(axis=1, ddof=1)
        # A component that varies by round-off alone has no standard error.
        real = spread > 1e-9 * np.maximum(np.abs(b).max(axis=1), 1e-12)
        if not real.any():
            continue
        for moment, change, size in (
            ("mean", a.mean(axis=1) - b.mean(axis=1), 1.0 / math.sqrt(n)),
            ("std", a.std(axis=1, ddof=1) - spread, 1.0 / math.sqrt(2.0 * (n - 1))),
        ):
            deviations[f"{name}_{moment}"] = float(np.sqrt(np.mean((change[real] / (spread[real] * size)) ** 2)))
    return deviations


def part(result: Result, members: Sequence[int]) -> Result:
    """Some members of a result, in memory or in a store."""
    at = np.asarray(members)
    if result.store is not None:
        from lgvi_warp.store.open import chosen

        return chosen(result, members)
    return result.part(at)
