# SPDX-License-Identifier: Apache-2.0
"""Many runs of one scene, whose settings, plan and kernel are settled once, and quantities of their members."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.status import Status, failed
from lgvi_warp.control.signals import ordered
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.shared import Shared
from lgvi_warp.engine.survey import survey
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.provenance import provenance
from lgvi_warp.results.quantities import OfEnds, OfResult
from lgvi_warp.results.result import Result
from lgvi_warp.runs.request import Request, enough_iterations
from lgvi_warp.scene.ensemble import SURVEYED, Ensemble
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.statistics.base import Statistic

# Members that are run together where quantities look over their paths, which are kept as long as they run.
PATHS_AT_ONCE = 16_384


@dataclass
class _Kind:
    """Plans of ensembles in which the same names vary, by what their survey found."""

    shared: Shared
    plans: dict[Any, Plan] = field(default_factory=dict)


@dataclass(frozen=True)
class Evaluated:
    """Quantities of some members.

    values: (n, m).
    status: (n,).
    widths: how many of the columns are those of each quantity of interest.
    provenance: that of the last run.
    """

    values: np.ndarray
    status: np.ndarray
    widths: list[int]
    provenance: dict[str, Any]

    @property
    def lost(self) -> np.ndarray:
        """Whether each member failed, or a quantity of it is not finite (n,)."""
        return failed(self.status) | ~np.isfinite(self.values).all(axis=1)

    @property
    def counts(self) -> dict[str, int]:
        """Number of members by what became of them."""
        names = {Status(int(code)).name.lower(): int((self.status == code).sum()) for code in np.unique(self.status)}
        odd = int((~np.isfinite(self.values).all(axis=1)).sum())
        return names | ({"quantity not finite": odd} if odd else {})


class Runner:
    """Plans of a request for many members, settled once: what `solve` does for a call."""

    def __init__(self, request: Request):
        self.request = request
        scene, chosen = request.fleet.scene, request.method
        self._auto = (chosen if isinstance(chosen, Method) else scene.run.method_of(chosen)).iterations == "auto"
        self._kinds: dict[frozenset[str], _Kind] = {}
        self._last: Plan | None = None

    @classmethod
    def of(cls, fleet: Ensemble, statistics: Sequence[Any], **settings: Any) -> Runner:
        """The runs of all members of an ensemble, whatever the scene says of statistics, keep and until."""
        faults = Faults()
        request = Request.of(faults, fleet, statistics=statistics, keep="all", until=False, **settings)
        faults.raise_if_any()
        return cls(request)

    def plan(self, fleet: Ensemble) -> Plan:
        """The plan of a run of some members; a kernel is chosen for what these members are, as `solve` does."""
        names = frozenset(fleet.varied_names)
        kind = self._kinds.get(names)
        if kind is not None and self._last is not None:
            last = self._last
            method = last.method
            if self._auto:
                method = replace(method, iterations=enough_iterations(fleet, method, last.grid.h, last.dtype))
            plan = kind.plans.get((method, survey(fleet, method, kind.shared, odd=False, most=SURVEYED).decisive))
            if plan is not None:
                return plan.of(fleet)
        plan = replace(self.request, fleet=fleet).plan(survey_all=False)
        plan.compile()
        if plan.method.reason:  # chosen once, by the members of the first plan
            self.request = replace(self.request, method=plan.method)
        kind = self._kinds.setdefault(names, _Kind(plan.shared))
        facts = survey(fleet, plan.method, kind.shared, odd=False, most=SURVEYED)
        kind.plans[plan.method, facts.decisive] = self._last = plan
        return plan

    def run(self, fleet: Ensemble, progress: Callable[[float], None] | None = None, warned: bool = True) -> Result:
        """Run some members.

        Returns: Their result, whose provenance names the members' number but not their values, and whose messages leave out
            what is odd about their values.
        """
        few = {"members": fleet.members, "seed": fleet.seed, "varied": sorted(fleet.varied_names)}

        def known(plan: Plan) -> tuple[dict[str, Any], tuple[str, ...]]:
            content = plan.shared("provenance", {}, lambda numbers: provenance(plan, self.request.observed))
            return {**content, "ensemble": few}, plan.grid.messages

        plan = self.plan(fleet)
        return self.request.run(plan, fields=plan.fields, progress=progress, known=known, warned=warned)

    def evaluate(
        self,
        fleet: Ensemble,
        of: Sequence[OfResult],
        at_once: int,
        progress: Callable[[float], None] | None = None,
        warned: bool = True,
    ) -> Evaluated:
        """Run members, so many at a time, and keep their quantities alone."""
        looks_at_members = any(each.looks_at_members for each in of)
        values, status, content, n = [], [], dict[str, Any](), fleet.members
        for first in range(0, n, at_once):
            stop = min(first + at_once, n)
            group = fleet if stop - first == n else fleet.subset(np.arange(first, stop))
            result = self.run(group, progress and part(progress, first / n, stop / n), warned)
            members = group.select(0, group.members) if looks_at_members else None
            values.append([each.values(result, members) for each in of])
            status.append(np.asarray(result.status))
            content = result.provenance
        numbers = np.concatenate([np.concatenate(of_group, axis=1) for of_group in values])
        return Evaluated(numbers, np.concatenate(status), [columns.shape[1] for columns in values[0]], content)


def part(progress: Callable[[float], None], begin: float, end: float) -> Callable[[float], None]:
    """Tell of a part of the work as a part of the whole."""
    return lambda fraction: progress(begin + (end - begin) * fraction)


def lost_text(lost: np.ndarray, counts: Mapping[str, int], remedy: str) -> str:
    """Describe how many members failed, and of what.

    lost: (n,), whether each failed, or a quantity of it is not finite.
    """
    causes = ", ".join(f"{name} {number}" for name, number in counts.items() if name != "ok")
    first = int(np.argmax(lost))
    return f"{int(lost.sum())} of {len(lost)} members failed ({causes}; the first: member {first}); {remedy}"


def samples_for(scene: SceneLike, of: Sequence[OfResult], save: SaveAt | None) -> SaveAt | None:
    """The samples that quantities need, where the user does not say which to keep."""
    if save is not None or not of:
        return save
    fields = ordered(name for each in of for name in each.fields)
    paths = [each.label for each in of if each.over_path]
    if paths and scene.run.save_every is None:
        problem = f"save = None: is missing, and {paths[0]} looks over the path"
        raise SceneError([f"{problem}; give save=lw.SaveAt(every=...) or [run] save_every"])
    if paths or any(each.is_function for each in of):
        return SaveAt(every=scene.run.save_every, fields=fields)
    times = sorted({each.when for each in of if isinstance(each, OfEnds) and each.when is not None})
    return SaveAt(at=times or None, fields=fields)


def statistics_for(scene: SceneLike, of: Sequence[OfResult]) -> list[Statistic]:
    """The statistics that quantities need, beside samples."""
    found = dict[str, Statistic]()
    for each in of:
        if isinstance(each, OfEnds):
            found |= each.gathered(scene.events)
    return list(found.values())
