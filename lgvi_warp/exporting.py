"""A run in a store as one NetCDF file or as Parquet, for programs that read those; piece by piece, whatever its size."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.blocks import Block
from lgvi_warp.errors import Faults, SceneError
from lgvi_warp.store import Folder
from lgvi_warp.store_layout import MEMBER
from lgvi_warp.stored import folder_of

if TYPE_CHECKING:
    import zarr

FORMATS = {"netcdf": ".nc", "parquet": ".parquet"}


def export(path: str | os.PathLike[str], to: str, out: str | os.PathLike[str] | None = None) -> Path:
    """Write a complete run as "netcdf" (one NetCDF-4 file) or "parquet" (one file, a row for each member and time).

    path: a store, or a folder with one. out: the file, default beside the store. Returns its path. Raises SceneError,
    or OSError.
    """
    faults = Faults()
    faults.choice("to", to, FORMATS)
    faults.raise_if_any()
    folder = Folder(folder_of(path))
    if not folder.complete:
        raise SceneError([f"{folder.path}: is not complete; go on with `lgvi-warp resume {folder.path.parent}` first"])
    target = Path(out) if out is not None else folder.path.with_suffix(FORMATS[to])
    part = target.with_name(target.name + ".part")
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        {"netcdf": _netcdf, "parquet": _parquet}[to](folder, part)
        part.replace(target)
    except ImportError as error:
        raise SceneError([f"to = {to!r}: {error}; install it: pip install 'lgvi-warp[export]'"]) from error
    finally:
        part.unlink(missing_ok=True)
    return target


def _netcdf(folder: Folder, target: Path) -> None:
    """Every array with its attributes, a block of members at a time."""
    import netCDF4

    group = folder.group()
    arrays = dict(group.arrays())
    with netCDF4.Dataset(target, "w") as file:
        for name, value in group.attrs.asdict().items():
            file.setncattr(name, np.int8(value) if isinstance(value, bool) else value)
        for name, array in arrays.items():
            dims = array.metadata.dimension_names
            shape = [folder.members if dim == MEMBER else size for dim, size in zip(dims, array.shape, strict=True)]
            for dim, size in zip(dims, shape, strict=True):
                if dim not in file.dimensions:
                    file.createDimension(dim, size)
            chunks = [min(c, size) for c, size in zip(array.chunks, shape, strict=True)]
            variable = file.createVariable(name, array.dtype.name, dims, chunksizes=chunks, fill_value=False)
            for key, value in array.attrs.asdict().items():
                variable.setncattr(
                    key, np.asarray(value, array.dtype) if key in ("flag_values", "flag_masks") else value
                )
            for at in _pieces(array, folder.runs):
                variable[at] = array[at]


def _pieces(array: zarr.Array[Any], runs: list[Block]) -> Iterator[tuple[slice, ...]]:
    """Slices that cover an array, a block of members at a time, all of it where it has none."""
    dims = array.metadata.dimension_names
    if "realization" not in dims:
        yield (slice(None),) * array.ndim
        return
    axis = dims.index("realization")
    for run in runs:
        yield (*(slice(None),) * axis, slice(run.first, run.stop), *(slice(None),) * (array.ndim - axis - 1))


def _parquet(folder: Folder, target: Path) -> None:
    """Columns realization, time, each component of the samples, status; a row group a block."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    group = folder.group()
    time = group["time"][:]
    timed = [name for name, array in group.arrays() if array.ndim > 1 and array.metadata.dimension_names[0] == "time"]
    writer = None
    try:
        for run in folder.runs:
            table = pa.table(_rows(group, time, timed, run))
            content = {name: str(group.attrs[name]) for name in ("Conventions", "source", "provenance")}
            table = table.replace_schema_metadata(content)
            writer = writer or pq.ParquetWriter(target, table.schema)
            writer.write_table(table)
    finally:
        if writer is not None:
            writer.close()


def _rows(group: Any, time: np.ndarray, timed: list[str], run: Block) -> dict[str, np.ndarray]:
    """A block's columns, member by member."""
    at = slice(run.first, run.stop)
    columns = {
        "realization": np.repeat(group["realization"][at], len(time)),
        "time": np.tile(time, run.count),
    }
    for name in timed:
        values = np.swapaxes(group[name][:, at], 0, 1).reshape(run.count * len(time), -1)
        size = values.shape[1]
        for i in range(size):
            digits = f"{i // 3}{i % 3}" if size == 9 else f"{i}"
            columns[f"{name}_{digits}"] = np.ascontiguousarray(values[:, i])
    return columns | {"status": np.repeat(group["status"][at], len(time))}
