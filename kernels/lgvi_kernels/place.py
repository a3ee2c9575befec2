"""Where a packet is: b, or with compensated sums b + low, in twice the digits of float32.

There a step's drifts add to `low`, which is small, so that their round-off is that of the step's own length. At its end
`settled` moves to b what b can hold, and keeps in `low` exactly what it cannot. Functions of the state's type: a kernel
without compensation has no trace of it.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes import REALS, WIDTHS, add, lane, lane3, ones, positive, sub, vec3  # noqa: F401
from lgvi_kernels.state import state_struct


@wp.func
def zeros(v: Any):
    """0 in every lane."""
    zero = ones(v.x) - ones(v.x)
    return vec3(zero, zero, zero)


for _width in WIDTHS:
    for _real in REALS:
        _State, _L, _L3 = state_struct(_width, _real), lane(_width, _real), lane3(_width, _real)

        @wp.func
        def place(x: _State):
            """b as laws see it."""
            return x.b

        @wp.func
        def moved(x: _State, d: _L3):
            """b <- b + d."""
            x.b = x.b + d
            return x

        @wp.func
        def moved_from(x: _State, start: _State, d: _L3):
            """b <- b of `start` + d."""
            x.b = start.b + d
            return x

        @wp.func
        def choose_place(test: _L, yes: _State, no: _State):
            """`no` at the place of `yes` in the lanes where test > 0."""
            no.b = positive(test, yes.b, no.b)
            return no

        @wp.func
        def at_origin(x: _State):
            """b <- 0."""
            x.b = zeros(x.b)
            return x

    _Compensated = state_struct(_width, wp.float32, True)
    _L, _L3 = lane(_width, wp.float32), lane3(_width, wp.float32)

    @wp.func
    def place(x: _Compensated):
        return x.b + x.low

    @wp.func
    def moved(x: _Compensated, d: _L3):
        x.low = x.low + d
        return x

    @wp.func
    def moved_from(x: _Compensated, start: _Compensated, d: _L3):
        x.low = start.low + d
        return x

    @wp.func
    def choose_place(test: _L, yes: _Compensated, no: _Compensated):
        no.b = positive(test, yes.b, no.b)
        no.low = positive(test, yes.low, no.low)
        return no

    @wp.func
    def at_origin(x: _Compensated):
        x.b = zeros(x.b)
        x.low = x.b
        return x

    @wp.func
    def settled(x: _Compensated):
        """b <- b + low rounded, low <- what was rounded off: exact where |low| < |b|, else to the round-off of low."""
        b = x.b + x.low
        x.low = x.low - (b - x.b)
        x.b = b
        return x
