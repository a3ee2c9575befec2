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
    """Drag along one axis alone: the change of its velocity."""

    @wp.func
    def changed(w: Any, decay: Any, gain: Any):
        unity = ones(w)
        slowed = w
        if wp.static(quadratic):
            slowed = slowed / (unity + component(gain) * absolute(w))
        if wp.static(linear):
            slowed = component(decay) * slowed
        return slowed - w

    return changed


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
            d = fx(nu.x, e.decay_force, e.gain_force)
            nu = nu + d * p.velocity_u
            Om = Om + d * p.rate_u
            du = du + d
            d = fy(nu.y, e.decay_force, e.gain_force)
            nu = nu + d * p.velocity_v
            Om = Om + d * p.rate_v
            dv = dv + d
            d = fz(nu.z, e.decay_force, e.gain_force)
            nu = nu + d * p.velocity_w
            Om = Om + d * p.rate_w
            dw = dw + d
        if wp.static(about):
            d = tx(Om.x, e.decay_torque, e.gain_torque)
            nu = nu + d * p.velocity_p
            Om = Om + d * p.rate_p
            dp = dp + d
            d = ty(Om.y, e.decay_torque, e.gain_torque)
            nu = nu + d * p.velocity_q
            Om = Om + d * p.rate_q
            dq = dq + d
            d = tz(Om.z, e.decay_torque, e.gain_torque)
            nu = nu + d * p.velocity_r
            Om = Om + d * p.rate_r
            dr = dr + d
        if wp.static(about):
            d = tz(Om.z, e.decay_torque, e.gain_torque)
            nu = nu + d * p.velocity_r
            Om = Om + d * p.rate_r
            dr = dr + d
            d = ty(Om.y, e.decay_torque, e.gain_torque)
            nu = nu + d * p.velocity_q
            Om = Om + d * p.rate_q
            dq = dq + d
            d = tx(Om.x, e.decay_torque, e.gain_torque)
            nu = nu + d * p.velocity_p
            Om = Om + d * p.rate_p
            dp = dp + d
        if wp.static(along):
            d = fz(nu.z, e.decay_force, e.gain_force)
            nu = nu + d * p.velocity_w
            Om = Om + d * p.rate_w
            dw = dw + d
            d = fy(nu.y, e.decay_force, e.gain_force)
            nu = nu + d * p.velocity_v
            Om = Om + d * p.rate_v
            dv = dv + d
            d = fx(nu.x, e.decay_force, e.gain_force)
            nu = nu + d * p.velocity_u
            Om = Om + d * p.rate_u
            du = du + d
        impulse = p.mass_force * vec3(du, dv, dw)
        moment = p.mass_torque * vec3(dp, dq, dr)
        x = pushed(x, transpose_times(p.turn, impulse))
        return twisted(x, transpose_times(p.turn, moment - cross(p.origin, impulse)))

    return prepare, E
