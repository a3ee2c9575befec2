"""The sub-maps that every method is a program of (Ab, Ap, T, D, K), each advancing a packet by h.

With p = M nu and pi = J Om; pi and J carry the factor 1 / max J throughout. R is kept as its rows R0, R1, R2.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes import add, cross, dot, mul, vec3  # noqa: F401
from lgvi_kernels.rotation import transpose_apply


@wp.func
def rotate(x: Any, v: Any):
    """R v."""
    return vec3(dot(x.R0, v), dot(x.R1, v), dot(x.R2, v))


@wp.func
def isotropic_velocity(inertia: Any, p: Any):
    """nu = M^-1 p for M = m I."""
    return inertia.mean * p


@wp.func
def anisotropic_velocity(inertia: Any, p: Any):
    """nu = M^-1 p."""
    return inertia.mean * p + inertia.anisotropy * p


def make_Ab(velocity):
    """The drift of the position."""

    @wp.func
    def Ab(x: Any, c: Any, h: Any):
        """Eq. (12) and (23), Nordkvist & Sanyal 2010: b <- b + h R nu."""
        x.b = x.b + rotate(x, h * velocity(c.inertia, x.p))
        return x

    return Ab


@wp.func
def Ap(x: Any, c: Any, h: Any):
    """The Munk moment of eq. (14) and (19): pi <- pi + h p x nu. Absent for M = m I, where it is zero."""
    x.pi = x.pi + (h * c.inertia.inverse_scale) * cross(x.p, c.inertia.anisotropy * x.p)
    return x


@wp.func
def T(x: Any, c: Any, h: Any):
    """Ab and Ap together: the exact flow of the kinetic energy p.M^-1 p / 2."""
    d = h * (c.inertia.anisotropy * x.p)
    x.b = x.b + rotate(x, (h * c.inertia.mean) * x.p + d)
    x.pi = x.pi + c.inertia.inverse_scale * cross(x.p, d)
    return x


def make_D(Rotation, solve):
    """The free rotation with this solver of equation (24)."""

    @wp.func
    def D(x: Any, c: Any, h: Any):
        """Eq. (10), (11): F = S(h pi), R <- R F; of (13), (14): p <- F^T p, pi <- F^T pi. Adjoint: (19)-(22)."""
        F, alarm = solve(Rotation(), x.alarm, h * x.pi, c.inertia.J, c.tolerance)
        x.alarm = alarm
        x.p = transpose_apply(F, x.p)
        x.pi = transpose_apply(F, x.pi)
        x.R0 = transpose_apply(F, x.R0)
        x.R1 = transpose_apply(F, x.R1)
        x.R2 = transpose_apply(F, x.R2)
        return x

    return D


def make_K(View, Wrench, law):
    """The kick by this law."""

    @wp.func
    def K(x: Any, c: Any, h: Any):
        """The potential's part of eq. (13), (14), (19), (20): p <- p + h f(b, R), pi <- pi + h mU(b, R)."""
        view = View()
        view.z = x.R2
        view.b = x.b
        w = law(Wrench(), view, c.params)
        x.p = x.p + h * w.force
        x.pi = x.pi + (h * c.inertia.inverse_scale) * w.torque
        return x

    return K


@functools.cache
def fold(maps):
    """One function (x, constants, h) from a sequence of (sub-map, coefficient), the first applied first."""
    (first, coefficient), rest = maps[0], maps[1:]

    @wp.func
    def scaled(x: Any, c: Any, h: Any):
        return first(x, c, h.dtype(wp.static(coefficient)) * h)

    if not rest:
        return scaled
    following = fold(rest)

    @wp.func
    def sequence(x: Any, c: Any, h: Any):
        return following(scaled(x, c, h), c, h)

    return sequence
