"""To be said in one sentence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.status import Status
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.plan import Plan
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt, time_grid
from lgvi_warp.runs.run import run_plan
from lgvi_warp.scene.ensemble import Ensemble


def blocks_there(only: range | None, plan: Plan) -> range | None:
    """The blocks of a run in parts that it has: the last part may ask for more. Raises SceneError where it has none."""
    count = len(blocks(plan.ensemble.members))
    if only is None:
        return None
    there = range(only.start, min(only.stop, count))
    if only.step != 1 or only.start < 0 or not there:
        raise SceneError(
            [f"blocks {only.start}:{only.stop}: are not within the {count} of this run; give 0:{count} or less"]
        )
    return there


def make_plan(
    ensemble: Ensemble,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    *,
    width: int | None = None,
    checks: str | None = None,
    on_failure: str | None = None,
    fields: Callable[[Sequence[str]], tuple[str, ...]] = tuple,
) -> Plan:
    """Settle a run's settings, from the arguments and then from the scene's [run]. Raises SceneError.

    fields: from the fields that `save` asks for, those that the kernel writes.
    """
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
    chosen = method if isinstance(method, Method) else settings.method_of(method)
    dtype, checks = dtype or settings.dtype, checks or settings.checks
    if chosen.iterations == "auto":
        chosen = replace(chosen, iterations=enough_iterations(ensemble, chosen, grid.h, dtype))
        n = chosen.iterations
        number = f"{n} a solve, enough for" if n is not None else f"to the tolerance: {MOST_FIXED} are too few for"
        text = f"Newton steps {number} every member's start at twice the step"
        grid = replace(grid, messages=(*grid.messages, text))
    return Plan(ensemble, chosen, grid, fields(save.fields), dtype, width, checks, on_failure or settings.on_failure)


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
