# SPDX-License-Identifier: Apache-2.0
"""All laws of a scene at one state and its velocities: the force and torque on the vehicle, and the water's velocity."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, div, mul, ones, sub  # noqa: F401
from lgvi_kernels.lanes.matrix3 import transposed
from lgvi_kernels.maps.dissipation import damped_force, damped_torque
from lgvi_kernels.maps.submaps import look, make_at_user_origin


def make_forces(
    View, Wrench, Flow, Damping, force, push, matrix, damping, flow, water_wrench, shifted, velocities, loads
):
    """(everything, forces, current, slope) of these laws; an argument is None where a scene has no such law (see make_K).

    docs/theory/integrator.md, (15), (16), (I8).

    push: the wrench of damping laws that give it; matrix: the damping of the others; damping: that of all laws, and of water
    that varies in space, which is in `water_wrench` as well; loads: of laws that look at the water (see seeing.py), those that
    are not in `push`.
    """
    at_user_origin = make_at_user_origin(shifted)

    @wp.func
    def water_at(view: Any, x: Any, c: Any):
        water = Flow()
        if wp.static(flow is not None):
            water = flow(water, at_user_origin(view, x, c), c.params)
        return water

    @wp.func
    def everything(w: Any, x: Any, c: Any, h: Any, nu: Any, Om: Any):
        """(w plus force and torque in body axes, the water's velocity in inertial axes): laws of water are called once."""
        view = look(View(), x, c, h)
        water = water_at(view, x, c)
        view.nu = nu
        view.Om = Om
        if wp.static(force is not None):
            w = force(w, view, c.params)
        if wp.static(water_wrench is not None):
            w = water_wrench(w, view, c.inertia, water)
        if wp.static(push is not None):
            w = push(w, view, c.params)
        if wp.static(matrix is not None):
            D = matrix(Damping(), view, c.params)
            w.force = w.force - damped_force(D, nu, Om)
            w.torque = w.torque - damped_torque(D, nu, Om)
        if wp.static(loads is not None):
            D_loads, w = loads(Damping(), w, view, c.params)
            w.force = w.force - damped_force(D_loads, nu, Om)
            w.torque = w.torque - damped_torque(D_loads, nu, Om)
        return w, water.velocity

    @wp.func
    def forces(x: Any, c: Any, h: Any, nu: Any, Om: Any):
        """phi(b, nu, R, Om), tau(b, nu, R, Om)."""
        w, u = everything(Wrench(), x, c, h, nu, Om)
        return w

    @wp.func
    def current(x: Any, c: Any, h: Any):
        """The water's velocity where the vehicle is, inertial axes."""
        return water_at(look(View(), x, c, h), x, c).velocity

    @wp.func
    def trace(D: Any, inertia: Any):
        """tr I6^-1 D [1/s], the sum of the rates at which damping acts."""
        a = transposed(D.force_velocity)
        b = transposed(D.force_rate)
        d = transposed(D.torque_velocity)
        e = transposed(D.torque_rate)
        u, p = velocities(inertia, a.row0, d.row0)
        v, q = velocities(inertia, a.row1, d.row1)
        w, r = velocities(inertia, a.row2, d.row2)
        total = u.x + v.y + w.z
        u, p = velocities(inertia, b.row0, e.row0)
        v, q = velocities(inertia, b.row1, e.row1)
        w, r = velocities(inertia, b.row2, e.row2)
        return total + p.x + q.y + r.z

    @wp.func
    def slope(x: Any, c: Any, h: Any, nu: Any, Om: Any):
        """D(s nu), near the derivative of D(nu) nu: s = 1 + q^2 / (1 + q^2), q = h tr I6^-1 D.

        s = 2 gives the derivative if each column of D is constant or grows with its velocity. Without it a long step
        would overshoot; in a short one, where lift across the way is more than drag along it, s = 1 is nearer.
        """
        view = look(View(), x, c, h)
        water = water_at(view, x, c)
        view.nu = nu
        view.Om = Om
        D = damping(Damping(), view, water, c)
        q = h * trace(D, c.inertia)
        square = q * q
        s = ones(q) + square / (ones(q) + square)
        view.nu = s * nu
        view.Om = s * Om
        return damping(Damping(), view, water, c)

    return everything, forces, current, slope
