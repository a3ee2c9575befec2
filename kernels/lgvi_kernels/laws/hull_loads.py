# SPDX-License-Identifier: Apache-2.0
"""Loads on the strips of a slender hull by varying water, beyond those of the water at the body's origin.

Each strip carries the momentum a w per length across the hull's axis, w its velocity through the water where it is. With
alpha = Du/Dt of the water, U the strip's velocity through it along the axis, and G = du/db, the force per length is

    f = rho S alpha - d(a w)/dt + d(U a w)/dx - a G^T w - c |w| w

(Lighthill 1960; Newman 1977, 7.4). For water that is everywhere as at the origin, and for the force of its slopes there, the
kernel has all of it but drag (maps/water.py): strips add the difference.
"""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.cross_flow import add_across

# Rows of a strip: station [m]; rho / 2 times drag coefficient and breadth; rho S; what the change of the section along the
# hull adds to the moment of the pressure; added mass: each of the last four times the strip's length.
ROWS = 5


# Axis, the unit vector along the hull, a and b across it, axis x a = b; origin, the user's.
# The origin is taken from that of the forces; a_arm, b_arm: origin x a and b. Rows: ROWS for each of `count` strips.
params = make_params("HullLoads", vectors="axis origin a b a_arm b_arm", words="first count")


@wp.func
def off_axis(axis: Any, v: Any):
    """The part of v across the axis."""
    return v - dot(axis, v) * axis


def seeing(water_at):
    """Its functions, which look at the water at each strip."""

    def make_strips(implicit):
        """The sums over strips; implicit: of drag, only what the water's difference along the hull adds."""

        @wp.func
        def strips(view: Any, p: Any, sea: Any):
            """Force, its moment along the hull, and the moments 0 to 2 of c |w| over stations."""
            e = p.axis
            here = water_at(view, p.origin, sea)
            u_here = to_body(view, here.velocity)
            through = velocity_at(view, p.origin)
            body = through + u_here
            turning = cross(view.Om, e)
            alpha_here = to_body(view, here.rate + slope_along(here, here.velocity))
            change_here = to_body(view, here.rate + slope_along(here, to_inertial(view, body)))
            force = through - through
            moment = force
            S0 = dot(force, force)
            S1 = S0
            S2 = S0
            for i in range(p.count):
                at = p.first + wp.static(ROWS) * i
                x = row1(view, at)
                drag = row1(view, at + 1)
                displaced = row1(view, at + 2)
                added = row1(view, at + 4)
                there = water_at(view, p.origin + x * e, sea)
                du = to_body(view, there.velocity) - u_here
                # Velocities through the water at the origin, and through that at the strip.
                far = through + x * turning
                near = far - du
                w_far = off_axis(e, far)
                w_near = off_axis(e, near)
                alpha = to_body(view, there.rate + slope_along(there, there.velocity)) - alpha_here
                # How the water across the axis changes for the strip, which moves in it and turns.
                moving = slope_along(there, to_inertial(view, body + x * turning))
                change = off_axis(e, to_body(view, there.rate + moving) - change_here)
                change = change - dot(e, du) * turning - dot(du, turning) * e
                held = added * to_body(view, slope_against(there, to_inertial(view, w_near)))
                held_here = added * to_body(view, slope_against(here, to_inertial(view, w_far)))
                s = drag * root(dot(w_near, w_near))
                pushed = displaced * alpha + added * change
                if wp.static(implicit):
                    pushed = pushed + s * off_axis(e, du)
                    S0 = S0 + s
                    S1 = S1 + s * x
                    S2 = S2 + (s * x) * x
                else:
                    pushed = pushed - s * w_near
                force = force + pushed - held + held_here
                moment = moment + x * (pushed - held) + row1(view, at + 3) * alpha
                moment = moment - added * (dot(e, near) * w_near - dot(e, far) * w_far)
            return force, moment, S0, S1, S2

        return strips

    affine, whole = make_strips(True), make_strips(False)

    @wp.func
    def hull_load(D: Any, w: Any, view: Any, p: Any, sea: Any):
        """w, and D + the sum over strips of c |w| t t^T for both directions across (see cross_flow.py)."""
        force, moment, S0, S1, S2 = affine(view, p, sea)
        w.force = w.force + force
        w.torque = w.torque + cross(p.origin, force) + cross(p.axis, moment)
        D = add_across(D, p.a, p.a_arm, p.b, S0, S1, S2)
        return add_across(D, p.b, p.b_arm, p.a, S0, -S1, S2), w

    @wp.func
    def hull_push(w: Any, view: Any, p: Any, sea: Any):
        """All of it at these velocities."""
        force, moment, S0, S1, S2 = whole(view, p, sea)
        w.force = w.force + force
        w.torque = w.torque + cross(p.origin, force) + cross(p.axis, moment)
        return w

    return {"load": hull_load, "push": hull_push}
