# SPDX-License-Identifier: Apache-2.0
"""Loops of many members at their steady motions, and tests by runs of whether they settle."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.control.loop_gain import FACTOR, LoopGain, of_all, with_factor
from lgvi_warp.control.over_floor import seen_floors
from lgvi_warp.control.set_point import SetPoint
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.physics.terms.control_wrench import COMPONENTS
from lgvi_warp.robustness.linear.bench import Motion, MotionBench
from lgvi_warp.robustness.linear.sampled_loop import DELAY, delayed
from lgvi_warp.scene.ensemble import Ensemble

# Why a member has no margins; "" where it has.
UNSETTLED, FAILED, IDLE, LIMITED = "does not settle", "failed", "moves nothing", "at its limit: "
# What repeats after a period to this, in m/s, rad/s and parts of 1, is steady.
REPEATS = 1e-6
# A command so near to its limit, as a part of it, is at it.
AT_LIMIT = 1e-9
# The envelope of a loop that settles shrinks at least so much from the second third of a run to the last.
SHRINKS = 0.97
# Where it shrinks by less than this the edge is near, and a run of 1.5 times the length is judged as well.
NEAR = 0.8
# What swings by less than this part of its first third, or of the tilt, has settled: what is left is round-off.
SETTLED = 1e-6
# What is aside by more tilts than this in the last third, or turns by more within a period, has not settled.
TILTS = 10.0
# What has shrunk to this part of its first third is not growing: where it does not shrink yet, slower modes are left.
FADED = 0.1
# Ticks of a run below which its thirds show no envelope.
LEAST_TICKS = 30


class Study:
    """Members, each with its own factor and delay in the loop; the arguments are those of `margins`.

    Loops are first examined after `begin` steps, and no later than after `last` steps; a run has `ticks` ticks.
    `components` are the components of the loop's demand.
    """

    def __init__(
        self, fleet: Ensemble, loop: str | None, about: float, settle: float, seconds: float, tilt: float, method: Any,
        h: float,
    ):  # fmt: skip
        scene: Any = fleet.scene
        controller, period = scene.controller, float(scene.controller.period)
        self.period = period
        # With some delay in the scene, commands may be delayed in any lane.
        laws = with_factor(controller.laws, loop)
        asks = next(law.asks for law in laws if isinstance(law, LoopGain))
        self.components = tuple(COMPONENTS.index(name) for name in asks)
        acted = replace(controller, laws=laws, delay=controller.delay if controller.delay > 0.0 else period)
        first, ticks = (max(1, round(time / period)) for time in (about, seconds))
        last = max(first, round(settle / period))
        inside = fleet.in_scene(
            replace(scene, controller=acted, events=seen_floors(scene.controller, scene.events)), (FACTOR, DELAY)
        )
        self.fleet, self.tilt, self.nominal = fleet, tilt, float(controller.delay)
        length = (last + 1 + ticks + ticks // 2) * period
        self.bench = MotionBench(inside, method, h, length, period, (*FIELDS, "command"))
        self.begin, self.last, self.ticks = first * self.bench.every, last * self.bench.every, ticks
        self.held = held(controller)
        self.channels = {key: term.channels for key, term in controller.actuators.items()}

    def loops(self, places: np.ndarray) -> tuple[list[Loops], np.ndarray]:
        """The loops of members (n,) at their steady motions, grouped by time; reasons (n,) of members without a loop.

        Members whose motion does not repeat after `about`, or that are at a limit, run on to twice the time, and so on.
        """
        bench, n, groups = self.bench, len(places), list[Loops]()
        parameters = self.fleet.subset(places).parameters(0, n)
        h = bench.plan.grid.h
        delay = np.broadcast_to(np.rint(np.asarray(parameters.get(DELAY, self.nominal)) / h).astype(np.int64), (n,))
        each_limit = [np.broadcast_to(parameters[f"{key}.limit"], (n, c)) for key, c in self.channels.items()]
        limits = np.concatenate(each_limit, axis=1)
        why: np.ndarray = np.full(n, UNSETTLED, dtype=object)
        pending, due = np.arange(n), self.begin
        latest: deque[np.ndarray] = deque(maxlen=2)

        def keep(_: int, values: Mapping[str, np.ndarray]) -> None:
            latest.extend(_what_repeats(values, self.held)[-2:])

        while True:
            latest.clear()
            # Each time from the start: of commands that are on their way, members remember as many as those beside them.
            numbers = {FACTOR: of_all(np.ones(len(pending))), DELAY: delay[pending] * h}
            end = due + bench.every
            motion = bench.run(places[pending], None, 0, end, numbers, keep)
            steady = np.all(_apart(latest[1], latest[0], limits[pending]) <= REPEATS, axis=1).tolist()
            limited = at_limit(_commands(latest[1], limits), limits[pending])
            alive = np.isfinite(motion.position).all(axis=1)
            why[pending] = [self._reason(*each) for each in zip(alive, steady, limited, strict=True)]
            well = why[pending] == ""
            if well.any():
                some = pending[well]
                groups.append(
                    Loops(self, places[some], delay[some], limits[some], motion.of(well), latest[1][well], end)
                )
            pending = pending[~well & alive]
            if due == self.last or not len(pending):
                return groups, why
            due = min(2 * due, self.last)

    def _reason(self, alive: bool, steady: bool, limited: np.ndarray) -> str:
        if not (alive and steady):
            return UNSETTLED if alive else FAILED
        names = [f"{key}[{i}]" for key, count in self.channels.items() for i in range(count)]
        at = ", ".join(name for name, bad in zip(names, limited, strict=True) if bad)
        return f"{LIMITED}{at}" if at else ""


def held(controller: Any) -> frozenset[str]:
    """Quantities that a set-point holds; beyond a limit of a law they may drift while all else repeats."""
    guides = {wish: part for part in controller.guidance for wish in part.gives}
    wishes = {wish for law in controller.laws for wish in law.needs if isinstance(guides.get(wish), SetPoint)}
    return frozenset(wishes & {"depth", "heading", "position"} | ({"heading"} if "attitude" in wishes else set()))


def _what_repeats(values: Mapping[str, np.ndarray], wishes: Collection[str]) -> np.ndarray:
    """Quantities of samples (k, m, ...) that must repeat: velocities, rates, down, commands and the held quantities."""
    place, attitude = values["position"], values["attitude"]
    wished = {"depth": place[..., 2:], "position": place, "heading": attitude[..., :2, 0]}
    always = values["velocity"], values["angular_velocity"], attitude[..., 2, :], values["command"]
    return np.concatenate([*always, *(wished[name] for name in sorted(wishes))], axis=-1)


def _commands(repeating: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """The commands (m, channels) among the repeating quantities."""
    return repeating[:, 9 : 9 + limits.shape[1]]


def at_limit(command: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Mask of commands (m, channels) at their limits; a limit of 0 does not count."""
    return np.asarray((limits > 0.0) & (np.abs(command) >= limits * (1.0 - AT_LIMIT)))


def _apart(repeating: np.ndarray, before: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Difference of repeating quantities from the earlier ones (m, ...); relative for large values."""
    size = np.maximum(1.0, np.abs(before))
    of_commands = _commands(size, limits)
    of_commands[:] = np.minimum(of_commands, np.maximum(limits, np.finfo(float).tiny))
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(repeating - before) / size)


class Loops:
    """Loops of members (n,) at their steady motions; runs test whether they settle with other factors and delays.

    delay: the loops' own delays, in steps. limits: (n, channels), the largest commands. repeating: as in `_what_repeats`.
    """

    def __init__(
        self, study: Study, places: np.ndarray, delay: np.ndarray, limits: np.ndarray, motion: Motion,
        repeating: np.ndarray, begin: int,
    ):  # fmt: skip
        self.study, self.places, self.delay = study, places, delay
        self.limits, self.motion, self.repeating, self.begin = np.maximum(limits, 1e-12), motion, repeating, begin

    def return_to_it(self) -> np.ndarray:
        """Mask of unchanged loops that return to their motions (n,), by a run."""
        every = np.arange(len(self.places))
        well, last = self._judged(np.ones(len(every)), self.delay, every)
        near = _apart(last, self.repeating, self.limits)[:, : 9 + self.limits.shape[1]] <= TILTS * self.study.tilt
        return np.asarray(well & near.all(axis=1))

    def settle(self, factor: np.ndarray, steps: np.ndarray, some: np.ndarray) -> np.ndarray:
        """Mask of the loops of some members (m,) that settle in a run, each with its factor and its delay in steps."""
        return self._judged(factor, steps, some)[0]

    def _judged(self, factor: np.ndarray, steps: np.ndarray, some: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mask of loops that settle, and the repeating quantities at the end of the run."""
        ticks = self.study.ticks
        settled, near, last = self._run(factor, steps, some, ticks)
        again = np.flatnonzero(near)
        if len(again):
            settled[again] = self._run(factor[again], steps[again], some[again], ticks + ticks // 2)[0]
        return settled, last

    def _run(
        self, factor: np.ndarray, steps: np.ndarray, some: np.ndarray, ticks: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Masks of loops that settle in `ticks` and that need a longer run, and the repeating quantities at the end."""
        bench, tilt, limits, m = self.study.bench, self.study.tilt, self.limits[some], len(some)
        k0, k1 = self.begin, self.begin + ticks * bench.every
        by = np.zeros((m, 12))
        by[:, 3:6] = tilt
        motion = delayed(bench, self.motion.of(some), k0, steps).moved(by)
        highest, first = np.full((3, m, 3 + limits.shape[1]), -np.inf), bench.plan.launches.samples_due(k0, k0)[1]
        lowest, last, within = -highest, np.zeros_like(self.repeating[some]), np.ones(m, bool)
        begun = self.motion.attitude[some]

        def watch(sample: int, values: Mapping[str, np.ndarray]) -> None:
            nonlocal within
            signals = np.concatenate([values["angular_velocity"], values["command"] / limits], axis=2)
            third = np.minimum((sample - first + np.arange(len(signals))) // (ticks // 3), 2)
            for w in np.unique(third):
                highest[w] = np.fmax(highest[w], signals[third == w].max(axis=0))
                lowest[w] = np.fmin(lowest[w], signals[third == w].min(axis=0))
            aside = _aside(values["attitude"][third == 2], begun, "heading" in self.study.held) <= TILTS * tilt
            within &= (aside & ~at_limit(values["command"][third == 2], limits).any(axis=2)).all(axis=0)
            last[:] = _what_repeats(values, self.study.held)[-1]

        numbers = {FACTOR: of_all(factor), DELAY: steps * bench.plan.grid.h}
        after = bench.run(self.places[some], motion, k0, k1, numbers, watch)
        near, swing = np.zeros(m, bool), highest - lowest
        rates, commands = np.linalg.norm(swing[..., :3], axis=2), np.linalg.norm(swing[..., 3:], axis=2)
        within &= np.isfinite(after.position).all(axis=1) & (rates[2] * self.study.period < TILTS * tilt)
        settled = within.copy()
        for sizes in (rates, commands):
            well, undecided = shrinks(sizes, tilt)
            settled &= well
            near |= undecided
        return settled, near & within, last


def _aside(attitude: np.ndarray, begun: np.ndarray, heading: bool) -> np.ndarray:
    """Angles of the vertical, and of the heading if it is held, from their initial directions (k, m) [rad]."""
    apart = np.abs(attitude - begun)
    down = apart[..., 2, :].max(axis=-1)
    return np.maximum(down, apart[..., :2, 0].max(axis=-1)) if heading else down


def shrinks(swing: np.ndarray, tilt: float) -> tuple[np.ndarray, np.ndarray]:
    """Masks (m,) of swings that settle, and of those that need a longer run: near the edge, or with slower modes left.

    swing: (3, m), range of the signal in each third of a run that began turned by a tilt [rad].
    """
    first, second, last = swing
    still = last <= SETTLED * tilt
    with np.errstate(invalid="ignore"):
        less = (last < SHRINKS * second) | (second < SETTLED * first)
    well = still | (less & (last < first))
    return well, ~still & (last > NEAR * second) & (well | (last < FADED * first))
