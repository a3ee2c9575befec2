# SPDX-License-Identifier: Apache-2.0
"""A kernel that evaluates one law alone at chosen views: lgvi_warp.checks compares the values with finite differences."""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, lane, mul, neg, ones, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.functions import cosine, sine
from lgvi_kernels.lanes.packet import put
from lgvi_kernels.lanes.state import damping_struct, flow_struct, view_struct, wrench_struct
from lgvi_kernels.maps.bounded import bounded_law
from lgvi_kernels.maps.compose import params_of, plays, superpose, superpose_loads
from lgvi_kernels.maps.seeing import seeing_laws

# Role of the law -> its columns of `out`, as (first, count); a role that the law does not have leaves zeros.
COLUMNS = {"law": (0, 6), "damping": (6, 36), "push": (59, 6), "flow": (42, 15), "distance": (57, 1), "energy": (58, 1),
           "load": (65, 42), "carried_inertia": (107, 36), "carried_momentum": (143, 6), "power": (149, 1)}  # fmt: skip
OUT_FIELDS = 150


class Examine(NamedTuple):
    """A kernel and the types of its arguments."""

    kernel: Any
    Lane: Any
    Params: Any


@wp.func
def swirl(f: Any, view: Any, sea: Any):
    """Water for laws that look at it: it varies in all directions, and grows everywhere at once."""
    half = view.h.dtype(0.5) * ones(view.b.x)
    phase = half * view.b.x + ones(half) * view.b.y - (half * half) * view.b.z
    u = vec3(half, -ones(half), half * half)
    s = sine(phase) * u
    f.velocity = f.velocity + cosine(phase) * u
    f.rate = f.rate + half * u
    f.by_north = f.by_north - half * s
    f.by_east = f.by_east - s
    f.by_depth = f.by_depth + (half * half) * s
    return f


@functools.cache
def make_examine(module, numbers, width, real):
    """Build (without compiling) the kernel that evaluates this module's functions."""
    module = bounded_law(module, width, real)
    (module,) = seeing_laws((module,), width, real, False, swirl)
    Lane, View, Params = lane(width, real), view_struct(width, real), params_of((module,), (numbers,), width, real)
    Wrench, Damping, Flow = (make(width, real) for make in (wrench_struct, damping_struct, flow_struct))
    roles = ("law", "damping", "push", "flow", "evolve", "follow")
    law, damping, push, flow, evolve, follow = (superpose((module,), role) for role in roles)
    load = superpose_loads((module,))
    inertia, momentum, depart = (
        superpose((module,), role) for role in ("carried_inertia", "carried_momentum", "depart")
    )
    distance, energy = plays(module, "distance"), superpose((module,), "energy")
    power = superpose((module,), "power")

    @wp.func
    def put_rows(out: wp.array2d(dtype=Lane), i: int, first: int, m: Any):
        """Write the blocks of rows of a 6x6 matrix, 6 numbers apart."""
        put(out, i, first, m.row0)
        put(out, i, first + 6, m.row1)
        put(out, i, first + 12, m.row2)

    @wp.kernel(module="unique", enable_backward=False)
    def examine(
        # the law's numbers
        params: wp.array(dtype=Params),
        table: wp.array2d(dtype=Lane),
        # the views: in space, in time, length and number of the kick; second: -1 evaluates, 0 and 1 call evolve, 2 follow
        views: wp.array2d(dtype=Lane),
        times: wp.array(dtype=real),
        h: real,
        step: int,
        second: int,
        # in and out
        memory: wp.array2d(dtype=Lane),
        # out
        out: wp.array2d(dtype=Lane),
    ):
        i = wp.tid()
        p = params[i % params.shape[0]]
        view = View()
        view.north = vec3(views[i, 0], views[i, 1], views[i, 2])
        view.east = vec3(views[i, 3], views[i, 4], views[i, 5])
        view.down = vec3(views[i, 6], views[i, 7], views[i, 8])
        view.b = vec3(views[i, 9], views[i, 10], views[i, 11])
        view.nu = vec3(views[i, 12], views[i, 13], views[i, 14])
        view.Om = vec3(views[i, 15], views[i, 16], views[i, 17])
        view.t = times[i]
        view.h = h
        view.step = step
        view.table = table
        view.memory = memory
        view.packet = i
        view.entry = i % table.shape[0]
        if second == 2:
            if wp.static(follow is not None):
                view = follow(view, view, p)
        elif second >= 0:
            if wp.static(evolve is not None):
                view.second = second
                view = evolve(view, view, p)
            if wp.static(depart is not None):
                view = depart(view, view, p)
        else:
            if wp.static(law is not None):
                w = law(Wrench(), view, p)
                put(out, i, 0, w.force)
                put(out, i, 3, w.torque)
            if wp.static(damping is not None):
                D = damping(Damping(), view, p)
                put_rows(out, i, 6, D.force_velocity)
                put_rows(out, i, 9, D.force_rate)
                put_rows(out, i, 24, D.torque_velocity)
                put_rows(out, i, 27, D.torque_rate)
            if wp.static(push is not None):
                w_push = push(Wrench(), view, p)
                put(out, i, 59, w_push.force)
                put(out, i, 62, w_push.torque)
            if wp.static(load is not None):
                D_load, w_load = load(Damping(), Wrench(), view, p)
                put_rows(out, i, 65, D_load.force_velocity)
                put_rows(out, i, 68, D_load.force_rate)
                put_rows(out, i, 83, D_load.torque_velocity)
                put_rows(out, i, 86, D_load.torque_rate)
                put(out, i, 101, w_load.force)
                put(out, i, 104, w_load.torque)
            if wp.static(inertia is not None):
                D_carried = inertia(Damping(), view, p)
                put_rows(out, i, 107, D_carried.force_velocity)
                put_rows(out, i, 110, D_carried.force_rate)
                put_rows(out, i, 125, D_carried.torque_velocity)
                put_rows(out, i, 128, D_carried.torque_rate)
            if wp.static(momentum is not None):
                w_carried = momentum(Wrench(), view, p)
                put(out, i, 143, w_carried.force)
                put(out, i, 146, w_carried.torque)
            if wp.static(flow is not None):
                f = flow(Flow(), view, p)
                put(out, i, 42, f.velocity)
                put(out, i, 45, f.rate)
                put(out, i, 48, f.by_north)
                put(out, i, 51, f.by_east)
                put(out, i, 54, f.by_depth)
            if wp.static(distance is not None):
                out[i, 57] = distance(view, p.own)
            if wp.static(energy is not None):
                out[i, 58] = energy(view.b.x - view.b.x, view, p)
            if wp.static(power is not None):
                out[i, 149] = power(view.b.x - view.b.x, view, p)

    return Examine(examine, Lane, Params)
