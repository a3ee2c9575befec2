# SPDX-License-Identifier: Apache-2.0
"""The plan of a run: the kernel with only the code that the scene needs, the launches of the run, and its samples."""

from __future__ import annotations

import functools
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels import built_in
from lgvi_kernels.advance.spec import Spec
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.phases import Phases
from lgvi_warp.control.signals import check_signals, ordered
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.going_on import begun
from lgvi_warp.engine.heights import FEWEST, time_between_looks
from lgvi_warp.engine.kernel import Kernel
from lgvi_warp.engine.kernel_choice import KernelChoice, check_backward_drag, choose_kernel, resists
from lgvi_warp.engine.kernel_spec import COMPENSATED, kind_of, lengths_of, spec_of, with_tangents
from lgvi_warp.engine.launches import Launches
from lgvi_warp.engine.packing import rows_shared
from lgvi_warp.engine.plan_checks import check_noise_steps, check_settings, check_substep, check_ticks, check_times
from lgvi_warp.engine.sample_layout import SampleLayout
from lgvi_warp.engine.shared import MEMBERS, SEED, SharedResultsCache
from lgvi_warp.engine.state_lanes import kernel_for
from lgvi_warp.engine.survey import Survey, survey, survey_of
from lgvi_warp.engine.widths import measured, of_table
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene.ensemble import SURVEYED, Ensemble


class NotSurveyed(Exception):  # noqa: N818  (what happened, and no fault of the scene)
    """Raised if a member outside the survey needs another kernel."""


@dataclass(frozen=True)
class Plan:
    """All decisions before a run; `choose_plan` makes it."""

    ensemble: Ensemble
    method: Method
    grid: TimeGrid
    fields: tuple[str, ...]  # the samples to keep, in the order in which they are saved
    dtype: str
    checks: str
    on_failure: str
    surveyed_all: bool  # the kernel was chosen by all members, or by the first SURVEYED
    kernel_choice: KernelChoice
    spec: Spec
    width_source: str = field(compare=False)  # see widths.Width
    kernel: Kernel = field(compare=False, repr=False)
    layout: SampleLayout = field(compare=False, repr=False)
    launches: Launches = field(compare=False, repr=False)
    facts: Survey = field(compare=False, repr=False)  # what the members that were looked at require of a kernel
    shared: SharedResultsCache = field(compare=False, repr=False)
    free_packets: list[Any] = field(default_factory=list, compare=False, repr=False)  # of finished blocks
    # Of a plan made by `subplan`: the plan of all, the members and the fields.
    parent: tuple[Plan, Sequence[int], Sequence[str]] | None = field(default=None, compare=False, repr=False)

    @property
    def phases(self) -> Phases:
        """Duration of `compile`, by phase; zeros if this process had already loaded the kernel."""
        return self.kernel.phases

    def compile(self) -> float:
        """Load the kernel and the kernel that packs states, or compile them first; returns the time [s]."""
        start = time.perf_counter()
        self.kernel.load()
        kernel_for(self.spec, self.ensemble.members)
        _ = self.kernel.dtypes, self.launches.times  # made here, before threads ask for them
        return time.perf_counter() - start

    def replanned(self, **changes: Any) -> Plan:
        """Plan the run again with other settings of `choose_plan`, and the same width."""
        return choose_plan(**{**self._settings(), **changes})

    def of_width(self, width: int, source: str) -> Plan:
        """The same plan with packets of another width. source: reason of the width (see widths.Width)."""
        if width == self.spec.width:
            return replace(self, width_source=source)
        return choose_plan(**(self._settings() | {"width": width}), width_source=source)

    def _settings(self) -> dict[str, Any]:
        named = ("ensemble", "method", "grid", "fields", "dtype", "checks", "on_failure")
        of_ticks = {"ticks": self.launches.ticks, "read_at_ticks": self.layout.read_at_ticks}
        settings = {name: getattr(self, name) for name in named} | of_ticks
        return settings | {"width": self.spec.width, "survey_all": self.surveyed_all}

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle only the settings: a kernel cannot be pickled, and the other process finds it in Warp's cache."""
        if self.parent:
            # Made anew from these members alone, the plan might choose another kernel.
            return Plan.subplan, self.parent
        return functools.partial(choose_plan, **self._settings(), width_source=self.width_source), ()

    def for_members(self, ensemble: Ensemble) -> Plan:
        """The same plan, with the same kernel, for other members of the scene to which the survey of this plan applies."""
        check_backward_drag(ensemble, self.kernel_choice, self.method, self.grid.h)
        plan = object.__new__(Plan)  # in a fourth of the time of `replace`
        vars(plan).update(vars(self), ensemble=ensemble)
        return plan

    def from_time(self, ensemble: Ensemble) -> Plan:
        """The same plan, with the same kernel and as many steps, for members that start or continue at another time."""
        grid = self.grid.shifted(ensemble.start_time)
        check_noise_steps(self.kernel_choice, grid)
        check_times(self.kernel_choice, grid)
        check_ticks(self.kernel_choice, grid, ensemble.final is not None)
        # What is packed of members that start depends on the time; what goes on brings that with it.
        shared = self.shared if ensemble.final is not None else _shared(ensemble, self.shared.user_axes)
        plan = replace(self.for_members(ensemble), grid=grid, launches=replace(self.launches, grid=grid), shared=shared)
        return begun(plan)

    def subplan(self, indices: Sequence[int], fields: Sequence[str], grid: TimeGrid | None = None) -> Plan:
        """The plan for some of the members, with all choices made for the whole ensemble.

        The members therefore have the same bits as in the whole run, unless steps are adaptive (see `with_neighbours`).

        grid: other steps and samples, for this process alone; default None: those of the plan.
        """
        grid = grid or self.grid
        layout = replace(self.layout, fields=ordered(fields))
        return replace(
            self,
            ensemble=self.ensemble.subset(indices),
            fields=layout.fields,
            layout=layout,
            grid=grid,
            launches=_launches(grid, self.method, self.spec, layout, False, self.launches.looks),
            shared=_shared(self.ensemble, self.shared.user_axes),
            free_packets=[],
            parent=(self, indices, fields),
        )

    def with_neighbours(self, indices: np.ndarray) -> np.ndarray:
        """Members that must run together so that these members (m,) have the bits of the whole run, in increasing order.

        Adaptive steps are chosen for a whole packet, so a member's bits depend on the other members of its packet.
        """
        if not self.method.adaptive:
            return indices
        width = self.spec.width
        lanes = np.unique(indices // width)[:, None] * width + np.arange(width)
        return lanes[lanes < self.ensemble.members]

    def check_block(self, block: Block, members: Members) -> None:
        """Check members that were not surveyed before the run; raise NotSurveyed if the kernel does not suit them."""
        self.ensemble.check_block(block.first, block.stop, members.parameters)
        unseen = not self.surveyed_all and block.stop > SURVEYED and self.parent is None
        if unseen and not self.serves(self.ensemble, block, members):
            raise NotSurveyed(f"a member of {block.first} to {block.stop - 1} needs what the first {SURVEYED} do not")

    def serves(self, ensemble: Ensemble, block: Block, members: Members) -> bool:
        """Whether the kernel suits some members of the same scene."""
        return self.facts.covers(survey_of(members.parameters, ensemble, self.method, self.shared, block))


def choose_plan(
    ensemble: Ensemble,
    method: Method,
    grid: TimeGrid,
    fields: Sequence[str],
    dtype: str = "float64",
    width: int | None = None,
    checks: str = "safe",
    on_failure: str = "freeze",
    survey_all: bool = True,
    ticks: bool = False,
    read_at_ticks: Mapping[str, tuple[int, ...]] | None = None,
    width_source: str = "asked for",
) -> Plan:
    """Make all decisions before a run; raise SceneError if the settings, the method and the scene do not fit together.

    width: members of a packet, one per lane; None: the width that suits this machine's registers.
    survey_all: whether the kernel is chosen from all members, or from the first SURVEYED. In the second case the run checks
        the others when it reaches them, and starts again, with all members surveyed, if one needs another kernel.
    """
    faults, scene = Faults(), ensemble.scene
    check_settings(faults, scene, method, dtype, width, checks, on_failure)
    # Those of `save` are checked before: these are of statistics.
    check_signals(faults, "statistics", fields, scene)
    faults.raise_if_any()
    shared = _shared(ensemble, _adds_forces(method) and bool(damping_terms(scene.terms)))
    varied = ensemble.varied_names
    # Before anything is packed, which depends on more than the scene and the method.
    with shared.continued(scene, varied, method):
        facts = survey(ensemble, method, shared, most=None if survey_all else SURVEYED)
        if ensemble.copies is not None:
            # The kernel must have what a number changes that is nothing now.
            facts = replace(survey(ensemble.copies.surveyed, method, shared), odd=facts.odd)
    choice = choose_kernel(ensemble, method, facts, built_in, checks, shared.user_axes)
    check_backward_drag(ensemble, choice, method, grid.h)
    if on_failure == "substep":
        check_substep(choice, method)
    check_noise_steps(choice, grid)
    check_times(choice, grid)
    check_ticks(choice, grid, ensemble.final is not None)
    chosen = width is None
    if width is None:
        width, width_source = of_table(kind_of(method, choice), dtype)
    layout = SampleLayout(choice, ordered(fields), dtype == COMPENSATED, read_at_ticks)
    spec = spec_of(choice, method, layout, width, dtype, checks, on_failure)
    if ensemble.copies is not None:
        spec = with_tangents(spec, len(ensemble.copies.targets))
    plan = Plan(
        ensemble=ensemble,
        method=method,
        grid=grid,
        fields=layout.fields,
        dtype=dtype,
        checks=checks,
        on_failure=on_failure,
        surveyed_all=survey_all,
        kernel_choice=choice,
        spec=spec,
        width_source=width_source,
        kernel=Kernel(spec, choice),
        layout=layout,
        launches=_launches(grid, method, spec, layout, ticks, time_between_looks(scene)),
        facts=facts,
        shared=shared,
    )
    settings = method, grid.h, dtype, width, checks, on_failure, layout.fields, facts.decisive
    with shared.continued(scene, varied, settings):
        many_rows = ensemble.copies is None and rows_shared(plan)
    if many_rows:
        spec = spec._replace(shared_rows=True)
        plan = replace(plan, spec=spec, kernel=Kernel(spec, choice))
    # A kernel's hash takes its source: only where some kernel was measured here.
    best = measured().get(plan.kernel.hash) if chosen and measured() and not spec.tangents else None
    plan = plan if best is None else plan.of_width(best, "measured")
    return begun(plan)


def _shared(ensemble: Ensemble, user_axes: bool) -> SharedResultsCache:
    return SharedResultsCache({*ensemble.varied_names, MEMBERS, SEED}, user_axes)


def _adds_forces(method: Method) -> bool:
    """Whether a method adds the forces of damping and forms no matrix."""
    return method.tableau is not None and not method.linearly_implicit


def _launches(
    grid: TimeGrid, method: Method, spec: Spec, layout: SampleLayout, ticks: bool, apart: float | None
) -> Launches:
    controller, size = layout.choice.controller, 8 if spec.real == wp.float64 else 4
    return Launches(
        grid,
        lengths_of(method, layout.choice),
        spec.real,
        sample_bytes=sum(layout.sizes.values()) * size,
        bytes_at_tick=sum(layout.tick_fields.values()) * size,
        width=spec.width,
        every=None if controller is None else controller.every(grid.h),
        has_callback=layout.choice.has_callback,
        ticks=ticks,
        looks=None if apart is None else max(FEWEST, int(apart / grid.h)),
    )


def damping_terms(terms: Sequence[Term]) -> list[Term]:
    """The terms whose device code has damping."""
    devices = [built_in("laws", term.device) if isinstance(term.device, str) else term.device for term in terms]
    return [term for term, device in zip(terms, devices, strict=True) if resists(device)]
