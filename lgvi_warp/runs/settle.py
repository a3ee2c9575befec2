# SPDX-License-Identifier: Apache-2.0
"""Settling of a run's settings from arguments and scene: its plan, its number of Newton steps, and its blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.status import Status
from lgvi_warp.control.signals import check
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.plan import Plan, choose_plan
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt, time_grid
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.runs.default_method import planned
from lgvi_warp.runs.run import run_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.settings import RunSettings


def blocks_there(only: range | None, plan: Plan) -> range | None:
    """Limit the blocks asked for to those that the run has.

    only: Indices of blocks, in steps of 1; the end may lie beyond the last block. None: all blocks.
    Returns: The indices that exist, or None for all blocks.
    """
    count = len(blocks(plan.ensemble.members))
    if only is None:
        return None
    present = range(only.start, min(only.stop, count))
    if only.step != 1 or only.start < 0 or not present:
        problem = f"are not within the {count} of this run"
        raise SceneError([f"blocks {only.start}:{only.stop}: {problem}; give 0:{count} or less"])
    return present


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
    survey_all: bool = True,
    looks: bool = False,
    read_at_looks: Mapping[str, tuple[int, ...]] | None = None,
) -> Plan:
    """Settle the settings of a run, from the arguments and, where they are None, from the scene's [run] section.

    h: Step [s].
    t1: End of the run [s].
    read_at_looks: As of `Plan`; default None.
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
    # The scene's save_every is meant for its own duration; a shorter run ignores it.
    dropped = save is None and every is not None and every > float(t1)  # type: ignore[arg-type]
    key = "run.save_fields" if save is None else "save.fields"
    if save is None:
        save = SaveAt(every=None if dropped else every, fields=fields_of(save, settings))
    check(faults, key, save.fields, ensemble.scene.controller)
    faults.raise_if_any()
    grid = time_grid(float(h), float(t1), save)  # type: ignore[arg-type]
    if dropped:
        text = f"run.save_every = {every} s is longer than the run, {t1} s: only the start and the end are kept"
        grid = replace(grid, messages=(*grid.messages, text))
    dtype = settings.dtype if dtype is None else dtype
    checks = settings.checks if checks is None else checks
    on_failure = settings.on_failure if on_failure is None else on_failure
    others = fields(save.fields), dtype, width, checks, on_failure, survey_all, looks, read_at_looks
    if method is None and settings.method is None and not settings.method_options:

        def plan_of(method: Method, told: tuple[str, ...]) -> Plan:
            return choose_plan(ensemble, method, replace(grid, messages=(*grid.messages, *told)), *others)

        return planned(ensemble, grid, plan_of)
    chosen = method if isinstance(method, Method) else settings.method_of(method)
    if chosen.iterations == "auto":
        chosen = replace(chosen, iterations=enough_iterations(ensemble, chosen, grid.h, dtype))
        n = chosen.iterations
        number = f"{n} a solve, enough for" if n is not None else f"to the tolerance: {MOST_FIXED} are too few for"
        text = f"Newton steps {number} every member's start at twice the step"
        grid = replace(grid, messages=(*grid.messages, text))
    return choose_plan(ensemble, chosen, grid, *others)


def fields_of(save: SaveAt | None, settings: RunSettings) -> tuple[str, ...]:
    """Names of the samples that a run keeps.

    save: What the call says; None where it says nothing.
    """
    if save is not None:
        return save.fields
    return FIELDS if settings.save_fields is None else tuple(settings.save_fields)


# With more Newton steps than this, a fixed number gains nothing over iterating to the tolerance.
MOST_FIXED = 4


def enough_iterations(ensemble: Ensemble, method: Method, h: float, dtype: str) -> int | None:
    """Find the least number of Newton steps that leaves every member's residual below the tolerance at twice the step.

    The residual after a fixed number grows with h |Omega|: twice the step leaves room for members that spin up.

    h: Step of the run [s].
    Returns: The number of Newton steps, or None if more than MOST_FIXED would be needed.
    """
    for n in range(MOST_FIXED + 1):
        fixed = replace(method, iterations=n)
        trial = run_plan(make_plan(ensemble, fixed, 2.0 * h, 2.0 * h, SaveAt(), dtype), machine.thread_count())
        if not np.any(trial.status == Status.NOT_CONVERGED):
            return n
    return None
