"""From an ensemble to kernel launches: the kernel with only what the scene has, and packets of lanes for its blocks."""

from __future__ import annotations

import contextlib
import copy
import functools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels.advance.kernel import Advance, make_advance
from lgvi_kernels.advance.spec import CHUNK, Spec
from lgvi_kernels.explicit import Explicit
from lgvi_kernels.lanes import WIDTHS
from lgvi_kernels.rows import SAMPLE_FIELDS
from lgvi_kernels.stops import STOPS
from lgvi_kernels.terms import LAWS
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.machine import DTYPES, default_width
from lgvi_warp.common.status import CHECKS, ON_FAILURE
from lgvi_warp.common.warp_setup import build_lock
from lgvi_warp.engine import kernel_cache
from lgvi_warp.engine.model import Model, make_model
from lgvi_warp.engine.step_warnings import watched
from lgvi_warp.methods.gauss import gauss
from lgvi_warp.methods.method import KINDS, Method
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.scene.ensemble import Ensemble

# Sub-maps whose equation may have no solution.
SOLVING = {"D", "W", "A", "Phi", "Phi*"}

# One launch advances at most this many vehicle-steps and samples: so progress moves, an interrupt is heard, and the
# buffer that samples pass through stays small, however long the run is.
SEGMENT_VEHICLE_STEPS = 20_000_000
SEGMENT_SAMPLE_BYTES = 16_000_000


@dataclass(frozen=True)
class Plan:
    """Everything decided before a run: which kernel, which width, which steps.

    Raises SceneError for a dtype, width, checks or on_failure that do not exist, and where the method cannot do what the
    scene asks.
    """

    ensemble: Ensemble
    method: Method
    grid: TimeGrid
    fields: tuple[str, ...]
    dtype: str = "float64"
    width: int | None = None
    checks: str = "safe"
    on_failure: str = "freeze"
    model: Model = field(init=False)
    spec: Spec = field(init=False)
    advance: Advance = field(init=False)
    # The plan that it is a part of, its members and fields.
    _whole: tuple[Plan, Sequence[int], Sequence[str]] | None = field(
        default=None, init=False, compare=False, repr=False
    )

    def __post_init__(self) -> None:
        faults = Faults()
        faults.choice("dtype", self.dtype, DTYPES)
        faults.choice("checks", self.checks, CHECKS)
        faults.choice("on_failure", self.on_failure, ON_FAILURE)
        if self.width is not None:
            faults.choice("width", self.width, WIDTHS)
        if self.checks == "none" and self.ensemble.scene.events:
            faults.add("checks", self.checks, "leaves events unseen", 'use checks="safe", or drop the events')
        if self.dtype == "float32_compensated" and (self.method.tableau or self.method.gauss or self.method.two_part):
            what = f"sums up what a method of sub-maps changes, which {self.method.name} is not"
            faults.add("dtype", self.dtype, what, "use float64, or psi_s, psi_x and their compositions")
        if self.checks == "none" and self.on_failure in ON_FAILURE[1:]:
            what = f"leaves failures unseen, which on_failure={self.on_failure!r} waits for"
            faults.add("checks", self.checks, what, 'use checks="safe", or on_failure="freeze"')
        faults.raise_if_any()
        checked = self.checks != "none"
        model = make_model(self.ensemble, self.method, self.grid.h, LAWS, STOPS, checked)
        object.__setattr__(self, "model", model)
        self._check_substep()
        if self.width is None:
            # The turns of psi_x follow one another; the implicit step V of damping laws fills the registers by itself, and so
            # do compensated sums.
            full = "dense" in self.model.parts or self.dtype == "float32_compensated"
            chained = self.method.turns and not full
            object.__setattr__(self, "width", default_width(self.dtype, chained=chained))
        object.__setattr__(self, "fields", tuple(name for name in SAMPLE_FIELDS if name in self.fields))
        self._choose_kernel()

    def _choose_kernel(self) -> None:
        object.__setattr__(self, "spec", self._spec())
        with build_lock, self._laws_compile():
            object.__setattr__(self, "advance", make_advance(self.spec))

    def _check_substep(self) -> None:
        """Refuse to divide the steps of a method or of laws that cannot be divided, with the reason."""
        if self.on_failure != "substep":
            return
        faults, name = Faults(), self.method.name
        letters = {letter for letter, _ in self.model.program} | ({self.model.lead[0]} if self.model.lead else set())
        if self.method.gauss:
            why = "starts each step from the stages of the last one, which a divided step would have lost"
            faults.add("on_failure", "substep", f"{name} {why}", 'shorten the step, or use on_failure="freeze"')
        elif not letters & SOLVING:
            why = "solves nothing that could fail"
            faults.add("on_failure", "substep", f"{name} {why}", 'use on_failure="freeze"; psi_s and psi solve (24)')
        for term, module in self.model.laws:
            noisy = getattr(module, "NOISE", False)
            if term.memory or noisy:
                why = (
                    "draws its noise once a step" if noisy else "remembers what a step that is made again would change"
                )
                faults.add("on_failure", "substep", f"{term.key} {why}", 'use on_failure="freeze", or a shorter step')
        faults.raise_if_any()

    def with_neighbours(self, indices: np.ndarray) -> np.ndarray:
        """(m,), these members, and where packets choose their steps the others of their packets: their bits hang on them."""
        if not self.method.adaptive:
            return indices
        width = self.spec.width
        found = np.unique(indices // width)[:, None] * width + np.arange(width)
        return found[found < self.ensemble.members]

    def part(self, indices: Sequence[int], fields: Sequence[str]) -> Plan:
        """The plan for these members alone, whose samples have these fields; all that was chosen for the whole stays.

        So its members' bits are those of the whole, for methods whose packets do not choose their steps.
        """
        part = copy.copy(self)
        for name in ("dtypes", "times"):
            part.__dict__.pop(name, None)
        object.__setattr__(part, "ensemble", self.ensemble.subset(indices))
        object.__setattr__(part, "fields", tuple(name for name in SAMPLE_FIELDS if name in fields))
        part._choose_kernel()
        object.__setattr__(part, "_whole", (self, indices, fields))
        return part

    def _sampled(self) -> tuple[str, ...]:
        """The fields that samples hold: those asked for, and what they are made of where the origin is moved."""
        needed = set(self.fields)
        if self.model.moved:
            needed |= {"attitude"} if "position" in needed else set()
            needed |= {"angular_velocity"} if "velocity" in needed else set()
        return tuple(name for name in SAMPLE_FIELDS if name in needed)

    def _spec(self) -> Spec:
        model, checked = self.model, self.checks != "none"
        back = min(0.0, *self.method.stages) < 0.0 and bool(model.drag) and self.method.tableau is None
        return Spec(
            width=self.width,
            real=wp.float64 if DTYPES[self.dtype] == "float64" else wp.float32,
            maps=model.program,
            lead=model.lead,
            laws=tuple(module for _, module in model.laws),
            mass=model.mass,
            solver=self.method.solver,
            iterations=int(self.method.iterations or 0),
            adaptive=self.method.iterations is None,
            checked=checked,
            fields=self._sampled(),
            events=tuple(module for _, module in model.events),
            drag=model.drag,
            parts=model.parts,
            coupling=model.coupling,
            flow=model.flow,
            timed=model.timed,
            memory=model.memory,
            averages=model.averages,
            composed=len(self.method.stages) > 1,
            paired=self.method.halved or (self.method.two_part and not model.lead),
            gauss=gauss(self.method.gauss) if self.method.gauss else (),
            lead_time=self.lengths[1][-1] if model.timed else 0.0,
            explicit=self._explicit(),
            compensated=self.dtype == "float32_compensated",
            looks=watched(self) if self.checks == "all" else (),
            energy=model.conservative,
            backward=checked and back,
            substep=self.on_failure == "substep",
        )

    def _explicit(self) -> Explicit | None:
        tableau = self.method.tableau
        if tableau is None:
            return None
        # A step that is given asks for no estimate: nothing of it then is in the kernel's source.
        estimate = (tableau.errors, tableau.estimate) if self.method.adaptive else ((), 0)
        kind = KINDS.get(self.method.name, "vector")
        if kind == "vector" and self.model.steady and not self.method.adaptive:
            kind = "inertial"
        return Explicit(kind, tableau.a, tableau.b, tableau.c, *estimate,
                        self.method.adaptive)  # fmt: skip

    @contextlib.contextmanager
    def _laws_compile(self) -> Iterator[None]:
        """Where a scene has laws of a user, what does not compile is theirs. Raises SceneError for it."""
        try:
            yield
        except OSError:  # of the kernel cache
            raise
        except Exception as error:
            known = (*LAWS.values(), *STOPS.values())
            own = [term.key for term, module in (*self.model.laws, *self.model.events) if module not in known]
            if not own:
                raise
            what = f"one of them does not compile ({type(error).__name__}: {error})"
            raise SceneError(
                [f"law {', '.join(own)}: {what}; lw.check_law(term) says where, docs/add_a_law.md how"]
            ) from error

    def __reduce__(self) -> tuple[Any, ...]:
        """Made again from its settings: kernels cannot be sent, and are found in Warp's cache."""
        if self._whole:
            # Of its members alone another kernel may be enough.
            return Plan.part, self._whole
        own = (self.ensemble, self.method, self.grid, self.fields, self.dtype, self.width, self.checks, self.on_failure)
        return Plan, own

    @property
    def kernel_hash(self) -> str:
        """What Warp's cache knows the kernel by: its source, its constants and the options of the compiler."""
        return str(self.advance.kernel.module.get_module_hash().hex())

    def compile(self) -> float:
        """Load the kernel, compiling it if Warp's cache has none. Returns the seconds it took."""
        start = time.perf_counter()
        with self._laws_compile():
            kernel_cache.load(self.advance.kernel.module)
        _ = self.dtypes, self.times  # made here, before threads ask for them
        return time.perf_counter() - start

    @functools.cached_property
    def dtypes(self) -> tuple[np.dtype, ...]:
        """NumPy's types of the kernel's Inertia, Params, Events and Limits."""
        types = (
            self.advance.types.Inertia,
            self.advance.types.Params,
            self.advance.types.Events,
            self.advance.types.Limits,
        )
        return tuple(np.dtype(one.numpy_dtype()) for one in types)

    @functools.cached_property
    def lengths(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Of the stages and of the leads, in steps."""
        lead = self.model.lead
        return self.method.lengths(lead[1] if lead else None)

    @functools.cached_property
    def times(self) -> tuple[Any, Any, Any]:
        """Kernel arguments that all blocks share: stage_h, lead_h and sample_step."""
        stages, leads = (np.array(one) * self.grid.h for one in self.lengths)
        due = np.append(self.grid.sample_steps, 2**31 - 1).astype(np.int32)
        return (
            wp.array(stages, dtype=self.spec.real, device="cpu"),
            wp.array(leads, dtype=self.spec.real, device="cpu"),
            wp.array(due, dtype=wp.int32, device="cpu"),
        )

    def due(self, k0: int, k1: int) -> tuple[int, int]:
        """(s0, s1): the samples s0 to s1 fall due after step k0 and up to step k1."""
        s0, s1 = np.searchsorted(self.grid.sample_steps, (k0, k1), side="right")
        return int(s0), int(s1)

    def segments(self, count: int) -> Iterator[tuple[int, int]]:
        """(k0, k1): launches from step k0 to step k1, for a block of `count` members."""
        due = self.grid.sample_steps
        per_sample = sum(self.spec.sample_fields.values()) * count * np.dtype(DTYPES[self.dtype]).itemsize
        most_samples = max(1, SEGMENT_SAMPLE_BYTES // max(per_sample, 1))
        most_steps = max(CHUNK, SEGMENT_VEHICLE_STEPS // count // CHUNK * CHUNK)
        k = 0
        while k < self.grid.steps:
            last = self.due(k, k)[1] + most_samples
            k1 = min(k + most_steps, int(due[min(last, len(due)) - 1]))
            yield k, k1
            k = k1
