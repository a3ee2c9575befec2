# SPDX-License-Identifier: Apache-2.0
"""A whole store as one NetCDF file: its arrays unchanged, kept members and statistics in separate groups."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.engine.block import Block
from lgvi_warp.results.result import END_TIME
from lgvi_warp.store.exporting.netcdf_files import new_netcdf
from lgvi_warp.store.exporting.tracks import Report
from lgvi_warp.store.folder import KEPT, Folder
from lgvi_warp.store.layout import KEPT_MEMBER, MEMBER
from lgvi_warp.store.open import open_run

if TYPE_CHECKING:
    import zarr

MEMBERS = (MEMBER, KEPT_MEMBER)


def netcdf(folder: Folder, target: Path, report: Report) -> None:
    """Write the run, and its kept members and statistics in separate groups."""
    with new_netcdf(target) as file:
        _group(folder, file, report)
        if (kept := folder.kept()) is not None:
            _group(kept, file.createGroup(KEPT), report)
        if statistics := open_run(folder.path).statistics:
            from xarray.backends import NetCDF4DataStore

            statistics.dataset.dump_to_store(NetCDF4DataStore(file.createGroup("statistics")))


def _group(folder: Folder, file: Any, report: Report) -> None:
    """Write every array with its attributes, a block of members at a time."""
    group = folder.group()
    for name, value in group.attrs.asdict().items():
        file.setncattr(name, np.int8(value) if isinstance(value, bool) else value)
    arrays = dict(group.arrays())
    for done, (name, array) in enumerate(arrays.items()):
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
            _end_time(folder, file, variable, group)
        report((done + 1) / len(arrays))


def _end_time(folder: Folder, file: Any, failures: Any, group: Any) -> None:
    """Write the end times of members with those of failures: an event, a failure, or the end of the run."""
    ends = file.createVariable("end_time", "f8", failures.dimensions, chunksizes=failures.chunking(), fill_value=False)
    for key, value in END_TIME.items():
        ends.setncattr(key, value)
    for run in folder.runs:
        at = slice(run.first, run.stop)
        failure_time = group["failure_time"][at]
        ends[at] = np.where(np.isnan(failure_time), group["time"][-1], failure_time)


def _pieces(array: zarr.Array[Any], runs: list[Block]) -> Iterator[tuple[slice, ...]]:
    """Slices that cover an array, one block of members at a time; a single slice if it has no dimension of members."""
    axis = next((i for i, dim in enumerate(array.metadata.dimension_names) if dim in MEMBERS), None)
    if axis is None:
        yield (slice(None),) * array.ndim
        return
    for run in runs:
        yield (*(slice(None),) * axis, slice(run.first, run.stop), *(slice(None),) * (array.ndim - axis - 1))
