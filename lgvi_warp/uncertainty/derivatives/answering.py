# SPDX-License-Identifier: Apache-2.0
"""Answer a question: run copies, extrapolate their differences, and name quantities without a derivative."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lgvi_warp.common.status import failed
from lgvi_warp.measuring.reference import ROUND_OFF
from lgvi_warp.results.quantities import EndQuantity, OfResult
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.variations import Target
from lgvi_warp.store.layout import units_of_numbers
from lgvi_warp.uncertainty.derivatives import undefined
from lgvi_warp.uncertainty.derivatives.answer import Derivatives
from lgvi_warp.uncertainty.derivatives.copies import CopyRuns, MovedCopies, Neighbours, neighbours
from lgvi_warp.uncertainty.derivatives.extrapolation import FEW, FINE, Extrapolated, extrapolated, relative_increments
from lgvi_warp.uncertainty.derivatives.stop_times import StopTimeRuns

# Members on which increments are chosen, and how many of these others are run at.
LOOKED_AT, KEPT_LEVELS = 8, 4
# A derivative, its error and its increment; or why there is none.
SlopeOrReason = tuple[float, float, float] | str
NUMBERS = ("jacobian", "error", "increments")


@dataclass(frozen=True, eq=False)
class SlopesQuestion:
    """Question of the derivatives.

    fleet: the members. scene: scene of the copies. interests: the quantities. names, targets: the numbers. alone: True
    for a single scene; answers then have no axis of members. rounding: quantum of each sensor that rounds. smoothed:
    names of quanta that are set to 0.
    """

    fleet: Ensemble
    scene: Any
    interests: tuple[OfResult, ...]
    names: tuple[str, ...]
    targets: tuple[Target, ...]
    alone: bool
    rounding: Mapping[str, float] = field(default_factory=dict)
    smoothed: tuple[str, ...] = ()

    def known_against(self, interest: OfResult, target: Target) -> str | None:
        """Reason why a quantity has no derivative by a number for any member; None if no reason is known."""
        return (
            undefined.of_number(self.scene, target)
            or undefined.of_interest(interest, target, self.scene)
            or undefined.of_loop(self.rounding)
        )


class Answering:
    """The answer under construction: arrays (n, m, k), and at (i, j) the reasons with the members that have them."""

    def __init__(self, question: SlopesQuestion, settings: Mapping[str, Any], report: Callable[[float], None]):
        self._question, self._settings, self._report = question, settings, report
        # Numbers by which nothing has a derivative are not moved: they would cost copies, and memory of a controller.
        pairs = [[question.known_against(each, target) for each in question.interests] for target in question.targets]
        self._live = [j for j, reasons in enumerate(pairs) if not all(reasons)]
        moved = tuple(question.targets[j] for j in self._live)
        self._copies = MovedCopies(question.fleet, question.scene, moved, question.smoothed)
        self._runs = CopyRuns(self._copies, question.interests, settings)
        self._eps = ROUND_OFF[self._runs.dtype.partition("_")[0]]
        self._reasons: dict[tuple[int, int], dict[str, list[int]]] = {}
        self._sides: dict[int, str] = {}

    def answer(self) -> Derivatives:
        """Run the copies, and fill in the results of each group of members."""
        question, runs = self._question, self._runs
        growth, from_here = runs.nudged(final=undefined.has_legs(question.scene))
        self._growth = growth if runs.dtype == "float64" else np.zeros_like(growth)
        self._legs = self._legs_of(undefined.legs_done(question.scene, from_here))
        groups = self._groups()
        n, m, k = question.fleet.members, len(runs.labels), len(question.names)
        value = np.full((n, m), np.nan)
        self._arrays = {name: np.full((n, m, k), np.nan) for name in NUMBERS}
        against = [[question.known_against(question.interests[i], target) for target in question.targets]
                   for i in runs.owner]  # fmt: skip
        for members, near, slopes in groups:
            value[members] = near.at
            self._fill(members, near, slopes)
        for i, j in np.ndindex(m, k):
            if (reason := against[i][j]) is not None:
                self._arrays_at(slice(None), i, j, (np.nan,) * 3)
                self._reasons[i, j] = {reason: list(range(n))}
        arrays = {"value": value, **self._arrays}
        smoothed = f"readings are not rounded: {', '.join(question.smoothed)} left out"
        return Derivatives(
            of=runs.labels,
            units=runs.units,
            by=question.names,
            **{name: values[0] if question.alone else values for name, values in arrays.items()},
            undefined={f"{runs.labels[i]} by {question.names[j]}": self._text(reasons, n)
                       for (i, j), reasons in sorted(self._reasons.items())},
            messages=(*([smoothed] if question.smoothed else ()), *self._sides.values()),
            members=runs.members,
            provenance=runs.provenance,
            by_units=tuple(units_of_numbers(question.scene, question.names).values()),
        )  # fmt: skip

    def _legs_of(self, at_end: np.ndarray) -> np.ndarray:
        """Legs of waypoints done (n, interests) at the time of each quantity; at_end: legs done at the end (n,)."""
        times = [each.when if isinstance(each, EndQuantity) else None for each in self._question.interests]
        at = {when: self._legs_at(when) for when in set(times) if when is not None and at_end.any()}
        return np.stack([at_end if when is None else at.get(when, at_end) for when in times], axis=1)

    def _legs_at(self, when: float) -> np.ndarray:
        """Legs that members have done at a time (n,), from a run that ends at this time."""
        if when <= 0.0:
            return np.zeros(self._question.fleet.members)
        interest = OfResult("position", lambda result: result.position[-1])
        own = CopyRuns(self._copies, [interest], {**self._same_steps(), "t1": when, "save": None})
        members = np.arange(self._question.fleet.members)
        ended = own.runner.run(self._copies.ensemble(members, self._copies.numbers), warned=False, final=True)
        self._runs.members += len(members)
        return undefined.legs_done(self._question.scene, ended)

    def _same_steps(self) -> dict[str, Any]:
        """Settings of further runs with the same steps."""
        plan = self._runs.plan
        return {**self._settings, "method": plan.method, "h": plan.grid.h, "dtype": self._runs.dtype}

    def _groups(self) -> list[tuple[np.ndarray, Neighbours, Extrapolated]]:
        """Run some members at all increments, and the others at the best of these increments."""
        runs, n, k = self._runs, self._question.fleet.members, len(self._live)
        relative = np.broadcast_to(relative_increments(runs.dtype), (k, len(relative_increments(runs.dtype))))
        looked = np.arange(min(n, LOOKED_AT))
        share = len(looked) / n
        near = neighbours(runs, looked, relative, lambda part: self._report(share * part))
        slopes = self._extrapolated(near)
        groups = [(looked, near, slopes)]
        if n > len(looked):
            others = np.arange(len(looked), n)
            first = np.median(slopes.first, axis=(0, 1)).astype(int) if k else np.zeros(0, int)
            first = np.clip(first, 0, relative.shape[1] - KEPT_LEVELS)
            chosen = np.take_along_axis(relative, first[:, None] + np.arange(KEPT_LEVELS), axis=1)
            near = neighbours(runs, others, chosen, lambda part: self._report(share + (1.0 - share) * part))
            rounding = np.broadcast_to(2.0 * np.nan_to_num(slopes.rounding).max(axis=0), near.above.shape[:-1])
            slopes = self._extrapolated(near, rounding)
            # Increments that suit the first members may be too long for others, or too short.
            again = self._unsure(near, slopes)
            groups.append((others[~again], near.part(~again), slopes.part(~again)))
            if again.any():
                near = neighbours(runs, others[again], relative)
                groups.append((others[again], near, self._extrapolated(near)))
        return groups

    def _unsure(self, near: Neighbours, slopes: Extrapolated) -> np.ndarray:
        """Mask of members (n,) whose derivatives need other increments."""
        against = [[self._question.known_against(self._question.interests[i], self._question.targets[j])
                    for j in self._live] for i in self._runs.owner]  # fmt: skip
        asked = np.array([[reason is None for reason in row] for row in against], bool)
        open_ends = np.isfinite(near.at)[:, :, None] & asked
        return np.asarray(((slopes.code != FINE) & open_ends).any(axis=(1, 2)) & ~failed(near.status))

    def _extrapolated(self, near: Neighbours, rounding: np.ndarray | None = None) -> Extrapolated:
        at = np.broadcast_to(near.at[:, :, None], near.above.shape[:-1])
        increments = np.broadcast_to(near.increments[:, None], near.above.shape)
        return extrapolated(at, near.above, near.below, increments, self._eps, rounding)

    def _arrays_at(self, members: Any, i: int, j: int, numbers: Any) -> None:
        for array, values in zip(self._arrays.values(), numbers, strict=True):
            array[members, i, j] = values

    def _fill(self, members: np.ndarray, near: Neighbours, slopes: Extrapolated) -> None:
        """Store derivatives of members, and examine those that may be undefined."""
        times = self._stop_times(members, near)
        odd = (near.status != 0) | (self._growth[members] > undefined.MOST_GROWTH)
        odd = odd[:, None] | ~np.isfinite(near.at) | (self._legs[members][:, list(self._runs.owner)] > 0.0)
        for i, place in np.ndindex(len(self._runs.labels), len(self._live)):
            j = self._live[place]
            increments = np.take_along_axis(near.increments[:, place], slopes.first[:, i, place, None], axis=1)[:, 0]
            self._arrays_at(members, i, j, (slopes.value[:, i, place], slopes.error[:, i, place], increments))
            closely = odd[:, i] | (slopes.code[:, i, place] != FINE)
            for row in np.flatnonzero(closely):
                self._put(int(members[row]), (int(row), i, place), near, slopes, times)
        for place, j in enumerate(self._live):
            if place in self._copies.unmovable:
                continue
            for values, side in ((near.below, "above"), (near.above, "below")):
                if np.isnan(values[:, :, place]).all() and not np.isnan(near.at).all():
                    self._sides[j] = (
                        f"{self._question.names[j]}: differences are from {side} alone, since no copy counts there"
                    )

    def _put(
        self, member: int, place: tuple[int, int, int], near: Neighbours, slopes: Extrapolated,
        times: Mapping[tuple[int, int, int], SlopeOrReason],
    ) -> None:  # fmt: skip
        """Store a derivative of a member, or the reason why there is none."""
        row, i, j = place[0], place[1], self._live[place[2]]
        owner = self._runs.owner[i]
        slope: SlopeOrReason | None = undefined.of_member(
            self._question.interests[owner], float(near.at[row, i]), int(near.status[row]),
            float(near.time[row]), float(self._growth[member]), float(self._legs[member, owner]),
        )  # fmt: skip
        if slope is None and slopes.code[place] == FEW and (reason := self._copies.unmovable.get(place[2])):
            slope = f"{self._question.names[j]} {reason}"
        slope = slope or times.get(place) or _numbers(slopes, place, near.increments[row, place[2]])
        if isinstance(slope, str):
            self._reasons.setdefault((i, j), {}).setdefault(slope, []).append(member)
            slope = (np.nan,) * 3
        self._arrays_at(member, i, j, slope)

    def _text(self, reasons: Mapping[str, list[int]], n: int) -> str:
        """Text of the members' reasons."""
        if self._question.alone:
            return next(iter(reasons))
        counted = [f"{text} ({len(which)} of {n} members, the first {which[0]})" for text, which in reasons.items()]
        return "; ".join(counted[:3])

    def _stop_times(self, members: np.ndarray, near: Neighbours) -> dict[tuple[int, int, int], SlopeOrReason]:
        """Derivatives of the times at which events stopped members: (row, i, j) -> derivative or reason."""
        runs, times = self._runs, dict[tuple[int, int, int], SlopeOrReason]()
        grid, events = runs.plan.grid, undefined.timed_events(self._question.scene)
        settings = self._same_steps()
        relative = relative_increments(runs.dtype)
        for i, owner in enumerate(runs.owner):
            interest = self._question.interests[owner]
            if not undefined.is_end_time(interest) or interest.outcome not in events:
                continue
            steps = np.floor(np.nan_to_num(near.at[:, i], nan=-1.0) / grid.h + 1e-9).astype(int)
            for step in np.unique(steps[steps >= 0]):
                rows = np.flatnonzero(steps == step)
                own = StopTimeRuns(self._copies, events[interest.outcome], int(step), settings)
                beside = neighbours(own, members[rows], np.broadcast_to(relative, (len(self._live), len(relative))))
                slopes = self._extrapolated(beside)
                runs.members += own.members
                for row, j in np.ndindex(len(rows), len(self._live)):
                    by_cubic, by_parabola = (
                        _numbers(slopes, (row, root, j), beside.increments[row, j]) for root in (0, 1)
                    )
                    if not isinstance(by_cubic, str) and not isinstance(by_parabola, str):
                        value, error, increment = by_cubic
                        by_cubic = value, error + abs(value - by_parabola[0]), increment
                    times[int(rows[row]), i, j] = by_cubic
        return times


def _numbers(slopes: Extrapolated, place: tuple[int, int, int], increments: np.ndarray) -> SlopeOrReason:
    """Derivative, error and increment, or the reason why there is none; increments: (levels,)."""
    reason = undefined.of_differences(slopes, place, increments)
    if reason is not None:
        return reason
    return float(slopes.value[place]), float(slopes.error[place]), float(increments[int(slopes.first[place])])
