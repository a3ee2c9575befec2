# SPDX-License-Identifier: Apache-2.0
"""The best width of packets, measured with the kernel on one block, if a run is long enough to repay the time."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.machine import register_width, thread_seconds
from lgvi_warp.engine import widths
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.plan import Plan

# A run that is expected to take longer on its threads is worth the second kernel [s].
LONG = 20.0
# Vehicle-steps that no kernel takes so long for.
FEW = 1e7
# What is timed: so many members, and so many steps of each.
MEMBERS, STEPS, ROUNDS = 512, 128, 5
# A width that is faster by less than this part is not better: readings differ by as much.
WORTH = 0.03


@dataclass(frozen=True)
class WidthTimes:
    """Time per vehicle and step [ns] by width; before: width of the plan; best: width to use."""

    ns: dict[int, float]
    before: int
    best: int


def candidates(plan: Plan, registers: Sequence[int]) -> list[int]:
    """Widths of packets in which one number of all vehicles fills one of these counts of SIMD registers."""
    found = (n * register_width(plan.dtype) for n in registers)
    return [width for width in found if width in widths.WIDTHS]


def measure(
    plan: Plan, others: Sequence[int], rounds: int = ROUNDS, clock: Callable[[], float] = thread_seconds
) -> WidthTimes:
    """Time a plan's kernel at its own width and at others, in turn, on one block."""
    plans = {width: plan.of_width(width, plan.width_source) for width in dict.fromkeys([plan.spec.width, *others])}
    timed = {width: _launch(candidate, clock) for width, candidate in plans.items()}
    seconds = dict.fromkeys(timed, float("inf"))
    for _ in range(rounds):
        for width, launch in timed.items():
            seconds[width] = min(seconds[width], launch())
    ns = {width: 1e9 * spent for width, spent in seconds.items()}
    before = plan.spec.width
    fastest = min(ns, key=lambda width: ns[width])
    return WidthTimes(ns, before, fastest if ns[fastest] < (1.0 - WORTH) * ns[before] else before)


def _launch(plan: Plan, clock: Callable[[], float]) -> Callable[[], float]:
    """Make a function that restarts some members, advances them, and returns the time per member and step [s]."""
    plan.compile()
    count, steps = min(plan.ensemble.members, MEMBERS), min(plan.grid.steps, STEPS)
    members = plan.ensemble.select(0, count)
    packets = Packets(plan, members)

    def launch() -> float:
        packets.refill(members)
        begun = clock()
        packets.launch(0, steps)
        return (clock() - begun) / (count * steps)

    launch()
    return launch


def with_best_width(plan: Plan, threads: int, clock: Callable[[], float] = thread_seconds) -> Plan:
    """Return a plan with the faster width. For a long run two widths are measured; the result is saved for later."""
    asked, choice = plan.width_source in ("asked for", "measured"), plan.kernel_choice
    work = plan.ensemble.members * plan.grid.steps
    # The bits of adaptive steps depend on the packet, and a function of the host is called between launches.
    if asked or plan.method.adaptive or choice.has_callback or work < FEW:
        return plan
    if work * _launch(plan, clock)() < LONG * threads:
        return plan
    one, two = candidates(plan, (1,)), candidates(plan, (2,))
    found = measure(plan, two if [plan.spec.width] == one else one, clock=clock)
    with contextlib.suppress(OSError, SceneError):  # a run goes on where nothing can be kept
        widths.keep_measured(plan.kernel.hash, found.best)
    return plan.of_width(found.best, "measured")
