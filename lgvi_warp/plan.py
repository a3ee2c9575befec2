"""From an ensemble to kernel launches: the kernel with only what the scene has, and packets of lanes for its blocks."""

from __future__ import annotations

import contextlib
import functools
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels.advance import CHUNK, SAMPLE_FIELDS, Advance, Spec, make_advance
from lgvi_kernels.explicit import Explicit
from lgvi_kernels.lanes import WIDTHS
from lgvi_kernels.stops import STOPS
from lgvi_kernels.terms import LAWS
from lgvi_warp import durable, warp_setup
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.errors import Faults, SceneError
from lgvi_warp.gauss import gauss
from lgvi_warp.machine import DTYPES, default_width
from lgvi_warp.method import KINDS, Method
from lgvi_warp.model import Model, make_model
from lgvi_warp.saveat import TimeGrid

CHECKS = ("none", "safe")

# One launch advances at most this many vehicle-steps and samples: so progress moves, an interrupt is heard, and the
# buffer that samples pass through stays small, however long the run is.
SEGMENT_VEHICLE_STEPS = 20_000_000
SEGMENT_SAMPLE_BYTES = 16_000_000

# Warp builds and launches kernels for one thread at a time.
build_lock = threading.Lock()


@contextlib.contextmanager
def _one_at_a_time() -> Iterator[None]:
    """Let one process compile while others wait for what it puts into Warp's cache.

    Without it each would compile the same kernel: that is safe, since Warp renames finished folders into their places, but
    slow.
    """
    path = Path(wp.config.kernel_cache_dir) / "lgvi_warp.lock"
    try:
        path.touch()
    except OSError:  # a cache that is only read
        yield
        return
    with durable.locked(path, wait=True):
        yield


@dataclass(frozen=True)
class Plan:
    """Everything decided before a run: which kernel, which width, which steps.

    Raises SceneError for a dtype, width or checks that do not exist, and where the method cannot do what the scene asks.
    """

    ensemble: Ensemble
    method: Method
    grid: TimeGrid
    fields: tuple[str, ...]
    dtype: str = "float64"
    width: int | None = None
    checks: str = "safe"
    model: Model = field(init=False)
    spec: Spec = field(init=False)
    advance: Advance = field(init=False)

    def __post_init__(self) -> None:
        faults = Faults()
        faults.choice("dtype", self.dtype, DTYPES)
        faults.choice("checks", self.checks, CHECKS)
        if self.width is not None:
            faults.choice("width", self.width, WIDTHS)
        if self.checks == "none" and self.ensemble.scene.events:
            faults.add("checks", self.checks, "leaves events unseen", 'use checks="safe", or drop the events')
        if self.dtype == "float32_compensated" and (self.method.tableau or self.method.gauss or self.method.two_part):
            what = f"sums up what a method of sub-maps changes, which {self.method.name} is not"
            faults.add("dtype", self.dtype, what, "use float64, or psi_s, psi_x and their compositions")
        faults.raise_if_any()
        object.__setattr__(self, "model", make_model(self.ensemble, self.method, self.grid.h, LAWS, STOPS))
        if self.width is None:
            # The turns of psi_x follow one another; the implicit step V of damping laws fills the registers by itself, and so
            # do compensated sums.
            full = "dense" in self.model.parts or self.dtype == "float32_compensated"
            chained = self.method.turns and not full
            object.__setattr__(self, "width", default_width(self.dtype, chained=chained))
        object.__setattr__(self, "spec", self._spec())
        with self._laws_compile():
            object.__setattr__(self, "advance", make_advance(self.spec))

    def _spec(self) -> Spec:
        model = self.model
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
            checked=self.checks != "none",
            fields=tuple(name for name in SAMPLE_FIELDS if name in self.fields),
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
            lead_time=self.lengths[1][-1],
            explicit=self._explicit(),
            compensated=self.dtype == "float32_compensated",
        )

    def _explicit(self) -> Explicit | None:
        tableau = self.method.tableau
        if tableau is None:
            return None
        # A step that is given asks for no estimate: nothing of it then is in the kernel's source.
        estimate = (tableau.errors, tableau.estimate) if self.method.adaptive else ((), 0)
        return Explicit(KINDS.get(self.method.name, "vector"), tableau.a, tableau.b, tableau.c, *estimate,
                        self.method.adaptive)  # fmt: skip

    @contextlib.contextmanager
    def _laws_compile(self) -> Iterator[None]:
        """Where a scene has laws of a user, what does not compile is theirs. Raises SceneError for it."""
        try:
            yield
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
        own = (self.ensemble, self.method, self.grid, self.fields, self.dtype, self.width, self.checks)
        return Plan, own

    @property
    def kernel_hash(self) -> str:
        """What Warp's cache knows the kernel by: its source, its constants and the options of the compiler."""
        return str(self.advance.kernel.module.get_module_hash().hex())

    def compile(self) -> float:
        """Load the kernel, compiling it if Warp's cache has none. Returns the seconds it took."""
        start = time.perf_counter()
        warp_setup.start()
        with build_lock, self._laws_compile(), _one_at_a_time():
            wp.load_module(self.advance.kernel.module, device="cpu")
        _ = self.dtypes, self.times  # made here, before threads ask for them
        return time.perf_counter() - start

    @functools.cached_property
    def dtypes(self) -> tuple[np.dtype, np.dtype, np.dtype]:
        """NumPy's types of the kernel's Inertia, Params and Events."""
        types = (self.advance.Inertia, self.advance.Params, self.advance.Events)
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
