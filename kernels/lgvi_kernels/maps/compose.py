"""The sum of laws is a law: an absent term is no code, no parameter and no time."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.state import struct


def plays(law, role):
    """The function of a law's module for this role, or None.

    A role is the name of a function: "law", "damping", "flow", "evolve", "distance". "potential" and "force" are those of
    "law" that follow from a potential, and those that do not.
    """
    if role in ("potential", "force"):
        wanted = getattr(law, "POTENTIAL", False) == (role == "potential")
        return getattr(law, "law", None) if wanted else None
    return getattr(law, role, None)


@functools.cache
def params_of(laws, width, real):
    """The parameters of several laws, nested: `own`, those of the first law, and `rest`, the same struct of the others.

    The functions of superpose nest alike: each hands `rest` on and reads `own`, without a name for each law.
    """
    if not laws:
        return struct("NoParams", unused=wp.uint8)
    return struct("Params", own=laws[0].params(width, real), rest=params_of(laws[1:], width, real))


@functools.cache
def superpose(laws, role):
    """Fold the functions of this role into one, (sum, view, params) -> sum. None if no law has it.

    The last law is added first; this order is part of the bits of a result.
    """
    if not any(plays(law, role) for law in laws):
        return None
    function, rest = plays(laws[0], role), superpose(laws[1:], role)
    if function is None:

        @wp.func
        def others(w: Any, view: Any, p: Any):
            return rest(w, view, p.rest)

        return others
    if rest is None:

        @wp.func
        def alone(w: Any, view: Any, p: Any):
            return function(w, view, p.own)

        return alone

    @wp.func
    def total(w: Any, view: Any, p: Any):
        return function(rest(w, view, p.rest), view, p.own)

    return total
