"""Quantities of interest of an ensemble's members, of some thousands at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.status import Status, failed
from lgvi_warp.methods.saveat import FIELDS, SaveAt
from lgvi_warp.runs.quantities import OfInterest, OfResult, quantities
from lgvi_warp.runs.solve import solve
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.like import SceneLike

# Members that are run together: what is kept of their paths stays small.
AT_ONCE = 16_384


class FailedMembers(SceneError):  # noqa: N818  (what happened, and no fault of the scene)
    """Members failed, and what was asked for does not follow from the others."""


@dataclass(frozen=True)
class Outputs:
    """Quantities (n, m) of n members, their labels, and which members failed; counts: members by name of status."""

    values: np.ndarray
    labels: tuple[str, ...]
    failed: np.ndarray
    counts: dict[str, int]
    provenance: dict[str, Any]

    def text(self, remedy: str) -> str:
        """How many failed, of what, and what to do."""
        bad = int(self.failed.sum())
        what = ", ".join(f"{name} {number}" for name, number in self.counts.items() if name != "ok")
        first = int(np.argmax(self.failed))
        return f"{bad} of {len(self.failed)} members failed ({what}; the first: member {first}); {remedy}"


def evaluate(
    fleet: Ensemble,
    of: OfInterest | Sequence[OfInterest],
    *,
    common_noise: bool = False,
    progress: Callable[[float], None] | None = None,
    save: SaveAt | None = None,
    **settings: Any,
) -> Outputs:
    """Run an ensemble, some thousands of members at a time, and keep the quantities of interest only.

    of: one or several, see `OfResult`. common_noise: whether laws with noise act on every member alike. save and settings:
    those of `lw.solve`. A member failed if its status says so or a quantity of it is not finite; stopped by an event it is
    as good as any. Raises SceneError.
    """
    asked = quantities(of)
    save = _samples(fleet.scene, asked, save)
    if common_noise:
        fleet = fleet.subset(np.arange(fleet.members))
        fleet.indices = np.zeros(fleet.members, dtype=np.int64)
    looks_at_members = any(one.looks_at_members for one in asked)
    values, status, provenance = [], [], {}
    for first in range(0, fleet.members, AT_ONCE):
        chosen = np.arange(first, min(first + AT_ONCE, fleet.members))
        part = progress and _part(progress, first / fleet.members, len(chosen) / fleet.members)
        # What the scene keeps of its own runs, and when those end, is no matter of a design that must be whole.
        group = fleet.subset(chosen)
        result = solve(group, save=save, progress=part, statistics=(), keep="all", until=False, **settings)
        members = group.select(0, len(chosen)) if looks_at_members else None
        values.append([one.values(result, members) for one in asked])
        status.append(np.asarray(result.status))
        provenance = result.provenance
    found = np.concatenate([np.concatenate(one, axis=1) for one in values])
    labels = [label for one, columns in zip(asked, values[0], strict=True) for label in one.labels(columns.shape[1])]
    ended = np.concatenate(status)
    finite = np.isfinite(found).all(axis=1)
    names = {Status(int(code)).name.lower(): int((ended == code).sum()) for code in np.unique(ended)}
    counts = names | ({"quantity not finite": int((~finite).sum())} if not finite.all() else {})
    failures = failed(ended) | ~finite
    return Outputs(found, tuple(labels), failures, counts, provenance | {"ensemble": fleet.to_dict()})


def _part(progress: Callable[[float], None], done: float, share: float) -> Callable[[float], None]:
    return lambda fraction: progress(done + share * fraction)


def _samples(scene: SceneLike, asked: Sequence[OfResult], save: SaveAt | None) -> SaveAt:
    """Which samples the quantities need. Raises SceneError where a path is asked for and none is kept."""
    if save is not None:
        return save
    fields = tuple(name for name in FIELDS if any(name in one.fields for one in asked))
    paths = [one.label for one in asked if one.over_path]
    if paths and scene.run.save_every is None:
        faults = Faults()
        faults.add(
            "save",
            None,
            f"is missing, and {paths[0]} looks over the path",
            "give save=lw.SaveAt(every=...) or [run] save_every",
        )
        faults.raise_if_any()
    given = any(one.is_function for one in asked)
    return SaveAt(every=scene.run.save_every if paths or given else None, fields=fields)
