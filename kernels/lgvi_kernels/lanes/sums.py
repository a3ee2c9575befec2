# SPDX-License-Identifier: Apache-2.0
"""How a change is added to a state: by a plain sum, or by a compensated one, where each number is a sum v + v_low of two.

Compensated (W. Kahan 1965): the change is added to v_low, v takes the digits of the result that it can hold, and v_low keeps
the rest, exactly. The round-off of a step is then that of its changes, which are small, not that of the state. Only b is
settled once a step, because many sub-maps move it: until then they add to b_low.

Each function here has an overload for each type of state. Sub-maps call the same names for both, so a kernel without
compensation has no trace of it.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes import overloads
from lgvi_kernels.lanes.arithmetic import add, lane, lane3, mul, ones, positive, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.packet import choose_vectors, vectors_at_rest
from lgvi_kernels.lanes.rotations import transpose_apply
from lgvi_kernels.lanes.state import state_struct


@wp.func
def carried(v: Any, low: Any, d: Any):
    """v + low + d as (v, low): exact but for the sum low + d where |low + d| < |v|, else to the round-off of d."""
    # t - v is what v has taken of y. By algebra the rest is 0: the compiler must not reorder these sums (see flags.py).
    y = low + d
    t = v + y
    return t, y - (t - v)


@wp.func
def carried_turn(v: Any, low: Any, F: Any):
    """F^T v with compensation: (v, low)."""
    return carried(v, low, v.x * F.row0 + v.y * F.row1 + v.z * F.row2)


@wp.func
def with_turned(
    x: Any,
    p: Any,
    p_low: Any,
    pi: Any,
    pi_low: Any,
    R0: Any,
    R0_low: Any,
    R1: Any,
    R1_low: Any,
    R2: Any,
    R2_low: Any,
):
    """The state with these p, pi and R."""
    x.p = p
    x.p_low = p_low
    x.pi = pi
    x.pi_low = pi_low
    x.R0 = R0
    x.R0_low = R0_low
    x.R1 = R1
    x.R1_low = R1_low
    x.R2 = R2
    x.R2_low = R2_low
    return x


place = overloads.family("place", "The position that laws see: b, or b + b_low.")
moved = overloads.family("moved", "b <- b + d.")
moved_from = overloads.family("moved_from", "b <- b of `start` + d: two halves of a move are so rounded as one.")
settled = overloads.family("settled", "b takes the digits of b_low that it can hold.")
pushed = overloads.family("pushed", "p <- p + d.")
twisted = overloads.family("twisted", "pi <- pi + d.")
turned = overloads.family("turned", "p <- F^T p, pi <- F^T pi, R <- R F.")
choose = overloads.family(
    "choose", "The state `yes` in the lanes where test > 0, `no` in the others; the alarm is that of `no`."
)
at_rest = overloads.family("at_rest", "The same vehicles at rest at the origin.")


@overloads.for_each_type
def _declare_plain(width, real):
    State, L, L3 = state_struct(width, real), lane(width, real), lane3(width, real)

    @overloads.func
    def place(x: State):
        return x.b

    @overloads.func
    def moved(x: State, d: L3):
        x.b = x.b + d
        return x

    @overloads.func
    def moved_from(x: State, start: State, d: L3):
        x.b = start.b + d
        return x

    @overloads.func
    def pushed(x: State, d: L3):
        x.p = x.p + d
        return x

    @overloads.func
    def twisted(x: State, d: L3):
        x.pi = x.pi + d
        return x

    @overloads.func
    def turned(x: State, F: Any):
        x.p = transpose_apply(F, x.p)
        x.pi = transpose_apply(F, x.pi)
        x.R0 = transpose_apply(F, x.R0)
        x.R1 = transpose_apply(F, x.R1)
        x.R2 = transpose_apply(F, x.R2)
        return x

    @overloads.func
    def choose(test: L, yes: State, no: State):
        return choose_vectors(test, yes, no)

    @overloads.func
    def at_rest(x: State):
        return vectors_at_rest(x)


@overloads.for_each_type
def _declare_compensated(width, real):
    if real != wp.float32:
        return
    State, L, L3 = state_struct(width, real, True), lane(width, real), lane3(width, real)

    @overloads.func
    def place(x: State):
        return x.b + x.b_low

    @overloads.func
    def moved(x: State, d: L3):
        x.b_low = x.b_low + d
        return x

    @overloads.func
    def moved_from(x: State, start: State, d: L3):
        x.b_low = start.b_low + d
        return x

    @overloads.func
    def settled(x: State):
        b = x.b + x.b_low
        x.b_low = x.b_low - (b - x.b)
        x.b = b
        return x

    @overloads.func
    def pushed(x: State, d: L3):
        p, low = carried(x.p, x.p_low, d)
        x.p = p
        x.p_low = low
        return x

    @overloads.func
    def twisted(x: State, d: L3):
        pi, low = carried(x.pi, x.pi_low, d)
        x.pi = pi
        x.pi_low = low
        return x

    @overloads.func
    def turned(x: State, F: Any):
        p, p_low = carried_turn(x.p, x.p_low, F)
        pi, pi_low = carried_turn(x.pi, x.pi_low, F)
        R0, R0_low = carried_turn(x.R0, x.R0_low, F)
        R1, R1_low = carried_turn(x.R1, x.R1_low, F)
        R2, R2_low = carried_turn(x.R2, x.R2_low, F)
        return with_turned(x, p, p_low, pi, pi_low, R0, R0_low, R1, R1_low, R2, R2_low)

    @overloads.func
    def choose(test: L, yes: State, no: State):
        no = choose_vectors(test, yes, no)
        no.R0_low = positive(test, yes.R0_low, no.R0_low)
        no.R1_low = positive(test, yes.R1_low, no.R1_low)
        no.R2_low = positive(test, yes.R2_low, no.R2_low)
        no.b_low = positive(test, yes.b_low, no.b_low)
        no.p_low = positive(test, yes.p_low, no.p_low)
        no.pi_low = positive(test, yes.pi_low, no.pi_low)
        return no

    @overloads.func
    def at_rest(x: State):
        x = vectors_at_rest(x)
        zero = x.b
        x.R0_low = zero
        x.R1_low = zero
        x.R2_low = zero
        x.b_low = zero
        x.p_low = zero
        x.pi_low = zero
        return x
