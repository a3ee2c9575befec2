# SPDX-License-Identifier: Apache-2.0
"""V: laws of the form (force; torque) = w - D(nu) (nu; Om), advanced by a linearly implicit step of order 2.

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


def make_implicit(Damping, Factor, coupled):
    """The matrix of an implicit step, factorised; coupled: M and J are."""

    @wp.func
    def implicit(D: Any, inertia: Any, h: Any):
        """I6 + h D, factorised. Where the inertia is divided by max J, h is too."""
        # Blocks of zeros: two to write the symmetric matrices into, two that stay zero where nothing couples.
        zeros = Damping()
        a = combine(symmetric(zeros.force_velocity, inertia.M), h, D.force_velocity)
        d = combine(symmetric(zeros.torque_rate, inertia.J_forces), h, D.torque_rate)
        b = zeros.force_rate
        c = zeros.torque_velocity
        if wp.static(coupled):
            b = inertia.C
            c = transposed(inertia.C)
        return factorise(Factor(), a, combine(b, h, D.force_rate), combine(c, h, D.torque_velocity), d)

    return implicit


def make_V(damping, velocities, Damping, Factor, coupled):
    """The step with the sum of these damping laws; `velocities`: (inertia, p, pi) -> (nu, Om) at the origin of the forces.

    docs/theory/splitting.md, (S14).
    """
    implicit = make_implicit(Damping, Factor, coupled)

    @wp.func
    def V(x: Any, view: Any, water: Any, c: Any, h: Any):
        """I6 nu' = -D nu over h, b and R fixed."""
        # D of the velocity that half an implicit Euler step predicts for the middle: with D of the start the order is 1.
        scaled = h * c.inertia.inverse_scale
        nu, Om = velocities(c.inertia, x.p, x.pi)
        view.nu = nu
        view.Om = Om
        D_start = damping(Damping(), view, water, c)
        predictor = implicit(D_start, c.inertia, h.dtype(0.5) * scaled)
        nu_half, Om_half = solve6(predictor, x.p, x.pi)
        view.nu = nu_half
        view.Om = Om_half
        D = damping(Damping(), view, water, c)
        gamma = h.dtype(wp.static(GAMMA)) * scaled
        # Two stages with weights 1 - gamma and gamma and one matrix, which is factorised once.
        factor = implicit(D, c.inertia, gamma)
        nu_1, Om_1 = solve6(factor, x.p, x.pi)
        x = pushed(x, (gamma - scaled) * damped_force(D, nu_1, Om_1))
        x = twisted(x, (gamma - scaled) * damped_torque(D, nu_1, Om_1))
        nu_2, Om_2 = solve6(factor, x.p, x.pi)
        x = pushed(x, -gamma * damped_force(D, nu_2, Om_2))
        return twisted(x, -gamma * damped_torque(D, nu_2, Om_2))

    return V


def make_loaded_V(damping, loads, velocities, Damping, Wrench, Factor, coupled):
    """The step with these damping laws and the loads (D, w) of laws that look at the water: I6 nu' = w - D nu."""
    implicit = make_implicit(Damping, Factor, coupled)

    @wp.func
    def resistance(view: Any, water: Any, c: Any):
        """D of all that resists, and w."""
        D, w = loads(damping(Damping(), view, water, c), Wrench(), view, c.params)
        return D, w

    @wp.func
    def damped(x: Any, D: Any, w: Any, nu: Any, Om: Any, h: Any):
        """The momenta after h of the force and torque w - D (nu; Om)."""
        x = pushed(x, h * (w.force - damped_force(D, nu, Om)))
        return twisted(x, h * (w.torque - damped_torque(D, nu, Om)))

    @wp.func
    def V(x: Any, view: Any, water: Any, c: Any, h: Any):
        """As V of make_V, with w frozen where D is: what is steady in the end is found, however strong D is."""
        scaled = h * c.inertia.inverse_scale
        half = h.dtype(0.5) * scaled
        nu, Om = velocities(c.inertia, x.p, x.pi)
        view.nu = nu
        view.Om = Om
        D_start, w_start = resistance(view, water, c)
        predictor = implicit(D_start, c.inertia, half)
        nu_half, Om_half = solve6(predictor, x.p + half * w_start.force, x.pi + half * w_start.torque)
        view.nu = nu_half
        view.Om = Om_half
        D, w = resistance(view, water, c)
        gamma = h.dtype(wp.static(GAMMA)) * scaled
        factor = implicit(D, c.inertia, gamma)
        nu_1, Om_1 = solve6(factor, x.p + gamma * w.force, x.pi + gamma * w.torque)
        x = damped(x, D, w, nu_1, Om_1, scaled - gamma)
        nu_2, Om_2 = solve6(factor, x.p + gamma * w.force, x.pi + gamma * w.torque)
        return damped(x, D, w, nu_2, Om_2, gamma)

    return V
