# SPDX-License-Identifier: Apache-2.0
"""Second run, at the end of a stored run, of members whose samples are kept, into the group `kept` of the store.

    run.zarr/kept/member/c.0      indices of these members in the run
    run.zarr/kept/position/...    chunks, markers and checksums like those of the run itself

The group is written like a run: in blocks, each with a marker after all of its files are on disk.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import scratch
from lgvi_warp.common.errors import SceneError
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.keepers.observation import Observation
from lgvi_warp.store.arrays import whole_array
from lgvi_warp.store.folder import KEPT, Folder, refuse_foreign
from lgvi_warp.store.layout import KEPT_MEMBER
from lgvi_warp.store.run import StoredRun
from lgvi_warp.store.settings import Store

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan

MEMBERS = {"long_name": "index of the member in the run", "units": "1"}
CHOSEN = {
    "long_name": "whether the member is kept",
    "flag_values": [0, 1],
    "flag_meanings": "shares_the_steps_of_a_kept_member kept",
}


@dataclass(frozen=True)
class KeptStore(Store):
    """The group of a store that holds the samples of kept members.

    members: Indices of the members in the group, shape (m,).
    chosen: Mask of the kept members, shape (m,); the others run too, since they share a packet with a kept member.
    """

    members: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64), compare=False)
    chosen: np.ndarray = field(default_factory=lambda: np.empty(0, bool), compare=False)

    @property
    def along(self) -> str:
        """Name of the group's own dimension of members: the run's group has another number of members."""
        return KEPT_MEMBER

    @property
    def whole(self) -> Path:
        """Folder of the run to which the group belongs."""
        return self.folder.parent

    def write_given(self, group: Any, plan: Plan) -> None:
        """Write the indices of the group's members; the arrays from which the ensemble was made are in the run's group."""
        whole_array(group, KEPT_MEMBER, self.members, (KEPT_MEMBER,), MEMBERS)
        if not self.chosen.all():
            whole_array(group, "chosen", self.chosen.astype(np.uint8), (KEPT_MEMBER,), CHOSEN)

    def is_there(self) -> bool:
        """Tell whether the folder holds a readable group of exactly these members."""
        try:
            return np.array_equal(Folder(self.folder, self.whole).group()[KEPT_MEMBER][:], self.members)
        except (SceneError, OSError, ValueError, KeyError):
            return False


@dataclass(frozen=True)
class KeptRun:
    """Last stage of a stored run: runs the members selected by `keep` again, this time storing their samples.

    fields: Names of the fields whose samples are kept.
    """

    observed: Observation
    fields: tuple[str, ...]

    def __call__(
        self, run: StoredRun, members: int, executor: Executor, progress: Callable[[float], None] | None = None
    ) -> int:
        """Run the missing or damaged blocks."""
        store, path = run.store, run.store.folder / KEPT
        wanted = members_kept(self.observed.keep, Folder(store.folder), members)
        group = group_of(store, run.plan, wanted)
        for beside in (*store.folder.glob(f"{KEPT}.*new"), path):
            if beside != path or not len(wanted) or not group.is_there():
                refuse_foreign(beside)
                scratch.remove_folder(beside)
        if not len(wanted):
            return 0
        plan = run.plan.subplan(group.members.tolist(), self.fields)
        content = {key: value for key, value in run.provenance.items() if key != "observed"}
        again = StoredRun(plan, group, content, run.messages)
        return again.run(executor, progress and _after(progress, members, len(group.members))).ran


def group_of(store: Store, plan: Plan, wanted: np.ndarray) -> KeptStore:
    """Build the group of a store for the selected members, by their indices (m,)."""
    beside = plan.with_neighbours(wanted)
    chosen = np.isin(beside, wanted)
    return KeptStore(store.folder / KEPT, store.dtype, None, "resume", store.force, store.chunk_bytes, beside, chosen)


def _after(progress: Callable[[float], None], before: int, more: int) -> Callable[[float], None]:
    """Progress of the whole work, from the progress of `more` members that follow `before` others."""
    return lambda fraction: progress((before + fraction * more) / (before + more))


def members_kept(keep: Any, folder: Folder, members: int | None = None) -> np.ndarray:
    """Indices (m,) of the members whose samples are kept; empty if all members are kept, or none."""
    if isinstance(keep, str) and keep in ("all", "none"):
        return np.empty(0, np.int64)
    status = folder.group()["status"][: folder.members if members is None else members]
    return Observation(keep=keep).again(np.asarray(status))


def keep_of(provenance: Mapping[str, Any]) -> Any:
    """Read the setting `keep` of a run from its provenance."""
    return provenance.get("observed", {}).get("keep", "all")
