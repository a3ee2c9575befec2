# SPDX-License-Identifier: Apache-2.0
"""Cost of a method's step on one core: CPU time of the thread that runs it, the smallest of several readings."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from lgvi_warp.common.machine import thread_seconds
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.plan import Plan
from lgvi_warp.physics.terms.noisy import NoisyTerm

# Approximate length of a launch that is timed [s].
TIMED = 2e-3
# Readings disagree where their median is above the least by this factor.
DISAGREE = 1.3
# The least reading is trusted where another is within this part of it;
# else as many readings again are taken, up to MORE times.
NEAR = 0.05
MORE = 3
# Largest number of settings that a message names.
MOST_TOLD = 6


@dataclass(frozen=True)
class Cost:
    """Cost of a setting. spread: median reading divided by the smallest, which is the cost."""

    us_per_vehicle_second: float
    spread: float


def costs(
    plans: Sequence[Plan], rounds: int = 5, *, make: Callable[..., Packets] = Packets,
    clock: Callable[[], float] = thread_seconds, grows: Callable[[Plan], bool] | None = None,
) -> list[Cost]:  # fmt: skip
    """Measure the cost of plans in turn; plans that run the same kernel share one number."""
    calls, steps = launches(plans, make=make, clock=clock)
    kinds = [Kind(plan.spec, plan.grid.h, (grows or work_grows)(plan)) for plan in plans]
    per_step = readings(kinds, lambda which: timed([calls[i] for i in which], rounds, clock=clock) / steps[which])
    return [Cost(1e6 * least / plan.grid.h, spread)
            for plan, (least, spread) in zip(plans, of_steps(kinds, per_step), strict=True)]  # fmt: skip


def readings(kinds: Sequence[Kind], read: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Read the cost of a step of each kind (kinds, rounds) [s]; repeat kinds whose two smallest readings disagree.

    read: function from indices of kinds to readings of one step (indices, rounds) [s].
    """
    seconds = read(np.arange(len(kinds)))
    rounds = seconds.shape[1]
    for _ in range(MORE):
        unsure = np.flatnonzero(~np.array(confirmed(kinds, seconds), dtype=bool))
        if not len(unsure):
            break
        again = np.full((len(kinds), rounds), np.nan)
        again[unsure] = read(unsure)
        seconds = np.concatenate([seconds, again], axis=1)
    return seconds


@dataclass(frozen=True)
class Kind:
    """Key of readings that measure the same work: the kernel, the step [s], and whether a longer step is more work."""

    kernel: Hashable
    h: float
    grows: bool = False


def of_steps(kinds: Sequence[Kind], seconds: np.ndarray) -> list[tuple[float, float]]:
    """Cost of a step of each kind [s] from all readings (kinds, rounds), and their median divided by the smallest.

    Most kernels do the same work in a step of any length; the cost is then the smallest of all readings of the kernel.
    If a longer step is more work, only readings of steps as long or longer count, since none of them is below the cost.
    """
    prices = []
    for kind in kinds:
        bounding = _bounding(kind, kinds, seconds)
        least = float(np.nanmin(bounding))
        # Longer steps may truly cost more, so only readings of this very step can disagree.
        same = [candidate.kernel == kind.kernel and candidate.h == kind.h for candidate in kinds]
        alike = seconds[same] if kind.grows else bounding
        prices.append((least, float(np.nanmedian(alike) / np.nanmin(alike))))
    return prices


def confirmed(kinds: Sequence[Kind], seconds: np.ndarray) -> list[bool]:
    """True for each kind whose second smallest reading is near its smallest: then both count as undisturbed."""
    met_again = []
    for kind in kinds:
        rising = np.sort(_bounding(kind, kinds, seconds), axis=None)  # NaN is last
        met_again.append(len(rising) > 1 and bool(rising[1] <= (1.0 + NEAR) * rising[0]))
    return met_again


def _bounding(kind: Kind, kinds: Sequence[Kind], seconds: np.ndarray) -> np.ndarray:
    """The readings that cannot be below the kind's cost."""
    bounds_it = [candidate.kernel == kind.kernel and (not kind.grows or candidate.h >= kind.h) for candidate in kinds]
    return np.asarray(seconds[np.array(bounds_it)])


def launches(
    plans: Sequence[Plan], *, make: Callable[..., Packets] = Packets, clock: Callable[[], float] = thread_seconds
) -> tuple[list[Callable[[], object]], np.ndarray]:
    """Prepare a launch of each plan, long enough to time, and its number of steps times vehicles (plans, 1)."""
    calls: list[Callable[[], object]] = []
    steps = np.empty((len(plans), 1))
    for i, plan in enumerate(plans):
        packets = make(plan, plan.ensemble.select(0, plan.ensemble.members))
        # The cheapest step takes 10 ns: a launch of a tenth of these steps tells how long one takes.
        guess = 10e-9 * len(plan.method.stages) * max(plan.ensemble.members, plan.spec.width)
        few = int(min(max(0.1 * TIMED / guess, 1), 10_000))
        begun = clock()
        packets.advance(0, few)
        n = int(min(max(TIMED * few / max(clock() - begun, 1e-9), 10), 100_000))
        calls.append(functools.partial(packets.advance, 0, n))
        steps[i] = n * plan.ensemble.members
    return calls, steps


def timed(
    calls: Sequence[Callable[[], object]], rounds: int, *, clock: Callable[[], float] = thread_seconds
) -> np.ndarray:
    """CPU time of calls in interleaved rounds (calls, rounds) [s], after one call of each to warm up."""
    in_turn(calls, 1, clock)
    # Nothing shorter than the clock's resolution can be measured.
    return np.maximum(in_turn(calls, rounds, clock), time.get_clock_info("thread_time").resolution)


def in_turn(calls: Sequence[Callable[[], object]], rounds: int, clock: Callable[[], float]) -> list[list[float]]:
    """Time calls in turn, so that a slow period of the machine slows all of them; the readings of each [s]."""
    readings: list[list[float]] = [[] for _ in calls]
    for _ in range(rounds):
        for call, seconds in zip(calls, readings, strict=True):
            begun = clock()
            call()
            seconds.append(clock() - begun)
    return readings


def work_grows(plan: Plan) -> bool:
    """True if a longer step is more work.

    This holds if a step iterates to a tolerance (except for the quartic's few Newton steps), if each packet chooses its
    own steps, or if a step takes several draws of noise.
    """
    spec, letters = plan.spec, {letter for letter, _ in plan.spec.maps}
    newton = spec.explicit is None and spec.adaptive and (spec.solver != "quartic" or "W" in letters)
    draws = any(isinstance(term, NoisyTerm) and term.draws(plan.grid.h) > 1 for term, _ in plan.kernel_choice.laws)
    return bool(spec.gauss) or spec.averages is not None or newton or draws or plan.method.adaptive


def disagreement(spreads: Sequence[tuple[str, float]]) -> str | None:
    """Message about settings whose cost readings disagree; spreads: (name, median divided by the smallest reading)."""
    worst: dict[str, float] = {}
    for name, spread in spreads:
        if spread > DISAGREE:
            worst[name] = max(worst.get(name, 1.0), spread)
    if not worst:
        return None
    ranked = sorted(worst, key=lambda name: -worst[name])
    listed = ", ".join(f"{name} ({worst[name]:.2g} times)" for name in ranked[:MOST_TOLD])
    more = f" and {len(ranked) - MOST_TOLD} more" if len(ranked) > MOST_TOLD else ""
    return (f"readings of cost disagree: their median is above the least, which is taken, for {listed}{more}; other programs "
            "run at the same time, and costs that lie closer are not told apart. Run again on an idle machine")  # fmt: skip


def agreement_text(spreads: Sequence[float]) -> str:
    """Sentence on the readings of costs and their agreement."""
    most = max((spread for spread in spreads if math.isfinite(spread)), default=1.0)
    return f"CPU time of one thread, the least of several readings; their median is at most {most:.2f} times that"
