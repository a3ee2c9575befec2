# SPDX-License-Identifier: Apache-2.0
"""Inertia that laws change in time, as a mass that moves in the vehicle does, in Runge-Kutta methods.

With D(t) the change of the inertia and w(t) the momentum that is carried within the vehicle, body axes, the momenta are
(P; Pi) = (I6 + D) (nu; Om) + w, and their equations are those of (p; pi). Between steps a state holds I6 (nu; Om), as without
such laws, so that nothing else need know of them. The step itself takes (P; Pi), which no jump of w changes.
"""

from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, mul, sub  # noqa: F401
from lgvi_kernels.lanes.matrix3 import apply, factor_struct, solve6, transpose_times
from lgvi_kernels.lanes.state import damping_struct, view_struct, wrench_struct
from lgvi_kernels.maps.compose import superpose
from lgvi_kernels.maps.dissipation import damped_force, damped_torque, make_implicit
from lgvi_kernels.maps.submaps import look, rotate


class Carried(NamedTuple):
    """Functions (x, constants, h).

    velocities: (nu, Om) of a state with (P; Pi); boarded: that state from one with I6 (nu; Om); landed: the reverse;
    depart: lets laws look at the step that begins, or None.
    """

    velocities: Any
    boarded: Any
    landed: Any
    depart: Any


def make_carried(spec, velocities):
    """The functions of this Spec's laws; None where none of them changes the inertia. velocities: without these laws."""
    laws, width, real = spec.laws, spec.lanes, spec.real
    inertia, momentum, depart = (superpose(laws, role) for role in ("carried_inertia", "carried_momentum", "depart"))
    if inertia is None:
        return None
    coupled = "coupled" in spec.parts or bool(spec.inverse)
    View = view_struct(width, real, spec.shared_rows)
    Wrench, Damping, Factor = (make(width, real) for make in (wrench_struct, damping_struct, factor_struct))
    implicit = make_implicit(Damping, Factor, coupled)

    @wp.func
    def own_momentum(view: Any, c: Any):
        w = Wrench()
        if wp.static(momentum is not None):
            w = momentum(w, view, c.params)
        return w

    @wp.func
    def carried_velocities(x: Any, c: Any, h: Any):
        """(nu; Om) = (I6 + D)^-1 (P - w)."""
        view = look(View(), x, c, h)
        w = own_momentum(view, c)
        s = c.inertia.inverse_scale
        factor = implicit(inertia(Damping(), view, c.params), c.inertia, s)
        nu, Om = solve6(factor, x.p - s * w.force, x.pi - s * w.torque)
        return nu, Om

    @wp.func
    def boarded(x: Any, c: Any, h: Any):
        """P = I6 (nu; Om) + D (nu; Om) + w."""
        view = look(View(), x, c, h)
        w = own_momentum(view, c)
        D = inertia(Damping(), view, c.params)
        nu, Om = velocities(c.inertia, x.p, x.pi)
        s = c.inertia.inverse_scale
        x.p = x.p + s * (damped_force(D, nu, Om) + w.force)
        x.pi = x.pi + s * (damped_torque(D, nu, Om) + w.torque)
        return x

    @wp.func
    def landed(x: Any, c: Any, h: Any):
        """I6 (nu; Om)."""
        nu, Om = carried_velocities(x, c, h)
        x.p = c.inertia.M * nu
        x.pi = c.inertia.J_forces * Om
        if wp.static(coupled):
            x.p = x.p + apply(c.inertia.C, Om)
            x.pi = x.pi + transpose_times(c.inertia.C, nu)
        return x

    departed = None
    if depart is not None:

        @wp.func
        def departing(x: Any, c: Any, h: Any):
            view = look(View(), x, c, h)
            # The view stands for the sum that folded laws hand on (see compose.superpose): these add nothing to it.
            view = depart(view, view, c.params)
            return x

        departed = departing

    return Carried(carried_velocities, boarded, landed, departed)


def make_carried_rates(Rates, Wrench, everything, velocities, kind, drifts, power_at=None):
    """Rates like make_rates', for any inertia. velocities: see Carried."""
    group = kind != "vector"

    @wp.func
    def carried_rates(x: Any, c: Any, h: Any):
        """b' = R nu + u, R' = R hat(Om), P' = P x Om + f, Pi' = Pi x Om + P x nu + m."""
        k = Rates()
        nu, Om = velocities(x, c, h)
        w, u = everything(Wrench(), x, c, h, nu, Om)
        k.b = rotate(x, nu)
        if wp.static(drifts):
            k.b = k.b + u
        if wp.static(group):
            k.Om = Om
        else:
            k.R0 = cross(x.R0, Om)
            k.R2 = cross(x.R2, Om)
        s = c.inertia.inverse_scale
        k.p = s * w.force + cross(x.p, Om)
        k.pi = s * w.torque + cross(x.pi, Om) + cross(x.p, nu)
        if wp.static(power_at is not None):
            k.power = power_at(x, c, h, nu, Om)
        return k

    return carried_rates


def make_departing(stages, depart):
    """The stages of a step, before which laws look at it."""

    @wp.func
    def departing_stages(x: Any, c: Any, h: Any):
        return stages(depart(x, c, h), c, h)

    return departing_stages


def make_ride(step, carried, depart=None):
    """The step of a state with I6 (nu; Om) by one of a state with (P; Pi). depart: where it is not among the stages."""

    @wp.func
    def ride(x: Any, c: Any, h: Any):
        x = carried.boarded(x, c, h)
        if wp.static(depart is not None):
            x = depart(x, c, h)
        return carried.landed(step(x, c, h), c, h)

    return ride
