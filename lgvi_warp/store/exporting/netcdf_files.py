# SPDX-License-Identifier: Apache-2.0
"""NetCDF files that are written, and closed after any error."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# HDF5 gives up what it could not write at the second or third time.
CLOSINGS = 5


@contextlib.contextmanager
def new_netcdf(target: Path) -> Iterator[Any]:
    """Create a NetCDF-4 file. After an error it is also closed, and its content is lost."""
    import netCDF4

    file = netCDF4.Dataset(target, "w")
    try:
        yield file
        file.close()
    except BaseException:
        _abandon(file, target)
        raise


def _abandon(file: Any, target: Path) -> None:
    """Close a file that does not fit on the disk. HDF5 keeps it open until the rest is written, here to nowhere."""
    folder = "/dev/fd"
    for name in os.listdir(folder) if os.path.isdir(folder) else ():
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(int(name)), os.stat(target)):
                nowhere = os.open(os.devnull, os.O_RDWR)
                os.dup2(nowhere, int(name), inheritable=False)
                os.close(nowhere)
    for _ in range(CLOSINGS):
        if file.isopen():
            with contextlib.suppress(OSError, RuntimeError):
                file.close()
