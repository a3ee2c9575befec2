# SPDX-License-Identifier: Apache-2.0
"""Forces that are sums of products of two velocities, value s v_k: s is v_j, |v_j| or the speed across the hull.

As damping D_ik = - sum of value s: one multiplication and one addition each, whose indices are known when the code is made.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *

# First row of its table. Rows: what gives the user's velocities from those of the forces (36), the values.
params = make_params("QuadraticForm", words="first")


def entries_of(words):
    """(kind, i, j, k, row) of words such as "c034at7": the product v_3 v_4 in force 0, whose value is the seventh.

    Kinds: "c", v_j; "d", |v_j|; "h", the speed across the hull.
    """
    parts = (word.split("at") for word in words)
    return tuple((name[0], *(int(digit) for digit in name[1:]), int(row)) for name, row in parts)


def make_component(j):
    """(nu, Om) -> component j of the six velocities."""

    @wp.func
    def component(nu: Any, Om: Any):
        v = nu
        if wp.static(j > 2):
            v = Om
        x = v.x
        if wp.static(j % 3 == 1):
            x = v.y
        if wp.static(j % 3 == 2):
            x = v.z
        return x

    return component


COMPONENTS = [make_component(j) for j in range(6)]


def make_cell(entries):
    """(view, first, nu, Om, across) -> D_ik, the sum over its (kind, j, row); `first` is the row of the first value."""
    (kind, j, row), others = entries[0], entries[1:]
    component, rest = COMPONENTS[j], make_cell(others) if others else None

    @wp.func
    def cell(view: Any, first: int, nu: Any, Om: Any, across: Any):
        s = across
        if wp.static(kind == "c"):
            s = component(nu, Om)
        if wp.static(kind == "d"):
            s = absolute(component(nu, Om))
        D = -(row1(view, first + row) * s)
        if wp.static(rest is not None):
            D = D + rest(view, first, nu, Om, across)
        return D

    return cell


def cells_of(entries):
    """{(i, k): cell} of the elements of D that are not zero."""
    grouped: dict[Any, Any] = {}
    for kind, i, j, k, row in entries:
        grouped.setdefault((i, k), []).append((kind, j, row))
    return {place: make_cell(tuple(listed)) for place, listed in sorted(grouped.items())}


def listed_of(cells):
    """{i: [(k, cell)]} of the forces that some product is of."""
    forces: dict[Any, Any] = {}
    for (i, k), cell in cells.items():
        forces.setdefault(i, []).append((k, cell))
    return forces


def make_across(entries):
    """(nu) -> the speed across the hull, if some product has it."""
    wanted = any(entry[0] == "h" for entry in entries)

    @wp.func
    def across_speed(nu: Any):
        s = nu.x
        if wp.static(wanted):
            s = root(nu.y * nu.y + nu.z * nu.z)
        return s

    return across_speed


@wp.func
def user_velocities(view: Any, first: int):
    """(nu, Om) at the user's origin, in his axes."""
    nu = view.nu
    Om = view.Om
    return (
        vec3(
            dot(row3(view, first), nu) + dot(row3(view, first + 3), Om),
            dot(row3(view, first + 6), nu) + dot(row3(view, first + 9), Om),
            dot(row3(view, first + 12), nu) + dot(row3(view, first + 15), Om),
        ),
        vec3(
            dot(row3(view, first + 21), Om),
            dot(row3(view, first + 27), Om),
            dot(row3(view, first + 33), Om),
        ),
    )


def make_twist(listed):
    """(view, first, nu, Om, across) -> sum over some (k, D_ik) of D_ik X_k, X_k measuring the user's velocity k."""
    (k, cell), others = listed[0], listed[1:]
    rest = make_twist(others) if others else None

    @wp.func
    def twist(view: Any, first: int, nu: Any, Om: Any, across: Any):
        d = cell(view, first + 36, nu, Om, across)
        row = wp.static(6 * k) + first
        velocity = d * row3(view, row)
        rate = d * row3(view, row + 3)
        if wp.static(rest is not None):
            more_velocity, more_rate = rest(view, first, nu, Om, across)
            velocity = velocity + more_velocity
            rate = rate + more_rate
        return velocity, rate

    return twist


def make_outer(forces):
    """(D, view, first, nu, Om, across) -> D + sum over (i, [(k, D_ik)]) of X_i times the sum of D_ik X_k."""
    (i, listed), others = forces[0], forces[1:]
    twist, rest = make_twist(listed), make_outer(others) if others else None

    @wp.func
    def outer(D: Any, view: Any, first: int, nu: Any, Om: Any, across: Any):
        velocity, rate = twist(view, first, nu, Om, across)
        row = wp.static(6 * i) + first
        D = add_outer(D, row3(view, row), row3(view, row + 3), velocity, rate)
        if wp.static(rest is not None):
            D = rest(D, view, first, nu, Om, across)
        return D

    return outer


def make_sum(listed):
    """(total, view, first, nu, Om, across) -> total less the sum over some (k, D_ik) of D_ik v_k."""
    (k, cell), others = listed[0], listed[1:]
    component, rest = COMPONENTS[k], make_sum(others) if others else None

    @wp.func
    def force(total: Any, view: Any, first: int, nu: Any, Om: Any, across: Any):
        total = total - cell(view, first, nu, Om, across) * component(nu, Om)
        if wp.static(rest is not None):
            total = rest(total, view, first, nu, Om, across)
        return total

    return force


def make_wrench(forces):
    """(w, view, first, nu, Om, across) -> w less the sum over (i, [(k, D_ik)]) of D_ik v_k X_i."""
    (i, listed), others = forces[0], forces[1:]
    force, rest = make_sum(listed), make_wrench(others) if others else None

    @wp.func
    def wrench(w: Any, view: Any, first: int, nu: Any, Om: Any, across: Any):
        f = force(across - across, view, first + 36, nu, Om, across)
        row = wp.static(6 * i) + first
        w.force = w.force + f * row3(view, row)
        w.torque = w.torque + f * row3(view, row + 3)
        if wp.static(rest is not None):
            w = rest(w, view, first, nu, Om, across)
        return w

    return wrench


@functools.cache
def made(words):
    """The law of these products, for any axes."""
    entries = entries_of(words)
    forces = tuple(listed_of(cells_of(entries)).items())
    across_speed, outer, wrench = make_across(entries), make_outer(forces), make_wrench(forces)

    @wp.func
    def form_damping(D: Any, view: Any, p: Any):
        """D plus that of the form."""
        nu, Om = user_velocities(view, p.first)
        return outer(D, view, p.first, nu, Om, across_speed(nu))

    @wp.func
    def form_push(w: Any, view: Any, p: Any):
        """w plus the force and torque of the form."""
        nu, Om = user_velocities(view, p.first)
        return wrench(w, view, p.first, nu, Om, across_speed(nu))

    return device(__name__, words, params=params, damping=form_damping, push=form_push)
