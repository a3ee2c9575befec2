"""The sum of laws is a law: an absent term is no code, no parameter and no time."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.terms import LAWS


@functools.cache
def superpose(names, width, real):
    """Fold the named laws into one. Returns (law, Params), the parameters nested as `own` and `rest`."""
    if not names:

        @wp.struct
        class NoParams:
            unused: wp.uint8

        @wp.func
        def none(w: Any, view: Any, p: Any):
            return w

        return none, NoParams

    module = LAWS[names[0]]
    law, Own = module.law, module.params(width, real)
    rest_law, Rest = superpose(names[1:], width, real)

    @wp.struct
    class Params:
        own: Own
        rest: Rest

    @wp.func
    def total(w: Any, view: Any, p: Any):
        return law(rest_law(w, view, p.rest), view, p.own)

    return total, Params
