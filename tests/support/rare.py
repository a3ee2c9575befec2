# SPDX-License-Identifier: Apache-2.0
"""Searches for rare events of standard normals and of walks, with what `lw.rare_event` takes by default."""

import inspect

import lgvi_warp as lw
from lgvi_warp.uncertainty.rare.search import RareSearch
from lgvi_warp.uncertainty.rare.split_search import SplitSearch

_DEFAULTS = {
    name: inspect.signature(lw.rare_event).parameters[name].default for name in ("relative_error", "seed", "most")
}


def searched(limit, d, **more):
    """Answer of a search for the event that a limit (n, d) -> (n,) or (k, n) is above 0."""
    return RareSearch(limit, d, **_DEFAULTS | more).answer()


def split(walk, **more):
    """Answer of splitting for the event of a walk."""
    return SplitSearch(walk, **_DEFAULTS | more).answer()
