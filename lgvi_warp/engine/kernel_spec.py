# SPDX-License-Identifier: Apache-2.0
"""The Spec of a run's kernel: everything that determines its source, from laws, method and settings."""

from __future__ import annotations

import warp as wp

from lgvi_kernels.advance.spec import Control, Spec
from lgvi_kernels.maps.explicit import Explicit
from lgvi_warp.common.machine import DTYPES
from lgvi_warp.control.signals import SIGNALS
from lgvi_warp.engine.kernel_choice import KernelChoice, declared
from lgvi_warp.engine.sample_layout import SampleLayout
from lgvi_warp.engine.step_warnings import watched
from lgvi_warp.methods.gauss import gauss
from lgvi_warp.methods.method import KINDS, Method
from lgvi_warp.physics.terms.base import JUMP_EARLY

COMPENSATED = "float32_compensated"


def spec_of(
    choice: KernelChoice, method: Method, layout: SampleLayout, width: int, dtype: str, checks: str, on_failure: str
) -> Spec:
    """Make the Spec of a run's kernel, except whether members share rows, which is known after packing."""
    checked = checks != "none"
    back = min(0.0, *method.stages) < 0.0 and bool(choice.drag) and method.tableau is None
    return Spec(
        width=width,
        real=wp.float64 if DTYPES[dtype] == "float64" else wp.float32,
        maps=choice.program,
        lead=choice.lead,
        laws=tuple(module for _, module in choice.laws),
        numbers=tuple(declared(term, module, choice.given) for term, module in (*choice.laws, *choice.events)),
        mass=choice.mass,
        solver=method.solver,
        iterations=int(method.iterations or 0),
        adaptive=method.iterations is None,
        checked=checked,
        events=tuple(module for _, module in choice.events),
        drag=choice.drag,
        parts=choice.parts,
        inverse=choice.inverse,
        coupling=choice.coupling,
        flow=choice.flow,
        timed=choice.timed,
        memory=choice.memory or choice.controller is not None,
        averages=choice.averages,
        composed=len(method.stages) > 1,
        paired=method.halved or (method.two_part and not choice.lead),
        gauss=gauss(method.gauss) if method.gauss else (),
        lead_time=lengths_of(method, choice)[1][-1] if choice.timed else 0.0,
        explicit=_explicit(method, choice),
        compensated=dtype == COMPENSATED,
        warning_rows=watched(method, choice, dtype, checks),
        energy=choice.conservative,
        backward=checked and back,
        substep=on_failure == "substep",
        control=_control(choice, layout.signals),
    )


def with_tangents(spec: Spec, tangents: int) -> Spec:
    """The Spec of numbers that carry slopes; its lane is then one of two vehicles or more."""
    return spec._replace(tangents=tangents, width=max(2, spec.width))


def lengths_of(method: Method, choice: KernelChoice) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Lengths of the stages and of the leads, in units of the step h [1]."""
    return method.lengths(choice.lead[1] if choice.lead else None)


def kind_of(method: Method, choice: KernelChoice) -> str:
    """Kind of kernel for which a width is chosen, one of widths.KINDS."""
    if "dense" in choice.parts:
        return "dense"
    if method.tableau or method.gauss:
        return "explicit"
    if method.base == "psi_1":
        return "single"
    # psi_w iterates, one product after the other; so do the rotations of a splitting of two parts.
    return "chained" if method.turns or method.two_part or method.base == "psi_w" else "plain"


def _control(choice: KernelChoice, signals: tuple[str, ...]) -> Control | None:
    if choice.controller is None:
        return None
    parts = choice.parts_of_control
    groups = {SIGNALS[name].group for name in signals}
    numbers = tuple(declared(part, module) for part, module in parts)
    headings = any(name.endswith("_heading") for name in signals)
    shown = bool(groups & {"actuator", "exerted"}), "exerted" in groups
    return Control(tuple(module for _, module in parts), numbers, *shown, choice.has_callback, headings)


def _explicit(method: Method, choice: KernelChoice) -> Explicit | None:
    tableau = method.tableau
    if tableau is None:
        return None
    # A step that is given asks for no estimate: nothing of it then is in the kernel's source.
    estimate = (tableau.errors, tableau.estimate) if method.adaptive else ((), 0)
    kind = KINDS.get(method.name, "vector")
    if kind == "vector" and choice.steady and not method.adaptive:
        kind = "inertial"
    # Without damping a linearly implicit method has no matrix, and is the explicit one of its tableau.
    implicit = tableau.implicit if choice.resisted else ()
    early = 2.0 * JUMP_EARLY if any(getattr(term, "jumps", False) for term, _ in choice.laws) else 0.0
    return Explicit(kind, tableau.a, tableau.b, tableau.c, *estimate, method.adaptive, implicit, early)
