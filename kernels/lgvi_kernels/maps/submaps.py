# SPDX-License-Identifier: Apache-2.0
"""Ab, Ap, T, D, K: the sub-maps of which every method is a program; each advances a packet by h.

p = M nu and pi = J Om, and M and J themselves, carry the factor 1 / max J throughout. R is kept as its rows R0, R1, R2.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, dot, mul, vec3  # noqa: F401
from lgvi_kernels.lanes.rotations import transpose_apply
from lgvi_kernels.lanes.sums import moved, moved_from, place, pushed, turned, twisted
from lgvi_kernels.maps.water import acceleration_wrench


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


def make_clock(timed):
    """The function by which a drift advances the laws' time; where no law looks at the time, it does nothing."""

    @wp.func
    def passed(x: Any, h: Any):
        if wp.static(timed):
            x.time = x.time + wp.float64(h)
        return x

    return passed


def make_Ab(velocity, timed):
    """The drift of the position. docs/theory/integrator.md, (12), (23); docs/theory/splitting.md, (S3)."""
    passed = make_clock(timed)

    @wp.func
    def Ab(x: Any, c: Any, h: Any):
        """Eq. (12) and (23), Nordkvist & Sanyal 2010: b <- b + h R nu."""
        return passed(moved(x, rotate(x, h * velocity(c.inertia, x.p))), h)

    return Ab


@wp.func
def Ap(x: Any, c: Any, h: Any):
    """The Munk moment of eq. (14) and (19): pi <- pi + h p x nu. Absent for M = m I, where it is zero.

    docs/theory/integrator.md, (14), (21); docs/theory/splitting.md, (S3).
    """
    return twisted(x, h * cross(x.p, c.inertia.anisotropy * x.p))


def make_T(timed, compensated):
    """Drift and Munk moment. docs/theory/splitting.md, (S2)."""
    passed = make_clock(timed)

    @wp.func
    def T(x: Any, c: Any, h: Any):
        """Ab and Ap together: the exact flow of the kinetic energy p.M^-1 p / 2."""
        d = h * (c.inertia.anisotropy * x.p)
        if wp.static(compensated):
            x = moved(x, rotate(x, (h * c.inertia.mean) * x.p + d))
            x = twisted(x, cross(x.p, d))
        else:
            # Written out as in D.
            x.b = x.b + rotate(x, (h * c.inertia.mean) * x.p + d)
            x.pi = x.pi + cross(x.p, d)
        return passed(x, h)

    return T


def make_D(Rotation, solve, compensated):
    """The free rotation with this solver of equation (24).

    docs/theory/integrator.md, (10), (11), (13), (14), (19), (20), (21), (22); docs/theory/splitting.md, (S4).
    """

    @wp.func
    def D(x: Any, c: Any, h: Any):
        """Eq. (10), (11): F = S(h pi), R <- R F; of (13), (14): p <- F^T p, pi <- F^T pi. Adjoint: (19)-(22)."""
        F, alarm = solve(Rotation(), x.alarm, h * x.pi, c.inertia.J, c.tolerance)
        x.alarm = alarm
        if wp.static(compensated):
            x = turned(x, F)
        else:
            # Written out: by a function of the state the compiler finds a slower schedule.
            x.p = transpose_apply(F, x.p)
            x.pi = transpose_apply(F, x.pi)
            x.R0 = transpose_apply(F, x.R0)
            x.R1 = transpose_apply(F, x.R1)
            x.R2 = transpose_apply(F, x.R2)
        return x

    return D


@wp.func
def look(view: Any, x: Any, c: Any, h: Any):
    """The View of a state, for a kick of h."""
    # The rows of R are R^T e1, R^T e2, R^T e3: nothing to compute.
    view.north = x.R0
    view.east = x.R1
    view.down = x.R2
    view.b = place(x)
    view.t = h.dtype(x.time)
    view.h = h
    view.step = x.step
    view.table = c.table
    view.memory = c.memory
    view.packet = c.packet
    view.entry = c.entry
    return view


@wp.func
def kicked(x: Any, c: Any, h: Any, w: Any):
    """p <- p + h f, pi <- pi + h m. Momenta are divided by max J, forces are not: hence inverse_scale."""
    k = h * c.inertia.inverse_scale
    return twisted(pushed(x, k * w.force), k * w.torque)


def make_at_user_origin(shifted):
    """The function that moves a view to where water is taken. shifted: the origin of the forces is not the user's."""

    @wp.func
    def at_user_origin(view: Any, x: Any, c: Any):
        """Water is taken at the user's origin, whichever origin the method has."""
        if wp.static(shifted):
            view.b = place(x) + rotate(x, c.inertia.user_origin_forces)
        return view

    return at_user_origin


def make_K(View, Wrench, Flow, law, evolve, flow, flow_varies, shifted, E, V, account=None, late=0.0):
    """The kick by these laws, each of them None where a scene has none.

    docs/theory/integrator.md, (13), (14), (20), (21); docs/theory/splitting.md, (S5).

    law: forces from position and time; evolve: laws that remember, half before and half after; flow: the water carries
    the vehicle, half before and half after, and where it varies in space or time also pushes it; shifted: the origin of
    the forces is not the user's; E: exact flow of drag, or V: velocity-dependent laws, between two half kicks. Order 2.
    account: the energy used (see accounting.make_kick_account). late: how much later than the kick the middle of the time
    is that laws remember, in lengths of the kick: 0.5 for a kick that opens the step, -0.5 for one that closes it.
    """
    drifts, damped, forced = flow is not None, E is not None or V is not None, law is not None or flow_varies
    at_user_origin = make_at_user_origin(shifted)

    @wp.func
    def K(x: Any, c: Any, h: Any):
        """The potential's part of eq. (13), (14), (19), (20), p <- p + h f(b, R), pi <- pi + h mU(b, R), and the rest."""
        view = look(View(), x, c, h)
        half = h.dtype(0.5) * h
        # Drag in the middle, all else half before and half after it in mirrored order: so the kick has order 2.
        if wp.static(account is not None):
            p = x.p
            pi = x.pi
        if wp.static(evolve is not None):
            # The view stands for the sum that folded laws hand on (see compose.superpose): these add nothing to it.
            if wp.static(late != 0.0):
                t = view.t
                view.t = t + h.dtype(wp.static(late)) * h
            view = evolve(view, view, c.params)
            if wp.static(late != 0.0):
                view.t = t
        if wp.static(drifts):
            start = x
            water = flow(Flow(), at_user_origin(view, x, c), c.params)
            x = moved_from(x, start, half * water.velocity)
            view.b = place(x)
            if wp.static(flow_varies):
                # The midpoint rule: where the vehicle is after half the way, the water carries it all the way.
                water = flow(Flow(), at_user_origin(view, x, c), c.params)
        if wp.static(forced):
            # Of both half kicks: these forces depend on b and R, which do not change between them.
            w = Wrench()
            if wp.static(law is not None):
                w = law(w, view, c.params)
            if wp.static(flow_varies):
                w = acceleration_wrench(w, view, c.inertia, water)
            if wp.static(damped):
                x = kicked(x, c, half, w)
            else:
                x = kicked(x, c, h, w)
        if wp.static(damped):
            if wp.static(E is not None):
                x = E(x, c, h)
            if wp.static(V is not None):
                if wp.static(drifts):
                    x = V(x, view, water, c, h)
                else:
                    x = V(x, view, Flow(), c, h)
            if wp.static(forced):
                x = kicked(x, c, half, w)
        if wp.static(drifts):
            # From the start, not from half way: b is rounded once.
            x = moved_from(x, start, h * water.velocity)
        if wp.static(account is not None):
            account(x, c, h, view, p, pi)
        if wp.static(evolve is not None):
            view.second = 1
            if wp.static(late != 0.0):
                view.t = t + h.dtype(wp.static(late)) * h
            view = evolve(view, view, c.params)
        return x

    return K


@functools.cache
def fold(maps):
    """One function (x, constants, h) from a sequence of (sub-map, coefficient), the first applied first."""
    # By recursion: Warp functions are bound when they are defined, so a loop in device code cannot go through a list of them.
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


def fold_pair(maps):
    """One function (x, constants, h1, h2): the maps before the middle over h1, after it over h2, a middle over their mean."""
    n = len(maps) // 2
    before, after = fold(maps[:n]), fold(maps[len(maps) - n :])
    has_middle = len(maps) % 2 == 1
    middle = fold(maps[n : n + 1])

    @wp.func
    def pair(x: Any, c: Any, h1: Any, h2: Any):
        x = before(x, c, h1)
        if wp.static(has_middle):
            x = middle(x, c, h1.dtype(0.5) * (h1 + h2))
        return after(x, c, h2)

    return pair
