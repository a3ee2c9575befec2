# SPDX-License-Identifier: Apache-2.0
"""Data sets: NetCDF files, opened so that only requested data are read, and no other file."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Iterator, Mapping
from typing import Any, BinaryIO

import numpy as np

from lgvi_warp.common import reading
from lgvi_warp.common.arguments import path_of
from lgvi_warp.common.errors import MissingExtra, SceneError, brief, closest, refusal
from lgvi_warp.common.sentences import capital
from lgvi_warp.extensions.ocean.closed_files import leads_elsewhere

# What reads a file, by how it begins: a stranger's file decides nothing else. HDF5 is read from the file that was looked at.
HDF5, CLASSIC = b"\x89HDF\r\n\x1a\n", (b"CDF\1", b"CDF\2", b"CDF\5")
# Where names of open files are.
FOLDER = "/dev/fd"
SCALES = ("scale_factor", "add_offset")
REMEDY = "give the path of a NetCDF file, or an xarray Dataset"


def xarray() -> Any:
    """The library xarray, imported when it is needed."""
    try:
        import xarray
    except ImportError as error:
        raise MissingExtra("data sets of the ocean", "xarray", "ocean") from error
    return xarray


@contextlib.contextmanager
def data_set(source: Any, attributes: Mapping[str, Any] | None = None) -> Iterator[Any]:
    """An xarray Dataset as `opened` returns it; the Dataset of a file is closed at the end."""
    ds = opened(source, attributes)
    try:
        yield ds
    except OSError as error:  # of what is read when it is needed
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise SceneError([f"file = {brief(os.fspath(source))} is damaged: {reason}. {capital(REMEDY)}"]) from error
    finally:
        if not isinstance(source, xarray().Dataset):
            ds.close()


def opened(source: Any, attributes: Mapping[str, Any] | None = None) -> Any:
    """An xarray Dataset: the given one, or that of a NetCDF file, of which only coordinates are read.

    attributes: Missing or wrong attributes, by "variable.attribute", or by "attribute" for an attribute of the file.
    """
    library = xarray()
    if isinstance(source, library.Dataset):
        return decoded(source, attributes) if attributes else source
    if isinstance(source, library.DataArray):
        raise refusal("file", type(source).__name__, "is one variable", "give the Dataset that has it")
    with contextlib.ExitStack() as stack:
        path, file = stack.enter_context(regular_file(source, "file"))
        try:
            begin = file.read(8)
            file.seek(0)
            if begin == HDF5:
                _check_closed(file, path)
                whole = library.open_dataset(file, engine="h5netcdf", cache=False, decode_cf=False, phony_dims="access")
            elif begin.startswith(CLASSIC):
                # The name of the open file: what is looked at is what is read, whatever becomes of the path.
                held = next((name for name in (f"{FOLDER}/{file.fileno()}",) if os.path.exists(name)), path)
                _check_whole(held, os.fstat(file.fileno()).st_size)
                whole = library.open_dataset(held, engine="netcdf4", cache=False, decode_cf=False)
            else:
                raise ValueError("it begins as none")
            stack.callback(whole.close)
            ds = decoded(whole, attributes)
            ds.set_close(stack.pop_all().close)
            return ds
        except (SceneError, MissingExtra):
            raise
        except Exception as error:  # whatever the library makes of a damaged file
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            raise SceneError([f"file = {path} is damaged, or no NetCDF file: {reason}. {capital(REMEDY)}"]) from error


def decoded(ds: Any, attributes: Mapping[str, Any] | None = None) -> Any:
    """The data set with attributes, decoded by the CF conventions, without variables that cannot be decoded.

    The reasons are in its `encoding["damaged"]`.
    """
    library, ds = xarray(), ds.copy()
    for key, value in (attributes or {}).items():
        name, _, attribute = key.rpartition(".")
        if name and name not in ds.variables:
            raise refusal("attributes", key, "names no variable of the data set", closest(name, map(str, ds.variables)))
        (ds[name].attrs if name else ds.attrs)[attribute] = value
    # The library finds that one is a text when values are read.
    damaged = {str(name): f"its {key} is no number" for name in ds.variables for key in SCALES
               if key in ds[name].attrs and np.asarray(ds[name].attrs[key]).dtype.kind not in "fiu"}  # fmt: skip
    ds = ds.drop_vars(damaged)
    with warnings.catch_warnings():
        # Of dates with a year of one digit, and of fill values that a variable cannot hold.
        warnings.simplefilter("ignore", library.SerializationWarning)
        try:
            result = library.decode_cf(ds, decode_timedelta=False)
        except Exception:  # of any one variable: attributes are a stranger's
            for name in ds.variables:
                try:
                    library.decode_cf(
                        library.Dataset({"one": ds[name].variable.to_base_variable()}), decode_timedelta=False
                    )
                except Exception as error:
                    damaged[str(name)] = " ".join(str(error).split())[:200] or type(error).__name__
            result = library.decode_cf(ds.drop_vars(damaged, errors="ignore"), decode_timedelta=False)
    result.encoding["damaged"] = damaged
    return result


def _check_closed(file: BinaryIO, path: str) -> None:
    """Refuse an HDF5 file that is not self-contained."""
    try:
        import h5py
    except ImportError as error:
        raise MissingExtra("NetCDF files", "h5py", "ocean") from error
    with h5py.File(file, "r") as content:
        problem = leads_elsewhere(content)
    if problem:
        raise refusal("file", path, problem, "give a file that holds all its numbers, packed by filters of HDF5 itself")


def _check_whole(path: str, size: int) -> None:
    """Refuse a file in a classic format that declares more numbers than it has bytes: these formats do not compress."""
    try:
        import netCDF4
    except ImportError as error:
        raise MissingExtra("NetCDF files", "netCDF4", "ocean") from error
    with netCDF4.Dataset(path) as content:
        if any(float(one.size) * one.dtype.itemsize > size for one in content.variables.values()):
            raise ValueError("it is shorter than it says")


@contextlib.contextmanager
def regular_file(source: Any, key: str) -> Iterator[tuple[str, BinaryIO]]:
    """The absolute path of a regular file, and the open file, so that libraries read the same file that was checked."""
    path = os.path.abspath(path_of(key, source))
    with contextlib.ExitStack() as stack:
        try:
            file = stack.enter_context(reading.opened(path, "data set"))
        except reading.UnreadableError as error:
            raise refusal(key, os.fspath(source), f"{error.what}: it is not a regular file", REMEDY) from None
        except (OSError, ValueError) as error:
            raise refusal(key, os.fspath(source), str(getattr(error, "strerror", None) or error), REMEDY) from None
        yield path, file
