# SPDX-License-Identifier: Apache-2.0
"""Products of two velocities (quadratic_form) in the user's axes, where they are those that the kernel has."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws import quadratic_form
from lgvi_kernels.laws.quadratic_form import cells_of, entries_of, listed_of, make_across, make_sum


def make_row(cells):
    """(row, view, first, nu, Om, across) -> three elements of D, with those that are not zero added."""
    x, y, z = cells

    @wp.func
    def row(total: Any, view: Any, first: int, nu: Any, Om: Any, across: Any):
        if wp.static(x is not None):
            total.x = total.x + x(view, first, nu, Om, across)
        if wp.static(y is not None):
            total.y = total.y + y(view, first, nu, Om, across)
        if wp.static(z is not None):
            total.z = total.z + z(view, first, nu, Om, across)
        return total

    return row


def make_block(cells, i, k):
    """The same of the block of D whose first element is (i, k)."""
    rows = [make_row([cells.get((i + a, k + b)) for b in range(3)]) for a in range(3)]
    first_row, second_row, third_row = rows

    @wp.func
    def block(m: Any, view: Any, first: int, nu: Any, Om: Any, across: Any):
        m.row0 = first_row(m.row0, view, first, nu, Om, across)
        m.row1 = second_row(m.row1, view, first, nu, Om, across)
        m.row2 = third_row(m.row2, view, first, nu, Om, across)
        return m

    return block


@wp.func
def unchanged(total: Any, view: Any, first: int, nu: Any, Om: Any, across: Any):
    """A force that no product is of."""
    return total


@functools.cache
def made(words):
    """The law of these products."""
    entries = entries_of(words)
    cells = cells_of(entries)
    across_speed = make_across(entries)
    force_velocity, force_rate = make_block(cells, 0, 0), make_block(cells, 0, 3)
    torque_velocity, torque_rate = make_block(cells, 3, 0), make_block(cells, 3, 3)
    forces = {i: make_sum(listed) for i, listed in listed_of(cells).items()}
    X, Y, Z, K, M, N = (forces.get(i, unchanged) for i in range(6))

    @wp.func
    def pattern_damping(D: Any, view: Any, p: Any):
        """D plus that of the form."""
        at = p.first + 36
        nu = view.nu
        Om = view.Om
        s = across_speed(nu)
        D.force_velocity = force_velocity(D.force_velocity, view, at, nu, Om, s)
        D.force_rate = force_rate(D.force_rate, view, at, nu, Om, s)
        D.torque_velocity = torque_velocity(D.torque_velocity, view, at, nu, Om, s)
        D.torque_rate = torque_rate(D.torque_rate, view, at, nu, Om, s)
        return D

    @wp.func
    def pattern_push(w: Any, view: Any, p: Any):
        """w plus the force and torque of the form."""
        at = p.first + 36
        nu = view.nu
        Om = view.Om
        s = across_speed(nu)
        f = w.force
        t = w.torque
        w.force = vec3(X(f.x, view, at, nu, Om, s), Y(f.y, view, at, nu, Om, s), Z(f.z, view, at, nu, Om, s))
        w.torque = vec3(K(t.x, view, at, nu, Om, s), M(t.y, view, at, nu, Om, s), N(t.z, view, at, nu, Om, s))
        return w

    return device(__name__, words, params=quadratic_form.params, damping=pattern_damping, push=pattern_push)
