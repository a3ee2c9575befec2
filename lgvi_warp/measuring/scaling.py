# SPDX-License-Identifier: Apache-2.0
"""Cost of a member's step: against members and threads, and of each term of a scene beside the bare one."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.arguments import listed, whole_number
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring.cost import Cost, costs
from lgvi_warp.measuring.speed import least
from lgvi_warp.methods.method import Method
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.runs.request import ensemble_of, scene_of
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

# Row of a scene without terms, and row of all its terms together.
NONE, ALL = "none", "all terms"


def scaling(
    fleet: Ensemble,
    members: Sequence[int] | None = None,
    threads: Sequence[int] | None = None,
    *,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    rounds: int = 3,
) -> list[dict[str, Any]]:
    """Measure what a member's step costs in whole runs of more and fewer members, by more and fewer threads.

    Runs are timed in turn, by the clock on the wall; the least of several readings counts, since other work on the machine can
    only lengthen one.

    Args:
        fleet: The ensemble; its first members run.
        members: Numbers of members, each at most those of the fleet; default powers of ten, and all.
        threads: Numbers of threads; default powers of two, and all of this machine.
        method: Name of the method, or a Method; default that of the scene.
        h: Step [s]; default `run.step` of the scene.
        t1: End of the runs [s]; default `run.duration` of the scene.
        rounds: Number of readings of each run; default 3.

    Returns:
        A row for each number of members and of threads: "members", "threads", "steps" and "ns_per_vehicle_step" [ns].

    Raises:
        SceneError: An argument is at fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> fleet = lw.Ensemble(lw.Scene.named("sphere"), members=8)
        >>> rows = lw.bench.scaling(fleet, [1, 8], [1], method="psi_s", h=0.1, t1=1.0)
        >>> [row["members"] for row in rows]
        [1, 8]
    """
    fleet = ensemble_of(fleet)
    sizes, counts = members_and_threads(fleet, members, threads)
    plans = [make_plan(fleet.subset(np.arange(n)), method, h=h, t1=t1) for n in sizes]
    for plan in plans:
        plan.compile()
    return timed_runs(plans, counts, rounds)


def members_and_threads(
    fleet: Ensemble, members: Sequence[int] | None, threads: Sequence[int] | None
) -> tuple[list[int], list[int]]:
    """Numbers of members and of threads that are asked for; None: of both some up to all. Raises SceneError."""
    sizes = rising(10, fleet.members) if members is None else _numbers("members", members)
    counts = rising(2, machine.thread_count()) if threads is None else _numbers("threads", threads)
    faults = Faults()
    if not sizes or sizes[0] < 1 or sizes[-1] > fleet.members:
        faults.add("members", members, "is not within the fleet", f"name numbers from 1 to {fleet.members}")
    if not counts or counts[0] < 1:
        faults.add("threads", threads, "holds no number of threads", "name numbers from 1 on")
    faults.raise_if_any()
    return sizes, counts


def timed_runs(
    plans: Sequence[Plan], counts: Sequence[int], rounds: int, *, run: Callable[[Plan, int], Any] = run_plan,
    clock: Callable[[], float] = time.perf_counter,
) -> list[dict[str, Any]]:  # fmt: skip
    """Time whole runs of plans by so many threads, in turn; the rows of `scaling`."""
    runs = [(plan, count) for plan in plans for count in counts]
    readings = least([functools.partial(run, *pair) for pair in runs], rounds, clock=clock)
    return [
        {
            "members": plan.ensemble.members,
            "threads": count,
            "steps": plan.grid.steps,
            "ns_per_vehicle_step": round(1e9 * seconds / (plan.ensemble.members * plan.grid.steps), 3),
        }
        for (plan, count), seconds in zip(runs, readings, strict=True)
    ]


def rising(base: int, most: int) -> list[int]:
    """List the powers of a number up to a bound, and the bound."""
    powers = [1]
    while powers[-1] * base < most:
        powers.append(powers[-1] * base)
    return sorted({*powers, most})


def term_cost(
    scene: Scene,
    *,
    method: str | Method | None = None,
    h: float | None = None,
    dtype: str | None = None,
    members: int = 64,
    rounds: int = 5,
) -> list[dict[str, Any]]:
    """Measure what a step costs without terms, with each term of a scene alone, and with all of them.

    The scenes take turns. Costs are processor time of the thread that runs the kernel, the least of several readings. What
    steers the vehicle, and what ends a run, is left out. Each kernel is compiled once, which takes some seconds.

    Args:
        scene: The scene.
        method: Name of the method, or a Method; default the one that the whole scene runs by.
        h: Step [s]; default `run.step` of the scene.
        dtype: "float64", "float32" or "float32_compensated"; default that of the scene.
        members: Number of vehicles that step together; default 64.
        rounds: Number of readings of each scene; default 5.

    Returns:
        A row for each scene: "term", "method", "dtype", "ns_per_vehicle_step" [ns], and "more_than_none" [ns], what it costs
        more than the scene without terms.

    Raises:
        SceneError: The scene has no terms, or an argument is at fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("sphere", terms=[lw.terms.Drag(linear=[1.0] * 6)])
        >>> rows = lw.bench.term_cost(scene, method="psi_s", h=0.1)
        >>> [row["term"] for row in rows]
        ['none', 'drag']
    """
    scene = scene_of(scene, "scene")
    faults = Faults()
    if h is not None:
        h = faults.positive("h", h)
    faults.raise_if_any()
    if not scene.terms:
        raise SceneError(["scene.terms: is empty; give the scene terms whose cost is to be measured"])
    step = scene.run.step if h is None else h
    plans = plans_of_terms(scene, members, method, step, dtype)
    for plan in plans.values():
        plan.compile()
    return priced(plans, costs(list(plans.values()), rounds))


def plans_of_terms(
    scene: Scene, members: int, method: str | Method | None, h: float | None, dtype: str | None
) -> dict[str, Plan]:
    """Plan ten steps of a scene without terms, with each alone and with all, by the method that the whole scene runs by.

    What steers the vehicle, and what ends a run, is left out.
    """

    def plan_of(terms: tuple[Term, ...], method: str | Method | None) -> Plan:
        bare = dataclasses.replace(scene, terms=terms, controller=None, events=(), ensemble_settings=None)
        return make_plan(Ensemble(bare, members, 1), method, h=h, t1=None if h is None else 10.0 * h, dtype=dtype)

    casts: dict[str, tuple[Term, ...]] = {NONE: ()} | {term.key: (term,) for term in scene.terms}
    if len(scene.terms) > 1:
        casts[ALL] = tuple(scene.terms)
    chosen = plan_of(tuple(scene.terms), method).method
    return {name: plan_of(terms, chosen) for name, terms in casts.items()}


def priced(plans: Mapping[str, Plan], prices: Sequence[Cost]) -> list[dict[str, Any]]:
    """The rows of `term_cost` of plans by name, of which the first is the scene without terms."""
    nanoseconds = [
        1e3 * price.us_per_vehicle_second * plan.grid.h for price, plan in zip(prices, plans.values(), strict=True)
    ]
    return [
        {
            "term": name,
            "method": plan.method.name,
            "dtype": plan.dtype,
            "ns_per_vehicle_step": round(price, 3),
            "more_than_none": round(price - nanoseconds[0], 3),
        }
        for (name, plan), price in zip(plans.items(), nanoseconds, strict=True)
    ]


def _numbers(key: str, values: Any) -> list[int]:
    """The numbers of a list, each once, rising."""
    return sorted({whole_number(key, value, -(2**31)) for value in listed(key, values, "whole numbers from 1")})
