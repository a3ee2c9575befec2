# SPDX-License-Identifier: Apache-2.0
"""The turns of psi_x: the kinetic energy of rotation as a sum of three squares, each solved exactly by a turn or a screw.

In axes where Js is diagonal, 1/2 (pi - E^T p).Js^-1 (pi - E^T p) with E moved to upper triangular form U by the choice of
an origin for each axis. Without coupling U = 0: three plain turns. No equation is solved; the map exists for every step,
but where half the angle of a turn reaches 1 rad it has no digit of the motion: such a member gets a status.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import (  # noqa: F401
    add,
    component_x,
    component_y,
    component_z,
    div,
    dot,
    largest,
    mul,
    neg,
    ones,
    sub,
    vec3,
)
from lgvi_kernels.lanes.sums import carried, moved, twisted, with_turned


@wp.func
def shear_pair(a: Any, b: Any, t: Any, s: Any):
    """(a, b) turned by the angle with tan(half) = t and sine s, as three shears.

    docs/theory/coupled.md, (X10).

    Their determinant is 1 however t and s are rounded, so that this rounding neither stretches nor shrinks what is turned.
    """
    u = a + t * b
    v = b - s * u
    return u + t * v, v


@wp.func
def shear_pair_back(a: Any, b: Any, t: Any, s: Any):
    """The same turn by shears that begin with b: here the first of the pair is ready first, in shear_pair the second."""
    u = b - t * a
    v = a + s * u
    return v, u - t * v


def make_turn_of_vector(axis, early):
    """F^T v for a turn about an axis; early: the component that is wanted one shear before the other."""
    pair = shear_pair_back if early == (axis + 1) % 3 else shear_pair

    @wp.func
    def turn(v: Any, t: Any, s: Any):
        if wp.static(axis == 0):
            y, z = pair(v.y, v.z, t, s)
            return vec3(v.x, y, z)
        elif wp.static(axis == 1):
            z, x = pair(v.z, v.x, t, s)
            return vec3(x, v.y, z)
        else:
            x, y = pair(v.x, v.y, t, s)
            return vec3(x, y, v.z)

    return turn


@wp.func
def carried_pair(a: Any, a_low: Any, b: Any, b_low: Any, t: Any, s: Any):
    """The same turn with compensation, as (a, a_low, b, b_low): each number's whole change is added at once."""
    v, v_low = carried(b, b_low, -(s * (a + t * b)))
    u, u_low = carried(a, a_low, t * (b + v))
    return u, u_low, v, v_low


def make_carried_turn(axis):
    """(v, v_low) -> F^T v with compensation, for a turn about an axis."""

    @wp.func
    def turn(v: Any, low: Any, t: Any, s: Any):
        if wp.static(axis == 0):
            y, y_low, z, z_low = carried_pair(v.y, low.y, v.z, low.z, t, s)
            return vec3(v.x, y, z), vec3(low.x, y_low, z_low)
        elif wp.static(axis == 1):
            z, z_low, x, x_low = carried_pair(v.z, low.z, v.x, low.x, t, s)
            return vec3(x, v.y, z), vec3(x_low, low.y, z_low)
        else:
            x, x_low, y, y_low = carried_pair(v.x, low.x, v.y, low.y, t, s)
            return vec3(x, y, v.z), vec3(x_low, y_low, low.z)

    return turn


def make_turn_of_state(axis, early, compensated):
    """p <- F^T p, pi <- F^T pi, R <- R F for a turn about an axis with this tangent of half the angle and sine."""
    turn, carried_turn = make_turn_of_vector(axis, early), make_carried_turn(axis)

    @wp.func
    def plain(x: Any, t: Any, s: Any):
        x.p = turn(x.p, t, s)
        x.pi = turn(x.pi, t, s)
        x.R0 = turn(x.R0, t, s)
        x.R1 = turn(x.R1, t, s)
        x.R2 = turn(x.R2, t, s)
        return x

    @wp.func
    def with_low(x: Any, t: Any, s: Any):
        pi, pi_low = carried_turn(x.pi, x.pi_low, t, s)
        p, p_low = carried_turn(x.p, x.p_low, t, s)
        R0, R0_low = carried_turn(x.R0, x.R0_low, t, s)
        R1, R1_low = carried_turn(x.R1, x.R1_low, t, s)
        R2, R2_low = carried_turn(x.R2, x.R2_low, t, s)
        return with_turned(x, p, p_low, pi, pi_low, R0, R0_low, R1, R1_low, R2, R2_low)

    return with_low if compensated else plain


@wp.func
def slide_x(pi: Any, p: Any, length: Any):
    """pi - (length e_x) x p: the moment about an origin that moves along x."""
    return vec3(pi.x, pi.y + length * p.z, pi.z - length * p.y)


@wp.func
def slide_y(pi: Any, p: Any, length: Any):
    """pi - (length e_y) x p."""
    return vec3(pi.x - length * p.z, pi.y, pi.z + length * p.x)


@wp.func
def slide_z(pi: Any, p: Any, length: Any):
    """pi - (length e_z) x p."""
    return vec3(pi.x + length * p.y, pi.y - length * p.x, pi.z)


AXES = ((component_x, slide_x), (component_y, slide_y), (component_z, slide_z))


def make_shift(axis, compensated):
    """The origin moves by a length along an axis of the body."""
    component, slide = AXES[axis]

    @wp.func
    def shift(x: Any, length: Any):
        """b <- b + length R e_i, pi <- pi - (length e_i) x p."""
        x = moved(x, length * vec3(component(x.R0), component(x.R1), component(x.R2)))
        if wp.static(compensated):
            x = twisted(x, slide(x.pi - x.pi, x.p, length))
        else:
            x.pi = slide(x.pi, x.p, length)
        return x

    return shift


@wp.func
def tangent(y: Any, third: Any):
    """tan(y) to order 4, y + y^3 / 3. Any odd function keeps the map symplectic; this one makes steady spin accurate."""
    return y + (y * y) * (third * y)


def make_turn(axis, pitched, following, compensated, watched=False):
    """R_i: turn about one axis, for `pitched` with a slide along it (a screw); following: the axis of the next turn.

    docs/theory/coupled.md, (X9).

    watched: the last turn of a step, about the axis of the least J, leaves in alarm.size the largest Y.Y, Y half the angles
    about all axes (see packet.turned_too_far). Turns keep |pi|, so Y is not below half the angle of the turn about the axis of
    the largest J, nor, as J3 <= 2 J2 for a rigid body, below a half of that about the middle one.

    A step is one chain of turns: each waits until the turn before has computed the momentum about its axis. How soon that
    component is ready decides the time of a step, so all that need not wait for it is written apart.
    """
    component, _ = AXES[axis]
    turn = make_turn_of_state(axis, following, compensated)
    shift = make_shift(axis, compensated)

    @wp.func
    def R_i(x: Any, c: Any, h: Any):
        """The exact flow of (pi_i - k_i p_i)^2 / (2 Js_i) with the tangent of half the angle replaced by its series."""
        unity = ones(x.b.x)
        g = h * component(c.inertia.half_over_J)
        y = g * component(x.pi)
        t = tangent(y, h.dtype(wp.static(1.0 / 3.0)))
        if wp.static(pitched):
            # t and -w are the tangents of half the angles by pi_i and by p_i. With n = t - w, m = 1 + t w,
            # q = 1 + t^2, r = 1 + w^2: m^2 + n^2 = q r, and one division serves n / m, 2 n m / (q r) and the slide's 1 / r.
            k = component(c.inertia.pitch)
            k2 = k + k
            w = (g * k) * component(x.p)
            r = unity + w * w
            n = t - w
            m = unity + t * w
            q = unity + t * t
            inverse = unity / (q * (r + t * (w * r)))
            t = (n * (q * r)) * inverse
            s = ((n + n) * (m * m)) * inverse
            length = k2 * (w - (y * (q * m)) * inverse)
        else:
            s = (t + t) / (unity + t * t)
        if wp.static(watched):
            Y = (h * c.inertia.half_over_J) * x.pi
            x.alarm.size = largest(x.alarm.size, dot(Y, Y))
        x = turn(x, t, s)
        if wp.static(pitched):
            x = shift(x, length)
        return x

    return R_i


def make_hop(axis_from, axis_to, U12, U13, U23, compensated):
    """The origin moves from that of axis `axis_from` to that of axis `axis_to` (0, 1, 2), by the elements of U but 0.

    docs/theory/coupled.md, (X8), (X11).
    """
    sign = 1.0 if axis_to > axis_from else -1.0
    first_two = (axis_from, axis_to) in ((0, 1), (1, 0))
    along_x, along_y, along_z = (make_shift(axis, compensated) for axis in range(3))

    @wp.func
    def hop(x: Any, c: Any, h: Any):
        """1 to 2: by U12 along z. 2 to 3: by U23 along x and -U13 along y."""
        if wp.static(first_two):
            if wp.static(U12):
                x = along_z(x, h.dtype(wp.static(sign)) * c.inertia.U12)
        else:
            if wp.static(U23):
                x = along_x(x, h.dtype(wp.static(sign)) * c.inertia.U23)
            if wp.static(U13):
                x = along_y(x, h.dtype(wp.static(-sign)) * c.inertia.U13)
        return x

    return hop
