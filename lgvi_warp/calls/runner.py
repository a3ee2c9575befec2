# SPDX-License-Identifier: Apache-2.0
"""Many runs of one scene that share settings, plan and kernel, and the quantities of their members."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.sentences import capital
from lgvi_warp.common.status import Status, failed
from lgvi_warp.control.signals import ordered
from lgvi_warp.engine import single_block
from lgvi_warp.engine.block import parts
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.shared import SharedResultsCache
from lgvi_warp.engine.state_lanes import MANY, kernel_for
from lgvi_warp.engine.survey import Survey, survey
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.drawn import DrawnParameters, DrawnStarts
from lgvi_warp.results.provenance import provenance_but_scene, starts_at
from lgvi_warp.results.quantities import EndQuantity, MetricQuantity, OfResult
from lgvi_warp.results.result import Result
from lgvi_warp.runs.request import ALL_SAMPLES, Request, enough_iterations
from lgvi_warp.scene.ensemble import SURVEYED, Ensemble
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.statistics.base import Statistic

# Members that are run together where quantities look over their paths, which are kept as long as they run.
PATHS_AT_ONCE = 16_384


@dataclass
class _Kind:
    """Plans of ensembles in which the same names vary, keyed by the findings of their survey."""

    shared: SharedResultsCache
    plans: dict[Any, Plan] = field(default_factory=dict)


@dataclass(frozen=True)
class Outputs:
    """Quantities of interest of an ensemble.

    Attributes:
        values: the quantities (n, m) [their units]; NaN for a failure by status, and if not finite.
        labels: names of the quantities (m,).
        failed: whether the status of each member is a failure, or a quantity of the member is not finite (n,).
        counts: name of a status -> number of members.
        provenance: scene, settings, versions and machine of the runs.
    """

    values: np.ndarray
    labels: tuple[str, ...]
    failed: np.ndarray
    counts: dict[str, int]
    provenance: dict[str, Any]

    def text(self, remedy: str) -> str:
        """Say how many members failed, and with which status.

        Args:
            remedy: last part of the text: what the user can do.

        Returns:
            One line of text.
        """
        causes = ", ".join(f"{name} {number}" for name, number in self.counts.items() if name != "ok")
        first, count = int(np.argmax(self.failed)), f"{int(self.failed.sum())} of {len(self.failed)}"
        return f"{count} members failed ({causes}; the first: member {first}). {capital(remedy)}"


class Runner:
    """Runs many ensembles with the same settings of `solve`; their common work is done once."""

    def __init__(self, fleet: Ensemble, statistics: Sequence[Any], **settings: Any):
        faults = Faults()
        # Every member runs, whatever the scene says of statistics, keep and until.
        self.request = Request.of(faults, fleet, statistics=statistics, keep="all", until=False, **settings)
        faults.raise_if_any()
        scene, chosen = fleet.scene, self.request.method
        self._auto = (chosen if isinstance(chosen, Method) else scene.run.method_of(chosen)).iterations == "auto"
        self._kinds: dict[frozenset[str], _Kind] = {}
        # The last plan, with the survey that it was chosen by; one pair, since threads may call at once.
        self._last: tuple[Survey, Plan] | None = None

    def plan(self, fleet: Ensemble) -> Plan:
        """Plan a run of some members; the kernel is chosen for these members, as in `solve`."""
        if fleet.final is not None or fleet.start_time:
            return self.plan(fleet.from_zero()).from_time(fleet)
        names = frozenset(fleet.varied_names)
        kind = self._kinds.get(names)
        if kind is not None and self._last is not None:
            last_facts, last = self._last
            method = last.method
            if self._auto:
                method = replace(method, iterations=enough_iterations(fleet, method, last.grid.h, last.dtype))
            facts = survey(fleet, method, kind.shared, odd=False, most=SURVEYED)
            if facts is last_facts and method is last.method:  # what decides agrees: it need not be compared
                return last.for_members(fleet)
            plan = kind.plans.get((method, facts.decisive))
            if plan is not None:
                self._last = facts, plan
                return plan.for_members(fleet)
        plan = replace(self.request, fleet=fleet).plan(survey_all=False)
        plan.compile()
        kernel_for(plan.spec, MANY)  # few members pack faster by it, too, and calls are many
        if plan.method.reason:  # chosen once, by the members of the first plan
            self.request = replace(self.request, method=plan.method)
        kind = self._kinds.setdefault(names, _Kind(plan.shared))
        facts = survey(fleet, plan.method, kind.shared, odd=False, most=SURVEYED)
        kind.plans[plan.method, facts.decisive] = plan
        self._last = facts, plan
        return plan

    def run(
        self,
        fleet: Ensemble,
        progress: Callable[[float], None] | None = None,
        warned: bool = True,
        final: bool = False,
    ) -> Result:
        """Run some members.

        final: whether the result has `final`, from which another run can continue.
        Returns: Their result. Its provenance has the number of members but not their values, and its messages leave out
            warnings about these values.
        """
        few = {"members": fleet.members, "seed": fleet.seed, "varied": sorted(fleet.varied_names)}

        def context_of(plan: Plan) -> tuple[dict[str, Any], tuple[str, ...]]:
            content = plan.shared("provenance", {}, lambda numbers: provenance_but_scene(plan, self.request.observed))
            return {**content, "ensemble": few, **starts_at(plan)}, plan.grid.messages

        plan = self.plan(fleet)
        return self.request.run(
            plan, fields=plan.fields, progress=progress, known=context_of, warned=warned, final=final
        )

    def samples(
        self, fleet: Ensemble, progress: Callable[[float], None] | None = None
    ) -> tuple[SimpleNamespace, np.ndarray | None] | None:
        """Run few members for their samples alone, at a lower cost than a Result.

        Returns: (the attributes of a Result that plain quantities read, status (n,) or None if all members reached the
            end); None in place of the pair if the run needs a Result.
        """
        request, plan = self.request, self.plan(fleet)
        if progress is not None or plan.on_failure == "raise" or request.observed != ALL_SAMPLES:
            return None
        if not isinstance(request.executor, Threads):
            return None
        blocks = parts(fleet.members, plan.grid.steps, request.count(plan), False)
        if not single_block.fits(plan, blocks):
            return None
        samples, status = single_block.run_for_samples(plan)
        numbers = dict(parameters=DrawnParameters(fleet, fleet.members), starts=DrawnStarts(fleet, fleet.members))
        known = dict(samples=samples, time=plan.grid.times, terms=fleet.scene.terms, members=fleet.members)
        return SimpleNamespace(**known, **numbers), status

    def evaluate(
        self,
        fleet: Ensemble,
        of: Sequence[OfResult],
        at_once: int,
        progress: Callable[[float], None] | None = None,
        warned: bool = True,
    ) -> Outputs:
        """Run the members in groups of `at_once`, and keep only their quantities."""
        groups, ends, content, n = [], [], dict[str, Any](), fleet.members
        for first in range(0, n, at_once):
            stop = min(first + at_once, n)
            group = fleet if stop - first == n else fleet.subset(np.arange(first, stop))
            result = self.run(group, progress and part(progress, first / n, stop / n), warned)
            groups.append(values_of(result, group, of))
            ends.append(np.asarray(result.status))
            content = result.provenance
        return outputs(of, groups, ends, content)


def outputs(
    of: Sequence[OfResult], groups: Sequence[list[np.ndarray]], ends: Sequence[np.ndarray], content: dict[str, Any]
) -> Outputs:
    """Join the quantities of groups of members, and count the members by status.

    groups: quantities of each group, as from `values_of`. ends: the status of each group's members.
    """
    labels = [label for each, columns in zip(of, groups[0], strict=True) for label in each.labels(columns.shape[1])]
    values, status = np.concatenate([np.concatenate(group, axis=1) for group in groups]), np.concatenate(ends)
    wrong, lost = np.concatenate([_not_numbers(of, group) for group in groups]), failed(status)
    odd = wrong.any(axis=1)
    values[wrong | lost[:, None]] = np.nan
    codes = np.unique(status) if status.any() else [Status.OK]
    counts = {Status(int(code)).name.lower(): int((status == code).sum()) for code in codes}
    counts |= {"quantity not finite": int(odd.sum())} if odd.any() else {}
    return Outputs(values, tuple(labels), lost | odd, counts, content)


def _not_numbers(of: Sequence[OfResult], numbers: Sequence[np.ndarray]) -> np.ndarray:
    """Mask (n, m) of the quantities that are NaN, or infinite where infinity is not allowed."""
    odd = [np.isnan(x) if each.may_be_infinite else ~np.isfinite(x) for each, x in zip(of, numbers, strict=True)]
    return np.asarray(np.concatenate(odd, axis=1))


def values_of(result: Any, fleet: Ensemble, of: Sequence[OfResult]) -> list[np.ndarray]:
    """Compute the numbers (n, m) of each quantity."""
    members = fleet.select(0, fleet.members) if any(each.looks_at_members for each in of) else None
    return [each.values(result, members) for each in of]


def part(progress: Callable[[float], None], begin: float, end: float) -> Callable[[float], None]:
    """Progress function of a part of the work, which covers the fractions from `begin` to `end` of the whole."""
    return lambda fraction: progress(begin + (end - begin) * fraction)


def samples_for(scene: SceneLike, of: Sequence[OfResult], save: SaveAt | None) -> SaveAt | None:
    """Choose the samples to save: those of `save`, or else those that the quantities need."""
    fields = ordered(name for each in of for name in each.fields)
    if save is not None or not of:
        if not isinstance(save, SaveAt):
            return save
        # Of a function of a Result nobody knows what it reads: the user chose.
        named = [name for each in of if not each.is_function for name in each.fields]
        return replace(save, fields=ordered((*save.fields, *named)))
    paths = [each.label for each in of if each.over_path]
    of_samples = [each.label for each in of if isinstance(each, MetricQuantity) and each.of_samples]
    every = scene.run.save_every
    if every is None and of_samples and not paths and scene.controller is not None:
        every = float(scene.controller.period)  # as of a sweep
    if (paths or of_samples) and every is None:
        problem = f"save = None is missing, and {[*paths, *of_samples][0]} is taken over the whole path"
        raise SceneError([f"{problem}. Give save=lw.SaveAt(every=...) or run.save_every (--set run.save_every=1.0)"])
    if paths or of_samples or any(each.is_function for each in of):
        return SaveAt(every=every, fields=fields)
    times = sorted({each.when for each in of if isinstance(each, EndQuantity) and each.when is not None})
    return SaveAt(at=times or None, fields=fields)


def statistics_for(scene: SceneLike, of: Sequence[OfResult]) -> list[Statistic]:
    """List the statistics that quantities need in addition to samples."""
    gathered = dict[str, Statistic]()
    for each in of:
        gathered |= each.gathered(scene.events)
    return list(gathered.values())
