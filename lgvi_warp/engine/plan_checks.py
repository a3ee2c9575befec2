# SPDX-License-Identifier: Apache-2.0
"""Refusals before a run: settings that are not compatible, and steps that do not suit the forces."""

from __future__ import annotations

import numpy as np

from lgvi_kernels.lanes.arithmetic import WIDTHS
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.machine import DTYPES
from lgvi_warp.common.status import CHECKS, ON_FAILURE
from lgvi_warp.common.times import whole_steps
from lgvi_warp.engine.kernel_choice import KernelChoice
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import TimeGrid, divisors
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.scene.like import SceneLike

# Sub-maps whose equation may have no solution.
SOLVING = {"D", "W", "A", "Phi", "Phi*"}


def check_settings(
    faults: Faults, scene: SceneLike, method: Method, dtype: str, width: int | None, checks: str, on_failure: str
) -> None:
    """Refuse values that are unknown, or that the scene, the method or another setting does not allow."""
    faults.choice("dtype", dtype, DTYPES)
    faults.choice("checks", checks, CHECKS)
    faults.choice("on_failure", on_failure, ON_FAILURE)
    faults.raise_if_any()
    if width is not None:
        faults.choice("width", width, WIDTHS)
    if checks == "none" and scene.events:
        faults.add("checks", checks, "does not see events", 'use checks="safe", or drop the events')
    if dtype == "float32_compensated" and (method.tableau or method.gauss or method.two_part):
        problem = f"compensates sums of a method of sub-maps, which {method.name} is not"
        faults.add("dtype", dtype, problem, "use float64, or psi_s, psi_x and their compositions")
    if checks == "none" and on_failure in ON_FAILURE[1:]:
        problem = f"does not see failures, which on_failure={on_failure!r} waits for"
        faults.add("checks", checks, problem, 'use checks="safe", or on_failure="freeze"')


def check_substep(choice: KernelChoice, method: Method) -> None:
    """Refuse substeps for a method or for laws that do not support them, with the reason."""
    faults, name = Faults(), method.name
    if choice.controller is not None:
        why = "remembers what a step that is made again would change"
        faults.add("on_failure", "substep", f"the controller {why}", 'use on_failure="freeze", or a shorter step')
    letters = {letter for letter, _ in (*choice.program, *([choice.lead] if choice.lead else []))}
    if method.gauss:
        why = "starts each step from the stages of the last one, which a divided step would have lost"
        faults.add("on_failure", "substep", f"{name} {why}", 'shorten the step, or use on_failure="freeze"')
    elif not letters & SOLVING:
        why = "solves nothing that could fail"
        faults.add("on_failure", "substep", f"{name} {why}", 'use on_failure="freeze"; psi_s and psi solve (24)')
    for term, module in choice.laws:
        noisy = getattr(module, "NOISE", False)
        if (term.memory and not term.accounts) or noisy:
            why = "draws its noise once a step" if noisy else "remembers what a step that is made again would change"
            faults.add("on_failure", "substep", f"{term.key} {why}", 'use on_failure="freeze", or a shorter step')
    faults.raise_if_any()


def check_noise_steps(choice: KernelChoice, grid: TimeGrid) -> None:
    """Refuse a step that is no whole multiple of a term's noise_step, and suggest the nearest one that is."""
    faults, h = Faults(), grid.h
    # All samples are whole multiples of this one.
    spacing = h * float(np.gcd.reduce(grid.sample_steps))
    for term, _ in choice.laws:
        if not isinstance(term, NoisyTerm) or term.noise_step is None:
            continue
        noise_step, draws = float(term.noise_step), term.draws(h)
        if whole_steps(h, noise_step) != draws:
            multiple = round(spacing / noise_step)
            problem = f"is not a whole multiple of {term.key}.noise_step = {noise_step:.9g} s"
            if multiple < 1 or whole_steps(spacing, noise_step) is None:
                remedy = f"give a noise_step that divides the {spacing:.9g} s between samples"
            else:
                count = min(divisors(multiple), key=lambda count: abs(multiple / count * noise_step - h))
                remedy = f"use a step of {multiple // count * noise_step:.9g} s"
            faults.add("step", h, problem, remedy)
        elif grid.last * draws >= 2**31:
            problem = f"makes {grid.last * draws:,} draws in this run"
            faults.add(f"{term.key}.noise_step", noise_step, problem, "there are 2,147,483,647: use a longer one")
    faults.raise_if_any()


def check_times(choice: KernelChoice, grid: TimeGrid) -> None:
    """Refuse a run at times for which a term has no data."""
    faults = Faults()
    for term, _ in choice.laws:
        term.check_times(faults, float(grid.times[0]), float(grid.times[-1]))
    faults.raise_if_any()


def check_ticks(choice: KernelChoice, grid: TimeGrid, goes_on: bool = False) -> None:
    """Refuse a controller's period or delay that is no whole number of steps, and a start between two ticks.

    goes_on: whether members have the commands of their last tick, from a continued run.
    """
    faults, controller = Faults(), choice.controller
    if controller is not None:
        controller.check_step(faults, grid.h, grid.asked)
        faults.raise_if_any()
        every = controller.every(grid.h)
        if grid.first % every and not goes_on:
            problem = f"lies between two ticks of the controller, whose period is {every * grid.h:.9g} s"
            faults.add(
                "t0", grid.times[0], problem, "start at a tick, or go on from result.final, which knows the commands"
            )
    faults.raise_if_any()
