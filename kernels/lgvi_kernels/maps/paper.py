# SPDX-License-Identifier: Apache-2.0
"""Phi and Phi* of Nordkvist & Sanyal (2010) with nonconservative forces: equations (10)-(16) and (19)-(23).

Conservative scenes are programs of submaps.py, which are the same maps. Here phi and tau, by (15) and (16) averages over
the old and the new configuration, make Phi* implicit in everything at once; it is solved by iteration.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, any_positive, dot, mul, ones, positive, sub  # noqa: F401
from lgvi_kernels.lanes.sums import moved
from lgvi_kernels.maps.submaps import kicked, look

FORCES_NOT_CONVERGED = 4

# If each round halves the change, or better, these are enough for float64; what converges more slowly counts as failed.
MOST_ITERATIONS = 60


def make_equation_15(alpha, beta):
    """The averages of the old and of the new configuration."""

    @wp.func
    def equation_15(old: Any, new: Any, h: Any):
        """Eq. (15), (16), Nordkvist & Sanyal 2010: phi = alpha phi_k + (1 - alpha) phi_k+1, tau likewise by beta."""
        a = h.dtype(wp.static(alpha))
        b = h.dtype(wp.static(beta))
        old.force = a * old.force + (h.dtype(1.0) - a) * new.force
        old.torque = b * old.torque + (h.dtype(1.0) - b) * new.torque
        return old

    return equation_15


@wp.func
def sum_of(a: Any, b: Any):
    """Two wrenches added."""
    a.force = a.force + b.force
    a.torque = a.torque + b.torque
    return a


@wp.func
def change(a: Any, b: Any):
    """Sum of the squares of the differences of two wrenches' components."""
    f = a.force - b.force
    m = a.torque - b.torque
    return dot(f, f) + dot(m, m)


def make_conservative(View, Wrench, potential):
    """(x, c, h) -> the wrench of the conservative laws."""

    @wp.func
    def conservative(x: Any, c: Any, h: Any):
        w = Wrench()
        if wp.static(potential is not None):
            w = potential(w, look(View(), x, c, h), c.params)
        return w

    return conservative


def make_remember(View, evolve):
    """(x, c, h, to_middle): laws that remember, over all of h."""

    @wp.func
    def remember(x: Any, c: Any, h: Any, to_middle: Any):
        """Laws that remember, over all of h; the middle of h lies `to_middle` after the state's time."""
        if wp.static(evolve is not None):
            view = look(View(), x, c, h)
            view.t = view.t + to_middle
            view = evolve(view, view, c.params)
            view.second = 1
            view = evolve(view, view, c.params)
        return x

    return remember


def make_phi(maps, laws, alpha, beta, account=None):
    """(Phi, Phi*). maps: Ab, Ap, D; laws: View, Wrench, potential, forces, current, evolve, velocities.

    account: the energy used (see accounting.make_map_account), at the end of Phi and the begin of Phi*.
    """
    Ab, Ap, D = maps
    View, Wrench, potential, forces, current, evolve, velocities = laws
    equation_15 = make_equation_15(alpha, beta)
    conservative, remember = make_conservative(View, Wrench, potential), make_remember(View, evolve)

    @wp.func
    def munk(x: Any, c: Any, h: Any):
        if wp.static(Ap is not None):
            x = Ap(x, c, h)
        return x

    @wp.func
    def Phi(x: Any, c: Any, h: Any):
        """Eq. (10)-(16), in the order they appear: explicit but for (10)."""
        x = remember(x, c, h, h.dtype(0.5) * h)
        nu, Om = velocities(c.inertia, x.p, x.pi)
        old = forces(x, c, h, nu, Om)
        u = current(x, c, h)
        x = Ab(x, c, h)
        x = moved(x, h * u)
        x = D(x, c, h)
        w = equation_15(old, forces(x, c, h, nu, Om), h)
        x = kicked(x, c, h, sum_of(w, conservative(x, c, h)))
        x = munk(x, c, h)
        if wp.static(account is not None):
            account(x, c, h)
        return x

    @wp.func
    def attempt(x: Any, c: Any, h: Any, w: Any, u: Any):
        """Eq. (19)-(23) with w for phi*, tau* and the potential's force, and u for the velocity of the water."""
        x = munk(x, c, h)
        x = kicked(x, c, h, w)
        x = D(x, c, h)
        x = Ab(x, c, h)
        x = moved(x, h * u)
        return x

    @wp.func
    def Phi_adjoint(x: Any, c: Any, h: Any):
        """Eq. (19)-(23): phi* and tau*, which depend on all that is new, by fixed-point iteration in each lane."""
        if wp.static(account is not None):
            account(x, c, h)
        w = conservative(x, c, h)
        nu, Om = velocities(c.inertia, x.p, x.pi)
        w_star = forces(x, c, h, nu, Om)
        u = current(x, c, h)
        y = attempt(x, c, h, sum_of(w, w_star), u)
        tolerance = c.force_tolerance * c.force_tolerance
        zero = ones(x.b.x) - ones(x.b.x)
        pending = ones(zero)
        k = int(0)
        while k < wp.static(MOST_ITERATIONS) and any_positive(pending):
            nu_1, Om_1 = velocities(c.inertia, y.p, y.pi)
            new = equation_15(forces(y, c, h, nu_1, Om_1), forces(x, c, h, nu_1, Om_1), h)
            u_1 = current(y, c, h)
            d = u_1 - u
            # The kick in units of the momenta, which are divided by max J.
            size = h * c.inertia.inverse_scale
            # Round-off is relative to the impulse of the forces, which may be all there is.
            impulse = (size * size) * (dot(new.force, new.force) + dot(new.torque, new.torque))
            momenta = dot(y.p, y.p) + dot(y.pi, y.pi)
            kick = (size * size) * change(new, w_star) - tolerance * (momenta + impulse)
            drift = dot(d, d) - tolerance * dot(u, u)
            w_star.force = positive(pending, new.force, w_star.force)
            w_star.torque = positive(pending, new.torque, w_star.torque)
            u = positive(pending, u_1, u)
            y = attempt(x, c, h, sum_of(w, w_star), u)
            pending = positive(pending, positive(kick, kick, drift), zero)
            k += 1
        failed = h.dtype(wp.static(float(FORCES_NOT_CONVERGED))) * ones(zero)
        y.alarm.size = positive(y.alarm.code, y.alarm.size, positive(pending, pending, y.alarm.size))
        y.alarm.code = positive(y.alarm.code, y.alarm.code, positive(pending, failed, zero))
        return remember(y, c, h, h.dtype(-0.5) * h)

    return Phi, Phi_adjoint
