"""All laws of a scene at one state and its velocities: the force and torque on the vehicle, and the water's velocity."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, sub  # noqa: F401
from lgvi_kernels.maps.dissipation import damped_force, damped_torque
from lgvi_kernels.maps.submaps import look, make_at_user_origin
from lgvi_kernels.maps.water import acceleration_wrench


def make_forces(View, Wrench, Flow, Damping, force, damping, flow, flow_varies, shifted):
    """(everything, forces, current, doubled) of these laws; an argument is None where a scene has no such law (see make_K)."""
    at_user_origin = make_at_user_origin(shifted)

    @wp.func
    def water_at(view: Any, x: Any, c: Any):
        water = Flow()
        if wp.static(flow is not None):
            water = flow(water, at_user_origin(view, x, c), c.params)
        return water

    @wp.func
    def everything(w: Any, x: Any, c: Any, h: Any, nu: Any, Om: Any):
        """(w plus force and torque in body axes, the water's velocity in inertial axes): laws of water are called once."""
        view = look(View(), x, c, h)
        water = water_at(view, x, c)
        view.nu = nu
        view.Om = Om
        if wp.static(force is not None):
            w = force(w, view, c.params)
        if wp.static(flow_varies):
            w = acceleration_wrench(w, view, c.inertia, water)
        if wp.static(damping is not None):
            D = damping(Damping(), view, water, c)
            w.force = w.force - damped_force(D, nu, Om)
            w.torque = w.torque - damped_torque(D, nu, Om)
        return w, water.velocity

    @wp.func
    def forces(x: Any, c: Any, h: Any, nu: Any, Om: Any):
        """phi(b, nu, R, Om), tau(b, nu, R, Om)."""
        w, u = everything(Wrench(), x, c, h, nu, Om)
        return w

    @wp.func
    def current(x: Any, c: Any, h: Any):
        """The water's velocity where the vehicle is, inertial axes."""
        return water_at(look(View(), x, c, h), x, c).velocity

    @wp.func
    def doubled(x: Any, c: Any, h: Any, nu: Any, Om: Any):
        """D of twice the velocity: the derivative of D nu where each column grows as the size of its velocity, or not at all."""
        view = look(View(), x, c, h)
        water = water_at(view, x, c)
        view.nu = nu + nu
        view.Om = Om + Om
        return damping(Damping(), view, water, c)

    return everything, forces, current, doubled
