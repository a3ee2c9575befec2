"""Members whose samples are wanted after all: run again when the run has ended, into the group `kept` of its store.

    run.zarr/kept/member/c.0      which members of the run they are
    run.zarr/kept/position/...    chunks, markers and checksums like those of the run itself

The group is written by what writes a run: in blocks, each marked when all of it is safe.
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
from lgvi_warp.runs.store.arrays import whole_array
from lgvi_warp.runs.store.folder import KEPT, Folder, refuse_foreign
from lgvi_warp.runs.store.layout import KEPT_MEMBER
from lgvi_warp.runs.store.run import Stored
from lgvi_warp.runs.store.settings import Store

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
    """The group of a store for kept members.

    members: (m,) indices of those that it holds; chosen: (m,), which are kept, where others must run beside them.
    """

    members: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64), compare=False)
    chosen: np.ndarray = field(default_factory=lambda: np.empty(0, bool), compare=False)

    @property
    def along(self) -> str:
        """Its own: xarray wants a group's dimensions as long as those of the group it lies in."""
        return KEPT_MEMBER

    @property
    def whole(self) -> Path:
        """The run that it is a group of."""
        return self.folder.parent

    def write_given(self, group: Any, plan: Plan) -> None:
        """Which members they are; what they were given as arrays is in the run's own group."""
        whole_array(group, KEPT_MEMBER, self.members, (KEPT_MEMBER,), MEMBERS)
        if not self.chosen.all():
            whole_array(group, "chosen", self.chosen.astype(np.uint8), (KEPT_MEMBER,), CHOSEN)

    def is_there(self) -> bool:
        """Whether the folder holds the group, of these members; one that cannot be read does not."""
        try:
            return np.array_equal(Folder(self.folder, self.whole).group()[KEPT_MEMBER][:], self.members)
        except (SceneError, OSError, ValueError, KeyError):
            return False


@dataclass(frozen=True)
class KeptRun:
    """What a stored run does before it is complete: it runs again the members that are kept; fields: of their samples."""

    observed: Observation
    fields: tuple[str, ...]

    def __call__(
        self, run: Stored, members: int, executor: Executor, progress: Callable[[float], None] | None = None
    ) -> int:
        """Write what is missing or damaged of those among the first `members`. Returns blocks run. Raises as the run does."""
        store, path = run.store, run.store.folder / KEPT
        wanted = members_kept(self.observed.keep, Folder(store.folder), members)
        group = group_of(store, run.plan, wanted)
        for beside in (*store.folder.glob(f"{KEPT}.*new"), path):
            if beside != path or not len(wanted) or not group.is_there():
                refuse_foreign(beside)
                scratch.remove_folder(beside)
        if not len(wanted):
            return 0
        plan = run.plan.part(group.members.tolist(), self.fields)
        told = {key: value for key, value in run.provenance.items() if key != "observed"}
        again = Stored(plan, group, told | {"kernel": plan.kernel_hash}, run.messages)
        return again.run(executor, progress and _after(progress, members, len(group.members))).ran


def group_of(store: Store, plan: Plan, wanted: np.ndarray) -> KeptStore:
    """The group of a store for these members of its run; resumed where it is there."""
    beside = plan.with_neighbours(wanted)
    chosen = np.isin(beside, wanted)
    return KeptStore(store.folder / KEPT, store.dtype, None, "resume", store.force, store.chunk_bytes, beside, chosen)


def _after(progress: Callable[[float], None], before: int, more: int) -> Callable[[float], None]:
    """Progress of the whole from that of `more` members after those before."""
    return lambda part: progress((before + part * more) / (before + more))


def members_kept(keep: Any, folder: Folder, members: int | None = None) -> np.ndarray:
    """(m,), indices of the members, of the first so many, whose samples are kept after all. keep: as of solve."""
    if isinstance(keep, str) and keep in ("all", "none"):
        return np.empty(0, np.int64)
    status = folder.group()["status"][: folder.members if members is None else members]
    return Observation(keep=keep).again(np.asarray(status))


def keep_of(provenance: Mapping[str, Any]) -> Any:
    """Which samples a run keeps, as its provenance tells."""
    return provenance.get("observed", {}).get("keep", "all")
