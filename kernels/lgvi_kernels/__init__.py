"""Device code of lgvi_warp: Warp functions and kernels, written for packets of vehicles."""

import functools
from importlib import import_module
from importlib.util import find_spec


@functools.cache
def built_in(folder, name):
    """The device code of a name in a folder ("laws", "stops"), imported when it is asked for first; None for no such name."""
    path = f"{__name__}.{folder}.{name}"
    return import_module(path) if name.isidentifier() and find_spec(path) else None
