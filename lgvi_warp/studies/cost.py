"""What a step of a method costs on one core: CPU time of the thread that makes it, the least of several readings."""

from __future__ import annotations

import functools
import math
import os
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.plan import Plan

# A launch that is timed takes about so long [s].
TIMED = 2e-3
# Readings disagree where their median is beyond so many times the least.
DISAGREE = 1.3
# The least reading is sure where another is so near; if none is, so many times as many are taken again.
NEAR = 0.05
MORE = 3
# So many are told by name.
MOST_TOLD = 6


def thread_seconds() -> float:
    """CPU time that this thread has taken [s]: what other programs take does not count.

    A kernel on the CPU runs in the thread that launches it, so its time is that thread's. Windows counts CPU time in ticks
    of 16 ms, too long for a launch: there it is the time of day.
    """
    return time.perf_counter() if os.name == "nt" else time.thread_time()


@dataclass(frozen=True)
class Cost:
    """What a setting costs. us_per_vehicle_second: microseconds of one core per vehicle and simulated second.

    spread: the median of the readings over the least, which is taken; near 1 on a machine that does nothing else.
    """

    us_per_vehicle_second: float
    spread: float

    @property
    def doubtful(self) -> bool:
        """Whether its readings disagree."""
        return self.spread > DISAGREE


def costs(plans: Sequence[Plan], rounds: int = 5) -> list[Cost]:
    """Of each plan: one number for all plans that run the same kernel, whatever their step.

    The readings are of interleaved rounds: what slows the machine for a while slows them all.
    """
    calls, steps = launches(plans)
    kinds = [Kind(plan.spec, plan.grid.h, work_grows(plan)) for plan in plans]
    seconds = timed(calls, rounds)
    for _ in range(MORE):
        unsure = ~np.array(confirmed(kinds, seconds / steps), dtype=bool)
        if not unsure.any():
            break
        again = np.full((len(plans), rounds), np.nan)
        again[unsure] = timed([calls[i] for i in np.flatnonzero(unsure)], rounds)
        seconds = np.concatenate([seconds, again], axis=1)
    return [Cost(1e6 * least / plan.grid.h, spread)
            for plan, (least, spread) in zip(plans, of_steps(kinds, seconds / steps), strict=True)]  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """Which readings belong together: the kernel, the step h [s], whether longer steps are more work."""

    kernel: Hashable
    h: float
    grows: bool = False


def of_steps(kinds: Sequence[Kind], seconds: np.ndarray) -> list[tuple[float, float]]:
    """(seconds of a step, median over least) of each kind, from readings (kinds, rounds), NaN where there is none.

    A step of one kernel is the same work whatever its length, and costs the least of all its readings. Where a longer step
    is more work, it costs the least of the readings of steps as long or longer, each of which is at least its cost.
    """
    found = []
    for kind in kinds:
        own = _bounding(kind, kinds, seconds)
        least = float(np.nanmin(own))
        # Longer steps may be dearer by right: whether readings disagree is seen in those of this step alone.
        alike = seconds[[other.kernel == kind.kernel and other.h == kind.h for other in kinds]] if kind.grows else own
        found.append((least, float(np.nanmedian(alike) / np.nanmin(alike))))
    return found


def confirmed(kinds: Sequence[Kind], seconds: np.ndarray) -> list[bool]:
    """Whether the least reading of each kind was met again, to NEAR: by chance a busy machine leaves none alone."""
    found = []
    for kind in kinds:
        rising = np.sort(_bounding(kind, kinds, seconds), axis=None)  # NaN is last
        found.append(len(rising) > 1 and bool(rising[1] <= (1.0 + NEAR) * rising[0]))
    return found


def _bounding(kind: Kind, kinds: Sequence[Kind], seconds: np.ndarray) -> np.ndarray:
    """The readings of which none can be below the kind's cost."""
    like = [other.kernel == kind.kernel and (not kind.grows or other.h >= kind.h) for other in kinds]
    return np.asarray(seconds[np.array(like)])


def launches(plans: Sequence[Plan]) -> tuple[list[Callable[[], object]], np.ndarray]:
    """A call of each plan that is worth timing, and the steps of vehicles that it makes (plans, 1)."""
    calls: list[Callable[[], object]] = []
    steps = np.empty((len(plans), 1))
    for i, plan in enumerate(plans):
        packets = Packets(plan, plan.ensemble.select(0, plan.ensemble.members))
        guess = 10e-9 * len(plan.method.stages) * max(plan.ensemble.members, plan.spec.width)
        n = int(min(max(TIMED / guess, 10), 100_000))
        calls.append(functools.partial(packets.advance, 0, n))
        steps[i] = n * plan.ensemble.members
    return calls, steps


def timed(calls: Sequence[Callable[[], object]], rounds: int) -> np.ndarray:
    """CPU seconds of each call in each round, (calls, rounds); before the first, each is made once."""
    for call in calls:
        call()
    found = np.empty((len(calls), rounds))
    for j in range(rounds):
        for i, call in enumerate(calls):
            begun = thread_seconds()
            call()
            found[i, j] = thread_seconds() - begun
    # Below what the clock can tell apart nothing is known.
    return np.maximum(found, time.get_clock_info("thread_time").resolution)


def work_grows(plan: Plan) -> bool:
    """Whether a longer step is more work: where one iterates to a tolerance, but for the quartic's few Newton steps.

    Also where each packet chooses its steps.
    """
    spec, letters = plan.spec, {letter for letter, _ in plan.spec.maps}
    newton = spec.explicit is None and spec.adaptive and (spec.solver != "quartic" or "W" in letters)
    return bool(spec.gauss) or spec.averages is not None or newton or plan.method.adaptive


def disagreement(priced: Sequence[tuple[str, Cost]]) -> str | None:
    """What to say of costs whose readings disagree, by the names of their settings; None where all agree."""
    worst: dict[str, float] = {}
    for name, cost in priced:
        if cost.doubtful:
            worst[name] = max(worst.get(name, 1.0), cost.spread)
    if not worst:
        return None
    ranked = sorted(worst, key=lambda name: -worst[name])
    listed = ", ".join(f"{name} ({worst[name]:.2g} times)" for name in ranked[:MOST_TOLD])
    more = f" and {len(ranked) - MOST_TOLD} more" if len(ranked) > MOST_TOLD else ""
    return (f"readings of cost disagree: their median is above the least, which is taken, for {listed}{more}; other programs "
            "run at the same time, and costs that lie closer are not told apart; run again on an idle machine")  # fmt: skip


def agreement_text(spreads: Sequence[float]) -> str:
    """How costs were read, and how well the readings agree."""
    most = max((spread for spread in spreads if math.isfinite(spread)), default=1.0)
    return f"CPU time of one thread, the least of several readings; their median is at most {most:.2f} times that"
