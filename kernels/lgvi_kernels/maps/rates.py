# SPDX-License-Identifier: Apache-2.0
"""The rates of a state that Runge-Kutta methods ask for, with all laws."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, lane, lane3, mul, sub  # noqa: F401
from lgvi_kernels.lanes.state import struct
from lgvi_kernels.maps.submaps import rotate


@functools.cache
def rates_struct(width, real, kind, accounted=False):
    """b', pi', p' unless it is known, and the first and last row of R' = R hat(Om); on the group, Om instead of them.

    accounted: also the power that is used [W].
    """
    Lane3 = lane3(width, real)
    turning = {"R0": Lane3, "R2": Lane3} if kind in ("vector", "inertial") else {"Om": Lane3}
    pushing = {} if kind == "inertial" else {"p": Lane3}
    power = {"power": lane(width, real)} if accounted else {}
    return struct("Rates", b=Lane3, **turning, **pushing, pi=Lane3, **power)


def make_rates(Rates, Wrench, everything, velocities, kind, mass, coupled, drifts, scaled, drag, power_at=None):
    """The right-hand side, eq. (1) and the dynamics of Nordkvist & Sanyal 2010 with all laws of a scene.

    docs/theory/integrator.md, (1), (I1); docs/theory/runge_kutta.md, (K1); docs/theory/water.md, (W1).

    scaled: momenta are divided by max J; drag: the function that adds drag along the axes, where it is not among
    `everything`, or None; power_at: of a scene that sums the energy used (see accounting.py), or None.
    """
    isotropic, munk = mass == "isotropic", make_munk(mass == "diagonal")
    group, inertial = kind not in ("vector", "inertial"), kind == "inertial"

    @wp.func
    def turning(w: Any, x: Any, c: Any, nu: Any, Om: Any):
        """p x Om and pi x Om + p x nu: the rates of the momenta in body axes without any force."""
        w.force = w.force + cross(x.p, Om)
        w.torque = w.torque + cross(x.pi, Om)
        if wp.static(coupled):
            w.torque = w.torque + cross(x.p, nu)
        elif wp.static(not isotropic):
            # p x M^-1 p without the mean of M^-1, of which it is zero.
            w.torque = munk(w.torque, x.p, c.inertia.anisotropy)
        return w

    @wp.func
    def rates(x: Any, c: Any, h: Any):
        """b' = R nu + u, R' = R hat(Om), p' = p x Om + f, pi' = pi x Om + p x nu + m."""
        k = Rates()
        if wp.static(inertial):
            x.p = in_body(x)
        nu, Om = velocities(c.inertia, x.p, x.pi)
        w = Wrench()
        if wp.static(not scaled):
            # Laws add to w: begun with these terms, it saves the addition of two wrenches.
            w = turning(w, x, c, nu, Om)
        w, u = everything(w, x, c, h, nu, Om)
        if wp.static(scaled):
            w.force = c.inertia.inverse_scale * w.force
            w.torque = c.inertia.inverse_scale * w.torque
            w = turning(w, x, c, nu, Om)
        k.b = rotate(x, nu)
        if wp.static(drifts):
            k.b = k.b + u
        if wp.static(group):
            k.Om = Om
        else:
            k.R0 = cross(x.R0, Om)
            k.R2 = cross(x.R2, Om)
        if wp.static(not inertial):
            k.p = w.force
        k.pi = w.torque
        if wp.static(drag is not None):
            k = drag(k, x, c.params.own)
        if wp.static(power_at is not None):
            k.power = power_at(x, c, h, nu, Om)
        return k

    return rates


@wp.func
def in_body(x: Any):
    """R^T P, with P in place of p."""
    return x.p.x * x.R0 + x.p.y * x.R1 + x.p.z * x.R2


def make_munk(diagonal):
    """pi' + p x A p, where A is M^-1 less its mean."""

    @wp.func
    def munk(turned: Any, p: Any, A: Any):
        if wp.static(diagonal):
            # The differences of A are the same in all steps: the compiler forms them before the loop.
            turned.x = turned.x + (A.z - A.y) * (p.y * p.z)
            turned.y = turned.y + (A.x - A.z) * (p.z * p.x)
            turned.z = turned.z + (A.y - A.x) * (p.x * p.y)
        else:
            turned = turned + cross(p, A * p)
        return turned

    return munk
