# SPDX-License-Identifier: Apache-2.0
"""Export of a run in a store to one NetCDF or Parquet file, piece by piece, whatever its size."""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.control.signals import SAVED
from lgvi_warp.engine.block import Block
from lgvi_warp.results.result import END_TIME
from lgvi_warp.store.folder import KEPT, Folder
from lgvi_warp.store.layout import KEPT_MEMBER, MEMBER, WEIGHT
from lgvi_warp.store.open import folder_of, open_run
from lgvi_warp.store.state import state

if TYPE_CHECKING:
    import zarr

FORMATS = {"netcdf": ".nc", "parquet": ".parquet"}
MEMBERS = (MEMBER, KEPT_MEMBER)


def export(path: str | os.PathLike[str], to: str, out: str | os.PathLike[str] | None = None) -> Path:
    """Export a complete run to a file of another format.

    "netcdf" writes one NetCDF-4 file; the members that the run keeps are in its group "kept", statistics in its group
    "statistics". "parquet" writes one table with a row for each member and time: of all samples, else of those of the kept
    members, else a row for each member without time.

    Args:
        path: A store, or a folder with one store.
        to: "netcdf" or "parquet".
        out: The file; default beside the store. A file that exists is replaced.

    Returns:
        Path of the file.

    Raises:
        SceneError: If the run is not complete or is damaged, or a library is missing.
        OSError: If the file cannot be written.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, store="run.zarr")
        >>> print(lw.export("run.zarr", to="netcdf"))
        run.nc
    """
    faults = Faults()
    faults.choice("to", to, FORMATS)
    faults.raise_if_any()
    folder = Folder(folder_of(path))
    if not folder.complete:
        raise SceneError([f"{folder.path}: is not complete; go on with `lgvi-warp resume {folder.path.parent}` first"])
    target = Path(out) if out is not None else folder.path.with_suffix(FORMATS[to])
    root = None if out is not None else folder.path.parent
    durable.place_of(target, root)
    check_whole(folder)
    target.parent.mkdir(parents=True, exist_ok=True)
    with fault_of_library(to, target), durable.placed(target, root) as beside:
        {"netcdf": _netcdf, "parquet": _parquet}[to](folder, beside)
    return target


@contextlib.contextmanager
def fault_of_library(to: str, target: Path) -> Iterator[None]:
    """Say of what a library of the format raises which file it is about, and what helps."""
    try:
        yield
    except ImportError as error:
        raise SceneError([f"to = {to!r}: {error}; install it: pip install 'lgvi-warp[export]'"]) from error
    except (OSError, RuntimeError) as error:
        # Neither library names the file, and netCDF4 hides the system's error.
        reason = getattr(error, "strerror", None) or f"was not written ({error}); is the disk full?"
        raise OSError(getattr(error, "errno", None) or errno.EIO, reason, str(target)) from error


def check_whole(folder: Folder) -> None:
    """Check that every file is as it was written: a missing chunk would be exported as NaN."""
    content = state(folder.path)
    if not content["complete"]:
        unfinished = content["blocks"] - content["finished"]
        damage = content["damage"][:5] or [f"{unfinished} blocks are not marked as finished"]
        raise SceneError(f"{folder.path}: {text}; `lgvi-warp resume {folder.path}` mends it" for text in damage)


def _netcdf(folder: Folder, target: Path) -> None:
    """Write the run, and its kept members and statistics in groups of their own."""
    import netCDF4

    with netCDF4.Dataset(target, "w") as file:
        _netcdf_group(folder, file)
        if (kept := folder.kept()) is not None:
            _netcdf_group(kept, file.createGroup(KEPT))
    if statistics := open_run(folder.path).statistics:
        statistics.dataset.to_netcdf(target, mode="a", group="statistics", engine="netcdf4")


def _netcdf_group(folder: Folder, file: Any) -> None:
    """Write every array with its attributes, a block of members at a time."""
    group = folder.group()
    for name, value in group.attrs.asdict().items():
        file.setncattr(name, np.int8(value) if isinstance(value, bool) else value)
    for name, array in dict(group.arrays()).items():
        dims = array.metadata.dimension_names
        shape = [folder.members if dim in MEMBERS else size for dim, size in zip(dims, array.shape, strict=True)]
        for dim, size in zip(dims, shape, strict=True):
            if dim not in file.dimensions:
                file.createDimension(dim, size)
        chunks = [min(c, size) for c, size in zip(array.chunks, shape, strict=True)]
        variable = file.createVariable(name, array.dtype.name, dims, chunksizes=chunks, fill_value=False)
        for key, value in array.attrs.asdict().items():
            variable.setncattr(key, np.asarray(value, array.dtype) if key in ("flag_values", "flag_masks") else value)
        for at in _pieces(array, folder.runs):
            variable[at] = array[at]
        if name == "failure_time":
            _netcdf_end_time(folder, file, variable, group)


def _netcdf_end_time(folder: Folder, file: Any, failures: Any, group: Any) -> None:
    """Write when members ended beside when they failed."""
    ends = file.createVariable("end_time", "f8", failures.dimensions, chunksizes=failures.chunking(), fill_value=False)
    for key, value in END_TIME.items():
        ends.setncattr(key, value)
    for run in folder.runs:
        at = slice(run.first, run.stop)
        ends[at] = _end_time(group["failure_time"][at], group)


def _pieces(array: zarr.Array[Any], runs: list[Block]) -> Iterator[tuple[slice, ...]]:
    """Slices that cover an array, a block of members at a time, or at once if it has no dimension of members."""
    axis = next((i for i, dim in enumerate(array.metadata.dimension_names) if dim in MEMBERS), None)
    if axis is None:
        yield (slice(None),) * array.ndim
        return
    for run in runs:
        yield (*(slice(None),) * axis, slice(run.first, run.stop), *(slice(None),) * (array.ndim - axis - 1))


def _parquet(folder: Folder, target: Path) -> None:
    """Write a row for each member and time that has samples, or for each member if there are none.

    A row group is a block. Columns: realization, time, each component of the samples and of what varies, status,
    failure_time. Units are in the metadata of the columns, and for pandas in its `attrs`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not _timed(folder.group()):
        folder = folder.kept() or folder
    group = folder.group()
    units = {name: str(array.attrs["units"]) for name, array in group.arrays() if "units" in array.attrs}
    writer = None
    try:
        for run in folder.runs:
            rows = _rows(group, run)
            unit_of = {name: units[array] for name, (array, _) in rows.items() if array in units}
            table = pa.table({name: values for name, (_, values) in rows.items()})
            fields = [
                column.with_metadata({"units": unit_of[column.name]}) if column.name in unit_of else column
                for column in table.schema
            ]
            content = {name: str(group.attrs[name]) for name in ("Conventions", "source", "provenance")}
            table = table.cast(pa.schema(fields, content | {"PANDAS_ATTRS": json.dumps({"units": unit_of})}))
            writer = writer or pq.ParquetWriter(target, table.schema)
            writer.write_table(table)
    finally:
        if writer is not None:
            writer.close()


def _timed(group: Any) -> list[str]:
    """Names of the fields with samples."""
    return [name for name in SAVED if name in group]


def _rows(group: Any, run: Block) -> dict[str, tuple[str, np.ndarray]]:
    """A block's columns, member by member: by column name, the name of its array and its numbers."""
    at, timed = np.arange(run.first, run.stop), _timed(group)
    if "chosen" in group:
        at = at[group["chosen"][run.first : run.stop] == 1]
    time = group["time"][:] if timed else np.zeros(1)
    columns = {"realization": ("realization", np.repeat(group["realization"].oindex[at], len(time)))}
    if timed:
        columns["time"] = ("time", np.tile(time, len(at)))
    for name in timed:
        columns |= _components(name, np.swapaxes(group[name].oindex[:, at], 0, 1).reshape(-1, *group[name].shape[2:]))
    for name in (name for name, _ in group.arrays() if "." in name):
        columns |= _components(name, np.repeat(group[name].oindex[at], len(time), axis=0))
    ends = {name: group[name].oindex[at] for name in ("status", "event", "failure_time") if name in group}
    ends |= {WEIGHT: group[WEIGHT].oindex[at]} if WEIGHT in group else {}
    ends["end_time"] = _end_time(ends["failure_time"], group)
    return columns | {name: ("failure_time" if name == "end_time" else name, np.repeat(values, len(time)))
                      for name, values in ends.items()}  # fmt: skip


def _end_time(failure_time: np.ndarray, group: Any) -> np.ndarray:
    """When members ended [s]: at their event, at their failure, or at the end of the run."""
    return np.where(np.isnan(failure_time), group["time"][-1], failure_time)


def _components(name: str, values: np.ndarray) -> dict[str, tuple[str, np.ndarray]]:
    """Split an array of rows (n, ...) into a column for each component: position_0, attitude_12, vehicle.mass."""
    if values.ndim == 1:
        return {name: (name, values)}
    places = itertools.product(*map(range, values.shape[1:]))
    flat = values.reshape(len(values), -1).T
    return {f"{name}_{''.join(map(str, at))}": (name, column.copy()) for at, column in zip(places, flat, strict=True)}
