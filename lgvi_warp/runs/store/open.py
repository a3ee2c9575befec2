"""Runs that lie in a store, read when they are asked for."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.status import Status
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.keepers.observation import Observation, Observing, observation_of, replicates_of
from lgvi_warp.physics.terms import Term, from_list
from lgvi_warp.runs.result import END_TIME, UNITS, Result
from lgvi_warp.runs.store.folder import KEPT, ROOT, Folder
from lgvi_warp.runs.store.kept import keep_of, members_kept
from lgvi_warp.runs.store.layout import KEPT_MEMBER, MEMBER
from lgvi_warp.runs.store.layout_check import understood
from lgvi_warp.runs.store.sink import name_of
from lgvi_warp.statistics.estimate import Estimates

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Arrays(Mapping[str, np.ndarray]):
    """Arrays of a store by name, read anew each time; `whole` ones are in memory. members: which to read, along `axis`."""

    group: Any
    names: tuple[str, ...]
    axis: int
    members: Any = None
    whole: Mapping[str, np.ndarray] | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        if self.whole is not None and name in self.whole:
            return self.whole[name]
        if name not in self.names:
            raise KeyError(name)
        chosen = slice(None) if self.members is None else self.members
        at = (*(slice(None),) * self.axis, chosen)
        array = self.group[name]
        return np.asarray(array[at] if isinstance(chosen, slice) else array.oindex[at])

    def dataset(self, path: Path) -> xarray.Dataset:
        """All of the store as xarray sees it."""
        return dataset(path)

    def __contains__(self, name: object) -> bool:
        return name in self.names or name in (self.whole or {})

    def __iter__(self) -> Iterator[str]:
        return iter((*self.names, *(self.whole or {})))

    def __len__(self) -> int:
        return len(self.names) + len(self.whole or {})


def folder_of(path: str | os.PathLike[str]) -> Path:
    """The store that a path is, or the one .zarr in it. Raises SceneError."""
    given = Path(path)
    if given.suffix == ".zarr":
        return given
    found = sorted(given.glob("*.zarr")) if given.is_dir() else []
    if len(found) == 1 and found[0].is_symlink():
        # A folder from elsewhere would lead to any run of the user's.
        raise SceneError([f"{found[0]}: is a link; name the store that it leads to: {found[0].resolve()}"])
    if len(found) == 1:
        return found[0]
    what = "is not there" if not given.exists() else "is a file" if given.is_file() else "holds no store"
    if found:
        what = f"holds {len(found)} stores"
    remedy = (
        f"name one: {', '.join(map(str, found[:5]))}" if found else "give the folder of a run made with --store zarr"
    )
    raise SceneError([f"{given}: {what}; {remedy}"])


def open_run(
    path: str | os.PathLike[str],
    members: slice | Sequence[int] | None = None,
    incomplete: bool = False,
    statistics: Sequence[Any] | None = None,
) -> Result:
    """A run in a store, or in a folder with one store: a Result whose samples and parameters are read when asked for.

    members: only these, (m,) indices or a slice. `result.dataset` is a view of all of it by xarray, read piece by piece.
    incomplete: also a run that has not ended; what its blocks have not reached reads as NaN and status 0.
    result.statistics and result.kept are those of a complete run's members, all of them; statistics: the run's own, needed
    for those of functions, which a store does not hold. Raises SceneError where there is no run, or it is not complete,
    IndexError for members that it has not.
    """
    folder = Folder(folder_of(path))
    messages = folder.messages
    if not folder.complete:
        left = len(folder.unfinished())
        missing = f"{left} blocks are missing" if left else "the members that it keeps have not been run again yet"
        text = f"{folder.path}: is not complete: {missing}"
        if not incomplete:
            raise SceneError([f"{text}; go on with `lgvi-warp resume {folder.path.parent}`, or give incomplete=True"])
        return result_of(folder, members, (*messages, text))
    told = folder.provenance.get("observed")
    if members is not None or told is None or (statistics is None and told.get("functions")):
        return result_of(folder, members, messages)
    with understood(folder.path / ROOT):
        observed = observation_of(told, statistics)
    return result_of(folder, None, messages, observing=gathered(folder, observed))


def times_of(folder: Folder) -> np.ndarray:
    """(k,) [s], of the samples. Raises SceneError where they are lost."""
    try:
        time = np.asarray(folder.group()["time"][:])
        if np.isfinite(time).all():
            return time
    except (ValueError, KeyError):
        pass
    remedy = "run the same scene again with --store zarr --resume, which mends it"
    raise SceneError([f"{folder.path}: {'; '.join(folder.damage()) or 'times are lost'}; {remedy}"])


def gathered(folder: Folder, observed: Observation) -> Observing:
    """The statistics of a complete run, from the parts of its blocks."""
    replicates = replicates_of(folder.provenance["ensemble"])
    observing = Observing(observed, times_of(folder), int(folder.recipe["members"]), replicates)
    sink = folder.sink
    for block in folder.runs:
        _check_parts(folder, sink.sums(block), block)
        with understood(folder.path / sink.parts_key(block)):
            for keeper, part in zip(observing.keepers, sink.parts(block, observing.keepers) or (), strict=True):
                keeper.merge(block, part)
    return observing


def _check_parts(folder: Folder, sums: Mapping[str, Sequence[int]] | None, block: Block) -> None:
    """A block's parts must be those that were written. Raises SceneError."""
    key = folder.sink.parts_key(block)
    if sums is None:
        found = [f"blocks/{name_of(block)}.json is missing or damaged"]
    elif key not in sums and not folder.recipe["keepers"]:
        found = []
    elif key not in sums:
        found = [f"{key} is not in the marker of its block"]
    else:
        found = [f"{key} {text}" for text in [durable.fault(folder.path, key, *sums[key])] if text]
    if found:
        raise SceneError(f"{folder.path}: {text}; `lgvi-warp resume {folder.path}` mends it" for text in found)


def result_of(
    folder: Folder,
    members: Any = None,
    messages: tuple[str, ...] = (),
    terms: Sequence[Term] | None = None,
    observing: Observing | None = None,
) -> Result:
    """The Result of a folder; terms: those of the scene, where its file does not tell them; observing: its statistics."""
    folder.refuse_too_large()
    group, time = folder.group(), times_of(folder)
    n, whole = folder.members, int(folder.recipe["members"])
    at = _places(members, n)
    arrays = {name: array for name, array in group.arrays()}
    fields = tuple(name for name in arrays if name in UNITS)
    varied = tuple(name for name in arrays if "." in name)
    small = Arrays(group, tuple(name for name in arrays if name not in (*fields, *varied, "time", "step")), 0, at)
    with understood(folder.path / ROOT):
        shared = {name: np.asarray(value, dtype=np.float64) for name, value in folder.shared.items()}
    strange = np.setdiff1d(small["status"], np.array([int(one) for one in Status]))
    if len(strange):
        raise SceneError([f"{folder.path}: has the status {strange[0]}, which no member ends with; run it again"])
    provenance = dict(folder.provenance)
    for name in ("steps_made", "steps_tried"):
        if name in arrays:
            provenance[name] = float(small[name].mean())
    if n < whole:
        provenance["members"] = n
    estimates, said = Estimates(), tuple[str, ...]()
    if observing is not None:
        estimates, said = observing.read(provenance["ensemble"], small["status"])
    with understood(folder.path / ROOT):
        of_scene = tuple(from_list(provenance["scene"].get("terms", ())) if terms is None else terms)
    indices, kept = kept_of(folder, of_scene) if members is None else (np.empty(0, np.int64), None)
    return Result(
        time=time,
        samples=Arrays(group, fields, 1, at),
        **Result.per_member(small),
        parameters=Arrays(group, varied, 0, at, shared),
        messages=messages + said,
        provenance=provenance,
        statistics=estimates,
        terms=of_scene,
        kept=kept,
        kept_members=indices,
        store=folder.path,
    )


def kept_of(folder: Folder, terms: Sequence[Term]) -> tuple[np.ndarray, Result | None]:
    """(indices, samples) of the members that a complete run keeps after all. Raises SceneError where they are lost."""
    wanted = members_kept(keep_of(folder.provenance), folder) if folder.complete else np.empty(0, np.int64)
    if not len(wanted):
        return wanted, None
    group = folder.kept()
    if group is None:
        raise SceneError([f"{folder.path / KEPT}: is missing; `lgvi-warp resume {folder.path}` makes it again"])
    found = result_of(group, _chosen_places(group.group()), group.messages, terms)
    ensemble = found.provenance["ensemble"]
    if found.members != len(wanted):
        raise SceneError(
            [f"{group.path}: holds {found.members} members, not {len(wanted)}; `lgvi-warp resume` mends it"]
        )
    with understood(folder.path / ROOT):
        places = np.asarray(ensemble.get("indices", range(folder.members)))[wanted]
    return wanted, replace(found, provenance=found.provenance | {"ensemble": ensemble | {"indices": places.tolist()}})


def _chosen_places(group: Any) -> np.ndarray | None:
    """Places of the kept members among those that were run with them; None where these are all."""
    return np.flatnonzero(group["chosen"][:]) if "chosen" in group else None


def _places(members: Any, n: int) -> slice | np.ndarray:
    """Which of n members are meant, all by default. Raises IndexError."""
    if members is None or isinstance(members, slice):
        return slice(*(members or slice(None)).indices(n))
    found = np.asarray(members, dtype=int)
    if len(found) and (found.min() < 0 or found.max() >= n):
        raise IndexError(f"members {found.min()} to {found.max()} of {n}")
    return found


def chosen(result: Result, members: Sequence[int]) -> Result:
    """Some members of a run in a store, in memory."""
    part = result_of(Folder(Path(result.store or "")), members, result.messages, result.terms)
    return replace(part, samples=dict(part.samples), parameters=dict(part.parameters), store=None)


def dataset(path: Path) -> xarray.Dataset:
    """A store as xarray sees it, in pieces of its chunks if dask is there."""
    import importlib.util

    import xarray

    chunks: Any = {} if importlib.util.find_spec("dask") else None
    whole = xarray.open_dataset(Folder(path).checked(), engine="zarr", chunks=chunks)
    if KEPT_MEMBER in whole.dims:
        whole = whole.swap_dims({KEPT_MEMBER: MEMBER})
    if "chosen" in whole:
        whole = whole.isel(realization=np.flatnonzero(whole.chosen.values))
    if "failure_time" in whole:
        ends = whole.failure_time.fillna(whole.time[-1]).drop_vars("time", errors="ignore")
        whole = whole.assign(end_time=ends.assign_attrs(END_TIME))
    return whole.isel(realization=slice(0, whole.attrs["members"])) if "members" in whole.attrs else whole
