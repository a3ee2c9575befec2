"""The turns of psi_x: the kinetic energy of rotation as a sum of three squares, each solved exactly by a turn or a screw.

In axes where Js is diagonal, 1/2 (pi - E^T p).Js^-1 (pi - E^T p) with E moved to upper triangular form U by the choice of
an origin for each axis. Without coupling U = 0: three plain turns. No equation is solved; the map exists for every step.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes import add, div, mul, neg, ones, sub, vec3  # noqa: F401


@wp.func
def shear_pair(a: Any, b: Any, t: Any, s: Any):
    """(a, b) turned by the angle with tan(half) = t and sine s, as three shears: what rounding leaves is still a turn."""
    u = a + t * b
    v = b - s * u
    return u + t * v, v


@wp.func
def turn_x(v: Any, t: Any, s: Any):
    """F^T v for a turn about x."""
    y, z = shear_pair(v.y, v.z, t, s)
    return vec3(v.x, y, z)


@wp.func
def turn_y(v: Any, t: Any, s: Any):
    """F^T v for a turn about y."""
    z, x = shear_pair(v.z, v.x, t, s)
    return vec3(x, v.y, z)


@wp.func
def turn_z(v: Any, t: Any, s: Any):
    """F^T v for a turn about z."""
    x, y = shear_pair(v.x, v.y, t, s)
    return vec3(x, y, v.z)


@wp.func
def component_x(v: Any):
    """v.x."""
    return v.x


@wp.func
def component_y(v: Any):
    """v.y."""
    return v.y


@wp.func
def component_z(v: Any):
    """v.z."""
    return v.z


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


AXES = ((component_x, turn_x, slide_x), (component_y, turn_y, slide_y), (component_z, turn_z, slide_z))


def make_shift(axis):
    """The origin moves by a length along an axis of the body."""
    component, _, slide = AXES[axis]

    @wp.func
    def shift(x: Any, length: Any):
        """b <- b + length R e_i, pi <- pi - (length e_i) x p."""
        x.b = x.b + length * vec3(component(x.R0), component(x.R1), component(x.R2))
        x.pi = slide(x.pi, x.p, length)
        return x

    return shift


SHIFTS = (make_shift(0), make_shift(1), make_shift(2))


@wp.func
def tangent(y: Any, one: Any):
    """tan(y) to order 4, y + y^3 / 3. Any odd function keeps the map symplectic; this one makes steady spin accurate."""
    return y + (one.dtype(1.0 / 3.0) * (y * y)) * y


def make_turn(axis, pitched):
    """R_i: turn about one axis, for `pitched` with a slide along it (a screw)."""
    component, turn, _ = AXES[axis]
    shift = SHIFTS[axis]

    @wp.func
    def R_i(x: Any, c: Any, h: Any):
        """The exact flow of (pi_i - k_i p_i)^2 / (2 Js_i) with the tangent of half the angle replaced by its series."""
        one = ones(x.b.x)
        g = h * component(c.inertia.half_over_J)
        t = tangent(g * component(x.pi), h)
        s = t + t
        if wp.static(pitched):
            k = component(c.inertia.pitch)
            kp = k * component(x.p)
            t2 = -(g * kp)
            # (1 - t t2)^2 + (t + t2)^2 = (1 + t^2)(1 + t2^2): one division serves the slide and the turn.
            sum_t = t + t2
            m = one - t * t2
            q1 = one + t * t
            q2 = one + t2 * t2
            inverse = one / (q1 * (q2 * m))
            x = shift(x, (g + g) * k * (kp - (inverse * (q1 * m)) * component(x.pi)))
            t = (inverse * (q1 * q2)) * sum_t
            s = (m * m) * (inverse * (sum_t + sum_t))
        else:
            s = s / (one + t * t)
        x.p = turn(x.p, t, s)
        x.pi = turn(x.pi, t, s)
        x.R0 = turn(x.R0, t, s)
        x.R1 = turn(x.R1, t, s)
        x.R2 = turn(x.R2, t, s)
        return x

    return R_i


def make_hop(here, there, U12, U13, U23):
    """The origin moves from that of axis `here` to that of axis `there` (0, 1, 2), by the elements of U that are not 0."""
    sign = 1.0 if there > here else -1.0
    first = (here, there) in ((0, 1), (1, 0))
    along_x, along_y, along_z = SHIFTS

    @wp.func
    def hop(x: Any, c: Any, h: Any):
        """1 to 2: by U12 along z. 2 to 3: by U23 along x and -U13 along y."""
        if wp.static(first):
            if wp.static(U12):
                x = along_z(x, h.dtype(wp.static(sign)) * c.inertia.U12)
        else:
            if wp.static(U23):
                x = along_x(x, h.dtype(wp.static(sign)) * c.inertia.U23)
            if wp.static(U13):
                x = along_y(x, h.dtype(wp.static(-sign)) * c.inertia.U13)
        return x

    return hop
