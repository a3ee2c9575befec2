# SPDX-License-Identifier: Apache-2.0
"""Laws that look at the water, at any point of the vehicle: their functions are made for the flows of a scene.

A law's `seeing(water_at)` gives `load(D, w, view, p, sea)`, which adds to a damping matrix and to a wrench: the force and the
torque are w - D (nu; Om), of which a splitting makes D implicit; and `push(w, view, p, sea)`, all of it at once, for explicit
methods. water_at(view, point, sea) is the water at a point of the body, from the origin of the forces.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add  # noqa: F401
from lgvi_kernels.lanes.state import flow_struct, view_struct
from lgvi_kernels.lanes.view import to_inertial
from lgvi_kernels.maps.bounded import make_bounded, make_unbounded
from lgvi_kernels.maps.compose import superpose


class SeeingLaw:
    """A law with the functions that it makes for the water of a scene; all else is the law's own."""

    def __init__(self, law, roles):
        self.device, self.SEES = law, frozenset(roles)
        vars(self).update(roles)

    def __getattr__(self, name):
        return getattr(self.device, name)


def sees(law):
    """Whether a law looks at the water."""
    return hasattr(law, "seeing")


def seeing_laws(laws, width, real, shared, flow=None):
    """The laws, with functions for the water of these laws where they look at it; flow: that water, by default theirs."""
    if not any(map(sees, laws)):
        return laws
    water_at = make_water_at(flow_struct(width, real), flow or superpose(laws, "flow"))
    return tuple(_seeing(law, water_at, width, real, shared) if sees(law) else law for law in laws)


def make_water_at(Flow, flow):
    """(view, point, sea) -> the water there; still water where no law moves it."""

    @wp.func
    def water_at(view: Any, point: Any, sea: Any):
        """The water at a point of the body [m], body axes, from the origin of the forces."""
        water = Flow()
        if wp.static(flow is not None):
            view.b = view.b + to_inertial(view, point)
            water = flow(water, view, sea)
        return water

    return water_at


def seeing_spec(spec):
    """The Spec with functions for its water in the laws that look at it."""
    return spec._replace(laws=seeing_laws(spec.laws, spec.lanes, spec.real, spec.shared_rows))


def _seeing(law, water_at, width, real, shared):
    if not getattr(law, "BOUNDED", False):
        return SeeingLaw(law, law.seeing(water_at))
    bounded, unbounded = make_bounded(width, real, shared), make_unbounded(view_struct(width, real, shared))

    @wp.func
    def bounded_water_at(view: Any, point: Any, sea: Any):
        return water_at(unbounded(view), point, sea)

    roles = law.seeing(bounded_water_at)
    held = {}
    if "load" in roles:
        held["load"] = _held_load(roles["load"], bounded)
    if "push" in roles:
        held["push"] = _held_push(roles["push"], bounded)
    return SeeingLaw(law, held)


def _held_load(load, bounded):
    @wp.func
    def held_load(D: Any, w: Any, view: Any, p: Any, sea: Any):
        return load(D, w, bounded(view, p.bounds), p.own, sea)

    return held_load


def _held_push(push, bounded):
    @wp.func
    def held_push(w: Any, view: Any, p: Any, sea: Any):
        return push(w, bounded(view, p.bounds), p.own, sea)

    return held_push
