# SPDX-License-Identifier: Apache-2.0
"""Moving water: how it carries and pushes a vehicle whose momenta are those relative to the water.

In the frame of the water around it, the vehicle's equations are those of still water, but that frame accelerates and
changes as the vehicle moves through it. With u the water's velocity, G = du/db and Du/Dt = du/dt + G u:
the force (rho V - m) R^T Du/Dt (Fossen 2021, 10.3, for a uniform current), and in water that varies in space, with
X = R^T G R, m the dry mass and A11, A12 the added mass,

    force = -m X nu - X^T (A11 nu + A12 Om),   torque = -m r_g x X nu

The body enters water of another velocity, of which its own momentum knows nothing; the momentum of the fluid that it sets
in motion is turned and stretched by the water (Taylor 1928; Lamb 1932, art. 137; Galper & Miloh 1994). It follows from the
fluid's Lagrangian (nu, Om).A6 (nu, Om) / 2 with nu = R^T (v - u(b)), for a body that is small beside the water's lengths.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, dot, mul, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.matrix3 import apply, combine, plus, product, transposed
from lgvi_kernels.lanes.view import slope_against, slope_along, to_body, to_inertial


@wp.func
def acceleration_wrench(w: Any, view: Any, inertia: Any, water: Any):
    """(rho V - m) R^T Du/Dt at the centres of buoyancy and of gravity. docs/theory/water.md, (W2)."""
    a = to_body(view, water.rate + slope_along(water, water.velocity))
    w.force = w.force + inertia.excess * a
    w.torque = w.torque + cross(inertia.excess_lever, a)
    return w


@wp.func
def slopes_in_body(m: Any, view: Any, water: Any):
    """X^T of X = R^T G R, written into m: row j is R^T G (R e_j)."""
    m.row0 = to_body(view, slope_along(water, vec3(view.north.x, view.east.x, view.down.x)))
    m.row1 = to_body(view, slope_along(water, vec3(view.north.y, view.east.y, view.down.y)))
    m.row2 = to_body(view, slope_along(water, vec3(view.north.z, view.east.z, view.down.z)))
    return m


@wp.func
def by_symmetric(m: Any, s: Any):
    """m s, s symmetric or diagonal."""
    m.row0 = s * m.row0
    m.row1 = s * m.row1
    m.row2 = s * m.row2
    return m


@wp.func
def about(m: Any, r: Any):
    """-m hat(r): if m acts on the velocity at the point r, this acts on the rates about the origin."""
    m.row0 = cross(r, m.row0)
    m.row1 = cross(r, m.row1)
    m.row2 = cross(r, m.row2)
    return m


@wp.func
def levered(r: Any, m: Any):
    """hat(r) m: the torque of m, a force that acts at the point r."""
    return transposed(about(transposed(m), r))


def make_water_wrench(lever, shifted):
    """The force and torque of water that accelerates and varies in space, at these velocities (see make_shear).

    docs/theory/water.md, (W3).
    """

    @wp.func
    def water_wrench(w: Any, view: Any, inertia: Any, water: Any):
        """acceleration_wrench, less the force m X nu + X^T (A11 nu + A12 Om) and the torque m r_g x X nu."""
        w = acceleration_wrench(w, view, inertia, water)
        nu = view.nu
        if wp.static(shifted):
            nu = nu + cross(view.Om, inertia.user_origin_forces)
        carried = to_body(view, slope_along(water, to_inertial(view, nu)))
        momentum = inertia.added * nu
        if wp.static(lever):
            momentum = momentum + apply(inertia.added_coupling, view.Om)
        force = inertia.dry * carried + to_body(view, slope_against(water, to_inertial(view, momentum)))
        w.force = w.force - force
        if wp.static(lever):
            w.torque = w.torque - cross(inertia.dry_lever, carried)
            if wp.static(shifted):
                w.torque = w.torque - cross(inertia.user_origin_forces, force)
        return w

    return water_wrench


def make_shear(Matrix3, lever, shifted):
    """The same of the variation in space, as a damping matrix.

    docs/theory/water.md, (W3).

    lever: the rigid body's centre is not at the user's origin, or added mass couples there (else no torque follows);
    shifted: the user's origin, where the water is taken, is not that of the forces.
    """

    @wp.func
    def shear(D: Any, view: Any, inertia: Any, water: Any):
        """D + the matrix of the force m X nu + X^T (A11 nu + A12 Om) and the torque m hat(r_g) X nu at the user's origin."""
        XT = slopes_in_body(Matrix3(), view, water)
        X = transposed(XT)
        force = combine(by_symmetric(XT, inertia.added), inertia.dry, X)
        D.force_velocity = plus(D.force_velocity, force)
        if wp.static(lever):
            torque = levered(inertia.dry_lever, X)
            force_rate = product(XT, inertia.added_coupling)
            if wp.static(shifted):
                r = inertia.user_origin_forces
                torque = plus(torque, levered(r, force))
                D.torque_rate = plus(D.torque_rate, plus(about(torque, r), levered(r, force_rate)))
                force_rate = plus(force_rate, about(force, r))
            D.force_rate = plus(D.force_rate, force_rate)
            D.torque_velocity = plus(D.torque_velocity, torque)
        return D

    return shear
