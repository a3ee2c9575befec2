# SPDX-License-Identifier: Apache-2.0
"""Runs with tangents: derivatives of all saved samples with respect to numbers of the scene, two in one pass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.status import Status
from lgvi_warp.control.loiter import Loiter
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.engine.kernel_spec import COMPENSATED
from lgvi_warp.engine.plan import Plan, choose_plan
from lgvi_warp.engine.tangents import Jacobians
from lgvi_warp.physics.terms.wrench import WrenchSchedule
from lgvi_warp.results.drawn import DrawnParameters, DrawnStarts
from lgvi_warp.results.result import Result
from lgvi_warp.runs.request import Request
from lgvi_warp.runs.run import refuse_failed, run_plan
from lgvi_warp.scene.copies import with_copies
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.variations import targets

# Tangents of one pass: with more, the numbers of a step no longer fit into a core's registers.
AT_ONCE = 2
# Bases of methods that iterate to a tolerance, by the values alone: where these stop, slopes may not have converged.
ITERATED = ("psi_w",)
# Entries of a part of a controller that act by whole looks or by chance: a run does not depend on them smoothly.
UNDEFINED = {
    "controller.delay": "is counted in whole steps",
    "every": "is counted in whole looks",
    "latency": "is counted in whole looks",
    "dropout": "is a probability, by which whole looks are lost",
    "quantum": "rounds: what follows jumps",
    "time": "sets the step at which something begins",
    "radius": "sets the tick at which a leg is done",
    "loiter_turns": "sets the tick at which a circle is done",
    "loiter_time": "sets the tick at which a circle is done",
    **dict.fromkeys(("mouth", "funnel", "judged"), "sets the tick at which the vehicle goes round"),
    "at": "sets the time at which a member ends",
}


def check(request: Request, tangents: Any, store: Any, start: Any, on_block: Any) -> tuple[str, ...]:
    """Check the names of the numbers, and refuse arguments that a run with tangents does not support, before any work."""
    faults, fleet = Faults(), request.fleet
    names = _names(faults, tangents)
    faults.raise_if_any()
    if store is not None:
        faults.add("tangents", "...", "are kept in memory, and not in a store", "leave store out")
    if start is not None:
        faults.add("tangents", "...", "begin at t = 0, and not where another run ended", "leave start out")
    if request.executor is not None and not isinstance(request.executor, Threads):
        faults.add("tangents", "...", "are kept by threads of this process", 'give executor="threads"')
    if not request.observed.samples:
        faults.add("tangents", "...", "are derivatives of samples, of which none are kept", 'give keep="all"')
    if request.observed.until is not None:
        faults.add("tangents", "...", "are of all members, and not until an interval is narrow", "leave until out")
    if on_block is not None:
        faults.add("on_block", "...", "is called with samples alone, and tangents come with the result", "leave it out")
    if request.save is not None and getattr(request.save, "final", None):
        faults.add("save.final", True, "is the end of a run without slopes, from which none can go on", "leave it out")
    if request.width == 1:
        faults.add("width", 1, "is too narrow for tangents", "give 2 or more, or leave it out")
    controller = fleet.scene.controller
    if controller is not None and controller.callback is not None:
        faults.add("tangents", "...", "end at a function of the host, which knows no slopes", "take the callback out")
    for name in names:
        for word, problem in UNDEFINED.items():
            if name == word or (name.split("[")[0].rpartition(".")[2] == word and _timed(name, fleet)):
                faults.add("tangents", name, f"{problem}, so that there is no derivative", "leave it out")
        if any(name.startswith(f"{schedule}.times[") for schedule in _jumping(fleet)):
            problem = "is when a push jumps, which a run meets at whole steps, so that there is no derivative"
            faults.add("tangents", name, problem, "leave it out")
    faults.raise_if_any()
    return names


def _names(faults: Faults, tangents: Any) -> tuple[str, ...]:
    listed = [tangents] if isinstance(tangents, str) else items_of(tangents)
    if not listed or not all(isinstance(name, str) for name in listed):
        faults.add(
            "tangents", tangents, "is not a list of names", 'give tangents=["vehicle.mass", "start.velocity[0]"]'
        )
        return ()
    return tuple(", ".join(target.label for target in targets(name)) for name in listed)


def _timed(name: str, fleet: Ensemble) -> bool:
    """Whether a name belongs to an event, or to a part of the controller other than a circle."""
    scene = fleet.scene
    parts = scene.controller.parts if scene.controller else ()
    return name.partition(".")[0] in {part.key for part in (*parts, *scene.events) if not isinstance(part, Loiter)}


def _jumping(fleet: Ensemble) -> list[str]:
    """Keys of the schedules with steps (jumps)."""
    return [term.key for term in fleet.scene.terms if isinstance(term, WrenchSchedule) and term.jumps]


def run_with_tangents(
    request: Request, plan: Plan, tangents: Sequence[str], progress: Callable[[float], None] | None
) -> Result:
    """Run a request with the derivatives of its samples; plan: the plan of the same run without derivatives."""
    _check_plan(plan)
    every = with_copies(request.fleet, tangents)
    result: Result | None = None
    columns: dict[str, list[np.ndarray]] = {}
    passes = _passes(tangents)
    for i, names in enumerate(passes):
        part = plan_of(plan, names, every)
        kept = Jacobians(part)
        settings: dict[str, Any] = {"fields": request.saved, "executor": request.executor, "slopes": kept}
        settings["progress"] = _share(progress, i, len(passes))
        if result is None:
            settings["observed"] = request.observed
        of_pass = run_plan(part, request.count(plan), **settings)
        result = of_pass if result is None else result
        for name, slopes in kept.fields.items():
            columns.setdefault(name, []).append(slopes)
        if i > 0:
            result = replace(result, compile_seconds=result.compile_seconds + of_pass.compile_seconds,
                             run_seconds=result.run_seconds + of_pass.run_seconds)  # fmt: skip
        part.free_packets.clear()
    assert result is not None
    jacobian = {
        name: np.concatenate(parts, axis=-1)[..., : len(tangents)]
        for name, parts in columns.items()
        if name in request.saved
    }
    gone = _without(result, jacobian)
    # What carries the copies would keep them as long as the result.
    own: dict[str, Any] = {
        "parameters": DrawnParameters(request.fleet, result.members),
        "starts": DrawnStarts(request.fleet, result.members),
    }
    remarks = (*_remarks(request.fleet, plan), *_of_members(gone, jacobian, len(result.status)))
    result = replace(result, jacobian=jacobian, tangents=tuple(tangents), messages=(*result.messages, *remarks), **own)
    return refuse_failed(result, plan)


def _passes(tangents: Sequence[str]) -> list[Sequence[str]]:
    """Group the names by pass. A last single name is paired with the first name, so that one kernel serves all passes."""
    passes = [tangents[first : first + AT_ONCE] for first in range(0, len(tangents), AT_ONCE)]
    if len(passes) > 1 and len(passes[-1]) < AT_ONCE:
        passes[-1] = [*passes[-1], tangents[0]]
    return passes


def _share(progress: Callable[[float], None] | None, i: int, passes: int) -> Callable[[float], None] | None:
    return None if progress is None else lambda fraction: progress((i + fraction) / passes)


def _check_plan(plan: Plan) -> None:
    if plan.dtype == COMPENSATED:
        problem = "keeps sums whose rest has no slope: their order alone makes them exact"
        raise refusal("dtype", COMPENSATED, problem, 'give dtype="float64" for tangents')
    method = plan.method
    if method.base in ITERATED or method.gauss:
        problem = "iterates until its values have converged, which slopes need not have"
        raise refusal("method", method.name, problem, 'give "psi_s", "psi_x" or "rk8" for tangents')


def plan_of(plan: Plan, tangents: Sequence[str], every: Ensemble) -> Plan:
    """Plan the same run with derivatives by these numbers; every: the ensemble with derivatives by all, for one kernel."""
    asked = plan.width_source == "asked for"
    # Slopes give the core enough to do beside each other: values of one register leave more of these free.
    width = plan.spec.width if asked else max(2, machine.register_width(plan.dtype))
    return choose_plan(
        with_copies(plan.ensemble, tangents, every),
        plan.method,
        plan.grid,
        plan.fields,
        plan.dtype,
        width,
        plan.checks,
        plan.on_failure,
        ticks=plan.launches.ticks,
        read_at_ticks=plan.layout.read_at_ticks,
        width_source=plan.width_source if asked else "one register",
    )


def _without(result: Result, jacobian: dict[str, np.ndarray]) -> np.ndarray:
    """Set derivatives to NaN from the time at which a member ended; returns which members (n,) ended."""
    ended = np.asarray(result.status) != Status.OK
    if ended.any():
        gone = ended & ~(result.time[:, None] < result.failure_time)
        for slopes in jacobian.values():
            slopes[gone] = np.nan
    return ended


def _of_members(ended: np.ndarray, jacobian: dict[str, np.ndarray], members: int) -> list[str]:
    texts = []
    if ended.any():
        texts.append(
            f"tangents: {ended.sum():,} of {members:,} members ended on the way: from there on their derivatives are NaN, "
            "since the time at which a member ends changes too"
        )
    unknown = np.zeros(members, bool)
    for slopes in jacobian.values():
        unknown |= ~np.isfinite(slopes).all(axis=(0, *range(2, slopes.ndim)))
    if (unknown & ~ended).any():
        texts.append(
            f"tangents: {(unknown & ~ended).sum():,} of {members:,} members have derivatives that are not numbers: they come "
            "to a point where something that acts has none"
        )
    return texts


def _remarks(fleet: Ensemble, plan: Plan) -> list[str]:
    """Messages on effects that the derivatives of this run leave out."""
    texts = []
    numbers = fleet.parameters(0, fleet.members)
    parts = fleet.scene.controller.parts if fleet.scene.controller else ()
    rounding = [part.key for part in parts if np.any(numbers.get(f"{part.key}.quantum", 0.0))]
    if rounding:
        texts.append(
            f"tangents: {', '.join(rounding)} rounds: the slope of a rounded reading is 0, so derivatives leave out what goes "
            "through it. Set quantum = 0 for those of the loop without it"
        )
    if plan.method.adaptive or plan.spec.substep:
        texts.append("tangents: derivatives hold the lengths of the steps that are chosen on the way")
    return texts
