# SPDX-License-Identifier: Apache-2.0
"""Drag, side force, lift and moments of a hull with wings, along the axes of the flow, by angle of attack and sideslip.

With u, v, w the velocity ahead, aside and below, V its size, s = sqrt(u^2 + w^2), and the axes of the flow x = (u, v, w) / V,
z = (-w, 0, u) / s, y = z x x: what acts along x is in proportion to (u, v, w), what acts along y and z is an antisymmetric
matrix times it.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

# Less than any speed [m/s], and within float32; the least s / V with which the axes y and z are formed.
STILL, LEAST_PART = 1e-30, 1e-3
COEFFICIENTS = (
    "drag", "drag_by_attack", "side_by_slip", "lift", "lift_by_attack",
    "roll_by_slip", "pitch", "pitch_by_attack", "yaw_by_slip",
)  # fmt: skip


@functools.cache
def params(width, real):
    """Params: the body's origin; its axes ahead, aside and below; coefficients as of the Term."""
    Lane, Lane3 = lane(width, real), lane3(width, real)
    axes = dict.fromkeys(("origin", "ahead", "aside", "below", "moment_by_rate"), Lane3)
    return struct("Polar", **axes, **dict.fromkeys(COEFFICIENTS, Lane))


@wp.func
def flow_in_axes(view: Any, p: Any):
    """(u, v, w) of the body's origin along its own axes, and (V, 1 / s, the angles of attack and of sideslip)."""
    velocity = velocity_at(view, p.origin)
    u = dot(p.ahead, velocity)
    v = dot(p.aside, velocity)
    w = dot(p.below, velocity)
    s = root(u * u + w * w)
    speed = root(s * s + v * v)
    unity = ones(u)
    least_s = greatest(view.h.dtype(wp.static(LEAST_PART)) * speed, view.h.dtype(wp.static(STILL)) * unity)
    return vec3(u, v, w), speed, unity / greatest(s, least_s), arctangent2(w, u), arctangent2(v, s)


@wp.func
def force_sizes(p: Any, speed: Any, over: Any, attack: Any, slip: Any):
    """(d, l, b): the force is -d (u, v, w) + l (w, 0, -u) + b (-u v, s^2, -w v)."""
    d = (p.drag + p.drag_by_attack * (attack * attack)) * speed
    l = (p.lift + p.lift_by_attack * attack) * (speed * speed * over)  # noqa: E741
    b = (p.side_by_slip * slip) * (speed * over)
    return d, l, b


@wp.func
def moment_sizes(p: Any, speed: Any, over: Any, attack: Any, slip: Any):
    """The same of the moment that does not depend on the angular velocity."""
    d = -(p.roll_by_slip * slip) * speed
    l = -(p.yaw_by_slip * slip) * (speed * speed * over)  # noqa: E741
    b = (p.pitch + p.pitch_by_attack * attack) * (speed * over)
    return d, l, b


@wp.func
def in_body(p: Any, v: Any):
    """A vector along the user's axes in the kernel's."""
    return v.x * p.ahead + v.y * p.aside + v.z * p.below


@wp.func
def along_flow(flow: Any, d: Any, l: Any, b: Any):  # noqa: E741
    """-d (u, v, w) + l (w, 0, -u) + b (-u v, s^2, -w v)."""
    side = b * flow.x
    below = b * flow.z
    x = l * flow.z - side * flow.y - d * flow.x
    y = side * flow.x + below * flow.z - d * flow.y
    return vec3(x, y, -(l * flow.x) - below * flow.y - d * flow.z)


@wp.func
def rate_moments(flow: Any, p: Any, speed: Any, over: Any):
    """The moments of an angular velocity of 1 rad/s about each of the body's axes: V^2 k along x, y and z of the flow."""
    zero = speed - speed
    k = p.moment_by_rate
    x = (k.x * speed) * flow
    y = along_flow(flow, zero, zero, k.y * (speed * over))
    z = along_flow(flow, zero, -(k.z * (speed * speed * over)), zero)
    return in_body(p, x), in_body(p, y), in_body(p, z)


@wp.func
def push(w: Any, view: Any, p: Any):
    """w and force and moment, about the body's origin."""
    flow, speed, over, attack, slip = flow_in_axes(view, p)
    d, l, b = force_sizes(p, speed, over, attack, slip)  # noqa: E741
    f = in_body(p, along_flow(flow, d, l, b))
    d, l, b = moment_sizes(p, speed, over, attack, slip)  # noqa: E741
    torque = in_body(p, along_flow(flow, d, l, b)) + cross(p.origin, f)
    x, y, z = rate_moments(flow, p, speed, over)
    w.force = w.force + f
    w.torque = w.torque + torque + dot(p.ahead, view.Om) * x + dot(p.aside, view.Om) * y + dot(p.below, view.Om) * z
    return w


@wp.func
def add_column(D: Any, p: Any, force: Any, torque: Any, axis: Any):
    """D and force and torque, along the user's axes about the body's origin, for each unit of its velocity along an axis."""
    f = in_body(p, force)
    return add_outer(D, -f, -(in_body(p, torque) + cross(p.origin, f)), axis, cross(p.origin, axis))


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D: of force and moment the columns of -d 1 + (antisymmetric), and the moments by angular velocity."""
    flow, speed, over, attack, slip = flow_in_axes(view, p)
    d, l, b = force_sizes(p, speed, over, attack, slip)  # noqa: E741
    e, m, c = moment_sizes(p, speed, over, attack, slip)
    zero = speed - speed
    u = flow.x
    w = flow.z
    D = add_column(D, p, vec3(-d, b * u, -l), vec3(-e, c * u, -m), p.ahead)
    D = add_column(D, p, vec3(-(b * u), -d, -(b * w)), vec3(-(c * u), -e, -(c * w)), p.aside)
    D = add_column(D, p, vec3(l, b * w, -d), vec3(m, c * w, -e), p.below)
    x, y, z = rate_moments(flow, p, speed, over)
    none = vec3(zero, zero, zero)
    D = add_outer(D, none, -x, none, p.ahead)
    D = add_outer(D, none, -y, none, p.aside)
    return add_outer(D, none, -z, none, p.below)
