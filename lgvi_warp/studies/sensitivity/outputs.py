"""Quantities of interest of an ensemble's members, computed for some thousands of members at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.status import Status, failed
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.runs.quantities import OfInterest, OfResult, quantities
from lgvi_warp.runs.solve import solve
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.like import SceneLike

# Number of members that are run together, so that their kept paths stay small.
AT_ONCE = 16_384


class FailedMembers(SceneError):  # noqa: N818  (what happened, and no fault of the scene)
    """Raised when members failed and the answer cannot be computed from the remaining ones."""


@dataclass(frozen=True)
class Outputs:
    """Quantities of interest of an ensemble.

    Attributes:
        values: the quantities (n, m) [their units].
        labels: names of the quantities (m,).
        failed: whether each member failed (n,).
        counts: name of a status -> number of members.
        provenance: scene, settings, versions and machine of the runs.
    """

    values: np.ndarray
    labels: tuple[str, ...]
    failed: np.ndarray
    counts: dict[str, int]
    provenance: dict[str, Any]

    def text(self, remedy: str) -> str:
        """Describe how many members failed, and of what.

        Args:
            remedy: what the user can do, which ends the text.

        Returns:
            One line of text.
        """
        bad = int(self.failed.sum())
        causes = ", ".join(f"{name} {number}" for name, number in self.counts.items() if name != "ok")
        first = int(np.argmax(self.failed))
        return f"{bad} of {len(self.failed)} members failed ({causes}; the first: member {first}); {remedy}"


def evaluate(
    fleet: Ensemble,
    of: OfInterest | Sequence[OfInterest],
    *,
    common_noise: bool = False,
    progress: Callable[[float], None] | None = None,
    save: SaveAt | None = None,
    **settings: Any,
) -> Outputs:
    """Run an ensemble, some thousands of members at a time, and keep its quantities of interest only.

    A member failed if its status says so or a quantity of it is not finite; one stopped by an event did not fail.

    Args:
        fleet: the ensemble.
        of: one or several quantities of interest, as of `sobol`.
        common_noise: whether forces with noise act on every member alike. Default False.
        progress: called with the fraction of the members that is done, from 0 to 1.
        save: samples to keep of each run. Default: those that the quantities need.
        settings: arguments of `lw.solve` (method, h, t1, dtype, threads).

    Returns:
        The quantities of every member, and which members failed.

    Raises:
        SceneError: for faulty arguments, and where a path is needed and no sampling interval is known.
    """
    interests = quantities(of)
    save = _samples(fleet.scene, interests, save)
    if common_noise:
        fleet = fleet.subset(np.arange(fleet.members))
        fleet.indices = np.zeros(fleet.members, dtype=np.int64)
    looks_at_members = any(interest.looks_at_members for interest in interests)
    values, status, provenance = [], [], {}
    for first in range(0, fleet.members, AT_ONCE):
        chosen = np.arange(first, min(first + AT_ONCE, fleet.members))
        group_progress = progress and _part(progress, first / fleet.members, len(chosen) / fleet.members)
        # The scene's own statistics, keep and until do not apply: every member of the design must run.
        group = fleet.subset(chosen)
        result = solve(group, save=save, progress=group_progress, statistics=(), keep="all", until=False, **settings)
        members = group.select(0, len(chosen)) if looks_at_members else None
        values.append([interest.values(result, members) for interest in interests])
        status.append(np.asarray(result.status))
        provenance = result.provenance
    numbers = np.concatenate([np.concatenate(group_values, axis=1) for group_values in values])
    labels: list[str] = []
    for interest, columns in zip(interests, values[0], strict=True):
        labels += interest.labels(columns.shape[1])
    ended = np.concatenate(status)
    finite = np.isfinite(numbers).all(axis=1)
    names = {Status(int(code)).name.lower(): int((ended == code).sum()) for code in np.unique(ended)}
    counts = names | ({"quantity not finite": int((~finite).sum())} if not finite.all() else {})
    failures = failed(ended) | ~finite
    return Outputs(numbers, tuple(labels), failures, counts, provenance | {"ensemble": fleet.to_dict()})


def _part(progress: Callable[[float], None], done: float, share: float) -> Callable[[float], None]:
    return lambda fraction: progress(done + share * fraction)


def _samples(scene: SceneLike, asked: Sequence[OfResult], save: SaveAt | None) -> SaveAt:
    """Choose the samples that the quantities need. Raises SceneError where a path is needed and none is kept."""
    if save is not None:
        return save
    fields = tuple(name for name in FIELDS if any(name in interest.fields for interest in asked))
    paths = [interest.label for interest in asked if interest.over_path]
    if paths and scene.run.save_every is None:
        problem = f"save = None: is missing, and {paths[0]} looks over the path"
        raise SceneError([f"{problem}; give save=lw.SaveAt(every=...) or [run] save_every"])
    has_function = any(interest.is_function for interest in asked)
    return SaveAt(every=scene.run.save_every if paths or has_function else None, fields=fields)
