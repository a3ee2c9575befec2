# SPDX-License-Identifier: Apache-2.0
"""Runge-Kutta methods on (b, R, p, pi), and on the rotation group: fixed steps, or steps chosen for a tolerance.

k_i = f(t + c_i h, y_i), where y_i comes from y by h a_i1 k_1, h a_i2 k_2, ... and the new state by h b_1 k_1, h b_2 k_2, ...
A move adds: two rows of R are six numbers like the others, which leave the group at the order of the method, and the third
is their cross product. Or it turns: R <- R exp(h a Om), one after the other (Crouch & Grossman 1993). Zero coefficients make
no code; the stages are unrolled. What laws remember is advanced from stage to stage, exactly.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, copy_rows, cross, mul, ones, sub  # noqa: F401
from lgvi_kernels.lanes.matrix3 import factor_struct
from lgvi_kernels.lanes.rotations import rotation_struct
from lgvi_kernels.lanes.state import damping_struct, struct, view_struct, wrench_struct
from lgvi_kernels.laws.drag import make_resistance
from lgvi_kernels.maps.accounting import make_power_at, spend, with_power
from lgvi_kernels.maps.carried import make_carried, make_carried_rates, make_departing, make_ride
from lgvi_kernels.maps.compose import ANEW, plays, superpose
from lgvi_kernels.maps.dissipation import make_implicit
from lgvi_kernels.maps.linearly_implicit import make_damped, make_damped_stages, make_factor
from lgvi_kernels.maps.munthe_kaas import make_act, make_munthe_kaas, make_turned
from lgvi_kernels.maps.rates import make_rates, rates_struct
from lgvi_kernels.maps.step_control import make_adaptive, make_errors
from lgvi_kernels.maps.submaps import look


class Explicit(NamedTuple):
    """All that decides the code of a Runge-Kutta method: a tableau, whose row i of `a` has i numbers, and how it is used.

    kind: "vector" (R as two of its rows), "inertial" (the same, and forces never change in inertial axes, so that R p is
    known for all times: it is kept in place of p), "group" (R turns by exponentials) or "munthe_kaas" (order 4 with its
    commutators).
    errors: rows of error estimates, (stages,) or one longer with f of the new state at its end, which go as h to the power
    `estimate`. adaptive: each packet chooses its steps.
    implicit: rows of the matrix g of a linearly implicit method (see maps/linearly_implicit.py), or none.
    early: the part of a step by which stages at its end are early, where a law jumps at whole steps and they come before.
    """

    kind: str
    a: tuple
    b: tuple
    c: tuple
    errors: tuple = ()
    estimate: int = 0
    adaptive: bool = False
    implicit: tuple = ()
    early: float = 0.0

    @property
    def goes_back(self):
        """Whether a stage may come before the last one in time: what laws remember at the step's start is then kept."""
        return self.adaptive or any(later < before for before, later in zip(self.c, self.c[1:]))


@functools.cache
def slopes_struct(Rates, count):
    """k_1 to k_count, as k0, k1, ..."""
    return struct("Slopes", **{f"k{i}": Rates for i in range(count)})


@wp.func
def along(x: Any, k: Any, s: Any):
    """x + s k; the middle row of R is left behind (see `completed`)."""
    x.b = x.b + s * k.b
    x.R0 = x.R0 + s * k.R0
    x.R2 = x.R2 + s * k.R2
    x.p = x.p + s * k.p
    x.pi = x.pi + s * k.pi
    return x


@wp.func
def along_known(x: Any, k: Any, s: Any):
    """The same without p, where P is known for all times."""
    x.b = x.b + s * k.b
    x.R0 = x.R0 + s * k.R0
    x.R2 = x.R2 + s * k.R2
    x.pi = x.pi + s * k.pi
    return x


@wp.func
def completed(x: Any):
    """The middle row of R from the others. docs/theory/runge_kutta.md, (K4)."""
    x.R1 = cross(x.R2, x.R0)
    return x


# The two functions that follow are written out for MOST_STAGES stages: a loop or a recursion over them would copy all the
# slopes for each, which the compiler removes again, in three times as long.
MOST_STAGES = 13


def make_moves(move, weights, complete):
    """One function (y, slopes, h): the moves by h w_1 k_1, then h w_2 k_2, ... of all weights that are not zero.

    docs/theory/runge_kutta.md, (K12).

    complete: the function that completes a moved state, or None (see `completed`).
    """
    w = weights + (0.0,) * (MOST_STAGES - len(weights))

    @wp.func
    def moves(y: Any, k: Any, h: Any):
        if wp.static(w[0] != 0.0):
            y = move(y, k.k0, h.dtype(wp.static(w[0])) * h)
        if wp.static(w[1] != 0.0):
            y = move(y, k.k1, h.dtype(wp.static(w[1])) * h)
        if wp.static(w[2] != 0.0):
            y = move(y, k.k2, h.dtype(wp.static(w[2])) * h)
        if wp.static(w[3] != 0.0):
            y = move(y, k.k3, h.dtype(wp.static(w[3])) * h)
        if wp.static(w[4] != 0.0):
            y = move(y, k.k4, h.dtype(wp.static(w[4])) * h)
        if wp.static(w[5] != 0.0):
            y = move(y, k.k5, h.dtype(wp.static(w[5])) * h)
        if wp.static(w[6] != 0.0):
            y = move(y, k.k6, h.dtype(wp.static(w[6])) * h)
        if wp.static(w[7] != 0.0):
            y = move(y, k.k7, h.dtype(wp.static(w[7])) * h)
        if wp.static(w[8] != 0.0):
            y = move(y, k.k8, h.dtype(wp.static(w[8])) * h)
        if wp.static(w[9] != 0.0):
            y = move(y, k.k9, h.dtype(wp.static(w[9])) * h)
        if wp.static(w[10] != 0.0):
            y = move(y, k.k10, h.dtype(wp.static(w[10])) * h)
        if wp.static(w[11] != 0.0):
            y = move(y, k.k11, h.dtype(wp.static(w[11])) * h)
        if wp.static(w[12] != 0.0):
            y = move(y, k.k12, h.dtype(wp.static(w[12])) * h)
        if wp.static(complete is not None):
            y = complete(y)
        return y

    return moves


def make_push(Wrench, View, laws):
    """(x, constants, h): P <- P + h F, where F never changes in inertial axes. docs/theory/runge_kutta.md, (K6)."""
    force = superpose(laws, "steady_force")

    @wp.func
    def pushed(x: Any, c: Any, h: Any):
        if wp.static(force is not None):
            # An empty view: such a force looks at nothing.
            x.p = x.p + h * force(Wrench(), View(), c.params).force
        return x

    return pushed


@wp.func
def copy_memory(c: Any, source: int, target: int):
    """Copy the laws' memory: place 0 is in use, place 1 keeps that of the step's start."""
    # Half of the array is a backup, and half of the rest is what is kept.
    rows = c.memory.shape[1] // 4
    copy_rows(c.memory, c.packet, source * rows, target * rows, c.first_memory, c.last_memory)


def make_recall(View, follow, settle, before, node):
    """(x, constants, h) -> x: advance what laws remember from the node of the last stage to this one, where x is.

    follow, settle: functions of all laws with this role, or None (see make_settle). None where both are, or no time passes.
    """
    back = node < before
    part = node if back else node - before
    if (follow is None and settle is None) or part == 0.0:
        return None

    @wp.func
    def recall(x: Any, c: Any, h: Any):
        if wp.static(follow is not None):
            if wp.static(back):
                copy_memory(c, 1, 0)
            view = look(View(), x, c, h.dtype(wp.static(part)) * h)
            # The view stands for the sum that folded laws hand on (see compose.superpose): these add nothing to it.
            view = follow(view, view, c.params)
        if wp.static(settle is not None):
            settle(x, c, h)
        return x

    return recall


def make_settle(View, Wrench, laws, role):
    """(x, constants, h): let laws keep what they need at this time, for all stages of it. None where no law does.

    role: "settle", at the start of a step; "settle anew", where the step before has done so; "settle_later", within it.
    """
    settle = superpose(laws, role)
    if settle is None:
        return None

    @wp.func
    def settled(x: Any, c: Any, h: Any):
        nothing = settle(Wrench(), look(View(), x, c, h), c.params)  # noqa: F841 (nothing is added)

    return settled


def make_stage(moves, push, node, timed, recall, early=0.0):
    """The state of one stage. push, recall: functions as of make_push and make_recall, or None; early: as of Explicit."""

    @wp.func
    def at_node(x: Any, k: Any, c: Any, h: Any):
        y = moves(x, k, h)
        if wp.static(push is not None):
            y = push(y, c, h.dtype(wp.static(node)) * h)
        if wp.static(timed):
            y.time = x.time + wp.float64(wp.static(node)) * wp.float64(h)
        if wp.static(early > 0.0):
            y.time = y.time - wp.float64(wp.static(early)) * wp.float64(h)
        if wp.static(recall is not None):
            y = recall(y, c, h)
        return y

    return at_node


def make_settled(stages, settle, anew):
    """The stages of a step, or a whole step, for which laws keep what they need at its start. settle, anew: of make_settle."""
    if settle is None:
        return stages

    @wp.func
    def settled_stages(x: Any, c: Any, h: Any):
        if x.prepared == 0:
            settle(x, c, h)
        elif wp.static(anew is not None):
            anew(x, c, h)
        return stages(x, c, h)

    return settled_stages


def make_stages(Rates, rates, ys, kept):
    """One function (x, constants, h) -> the slopes of all stages.

    docs/theory/runge_kutta.md, (K2).

    ys: their states (see make_stage); kept: whether what laws remember at the step's start is kept.
    """
    count = len(ys)
    Slopes = slopes_struct(Rates, count)
    _, at_1, at_2, at_3, at_4, at_5, at_6, at_7, at_8, at_9, at_10, at_11, at_12 = ys + [None] * (MOST_STAGES - count)

    @wp.func
    def stages(x: Any, constants: Any, h: Any):
        k = Slopes()
        if wp.static(kept):
            copy_memory(constants, 0, 1)
        k.k0 = rates(x, constants, h)
        if wp.static(count > 1):
            k.k1 = rates(at_1(x, k, constants, h), constants, h)
        if wp.static(count > 2):
            k.k2 = rates(at_2(x, k, constants, h), constants, h)
        if wp.static(count > 3):
            k.k3 = rates(at_3(x, k, constants, h), constants, h)
        if wp.static(count > 4):
            k.k4 = rates(at_4(x, k, constants, h), constants, h)
        if wp.static(count > 5):
            k.k5 = rates(at_5(x, k, constants, h), constants, h)
        if wp.static(count > 6):
            k.k6 = rates(at_6(x, k, constants, h), constants, h)
        if wp.static(count > 7):
            k.k7 = rates(at_7(x, k, constants, h), constants, h)
        if wp.static(count > 8):
            k.k8 = rates(at_8(x, k, constants, h), constants, h)
        if wp.static(count > 9):
            k.k9 = rates(at_9(x, k, constants, h), constants, h)
        if wp.static(count > 10):
            k.k10 = rates(at_10(x, k, constants, h), constants, h)
        if wp.static(count > 11):
            k.k11 = rates(at_11(x, k, constants, h), constants, h)
        if wp.static(count > 12):
            k.k12 = rates(at_12(x, k, constants, h), constants, h)
        return k

    return stages


def make_fixed(stages, finish, push, timed, recall, used=None, settles=False):
    """One step of length h. push, recall: as in make_stage; used: (energy, slopes, h) -> energy plus that of the step.

    docs/theory/runge_kutta.md, (K3).
    """

    @wp.func
    def step(x: Any, c: Any, h: Any):
        """y + h sum_i b_i k_i."""
        if wp.static(used is not None):
            k = stages(x, c, h)
            spend(c, used(ones(x.b.x) - ones(x.b.x), k, h))
            x = finish(x, k, h)
        else:
            x = finish(x, stages(x, c, h), h)
        if wp.static(push is not None):
            x = push(x, c, h)
        if wp.static(timed):
            x.time = x.time + wp.float64(h)
        if wp.static(recall is not None):
            x = recall(x, c, h)
        if wp.static(settles):
            x.prepared = 1
        return x

    return step


def make_implicit_stages(spec, rates, states, velocities, slope):
    """The stages of a linearly implicit method for this Spec.

    states: those of the stages (see make_stage); slope: the matrix of damping (see make_forces).
    """
    method, width, real, coupled = spec.explicit, spec.lanes, spec.real, "coupled" in spec.parts
    Rates = rates_struct(width, real, method.kind, spec.accounted)
    damped = [make_damped(Rates, make_moves, row, coupled) for row in method.implicit]
    implicit = make_implicit(damping_struct(width, real), factor_struct(width, real), coupled)
    factor = make_factor(implicit, velocities, slope, method.implicit[0][0])
    return make_damped_stages(slopes_struct(Rates, len(damped)), rates, states, damped, factor)


# Roles of laws, over all stages, beyond which their code is compiled once and called: inlined for each stage, it would take
# the compiler longer than all the rest.
MOST_INLINED = 100


def make_called(rates, State, Constants, real):
    """The same rates by a call at each stage, which takes a tenth longer than code for each."""

    @wp.func(inline=False)
    def at(x: wp.ref[State], c: wp.ref[Constants], h: real):
        return rates(x, c, h)

    @wp.func
    def called(x: Any, c: Any, h: Any):
        return at(x, c, h)

    return called


def make_explicit(spec, types, everything, velocities, slope):
    """The step of a Runge-Kutta method for this Spec, with all the laws in `everything`; slope: see make_implicit_stages.

    types: of the kernel's state and constants (see advance/spec.py).
    """
    method, width, real, timed = spec.explicit, spec.lanes, spec.real, spec.timed
    Wrench = wrench_struct(width, real)
    Rates = rates_struct(width, real, method.kind, spec.accounted)
    turned = make_turned(rotation_struct(width, real), real)
    moves = {"vector": (along, completed), "inertial": (along_known, completed)}
    move, complete = moves.get(method.kind, (make_act(turned), None))
    View = view_struct(width, real, spec.shared_rows)
    push = make_push(Wrench, View, spec.laws) if method.kind == "inertial" else None
    shape = (spec.mass, "coupled" in spec.parts or bool(spec.inverse), spec.flow != "none", spec.scaled)
    drag = make_resistance(spec.drag) if spec.drag else None
    carried = make_carried(spec, velocities)
    power_at = make_power_at(View, spec.laws) if spec.accounted else None
    if carried:
        drifts = spec.flow != "none"
        rates = make_carried_rates(Rates, Wrench, everything, carried.velocities, method.kind, drifts, power_at)
    else:
        rates = make_rates(Rates, Wrench, everything, velocities, method.kind, *shape, drag, power_at)
    roles = sum(plays(law, role) is not None for law in spec.laws for role in ("law", "push", "matrix", "flow"))
    if roles * len(method.b) > MOST_INLINED:
        rates = make_called(rates, types.State, types.Constants, real)
    follow = superpose(spec.laws, "follow") if spec.memory else None
    settle, anew, later = (make_settle(View, Wrench, spec.laws, role) for role in ("settle", ANEW, "settle_later"))
    if method.kind == "munthe_kaas":
        step = make_munthe_kaas(rates, move, turned, timed, make_recall(View, follow, later, 0.0, 0.5), spec.accounted)
        step = make_settled(step, settle, anew)
        return make_ride(step, carried, carried.depart) if carried else step
    a, c = method.a, method.c
    # An estimate of one number more asks for the slope at the end of the step, whose row of `a` is b.
    if method.adaptive and len(method.errors[0]) > len(a):
        a, c = (*a, method.b), (*c, 1.0)
    *recalls, last = (make_recall(View, follow, later, before, node) for before, node in zip((0.0, *c), (*c, 1.0)))
    states = [
        make_stage(make_moves(move, row, complete), push, node, timed, recall, method.early if node == 1.0 else 0.0)
        for row, node, recall in zip(a, c, recalls)
    ]
    kept = follow is not None and method.goes_back
    if method.implicit:
        stages = make_implicit_stages(spec, rates, states, velocities, slope)
    else:
        stages = make_stages(Rates, rates, states, kept)
    stages = make_settled(stages, settle, anew)
    if carried and carried.depart:
        stages = make_departing(stages, carried.depart)
    finish = make_moves(move, method.b + (0.0,) * (len(a) - len(method.b)), complete)
    used = make_moves(with_power, method.b, None) if spec.accounted else None
    if not method.adaptive:
        step = make_fixed(stages, finish, push, timed, last, used, settle is not None)
        return make_ride(step, carried) if carried else step
    errors = make_errors(Rates, [make_moves(along, row, None) for row in method.errors])
    step = make_adaptive(
        stages, finish, errors, method.estimate, spec.width, real, timed, copy_memory if kept else None, last, used
    )
    return make_ride(step, carried) if carried else step
