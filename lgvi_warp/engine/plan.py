# SPDX-License-Identifier: Apache-2.0
"""The plan of a run: the kernel that holds only what the scene needs, and the launches that make up the run."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels import built_in
from lgvi_kernels.advance.kernel import Advance, make_advance
from lgvi_kernels.advance.noting import ALL_NOTES, NOTED, bit
from lgvi_kernels.advance.rows import SAMPLE_FIELDS
from lgvi_kernels.advance.spec import CHUNK, Control, Spec
from lgvi_kernels.lanes.arithmetic import WIDTHS
from lgvi_kernels.maps.explicit import Explicit
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.machine import DTYPES
from lgvi_warp.common.phases import Phases
from lgvi_warp.common.status import CHECKS, ON_FAILURE
from lgvi_warp.common.warp_setup import build_lock
from lgvi_warp.control.base import Part
from lgvi_warp.control.signals import SIGNALS, check, ordered, row_of, saved_fields
from lgvi_warp.engine import kernel_cache
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.kernel_choice import KernelChoice, check_backward_drag, choose_kernel, declared, is_built_in
from lgvi_warp.engine.packing import rows_shared
from lgvi_warp.engine.shared import MEMBERS, SEED, Shared
from lgvi_warp.engine.step_warnings import watched
from lgvi_warp.engine.survey import Survey, survey, survey_of
from lgvi_warp.engine.widths import default_width
from lgvi_warp.methods.gauss import gauss
from lgvi_warp.methods.method import KINDS, Method
from lgvi_warp.methods.saveat import TimeGrid, divisors
from lgvi_warp.physics.fields import Field
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene.ensemble import SURVEYED, Ensemble

# Sub-maps whose equation may have no solution.
SOLVING = {"D", "W", "A", "Phi", "Phi*"}

# A step and the draws that fill it differ by less than this part, the round-off of their quotient and of their texts.
STEP_ROUND_OFF = 1e-12

# Limits of one launch: they keep progress current, interrupts prompt and the sample buffer small in long runs.
SEGMENT_VEHICLE_STEPS = 20_000_000
SEGMENT_SAMPLE_BYTES = 16_000_000
# What is gathered at looks before it is reduced: it should stay in the caches.
GATHERED_BYTES = 8_000_000


class NotSurveyed(Exception):  # noqa: N818  (what happened, and no fault of the scene)
    """Raised when a member beyond those that were looked at needs another kernel."""


@dataclass(frozen=True)
class Plan:
    """All that is decided before a run: the kernel, the lanes of a packet, and the steps and samples.

    Args:
        ensemble: the members.
        method: the integration method.
        grid: the steps and the sample times.
        fields: names of the samples to keep; stored in their order (see signals.SAVED).
        dtype: numbers of the kernel: "float64" (default), "float32" or "float32_compensated".
        width: members of a packet, one a lane; None (default) for what suits this machine's registers.
        checks: "safe" (default), "all" for warnings as well, or "none".
        on_failure: "freeze" (default), "raise" or "substep".
        survey_all: whether the kernel is chosen by all members (default), or by the first SURVEYED. Then a run looks at the
            others as it comes to them, and begins anew, with all members looked at, if any of them needs more.
        looks: whether samples are taken at all looks of the controller as well, for statistics that want them; default False.
        read_at_looks: field of the motion -> which of its numbers statistics read at looks, () for all; None (default) for
            all numbers of all fields.

    Attributes:
        kernel_choice: the laws that act and the method's program for them.
        spec: all that decides the kernel's source.
        width_source: what chose the width (see widths.Width).
        phases: how long `compile` took, by phase; zeros where this process had loaded the kernel.

    Raises:
        SceneError: if dtype, width, checks or on_failure is none of these, or the method cannot do what the scene asks.
    """

    ensemble: Ensemble
    method: Method
    grid: TimeGrid
    fields: tuple[str, ...]
    dtype: str = "float64"
    width: int | None = None
    checks: str = "safe"
    on_failure: str = "freeze"
    survey_all: bool = True
    looks: bool = False
    read_at_looks: Mapping[str, tuple[int, ...]] | None = None
    kernel_choice: KernelChoice = field(init=False)
    spec: Spec = field(init=False)
    width_source: str = field(init=False, default="asked for", compare=False)
    phases: Phases = field(init=False, default=Phases(), compare=False)
    _facts: Survey = field(init=False, compare=False, repr=False)
    # Of a plan made by part(): the whole plan, the members and the fields.
    _whole: tuple[Plan, Sequence[int], Sequence[str]] | None = field(
        default=None, init=False, compare=False, repr=False
    )

    def __post_init__(self) -> None:
        faults = Faults()
        faults.choice("dtype", self.dtype, DTYPES)
        faults.choice("checks", self.checks, CHECKS)
        faults.choice("on_failure", self.on_failure, ON_FAILURE)
        faults.raise_if_any()
        if self.width is not None:
            faults.choice("width", self.width, WIDTHS)
        if self.checks == "none" and self.ensemble.scene.events:
            faults.add("checks", self.checks, "does not see events", 'use checks="safe", or drop the events')
        if self.dtype == "float32_compensated" and (self.method.tableau or self.method.gauss or self.method.two_part):
            problem = f"compensates sums of a method of sub-maps, which {self.method.name} is not"
            faults.add("dtype", self.dtype, problem, "use float64, or psi_s, psi_x and their compositions")
        if self.checks == "none" and self.on_failure in ON_FAILURE[1:]:
            problem = f"does not see failures, which on_failure={self.on_failure!r} waits for"
            faults.add("checks", self.checks, problem, 'use checks="safe", or on_failure="freeze"')
        # Those of `save` are checked before: these are of statistics.
        check(faults, "statistics", self.fields, self.ensemble.scene.controller)
        faults.raise_if_any()
        checked = self.checks != "none"
        most = None if self.survey_all else SURVEYED
        facts = survey(self.ensemble, self.method, self.grid.h, self.shared, most=most)
        object.__setattr__(self, "_facts", facts)
        choice = choose_kernel(self.ensemble, self.method, self.grid.h, facts, built_in, checked)
        object.__setattr__(self, "kernel_choice", choice)
        check_backward_drag(self.ensemble, choice, self.method, self.grid.h)
        self._check_substep()
        self._check_noise_steps()
        self._check_looks()
        if self.width is None:
            width, source = default_width(self._kind(), self.dtype)
            object.__setattr__(self, "width", width)
            object.__setattr__(self, "width_source", source)
        object.__setattr__(self, "fields", ordered(self.fields))
        object.__setattr__(self, "spec", self._spec())
        object.__setattr__(self, "spec", self.spec._replace(shared_rows=rows_shared(self)))

    @functools.cached_property
    def advance(self) -> Advance:
        """The kernel and its types, made when first asked for: many plans are never run."""
        with build_lock, self._laws_compile():
            return make_advance(self.spec)

    @functools.cached_property
    def gathered(self) -> TimeGrid | None:
        """The controller's looks, where samples are taken at all of them; None without a controller or without `looks`."""
        controller = self.kernel_choice.controller
        return self.grid.looks(controller.every(self.grid.h)) if self.looks and controller is not None else None

    @functools.cached_property
    def look_fields(self) -> dict[str, int]:
        """How many numbers of each field the kernel gathers at a look, in the user's axes; of signals all, as in samples."""
        sizes = {name: size for name, size in self.sample_fields.items() if name in self.fields}
        entries = self.look_entries
        return {name: len(entries.get(name, ())) or size for name, size in sizes.items() if self._reads(name)}

    @functools.cached_property
    def look_entries(self) -> dict[str, tuple[int, ...]]:
        """Fields of the motion of which some numbers alone are gathered at looks: field -> these, counted from 0."""
        entries = {name: numbers for name, numbers in (self.read_at_looks or {}).items() if numbers}
        if self.spec.compensated:  # a place is a pair of sums
            entries.pop("position", None)
        return entries

    def _reads(self, name: str) -> bool:
        """Whether a field is gathered at looks: a signal always, the motion where a statistic reads it."""
        return name in SIGNALS or self.read_at_looks is None or name in self.read_at_looks

    def slots(self, count: int) -> int:
        """How many looks of a block are gathered at once.

        Args:
            count: number of members of the block.

        Returns:
            At least 2, since the first launch begins with a look; 0 where none are gathered.
        """
        if self.gathered is None:
            return 0
        return max(2, min(GATHERED_BYTES // max(1, self.look_bytes(count)), len(self.gathered.times)))

    def look_bytes(self, count: int) -> int:
        """Memory of what is gathered at a look of a block [bytes].

        Args:
            count: number of members of the block.
        """
        return sum(self.look_fields.values()) * count * np.dtype(DTYPES[self.dtype]).itemsize

    def looks_of(self, k0: int, k1: int) -> slice:
        """Which looks are gathered once a launch has ended.

        Args:
            k0: number of steps made before the launch.
            k1: number of steps made after it.

        Returns:
            Those after step k0, with that of the start, and no later than step k1. Where a function of the host answers, a
            look ends in the next launch: those from step k0 on and before step k1, with that of the end.
        """
        assert self.gathered is not None
        bounds = np.array([k0 + 1 if k0 else 0, k1 + 1])
        if self.asks:
            bounds = np.array([k0, k1 if k1 < self.grid.steps else k1 + 1])
        first, stop = np.searchsorted(self.gathered.sample_steps, bounds)
        return slice(int(first), int(stop))

    @functools.cached_property
    def shared(self) -> Shared:
        """What all members share, computed once."""
        return Shared({*self.ensemble.varied_names, MEMBERS, SEED})

    @functools.cached_property
    def idle(self) -> list[Any]:
        """Packets of finished blocks, to be used again."""
        return []

    def _check_substep(self) -> None:
        """Refuse to divide the steps of a method or of laws that cannot be divided, with the reason."""
        if self.on_failure != "substep":
            return
        faults, name = Faults(), self.method.name
        if self.kernel_choice.controller is not None:
            why = "remembers what a step that is made again would change"
            faults.add("on_failure", "substep", f"the controller {why}", 'use on_failure="freeze", or a shorter step')
        program, lead = self.kernel_choice.program, self.kernel_choice.lead
        letters = {letter for letter, _ in (*program, *([lead] if lead else []))}
        if self.method.gauss:
            why = "starts each step from the stages of the last one, which a divided step would have lost"
            faults.add("on_failure", "substep", f"{name} {why}", 'shorten the step, or use on_failure="freeze"')
        elif not letters & SOLVING:
            why = "solves nothing that could fail"
            faults.add("on_failure", "substep", f"{name} {why}", 'use on_failure="freeze"; psi_s and psi solve (24)')
        for term, module in self.kernel_choice.laws:
            noisy = getattr(module, "NOISE", False)
            if term.memory or noisy:
                why = (
                    "draws its noise once a step" if noisy else "remembers what a step that is made again would change"
                )
                faults.add("on_failure", "substep", f"{term.key} {why}", 'use on_failure="freeze", or a shorter step')
        faults.raise_if_any()

    def _check_looks(self) -> None:
        """Refuse a period or a delay of the controller that is no whole number of steps."""
        controller, faults = self.kernel_choice.controller, Faults()
        if controller is not None:
            controller.check_step(faults, self.grid.h)
        faults.raise_if_any()

    def _check_noise_steps(self) -> None:
        """Refuse a step that is no whole multiple of a term's noise_step, and name the nearest one that is."""
        faults, h = Faults(), self.grid.h
        # All samples are whole multiples of this one.
        spacing = h * float(np.gcd.reduce(self.grid.sample_steps))
        for term, _ in self.kernel_choice.laws:
            if not isinstance(term, NoisyTerm) or term.noise_step is None:
                continue
            noise_step, draws = float(term.noise_step), term.draws(h)
            if abs(h - draws * noise_step) > STEP_ROUND_OFF * h:
                multiple = round(spacing / noise_step)
                problem = f"is no whole multiple of {term.key}.noise_step = {noise_step:.9g} s"
                if multiple < 1 or abs(spacing - multiple * noise_step) > STEP_ROUND_OFF * spacing:
                    remedy = f"give a noise_step that divides the {spacing:.9g} s between samples"
                else:
                    count = min(divisors(multiple), key=lambda count: abs(multiple / count * noise_step - h))
                    remedy = f"use a step of {multiple // count * noise_step:.9g} s"
                faults.add("step", h, problem, remedy)
            elif self.grid.steps * draws >= 2**31:
                problem = f"makes {self.grid.steps * draws:,} draws in this run"
                faults.add(f"{term.key}.noise_step", noise_step, problem, "there are 2,147,483,647: use a longer one")
        faults.raise_if_any()

    def of(self, ensemble: Ensemble) -> Plan:
        """The same plan for other members, of the same scene and with the same names that vary.

        Args:
            ensemble: the members; the survey of the whole plan must hold for them.

        Returns:
            A plan that shares the kernel and all that members share.

        Raises:
            SceneError: if a member's drag is too strong for the method.
        """
        check_backward_drag(ensemble, self.kernel_choice, self.method, self.grid.h)
        plan = self._copy()
        object.__setattr__(plan, "ensemble", ensemble)
        return plan

    def _copy(self) -> Plan:
        """The same plan, with nothing chosen anew, as copy.copy would by way of __reduce__."""
        # Copies have these in common: none computes them again.
        _ = self.shared, self.idle, self.gathered, self.table, self.sample_fields, self.look_fields, self.signal_rows
        plan = object.__new__(Plan)
        plan.__dict__.update(self.__dict__)
        return plan

    def check_block(self, block: Block, members: Members) -> None:
        """Look at members of a block that were not looked at before the run.

        Args:
            block: the block.
            members: its members.

        Raises:
            SceneError: if a member is unphysical.
            NotSurveyed: if a member needs what the kernel does not have.
        """
        self.ensemble.check_block(block.first, block.stop, members.parameters)
        unseen = not self.survey_all and block.stop > SURVEYED and self._whole is None
        if unseen and not self.serves(self.ensemble, block, members):
            raise NotSurveyed(f"a member of {block.first} to {block.stop - 1} needs what the first {SURVEYED} do not")

    def serves(self, ensemble: Ensemble, block: Block, members: Members) -> bool:
        """Whether the kernel has all that some members need, which may be others than those it was chosen by.

        Args:
            ensemble: the ensemble that they are of, of the same scene and with the same names that vary.
            block: where they are in it.
            members: the members.

        Returns:
            False where they need more.
        """
        facts = survey_of(members.parameters, ensemble, self.method, self.grid.h, self.shared, block)
        return self._facts.covers(facts)

    def with_neighbours(self, indices: np.ndarray) -> np.ndarray:
        """The members whose run gives these members the bits of the whole run.

        Adaptive steps are chosen for a whole packet, so a member's bits depend on the others of its packet.

        Args:
            indices: (m,), indices of members.

        Returns:
            Indices of these members, and for adaptive steps of all members of their packets, in rising order.
        """
        if not self.method.adaptive:
            return indices
        width = self.spec.width
        lanes = np.unique(indices // width)[:, None] * width + np.arange(width)
        return lanes[lanes < self.ensemble.members]

    def subplan(self, indices: Sequence[int], fields: Sequence[str]) -> Plan:
        """The plan for some of the members, with all choices made for the whole ensemble.

        The members' bits are therefore those of the whole run, unless steps are adaptive (see `with_neighbours`).

        Args:
            indices: (m,), indices of the members.
            fields: names of the sample fields to keep.

        Returns:
            A plan for m members.
        """
        subplan = self._copy()
        for name in (
            "shared",
            "idle",
            "sample_fields",
            "look_fields",
            "look_entries",
            "signal_rows",
            "gathered",
            "times",
        ):
            subplan.__dict__.pop(name, None)
        object.__setattr__(subplan, "ensemble", self.ensemble.subset(indices))
        object.__setattr__(subplan, "fields", ordered(fields))
        object.__setattr__(subplan, "looks", False)
        object.__setattr__(subplan, "_whole", (self, indices, fields))
        return subplan

    @functools.cached_property
    def sample_fields(self) -> dict[str, int]:
        """What the kernel writes of a sample: the fields kept, and those needed to move them back to the user's origin.

        Returns:
            Field -> numbers per sample, in the order in which they are written; a compensated position is b, then b_low.
            Signals of the controller come last.
        """
        needed = set(self.fields)
        if self.kernel_choice.moved:
            needed |= {"attitude"} if "position" in needed else set()
            needed |= {"angular_velocity"} if "velocity" in needed else set()
        numbers = {name: size for name, size in SAMPLE_FIELDS.items() if name in needed}
        if self.spec.compensated and "position" in numbers:
            numbers["position"] = 6
        return numbers | {name: math.prod(self.table[name].shape) for name in self.signals}

    def _spec(self) -> Spec:
        choice, checked = self.kernel_choice, self.checks != "none"
        back = min(0.0, *self.method.stages) < 0.0 and bool(choice.drag) and self.method.tableau is None
        return Spec(
            width=self.width,
            real=wp.float64 if DTYPES[self.dtype] == "float64" else wp.float32,
            maps=choice.program,
            lead=choice.lead,
            laws=tuple(module for _, module in choice.laws),
            numbers=tuple(declared(term, module) for term, module in (*choice.laws, *choice.events)),
            mass=choice.mass,
            solver=self.method.solver,
            iterations=int(self.method.iterations or 0),
            adaptive=self.method.iterations is None,
            checked=checked,
            events=tuple(module for _, module in choice.events),
            drag=choice.drag,
            parts=choice.parts,
            coupling=choice.coupling,
            flow=choice.flow,
            timed=choice.timed,
            memory=choice.memory or choice.controller is not None,
            averages=choice.averages,
            composed=len(self.method.stages) > 1,
            paired=self.method.halved or (self.method.two_part and not choice.lead),
            gauss=gauss(self.method.gauss) if self.method.gauss else (),
            lead_time=self.lengths[1][-1] if choice.timed else 0.0,
            explicit=self._explicit(),
            compensated=self.dtype == "float32_compensated",
            looks=watched(self),
            energy=choice.conservative,
            backward=checked and back,
            substep=self.on_failure == "substep",
            control=self._control(),
        )

    def _control(self) -> Control | None:
        parts = self.kernel_choice.parts_of_control
        if self.kernel_choice.controller is None:
            return None
        groups = {SIGNALS[name].group for name in self.signals}
        numbers = tuple(declared(part, module) for part, module in parts)
        headings = any(name.endswith("_heading") for name in self.signals)
        return Control(tuple(module for _, module in parts), numbers, "actuator" in groups, self.asks, headings)

    @property
    def asks(self) -> bool:
        """Whether a function of the host answers each look."""
        controller = self.kernel_choice.controller
        return controller is not None and controller.callback is not None

    @property
    def notes(self) -> int:
        """What looks note, as bits (see noting.py): that of which something is saved, and all where the host is asked."""
        noted = [signal for name in self.signals if (signal := SIGNALS[name]).group in NOTED]
        return ALL_NOTES if self.asks else sum({bit(signal.group, signal.row) for signal in noted})

    @functools.cached_property
    def table(self) -> dict[str, Field]:
        """The fields that the run may save, by name."""
        return saved_fields(self.kernel_choice.controller)

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the controller's signals among the fields."""
        return tuple(name for name in self.fields if name in SIGNALS)

    @functools.cached_property
    def noted_rows(self) -> dict[str, range]:
        """Rows of the memory in which looks note something, by its name in NOTED."""
        controller = self.kernel_choice.controller
        if controller is None:
            return {}
        firsts = accumulate(NOTED.values(), initial=controller.bus.rows)
        return {name: range(first, first + size) for (name, size), first in zip(NOTED.items(), firsts, strict=False)}

    @functools.cached_property
    def signal_rows(self) -> tuple[int, ...]:
        """Rows of the memory that are saved with each sample: those of each signal in turn."""
        controller = self.kernel_choice.controller
        if controller is None or controller.bus is None:
            return ()
        noted = {name: rows.start for name, rows in self.noted_rows.items()}
        begins = ((row_of(name, controller.bus, noted), self.sample_fields[name]) for name in self.signals)
        return tuple(row + i for row, size in begins for i in range(size))

    def _kind(self) -> str:
        """The kind of kernel for which a width is chosen, one of widths.KINDS."""
        if "dense" in self.kernel_choice.parts:
            return "dense"
        if self.method.tableau or self.method.gauss:
            return "explicit"
        return "chained" if self.method.turns else "plain"

    def _explicit(self) -> Explicit | None:
        tableau = self.method.tableau
        if tableau is None:
            return None
        # A step that is given asks for no estimate: nothing of it then is in the kernel's source.
        estimate = (tableau.errors, tableau.estimate) if self.method.adaptive else ((), 0)
        kind = KINDS.get(self.method.name, "vector")
        if kind == "vector" and self.kernel_choice.steady and not self.method.adaptive:
            kind = "inertial"
        # Without damping a linearly implicit method has no matrix, and is the explicit one of its tableau.
        implicit = tableau.implicit if "dense" in self.kernel_choice.parts else ()
        return Explicit(kind, tableau.a, tableau.b, tableau.c, *estimate, self.method.adaptive, implicit)

    @contextlib.contextmanager
    def _laws_compile(self) -> Iterator[None]:
        """Turn an exception raised while a user's law compiles into a SceneError that names the law."""
        try:
            yield
        except OSError:  # of the kernel cache
            raise
        except Exception as error:
            choice = self.kernel_choice
            acting = (*choice.laws, *choice.events, *choice.parts_of_control)
            of_user = [term for term, module in acting if not is_built_in(module)]
            if not of_user:
                raise
            problem = f"one of them does not compile ({type(error).__name__}: {error})"
            remedies = {
                False: "lw.check_law(term) says where, docs/develop/add_a_force.md how",
                True: "lw.check_controller(part) says where, docs/develop/add_a_controller.md how",
            }
            remedy = " and ".join(remedies[kind] for kind in sorted({isinstance(term, Part) for term in of_user}))
            raise SceneError([f"law {', '.join(term.key for term in of_user)}: {problem}; {remedy}"]) from error

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the settings alone: a kernel cannot be pickled, and the other process finds it in Warp's cache."""
        if self._whole:
            # Made anew from these members alone, the plan might choose another kernel.
            return Plan.subplan, self._whole
        settings = tuple(getattr(self, item.name) for item in dataclasses.fields(self) if item.init)
        return Plan, settings, {"width_source": self.width_source}

    @property
    def kernel_hash(self) -> str:
        """Hash of the kernel in Warp's cache: of its source, its constants and the compiler's options.

        Returns:
            Hexadecimal digits.
        """
        return str(self.advance.kernel.module.get_module_hash().hex())

    def compile(self) -> float:
        """Load the kernel, and compile it first if Warp's cache has none.

        Returns:
            How long it took [s].

        Raises:
            SceneError: if the device code of a user's law does not compile.
            OSError: if the kernel cache cannot be written.
        """
        start = time.perf_counter()
        module = self.advance.kernel.module
        if module in kernel_cache.loaded and "times" in self.__dict__:
            return 0.0
        source_seconds = time.perf_counter() - start
        with self._laws_compile():
            phases = kernel_cache.load(module)
        _ = self.dtypes, self.times  # made here, before threads ask for them
        if any(phases):  # not loaded before in this process
            object.__setattr__(self, "phases", phases._replace(source=source_seconds + phases.source))
        return time.perf_counter() - start

    @functools.cached_property
    def dtypes(self) -> tuple[np.dtype, ...]:
        """NumPy dtypes of the kernel's structs Inertia, Params, Events and Limits, and of Loop where there is a controller."""
        return _dtypes(self.advance)

    @functools.cached_property
    def lengths(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Lengths of the stages and of the leads, in units of the step h [1]."""
        lead = self.kernel_choice.lead
        return self.method.lengths(lead[1] if lead else None)

    @functools.cached_property
    def times(self) -> tuple[Any, Any, Any]:
        """Kernel arguments that all blocks share.

        Returns:
            (stage_h, lead_h, sample_step): lengths of stages and leads [s], and the numbers of steps after which samples
            are due.
        """
        stages, leads = (np.array(fractions) * self.grid.h for fractions in self.lengths)
        due = np.append(self.grid.sample_steps, 2**31 - 1).astype(np.int32)
        return (
            wp.array(stages, dtype=self.spec.real, device="cpu"),
            wp.array(leads, dtype=self.spec.real, device="cpu"),
            wp.array(due, dtype=wp.int32, device="cpu"),
        )

    def due(self, k0: int, k1: int) -> tuple[int, int]:
        """Which samples fall due in a launch.

        Args:
            k0: number of steps made before the launch.
            k1: number of steps made after it.

        Returns:
            (s0, s1): samples s0 to s1 - 1 are due after step k0 and no later than step k1.
        """
        steps = self.grid.sample_steps
        return int(steps.searchsorted(k0, side="right")), int(steps.searchsorted(k1, side="right"))

    def segments(self, count: int) -> Iterator[tuple[int, int]]:
        """The launches of a block: each is short enough to be interrupted, and its samples fit into a small buffer.

        Args:
            count: number of members of the block.

        Yields:
            (k0, k1): a launch makes the steps from k0 to k1.
        """
        if self.asks:
            yield from self._periods()
            return
        due, slots = self.grid.sample_steps, self.slots(count)
        every = int(self.gathered.sample_steps[1]) if self.gathered and len(self.gathered.times) > 1 else 0
        per_sample = sum(self.sample_fields.values()) * count * np.dtype(DTYPES[self.dtype]).itemsize
        most_samples = max(1, SEGMENT_SAMPLE_BYTES // max(per_sample, 1))
        most_steps = max(CHUNK, SEGMENT_VEHICLE_STEPS // count // CHUNK * CHUNK)
        k = 0
        while k < self.grid.steps:
            last = self.due(k, k)[1] + most_samples
            k1 = min(k + most_steps, int(due[min(last, len(due)) - 1]))
            if every:
                # Up to the last look for which there is a slot before those of earlier ones are taken again.
                k1 = min(k1, ((k // every + 1) // slots * slots + slots - 1) * every)
            yield k, k1
            k = k1

    def _periods(self) -> Iterator[tuple[int, int]]:
        """The launches where a function of the host answers each look: one a period."""
        controller = self.kernel_choice.controller
        assert controller is not None
        every = controller.every(self.grid.h)
        for k in range(0, self.grid.steps, every):
            yield k, min(k + every, self.grid.steps)


def damping_terms(terms: Sequence[Term]) -> list[Term]:
    """The terms whose device code has damping."""
    devices = [built_in("laws", term.device) if isinstance(term.device, str) else term.device for term in terms]
    return [term for term, device in zip(terms, devices, strict=True) if hasattr(device, "damping")]


@functools.lru_cache(maxsize=256)
def _dtypes(advance: Advance) -> tuple[np.dtype, ...]:
    """Kept by kernel, since plans of one kernel are many and Warp takes long to tell."""
    types = advance.types
    kinds = (types.Inertia, types.Params, types.Events, types.Limits, *([types.Loop] if types.Loop else []))
    return tuple(np.dtype(kind.numpy_dtype()) for kind in kinds)
