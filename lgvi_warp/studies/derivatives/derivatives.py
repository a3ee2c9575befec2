# SPDX-License-Identifier: Apache-2.0
"""`derivatives`: how what a run gives changes with the numbers of its scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import scene_value
from lgvi_warp.common.arguments import flag
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.quantities import OfInterest, OfResult, quantities
from lgvi_warp.runs.request import scene_of
from lgvi_warp.scene.columns import names_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.variations import Target, targets
from lgvi_warp.studies.derivatives import undefined
from lgvi_warp.studies.derivatives.answer import Derivatives
from lgvi_warp.studies.derivatives.copies import Copies, CopyRuns, Neighbours, neighbours
from lgvi_warp.studies.derivatives.extrapolation import Extrapolated, extrapolated, relative_increments
from lgvi_warp.studies.derivatives.stop_times import StopTimeRuns
from lgvi_warp.studies.reference import ROUND_OFF

# Members on which increments are chosen, and how many of these others are run at.
LOOKED_AT, KEPT_LEVELS = 8, 4
# A derivative, its error and its increment; or why there is none.
Told = tuple[float, float, float] | str


@shows_progress
def derivatives(
    fleet: Scene | Ensemble,
    of: OfInterest | Sequence[OfInterest],
    by: str | Sequence[str],
    *,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    smooth: bool = False,
    seed: int | None = None,
    threads: int | None = None,
    width: int | None = None,
    executor: Any = "threads",
    scheduler: str | None = None,
    progress: Callable[[float], None] | bool | None = None,
) -> Derivatives:
    """Find the derivatives of what whole runs give by any numbers of the scene, each with a bound of its error.

    Copies of a member, moved by many increments to both sides, run beside it in one call, with its noise; their differences
    are extrapolated, and the increments that agree best are taken. What goes in steps, or jumps, has no derivative: it is
    named with the reason, and its entries are NaN.

    Args:
        fleet: A Scene, whose [ensemble] is left out; or an Ensemble, of whose members each has derivatives of its own.
        of: One or several quantities, as of `lw.prepare`: "position[2]", "max(depth)", "end_time floor",
            lw.metrics.ITAE("depth"), a function of a Result.
        by: Names of the numbers, as of `lw.prepare`: "vehicle.mass", "start.position[2]", "depth_pid.kp", ...
        method: As of `lw.solve`, as all settings that follow: what is left out is that of the scene.
        h: Step [s].
        t1: End of the run [s].
        save: Samples to keep; default those that the quantities need.
        dtype: "float64", "float32" or "float32_compensated". In float32 derivatives have few digits.
        smooth: Whether sensors' readings are not rounded to their quantum. Default False.
        seed: Seed of the noise, and of the members of a fleet that is drawn, a whole number from 0; default that of the
            ensemble.
        threads: Number of threads; default all cores, one for short runs.
        width: Vehicles per packet; default from the CPU.
        executor: "threads" (default), "processes" or "dask", or an object that runs blocks.
        scheduler: Address of Dask's scheduler.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the fraction of the work that is done,
            in [0, 1]. None, the default, for nobody.

    Returns:
        Values, derivatives with their errors, and what has none.

    Raises:
        SceneError: For faulty arguments, all in one message.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> slopes = lw.derivatives(scene, of="depth", by=["vehicle.buoyancy", "start.velocity[0]"], h=0.1, t1=2.0)
        >>> slopes.jacobian.shape, bool((slopes.error < 1e-7 * abs(slopes.jacobian)).all())
        ((1, 2), True)
    """
    settings = dict(
        method=method, h=h, t1=t1, save=save, dtype=dtype, threads=threads, width=width, executor=executor,
        scheduler=scheduler,
    )  # fmt: skip
    question = _checked(fleet, of, by, smooth, seed)
    runs = CopyRuns(question.copies, question.interests, settings)
    found = _found(runs, callback(progress) or (lambda share: None))
    return _Answer(question, runs, found, settings).told()


@dataclass(frozen=True)
class _Question:
    """What is asked, of which members; alone: of a scene; rounding: quanta of sensors that act; notes: for the user."""

    copies: Copies
    interests: tuple[OfResult, ...]
    names: tuple[str, ...]
    alone: bool
    rounding: Mapping[str, float]
    notes: tuple[str, ...]


def _checked(fleet: Any, of: Any, by: Any, smooth: Any, seed: Any) -> _Question:
    """The question. Raises SceneError, with all faults of the arguments."""
    scene, faults = scene_of(fleet), Faults()
    interests: tuple[OfResult, ...] = ()
    with faults.including():
        interests = quantities(of)
    labels = [each.label for each in interests]
    for label in sorted({label for label in labels if labels.count(label) > 1}):
        faults.add("of", label, "is named twice", "name each quantity once, and give functions names of their own")
    names, numbers = names_of(faults, by, "by"), list[Target]()
    for name in names:
        if len(several := targets(name)) > 1:
            faults.add("by", name, "names several numbers", "name each by itself")
            continue
        with faults.including():
            scene_value(scene, name, "by")
            numbers += several
    with faults.including():
        flag("smooth", smooth)
    if isinstance(fleet, Ensemble):
        members = fleet
        if fleet.final is not None:
            faults.add("fleet", "...", "goes on from another run", "give members that start at t = 0")
        with faults.including():
            members = fleet if seed is None else fleet.with_seed(seed)
    else:
        settings = scene.ensemble_settings
        members = Ensemble(scene, 1)
        with faults.including():
            members = Ensemble(scene, 1, (settings.seed if settings else 0) if seed is None else seed)
    faults.raise_if_any()
    n = members.members
    of_members = members.parameters(0, n)
    rounding = undefined.quanta(scene, of_members)
    notes: tuple[str, ...] = ()
    if smooth and rounding:
        scene = scene.with_numbers({name: 0.0 * scene.parameters()[name] for name in rounding})
        notes = (f"readings are not rounded: {', '.join(rounding)} left out",)
    copies = Copies(members, scene, tuple(numbers), tuple(rounding) if smooth else ())
    return _Question(copies, interests, names, not isinstance(fleet, Ensemble), {} if smooth else rounding, notes)


@dataclass(frozen=True)
class _Found:
    """Differences of all members: values (n, m), what they tell (n, m, k), increments (n, k, levels) of each place."""

    near: Sequence[tuple[np.ndarray, Neighbours, Extrapolated]]
    growth: np.ndarray
    legs: np.ndarray


def _found(runs: CopyRuns, report: Callable[[float], None]) -> _Found:
    """Run some members at all increments, and the others at those that were best."""
    n, k, eps = runs.copies.fleet.members, len(runs.copies.targets), ROUND_OFF[runs.dtype.partition("_")[0]]
    relative = np.broadcast_to(relative_increments(runs.dtype), (k, len(relative_increments(runs.dtype))))
    looked = np.arange(min(n, LOOKED_AT))
    share = len(looked) / n
    growth, from_here = runs.nudged()
    near = neighbours(runs, looked, relative, lambda part: report(0.1 + 0.9 * share * part))
    tells = _extrapolated(near, eps)
    found = [(looked, near, tells)]
    if n > len(looked):
        others = np.arange(len(looked), n)
        first = np.median(tells.first.reshape(-1, k), axis=0).astype(int)
        first = np.clip(first, 0, relative.shape[1] - KEPT_LEVELS)
        chosen = np.take_along_axis(relative, first[:, None] + np.arange(KEPT_LEVELS), axis=1)
        near = neighbours(runs, others, chosen, lambda part: report(0.1 + 0.9 * (share + (1.0 - share) * part)))
        rounding = np.broadcast_to(2.0 * np.nan_to_num(tells.rounding).max(axis=0), near.above.shape[:-1])
        found.append((others, near, _extrapolated(near, eps, rounding)))
    wide = growth if runs.dtype == "float64" else np.zeros(n)
    return _Found(found, wide, undefined.legs_done(runs.copies.scene, from_here.final))


def _extrapolated(near: Neighbours, eps: float, rounding: np.ndarray | None = None) -> Extrapolated:
    """Extrapolate differences; near.at has no number that is moved."""
    at = np.broadcast_to(near.at[:, :, None], near.above.shape[:-1])
    increments = np.broadcast_to(near.increments[:, None], near.above.shape)
    return extrapolated(at, near.above, near.below, increments, eps, rounding)


class _Answer:
    """The answer as it is put together: arrays (n, m, k), and reasons by pair of names."""

    def __init__(self, question: _Question, runs: CopyRuns, found: _Found, settings: Mapping[str, Any]):
        self._question, self._runs, self._found, self._settings = question, runs, found, settings
        n, m, k = runs.copies.fleet.members, len(runs.labels), len(question.names)
        self._value = np.full((n, m), np.nan)
        self._arrays = {name: np.full((n, m, k), np.nan) for name in ("jacobian", "error", "increments")}
        self._reasons: dict[tuple[int, int], dict[str, list[int]]] = {}
        self._sides: dict[int, str] = {}

    def told(self) -> Derivatives:
        """Fill in what each group of members gave."""
        for members, near, tells in self._found.near:
            self._value[members] = near.at
            self._note_sides(near)
            times = self._stop_times(members, near)
            for place in np.ndindex(*tells.value.shape):
                self._put(int(members[place[0]]), place, near, tells, times)
        question, runs = self._question, self._runs
        arrays = {"value": self._value, **self._arrays}
        if question.alone:
            arrays = {name: values[0] for name, values in arrays.items()}
        return Derivatives(
            of=runs.labels,
            units=runs.units,
            by=question.names,
            **arrays,
            undefined={self._name(*pair): self._text(reasons) for pair, reasons in self._reasons.items()},
            messages=(*question.notes, *self._sides.values()),
            members=runs.members,
            provenance=runs.provenance,
        )

    def _name(self, i: int, j: int) -> str:
        return f"{self._runs.labels[i]} by {self._question.names[j]}"

    def _text(self, reasons: Mapping[str, list[int]]) -> str:
        """The reasons of members in one text."""
        if self._question.alone:
            return next(iter(reasons))
        counted = [f"{text} ({len(which)} of {len(self._value)} members, the first {which[0]})"
                   for text, which in reasons.items()]  # fmt: skip
        return "; ".join(counted[:3])

    def _note_sides(self, near: Neighbours) -> None:
        """Say which numbers could be moved to one side only."""
        for j, name in enumerate(self._question.names):
            for values, side in ((near.below, "above"), (near.above, "below")):
                if np.isnan(values[:, :, j]).all() and not np.isnan(near.at).all():
                    self._sides[j] = (
                        f"{name}: differences are from {side} alone, since no copy counts on the other side"
                    )

    def _put(
        self, member: int, place: tuple[int, ...], near: Neighbours, tells: Extrapolated,
        times: Mapping[tuple[int, ...], Told],
    ) -> None:  # fmt: skip
        """Note a derivative of a member, or why there is none."""
        row, i, j = place
        number, interest = self._question.copies.targets[j], self._question.interests[self._runs.owner[i]]
        scene, found = self._question.copies.scene, self._found
        reason = (
            undefined.of_number(scene, number)
            or undefined.of_interest(interest, number, scene)
            or undefined.of_loop(self._question.rounding)
            or undefined.of_member(
                interest, float(near.at[row, i]), int(near.status[row]), float(near.time[row]),
                float(found.growth[member]), float(found.legs[member]),
            )
        )  # fmt: skip
        increments = near.increments[row, j]
        numbers = times[place] if place in times else _numbers(tells, place, increments)
        told: Told = reason or numbers
        if isinstance(told, str):
            self._reasons.setdefault((i, j), {}).setdefault(told, []).append(member)
            return
        for array, each in zip(self._arrays.values(), told, strict=True):
            array[member, i, j] = each

    def _stop_times(self, members: np.ndarray, near: Neighbours) -> dict[tuple[int, ...], Told]:
        """What is told of the times at which events stopped members, by place (row, i, j)."""
        runs, copies = self._runs, self._question.copies
        grid, events = runs.plan.grid, undefined.timed_events(copies.scene)
        settings = {**self._settings, "method": runs.plan.method, "h": grid.h, "dtype": runs.dtype}
        relative = relative_increments(runs.dtype)
        told: dict[tuple[int, ...], Told] = {}
        for i, owner in enumerate(runs.owner):
            interest = self._question.interests[owner]
            if not undefined.is_end_time(interest) or interest.outcome not in events:
                continue
            steps = np.floor(np.nan_to_num(near.at[:, i], nan=-1.0) / grid.h + 1e-9).astype(int)
            for step in np.unique(steps[steps >= 0]):
                rows = np.flatnonzero(steps == step)
                own = StopTimeRuns(copies, events[interest.outcome], int(step), settings)
                beside = neighbours(own, members[rows], np.broadcast_to(relative, (len(copies.targets), len(relative))))
                tells = _extrapolated(beside, ROUND_OFF[runs.dtype.partition("_")[0]])
                runs.members += own.members
                for row, j in np.ndindex(len(rows), len(copies.targets)):
                    by_cubic, by_parabola = (
                        _numbers(tells, (row, root, j), beside.increments[row, j]) for root in (0, 1)
                    )
                    if not isinstance(by_cubic, str) and not isinstance(by_parabola, str):
                        slope, error, increment = by_cubic
                        by_cubic = slope, error + abs(slope - by_parabola[0]), increment
                    told[int(rows[row]), i, j] = by_cubic
        return told


def _numbers(tells: Extrapolated, place: tuple[int, ...], increments: np.ndarray) -> Told:
    """Derivative, error and increment, or why there is none; increments: (levels,)."""
    reason = undefined.of_differences(tells, place, increments)
    if reason is not None:
        return reason
    return float(tells.value[place]), float(tells.error[place]), float(increments[int(tells.first[place])])
