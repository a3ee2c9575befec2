# SPDX-License-Identifier: Apache-2.0
"""Data sets: files in NetCDF, opened so that only what is asked for is read."""

from __future__ import annotations

import importlib.util
import os
import stat
from typing import Any

from lgvi_warp.common.arguments import path_of
from lgvi_warp.common.errors import MissingExtra, SceneError, refusal

# What reads NetCDF, the first that is installed. Others that xarray may find are not asked: a stranger's file decides nothing.
ENGINES = {"netcdf4": "netCDF4", "h5netcdf": "h5py"}
REMEDY = "give the path of a NetCDF file, or an xarray Dataset"


def xarray() -> Any:
    """The library, imported when it is needed."""
    try:
        import xarray
    except ImportError as error:
        raise MissingExtra("data sets of the ocean", "xarray", "ocean") from error
    return xarray


def opened(source: Any, key: str = "file") -> Any:
    """An xarray Dataset: the one that is given, or that of a NetCDF file, of which nothing but coordinates is read yet."""
    library = xarray()
    if isinstance(source, library.Dataset):
        return source
    if isinstance(source, library.DataArray):
        raise refusal(key, type(source).__name__, "is one variable", "give the Dataset that has it")
    path = regular_file(source, key)
    engine = next((name for name, module in ENGINES.items() if importlib.util.find_spec(module)), None)
    if engine is None:
        raise MissingExtra("NetCDF files", "netCDF4", "ocean")
    try:
        return library.open_dataset(path, engine=engine, cache=False)
    except Exception as error:  # whatever the library makes of a damaged file
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise SceneError([f"{key} = {path}: is damaged, or no NetCDF file: {reason}; {REMEDY}"]) from error


def regular_file(source: Any, key: str) -> str:
    """The path of a regular file, absolute, so that no library takes it for the address of another machine."""
    path = os.path.abspath(path_of(key, source))
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:
        raise refusal(key, os.fspath(source), str(getattr(error, "strerror", None) or error), REMEDY) from None
    if not stat.S_ISREG(mode):
        raise refusal(key, os.fspath(source), "is no regular file", REMEDY)
    return path
