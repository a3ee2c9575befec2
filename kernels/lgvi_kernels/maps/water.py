# SPDX-License-Identifier: Apache-2.0
"""Moving water: how it carries and pushes a vehicle whose momenta are those relative to the water.

In the frame of the water around it, the vehicle's equations are those of still water, but that frame accelerates and
changes as the vehicle moves through it. With u the water's velocity, G = du/db and Du/Dt = du/dt + G u:
the force (rho V - m) R^T Du/Dt (Fossen 2021, 10.3, for a uniform current), and in water that varies in space
-M R^T G R nu, since the vehicle enters water of another velocity (Thomasson & Woolsey 2013, without the water's rotation).
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, div, mul, ones, vec3  # noqa: F401
from lgvi_kernels.lanes.matrix3 import combine, product, symmetric, transposed
from lgvi_kernels.lanes.view import to_body


@wp.func
def along(water: Any, v: Any):
    """G v: how fast the water's velocity changes along v, inertial axes."""
    return v.x * water.by_north + v.y * water.by_east + v.z * water.by_depth


@wp.func
def acceleration_wrench(w: Any, view: Any, inertia: Any, water: Any):
    """(rho V - m) R^T Du/Dt at the centres of buoyancy and of gravity."""
    a = to_body(view, water.rate + along(water, water.velocity))
    w.force = w.force + inertia.excess * a
    w.torque = w.torque + cross(inertia.excess_lever, a)
    return w


@wp.func
def gradient_in_body(m: Any, view: Any, water: Any):
    """R^T G R, written into m: column j is R^T G (R e_j)."""
    m.row0 = to_body(view, along(water, vec3(view.north.x, view.east.x, view.down.x)))
    m.row1 = to_body(view, along(water, vec3(view.north.y, view.east.y, view.down.y)))
    m.row2 = to_body(view, along(water, vec3(view.north.z, view.east.z, view.down.z)))
    return transposed(m)


@wp.func
def about(m: Any, r: Any):
    """-m hat(r): if m acts on the velocity at the point r, this acts on the rates about the origin."""
    m.row0 = cross(r, m.row0)
    m.row1 = cross(r, m.row1)
    m.row2 = cross(r, m.row2)
    return m


def make_shear(Matrix3, coupled, shifted):
    """The damping matrix of the water's variation in space. shifted: the water is taken at the user's origin."""

    @wp.func
    def shear(D: Any, view: Any, inertia: Any, water: Any):
        """D + I6 (R^T G R, 0): force M R^T G R nu and, where M and J are coupled, torque C^T R^T G R nu."""
        # M and C are divided by max J, D is not.
        scale = ones(inertia.mean) / inertia.inverse_scale
        X = gradient_in_body(Matrix3(), view, water)
        MX = product(symmetric(Matrix3(), inertia.M), X)
        D.force_velocity = combine(D.force_velocity, scale, MX)
        if wp.static(shifted):
            D.force_rate = combine(D.force_rate, scale, about(MX, inertia.user_origin_forces))
        if wp.static(coupled):
            CX = product(transposed(inertia.C), X)
            D.torque_velocity = combine(D.torque_velocity, scale, CX)
            if wp.static(shifted):
                D.torque_rate = combine(D.torque_rate, scale, about(CX, inertia.user_origin_forces))
        return D

    return shear
