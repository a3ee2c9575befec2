# SPDX-License-Identifier: Apache-2.0
"""Drag per axis where the axes of drag are not principal axes of the inertia: one axis after the other, each exactly.

On the velocity w along one axis alone, w -> w e^-y / (1 + h L q|w| (1 - e^-y)/y) with y = h L l, L the axis's mobility,
and all velocities follow as the inertia couples them. Half a step of each axis in turn, then half a step of each in
reversed order: symmetric, order 2, and the energy never grows.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import component_x, component_y, component_z
from lgvi_kernels.lanes.matrix3 import apply, transpose_times
from lgvi_kernels.lanes.state import matrix3_struct
from lgvi_kernels.lanes.sums import pushed, twisted
from lgvi_kernels.law import *
from lgvi_kernels.laws.drag import PARTS
from lgvi_kernels.laws.drag import make_E as make_exact

COLUMNS = tuple(f"{kind}_{axis}" for axis in "uvwpqr" for kind in ("velocity", "rate"))


@functools.cache
def params(width, real):
    """Params: as drag, with L l [1/s] and L q; turn and origin, from the kernel's frame to the user's; mass, 1 / L by max J.

    velocity_u ... rate_r: the changes of nu and Om that go with a unit change of the velocity along one axis.
    """
    Lane3 = lane3(width, real)
    fields = {part: Lane3 for part in PARTS} | {name: Lane3 for name in COLUMNS}
    return struct(
        "DragDirections", turn=matrix3_struct(width, real), origin=Lane3, mass_force=Lane3, mass_torque=Lane3, **fields
    )


def make_axis(component, linear, quadratic):
    """Drag along one axis alone: (nu, Om, total, w, decay, gain, velocity, rate) -> nu, Om, total.

    w: the velocity along the axis; velocity, rate: what a change of 1 in it changes of nu and Om; total: its changes so far.
    """

    @wp.func
    def slowed(nu: Any, Om: Any, total: Any, w: Any, decay: Any, gain: Any, velocity: Any, rate: Any):
        unity = ones(w)
        left = w
        if wp.static(quadratic):
            left = left / (unity + component(gain) * absolute(w))
        if wp.static(linear):
            left = component(decay) * left
        d = left - w
        return nu + d * velocity, Om + d * rate, total + d

    return slowed


COMPONENTS = (component_x, component_y, component_z)


def make_E(parts, velocities):
    """(prepare, E) as for drag; `velocities` are those at the origin of the forces."""
    prepare_exact, _ = make_exact(parts, by_changes=False)
    force = [make_axis(c, PARTS[0] in parts, PARTS[2] in parts) for c in COMPONENTS]
    torque = [make_axis(c, PARTS[1] in parts, PARTS[3] in parts) for c in COMPONENTS]
    fx, fy, fz = force
    tx, ty, tz = torque
    along = PARTS[0] in parts or PARTS[2] in parts
    about = PARTS[1] in parts or PARTS[3] in parts

    @wp.func
    def prepare(e: Any, p: Any, h: Any):
        """The constants of E for steps of h, which takes each axis twice for h / 2."""
        e = prepare_exact(e, p, h.dtype(0.5) * h)
        e.h = h
        return e

    @wp.func
    def E(x: Any, e: Any, c: Any):
        """Each axis over e.h / 2, and again in reversed order."""
        p = c.params.own
        nu_forces, Om_forces = velocities(c.inertia, x.p, x.pi)
        Om = apply(p.turn, Om_forces)
        nu = apply(p.turn, nu_forces) - cross(Om, p.origin)
        # du to dr sum up each axis's changes: velocities follow at once, momenta once at the end.
        # Written out, since each axis has fields of its own, which no loop can index.
        zero = ones(Om.x) - ones(Om.x)
        du = zero
        dv = zero
        dw = zero
        dp = zero
        dq = zero
        dr = zero
        if wp.static(along):
            nu, Om, du = fx(nu, Om, du, nu.x, e.decay_force, e.gain_force, p.velocity_u, p.rate_u)
            nu, Om, dv = fy(nu, Om, dv, nu.y, e.decay_force, e.gain_force, p.velocity_v, p.rate_v)
            nu, Om, dw = fz(nu, Om, dw, nu.z, e.decay_force, e.gain_force, p.velocity_w, p.rate_w)
        if wp.static(about):
            nu, Om, dp = tx(nu, Om, dp, Om.x, e.decay_torque, e.gain_torque, p.velocity_p, p.rate_p)
            nu, Om, dq = ty(nu, Om, dq, Om.y, e.decay_torque, e.gain_torque, p.velocity_q, p.rate_q)
            nu, Om, dr = tz(nu, Om, dr, Om.z, e.decay_torque, e.gain_torque, p.velocity_r, p.rate_r)
            nu, Om, dr = tz(nu, Om, dr, Om.z, e.decay_torque, e.gain_torque, p.velocity_r, p.rate_r)
            nu, Om, dq = ty(nu, Om, dq, Om.y, e.decay_torque, e.gain_torque, p.velocity_q, p.rate_q)
            nu, Om, dp = tx(nu, Om, dp, Om.x, e.decay_torque, e.gain_torque, p.velocity_p, p.rate_p)
        if wp.static(along):
            nu, Om, dw = fz(nu, Om, dw, nu.z, e.decay_force, e.gain_force, p.velocity_w, p.rate_w)
            nu, Om, dv = fy(nu, Om, dv, nu.y, e.decay_force, e.gain_force, p.velocity_v, p.rate_v)
            nu, Om, du = fx(nu, Om, du, nu.x, e.decay_force, e.gain_force, p.velocity_u, p.rate_u)
        impulse = p.mass_force * vec3(du, dv, dw)
        moment = p.mass_torque * vec3(dp, dq, dr)
        x = pushed(x, transpose_times(p.turn, impulse))
        return twisted(x, transpose_times(p.turn, moment - cross(p.origin, impulse)))

    return prepare, E
