# SPDX-License-Identifier: Apache-2.0
"""Results that read from a store: opening a run, its statistics and its kept members."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import members_of, path_of
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.sentences import sentences
from lgvi_warp.common.status import Status
from lgvi_warp.common.summaries import as_table, few_digits
from lgvi_warp.common.write_lock import writer_of
from lgvi_warp.control.controller import terms_of
from lgvi_warp.control.signals import IN_FILES
from lgvi_warp.engine.keepers.observation import Observation, Observing, observation_of, replicates_of
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.results.outcomes import remarks_on
from lgvi_warp.results.provenance import at_end
from lgvi_warp.results.result import END_TIME, Result
from lgvi_warp.scene.functions import functions_of, identities
from lgvi_warp.statistics.estimates.estimate import Estimates
from lgvi_warp.store.final import check_parts, end_of, has_end
from lgvi_warp.store.folder import KEPT, ROOT, Folder
from lgvi_warp.store.kept import keep_of, members_kept
from lgvi_warp.store.layout import KEPT_MEMBER, MEMBER, WEIGHT
from lgvi_warp.store.layout_check import corrupt_store_as_scene_error
from lgvi_warp.store.recipe import noted_functions

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Arrays(Mapping[str, np.ndarray]):
    """Arrays of a store by name, read from disk at each access.

    group: zarr group of the store.
    axis: Axis of the members.
    members: Slice with start, stop and step, or indices, of the members to read.
    in_memory: Additional arrays by name, held in memory.
    """

    group: Any
    names: tuple[str, ...]
    axis: int
    members: Any
    in_memory: Mapping[str, np.ndarray] | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        if self.in_memory is not None and name in self.in_memory:
            return self.in_memory[name]
        if name not in self.names:
            raise KeyError(name)
        at = (*(slice(None),) * self.axis, self.members)
        array = self.group[name]
        return np.asarray(array[at] if isinstance(self.members, slice) else array.oindex[at])

    def __repr__(self) -> str:
        """Table of names and shapes; no array is read for it."""
        rows = [(name, f"{' x '.join(map(str, self.group[name].shape))} numbers in the store") for name in self.names]
        return as_table(
            f"{len(self)} arrays",
            [*rows, *((name, few_digits(values)) for name, values in (self.in_memory or {}).items())],
        )

    def rows(self, name: str, when: slice | np.ndarray, places: slice) -> np.ndarray:
        """Read samples of some of these members at some times; only the chunks that contain them are read."""
        few, array = self.part(places), self.group[name]
        return np.asarray(array.oindex[when, few.members])

    def part(self, places: slice | np.ndarray) -> Arrays:
        """Select some of the members of these arrays."""
        if not isinstance(self.members, slice):
            return replace(self, members=self.members[places])
        of_slice = range(self.members.start, self.members.stop, self.members.step)
        if not isinstance(places, slice):
            return replace(self, members=np.asarray(of_slice)[places])
        chosen_range = of_slice[places]
        return replace(self, members=slice(chosen_range.start, chosen_range.stop, chosen_range.step))

    def dataset(self, path: Path) -> xarray.Dataset:
        """Open the whole store as an xarray Dataset."""
        return dataset(path)

    def __contains__(self, name: object) -> bool:
        return name in self.names or name in (self.in_memory or {})

    def __iter__(self) -> Iterator[str]:
        return iter((*self.names, *(self.in_memory or {})))

    def __len__(self) -> int:
        return len(self.names) + len(self.in_memory or {})


def folder_of(path: str | os.PathLike[str]) -> Path:
    """Find the store at a path: the path itself if it ends in .zarr, else the one .zarr in that folder."""
    location = path_of("path", path)
    if location.suffix == ".zarr":
        return location
    stores = sorted(location.glob("*.zarr")) if location.is_dir() else []
    if len(stores) == 1 and stores[0].is_symlink():
        # A folder from elsewhere could otherwise lead to any run of the user.
        raise SceneError([f"{stores[0]} is a link. Name the store that it leads to: {stores[0].resolve()}"])
    if len(stores) == 1:
        return stores[0]
    if stores:
        fault, remedy = f"holds {len(stores)} stores", f"name one: {', '.join(map(str, stores[:5]))}"
    else:
        fault = "is not there" if not location.exists() else "is a file" if location.is_file() else "holds no store"
        remedy = "give the folder of a run made with --store zarr"
    raise SceneError([sentences(location, fault, remedy)])


def open_run(
    path: str | os.PathLike[str],
    members: slice | Sequence[int] | None = None,
    incomplete: bool = False,
    statistics: Sequence[Any] | None = None,
) -> Result:
    """Open a run in a store as a Result that reads samples and parameters when they are used.

    `result.dataset` is the whole run as an xarray Dataset, read chunk by chunk. `result.statistics` and `result.kept`
    exist for all members of a complete run; a result opened with `members` has neither.

    Args:
        path: A store, or a folder with one store.
        members: Members to open: indices from 0, in the order of the result; a slice; or a mask with a truth value for
            each member. By default all members.
        incomplete: Whether to open an unfinished run too. Members that were not run yet read as NaN with status 0.
        statistics: The statistics of the run. Needed if a statistic uses a function, which a store cannot save.

    Returns:
        The result.

    Raises:
        SceneError: If the path holds no run, the run is not complete, or one of its files is missing.
        SceneError: If the run does not have these members (this error is also an IndexError).

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, store="run.zarr")
        >>> lw.open_run("run.zarr", members=slice(2, 4)).position.shape
        (2, 2, 3)
    """
    folder = Folder(folder_of(path))
    messages = folder.messages
    if not folder.complete:
        blocks = len(folder.unfinished())
        missing = f"{blocks} blocks are missing" if blocks else "the members that it keeps have not been run again yet"
        text = f"{folder.path} is not complete: {missing}"
        if not incomplete and (writer := writer_of(folder.path)):
            raise SceneError([f"{text}. It is being written ({writer}): wait for it, or give incomplete=True"])
        if not incomplete:
            raise SceneError([f"{text}. Go on with `lgvi-warp resume {folder.path.parent}`, or give incomplete=True"])
        return result_of(folder, members, (*messages, text))
    if lost := folder.lost():
        more = f", and {len(lost) - 1:,} more" if len(lost) > 1 else ""
        text = f"{folder.path}: {lost[0]} is missing{more}"
        if not incomplete:
            raise SceneError(
                [f"{text}; repair it with `lgvi-warp resume {folder.path.parent}`, or give incomplete=True"]
            )
        return result_of(folder, members, (*messages, text))
    observed_content = folder.provenance.get("observed")
    if members is not None or observed_content is None or (statistics is None and observed_content.get("functions")):
        return result_of(folder, members, messages)
    with corrupt_store_as_scene_error(folder.path / ROOT):
        observed = observation_of(observed_content, statistics)
    now = {"functions": identities(functions_of(None, observed.statistics))}
    noted = noted_functions(folder.provenance, now)
    return result_of(folder, None, (*messages, *noted), observing=gathered(folder, observed))


def gathered(folder: Folder, observed: Observation) -> Observing:
    """Read the statistics of a complete run from the parts of its blocks."""
    replicates = replicates_of(folder.provenance["ensemble"])
    observing = Observing(observed, folder.times(), int(folder.recipe["members"]), replicates)
    block_files = folder.block_files
    for block in folder.runs:
        check_parts(folder, block_files.sums(block), block)
        with corrupt_store_as_scene_error(folder.path / block_files.parts_key(block)):
            for keeper, part in zip(observing.keepers, block_files.parts(block, observing.keepers) or (), strict=True):
                keeper.merge(block, part)
    return observing


def result_of(
    folder: Folder,
    members: Any = None,
    messages: tuple[str, ...] = (),
    terms: Sequence[Term] | None = None,
    observing: Observing | None = None,
) -> Result:
    """Build the Result of a store.

    members: Indices or a slice of the members; None: all.
    observing: Keepers of its statistics, with all blocks merged; None: no statistics.
    """
    folder.refuse_too_large()
    group, time, n = folder.group(), folder.times(), folder.members
    at = _places(members, n)
    arrays = {name: array for name, array in group.arrays()}
    fields = tuple(name for name in arrays if name in IN_FILES)
    varied = tuple(name for name in arrays if "." in name and not name.startswith("start."))
    starts = tuple(name for name in arrays if name.startswith("start."))
    small = Arrays(
        group, tuple(name for name in arrays if name not in (*fields, *varied, *starts, "time", "step")), 0, at
    )
    with corrupt_store_as_scene_error(folder.path / ROOT):
        shared = {name: np.asarray(value, dtype=np.float64) for name, value in folder.shared.items()}
    strange = np.setdiff1d(small["status"], np.array([int(code) for code in Status]))
    if len(strange):
        raise SceneError([f"{folder.path} has the status {strange[0]}, which no member ends with. Run it again"])
    provenance = at_end(folder.provenance, small, n, int(folder.recipe["members"]))
    estimates, remarks = Estimates(), tuple[str, ...]()
    if observing is not None:
        estimates, remarks = observing.read(provenance["ensemble"], small["status"])
    with corrupt_store_as_scene_error(folder.path / ROOT):
        of_scene = tuple(terms_of(provenance["scene"]) if terms is None else terms)
    indices, kept = kept_of(folder, of_scene) if members is None else (np.empty(0, np.int64), None)
    parameters = Arrays(group, varied, 0, at, shared)
    return Result(
        time=time,
        samples=Arrays(group, fields, 1, at),
        **Result.per_member(small),
        parameters=parameters,
        messages=messages + remarks + remarks_on(small),
        provenance=provenance,
        statistics=estimates,
        terms=of_scene,
        kept=kept,
        kept_members=indices,
        store=folder.path,
        end=functools.partial(end_of, folder.path, at, parameters) if has_end(folder) else None,
        starts=Arrays(group, starts, 0, at),
        weights=small.get(WEIGHT),
    )


def kept_of(folder: Folder, terms: Sequence[Term]) -> tuple[np.ndarray, Result | None]:
    """Read the members that a complete run keeps: their indices (m,), and their result, None if there are none."""
    wanted = members_kept(keep_of(folder.provenance), folder) if folder.complete else np.empty(0, np.int64)
    if not len(wanted):
        return wanted, None
    group = folder.kept()
    if group is None:
        raise SceneError([f"{folder.path / KEPT} is missing. `lgvi-warp resume {folder.path}` makes it again"])
    kept = result_of(group, _chosen_places(group.group()), group.messages, terms)
    ensemble = kept.provenance["ensemble"]
    if kept.members != len(wanted):
        count = f"holds {kept.members} members, not {len(wanted)}"
        raise SceneError([f"{group.path}: {count}. `lgvi-warp resume` mends it"])
    with corrupt_store_as_scene_error(folder.path / ROOT):
        places = np.asarray(ensemble.get("indices", range(folder.members)))[wanted]
    return wanted, replace(kept, provenance=kept.provenance | {"ensemble": ensemble | {"indices": places.tolist()}})


def _chosen_places(group: Any) -> np.ndarray | None:
    """Positions of the kept members among the members of the second run; None if all of these are kept."""
    return np.flatnonzero(group["chosen"][:]) if "chosen" in group else None


def _places(members: Any, n: int) -> slice | np.ndarray:
    """Slice or indices of the selected members among n members; all by default."""
    if members is None:
        return slice(0, n, 1)
    indices = members_of("members", members, n)
    # A rising slice reads whole chunks.
    rising = isinstance(members, slice) and (members.step is None or members.step > 0)
    return slice(*members.indices(n)) if rising else indices


def chosen(result: Result, members: Sequence[int]) -> Result:
    """Read some members of a run in a store into memory."""
    selection = result_of(Folder(Path(result.store or "")), members, result.messages, result.terms)
    return replace(selection, samples=dict(selection.samples), parameters=dict(selection.parameters), store=None,
                   starts=dict(selection.starts))  # fmt: skip


def dataset(path: Path) -> xarray.Dataset:
    """Open a store as an xarray Dataset; with dask installed it is divided into the store's chunks."""
    import importlib.util

    import xarray

    chunks: Any = {} if importlib.util.find_spec("dask") else None
    stored = xarray.open_dataset(Folder(path).checked(), engine="zarr", chunks=chunks)
    if KEPT_MEMBER in stored.dims:
        stored = stored.swap_dims({KEPT_MEMBER: MEMBER})
    if "chosen" in stored:
        stored = stored.isel(realization=np.flatnonzero(stored.chosen.values))
    if "failure_time" in stored:
        ends = stored.failure_time.fillna(stored.time[-1]).drop_vars("time", errors="ignore")
        stored = stored.assign(end_time=ends.assign_attrs(END_TIME))
    return stored.isel(realization=slice(0, stored.attrs["members"])) if "members" in stored.attrs else stored
