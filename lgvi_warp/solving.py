"""The walk from an ensemble to a result."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp import machine, notation
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.errors import Faults, SceneError, shown
from lgvi_warp.executors import threads as thread_executor
from lgvi_warp.inertia import Frame
from lgvi_warp.method import Method
from lgvi_warp.packets import Packets
from lgvi_warp.plan import Block, Plan, blocks
from lgvi_warp.result import Result
from lgvi_warp.saveat import SaveAt, time_grid
from lgvi_warp.scene import Scene
from lgvi_warp.status import Status, StatusArray

SHAPES: dict[str, tuple[int, ...]] = {
    "position": (3,),
    "attitude": (3, 3),
    "velocity": (3,),
    "angular_velocity": (3,),
}


def solve(
    fleet: Ensemble | Scene,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    *,
    threads: int | None = None,
    width: int | None = None,
    checks: str = "safe",
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Advance every member of the fleet from t = 0 to t1 and keep the samples asked for.

    fleet: an Ensemble, or a Scene for its own ensemble (one vehicle if it has none).
    method: a name or a Method. h, t1: step and end [s]. dtype: "float64", "float32", or "float32_compensated", which
    keeps each number of the state as a sum of two (many short steps, far from the origin). What is left out is taken from
    the scene's [run] section (method "psi_s" and float64 where it says nothing).
    save: what to keep (default: every [run] save_every of the scene, else the start and the end).
    threads: default all cores. width: vehicles per packet, default from the CPU.
    checks: "safe" gives each member a status and freezes it when it fails; "none" leaves that code out.
    progress: called with the fraction of the work that is done, from the threads that do it.

    Raises SceneError naming every fault of the arguments. Prints nothing. The same inputs give the same bits for any
    number of threads, on one type of machine.
    """
    if not isinstance(fleet, Ensemble | Scene):
        raise SceneError(
            [f"fleet = {shown(fleet)}: is neither an Ensemble nor a Scene; give lw.Scene(...) or lw.Ensemble(...)"]
        )
    ensemble = fleet if isinstance(fleet, Ensemble) else Ensemble.from_scene(fleet)
    plan = make_plan(ensemble, method, h, t1, save, dtype, width=width, checks=checks)
    faults = Faults()
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, int) or threads < 1):
        faults.add("threads", threads, "is not a whole number above 0", "give 1 or more, or leave it out for all cores")
    faults.raise_if_any()
    return run_plan(plan, threads or machine.thread_count(), progress)


def make_plan(
    ensemble: Ensemble,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    *,
    width: int | None = None,
    checks: str = "safe",
) -> Plan:
    """Settle a run's settings, from the arguments and then from the scene's [run]. Raises SceneError."""
    settings = ensemble.scene.run
    h = settings.step if h is None else h
    t1 = settings.duration if t1 is None else t1
    faults = Faults()
    if h is None:
        faults.add("h", h, "is missing", "give the step in seconds: solve(..., h=0.01) or [run] step")
    else:
        h = faults.positive("h", h)
    if t1 is None:
        faults.add("t1", t1, "is missing", "give the end in seconds: solve(..., t1=150.0) or [run] duration")
    else:
        t1 = faults.positive("t1", t1)
    if save is not None and not isinstance(save, SaveAt):
        faults.add("save", save, "is no SaveAt", "give lw.SaveAt(every=1.0) or lw.SaveAt(at=[...])")
    faults.raise_if_any()
    every = settings.save_every
    # A spacing that the scene gave for its own duration says nothing about a shorter run.
    dropped = save is None and every is not None and every > float(t1)  # type: ignore[arg-type]
    if save is None:
        save = SaveAt(every=None if dropped else every)
    grid = time_grid(float(h), float(t1), save)  # type: ignore[arg-type]
    if dropped:
        text = f"run.save_every = {every} s is longer than the run, {t1} s: only the start and the end are kept"
        grid = replace(grid, messages=(*grid.messages, text))
    chosen = method if isinstance(method, Method) else Method(method or settings.method)
    dtype = dtype or settings.dtype
    if chosen.iterations == "auto":
        chosen = replace(chosen, iterations=enough_iterations(ensemble, chosen, grid.h, dtype))
        n = chosen.iterations
        number = f"{n} a solve, enough for" if n is not None else f"to the tolerance: {MOST_FIXED} are too few for"
        text = f"Newton steps {number} every member's start at twice the step"
        grid = replace(grid, messages=(*grid.messages, text))
    return Plan(ensemble, chosen, grid, save.fields, dtype, width, checks)


# Beyond so many Newton steps a fixed number gains nothing over iterating to the tolerance.
MOST_FIXED = 4


def enough_iterations(ensemble: Ensemble, method: Method, h: float, dtype: str) -> int | None:
    """The least Newton steps that leave every member's residual below the tolerance at twice the step; None above 4.

    The residual of a fixed number grows with h |Omega|: twice the step leaves room for members that spin up.
    """
    for n in range(MOST_FIXED + 1):
        fixed = replace(method, iterations=n)
        trial = run_plan(make_plan(ensemble, fixed, 2.0 * h, 2.0 * h, SaveAt(), dtype), machine.thread_count())
        if not np.any(trial.status == Status.NOT_CONVERGED):
            return n
    return None


class _Progress:
    """Fraction of the vehicle-steps made so far, counted from several threads."""

    def __init__(self, total: int, report: Callable[[float], None] | None):
        self._total, self._done, self._report, self._lock = total, 0, report, threading.Lock()

    def add(self, vehicle_steps: int) -> None:
        if self._report is None:
            return
        with self._lock:
            self._done += vehicle_steps
            self._report(self._done / self._total)


def run_plan(plan: Plan, threads: int, progress: Callable[[float], None] | None = None) -> Result:
    """Run every block of the plan and gather the result."""
    compile_seconds = plan.compile()
    n, k = plan.ensemble.members, len(plan.grid.times)
    real = machine.DTYPES[plan.dtype]
    samples = {name: np.empty((k, n, *SHAPES[name]), real) for name in plan.spec.fields}
    if plan.spec.compensated and "position" in samples:
        samples["position"] = np.empty((k, n, 3))
    status, failed_step, failed_size = np.zeros(n, np.uint8), np.zeros(n, np.int64), np.zeros(n)
    chosen = np.zeros((n, 2 if plan.method.adaptive else 0), np.int64)
    counter = _Progress(n * plan.grid.steps, progress)

    stop = threading.Event()

    def advance(block: Block) -> None:
        members = plan.ensemble.select(block.first, block.stop)
        packets = Packets(plan, members)
        at = slice(block.first, block.stop)
        for name, values in samples.items():
            values[0, at] = getattr(members, name)
        for k0, k1 in plan.segments(block.count):
            if stop.is_set():
                return
            raw = packets.advance(k0, k1)[:, : block.count]
            _store(samples, slice(*plan.due(k0, k1)), at, unpacked(plan.spec.sample_fields, raw, packets.frame))
            counter.add(block.count * (k1 - k0))
        outcome = packets.outcome()
        status[at], failed_step[at], failed_size[at] = outcome.status, outcome.failed_step, outcome.failed_size
        chosen[at] = outcome.chosen

    def work(block: Block) -> None:
        # A member that is not finite, or not within float32, gets its status from the kernel; NumPy need not remark.
        with np.errstate(invalid="ignore", over="ignore"):
            advance(block)

    start = time.perf_counter()
    thread_executor.run(blocks(n), work, threads, stop)
    run_seconds = time.perf_counter() - start
    failed, stopped = status != 0, status >= Status.SURFACE
    # An event's size is the part of its step that was made before it.
    steps_made = failed_step + np.where(stopped, failed_size, 0.0)
    return Result(
        time=plan.grid.times,
        samples=samples,
        status=status.view(StatusArray),
        failure_time=np.where(failed, steps_made * plan.grid.h, np.nan),
        failure_value=np.where(failed, np.where(stopped, 0.0, failed_size), np.nan),
        parameters=plan.ensemble.parameters(0, n),
        messages=plan.grid.messages + plan.ensemble.scene.vehicle.warnings,
        provenance=provenance(plan)
        | dict(zip(("steps_made", "steps_tried"), chosen.mean(axis=0).tolist(), strict=False)),
        terms=tuple(plan.ensemble.scene.terms),
        compile_seconds=compile_seconds,
        run_seconds=run_seconds,
    )


def _store(samples: dict[str, np.ndarray], when: slice, at: slice, parts: dict[str, np.ndarray]) -> None:
    """Put the samples of a block into their places."""
    for name, values in parts.items():
        samples[name][when, at] = values


def unpacked(fields: Mapping[str, int], raw: np.ndarray, frame: Frame) -> dict[str, np.ndarray]:
    """Raw samples (samples, members, numbers) as fields, from the kernel's origin and axes to the user's.

    fields: numbers of each field; twice as many as it has for a sum of two numbers, which is made in float64.
    """
    parts: dict[str, np.ndarray] = {}
    column = 0
    for name, size in fields.items():
        shape = SHAPES[name]
        values = raw[..., column : column + size]
        if size == 2 * int(np.prod(shape)):
            values = np.add(*np.split(values, 2, axis=-1), dtype=np.float64)
        parts[name] = values.reshape(*raw.shape[:2], *shape)
        column += size
    if not np.array_equal(frame.Q, np.broadcast_to(np.eye(3), frame.Q.shape)):
        turns = {"attitude": lambda R: R @ np.swapaxes(frame.Q, -1, -2)}
        for name in parts.keys() - {"position"}:
            turn = turns.get(name, lambda v: notation.rotate_out(frame.Q, v))
            parts[name] = turn(parts[name])
    if np.any(frame.origin):
        o = np.broadcast_to(frame.origin, (raw.shape[1], 3))
        if "position" in parts:
            parts["position"] = parts["position"] - np.einsum("knij,nj->kni", parts["attitude"], o)
        if "velocity" in parts:
            parts["velocity"] = parts["velocity"] - np.cross(parts["angular_velocity"], o)
    return parts


def provenance(plan: Plan) -> dict[str, Any]:
    """Everything that the result follows from: scene, ensemble, settings, versions, machine."""
    return {
        "scene": plan.ensemble.scene.to_dict(),
        "ensemble": plan.ensemble.to_dict(),
        "method": {
            "name": plan.method.name,
            "solver": plan.method.solver,
            "iterations": plan.method.iterations,
            "tolerance": plan.method.residual_tolerance(plan.dtype),
        }
        | ({"alpha": plan.method.alpha, "beta": plan.method.beta} if plan.spec.averages else {})
        | ({"rtol": plan.method.rtol, "atol": plan.method.atol} if plan.method.adaptive else {}),
        "step": plan.grid.h,
        "steps": plan.grid.steps,
        "dtype": plan.dtype,
        "width": plan.spec.width,
        "checks": plan.checks,
        "terms": [term.type for term, _ in plan.model.laws],
        "versions": machine.versions(),
        "machine": machine.describe(),
    }
