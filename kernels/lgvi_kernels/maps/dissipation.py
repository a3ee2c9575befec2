"""V: laws of the form (force; torque) = -D(nu) (nu; Om), advanced by a linearly implicit step of order 2.

D is frozen at a velocity predicted for the middle of the step; with D frozen, two stages of the L-stable scheme with
gamma = 1 - 1/sqrt(2) (Alexander 1977) solve I6 nu' = -D nu. Stiff drag decays, whatever the step; for D + D^T >= 0 the
kinetic energy never grows. Nothing is iterated.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, mul, neg, sub  # noqa: F401
from lgvi_kernels.lanes.matrix3 import apply, combine, factorise, solve6, symmetric, transposed
from lgvi_kernels.lanes.sums import pushed, twisted

GAMMA = 1.0 - 0.5**0.5


@wp.func
def damped_force(D: Any, nu: Any, Om: Any):
    """The force's part of D (nu; Om)."""
    return apply(D.force_velocity, nu) + apply(D.force_rate, Om)


@wp.func
def damped_torque(D: Any, nu: Any, Om: Any):
    """The torque's part of D (nu; Om)."""
    return apply(D.torque_velocity, nu) + apply(D.torque_rate, Om)


def make_V(damping, velocities, Damping, Factor, coupled):
    """The step with the sum of these damping laws; `velocities` gives (nu, Om) at the origin of the forces."""

    @wp.func
    def implicit(D: Any, inertia: Any, h: Any):
        """I6 + h D, factorised. h is divided by max J, as the inertia is."""
        none = Damping()
        a = combine(symmetric(none.force_velocity, inertia.M), h, D.force_velocity)
        d = combine(symmetric(none.torque_rate, inertia.J_forces), h, D.torque_rate)
        b = none.force_rate
        c = none.torque_velocity
        if wp.static(coupled):
            b = inertia.C
            c = transposed(inertia.C)
        return factorise(Factor(), a, combine(b, h, D.force_rate), combine(c, h, D.torque_velocity), d)

    @wp.func
    def V(x: Any, view: Any, water: Any, c: Any, h: Any):
        scaled = h * c.inertia.inverse_scale
        nu, Om = velocities(c.inertia, x.p, x.pi)
        view.nu = nu
        view.Om = Om
        start = damping(Damping(), view, water, c)
        predictor = implicit(start, c.inertia, h.dtype(0.5) * scaled)
        nu_half, Om_half = solve6(predictor, x.p, x.pi)
        view.nu = nu_half
        view.Om = Om_half
        D = damping(Damping(), view, water, c)
        gamma = h.dtype(wp.static(GAMMA)) * scaled
        factor = implicit(D, c.inertia, gamma)
        nu_1, Om_1 = solve6(factor, x.p, x.pi)
        x = pushed(x, (gamma - scaled) * damped_force(D, nu_1, Om_1))
        x = twisted(x, (gamma - scaled) * damped_torque(D, nu_1, Om_1))
        nu_2, Om_2 = solve6(factor, x.p, x.pi)
        x = pushed(x, -gamma * damped_force(D, nu_2, Om_2))
        return twisted(x, -gamma * damped_torque(D, nu_2, Om_2))

    return V
