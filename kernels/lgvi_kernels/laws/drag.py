# SPDX-License-Identifier: Apache-2.0
"""Drag per axis, -(l + q|v|) v, by its exact flow E: v -> v e^-x / (1 + (h q|v|/I) (1 - e^-x)/x), x = h l / I.

E is the solution of I v' = -(l + q|v|) v on one axis, exact at any h, and exact altogether where the axes of drag are
principal axes of M and J. (Where they are not, drag_directions.py takes its place.)
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.sums import pushed, twisted
from lgvi_kernels.law import *

PARTS = ("linear_force", "linear_torque", "quadratic_force", "quadratic_torque")


# L / I [1/s] of force and torque, and q / I per momentum divided by max J, as it is kept.
params = make_params("Drag", vectors="linear_force linear_torque quadratic_force quadratic_torque")


@functools.cache
def flow_struct(width, real):
    """Per axis, for one length of step: e^-x (1 - e^-x by changes) and (h q/I) (1 - e^-x)/x, of force and torque."""
    Lane3 = lane3(width, real)
    return struct("DragFlow", decay_force=Lane3, decay_torque=Lane3, gain_force=Lane3, gain_torque=Lane3, h=real)


@wp.func
def decay3(x: Any):
    """(1 - e^-x)/x on each of three axes."""
    return vec3(decay(x.x), decay(x.y), decay(x.z))


@wp.func
def remaining(x: Any, s: Any):
    """e^-x from s = (1 - e^-x)/x; beyond x = 37, where only the round-off of the difference is left, 0."""
    unity = ones(x)
    return positive(x - unity.dtype(37.0) * unity, unity - unity, unity - x * s)


@wp.func
def remaining3(x: Any, s: Any):
    """The same on each of three axes."""
    return vec3(remaining(x.x, s.x), remaining(x.y, s.y), remaining(x.z, s.z))


@wp.func
def size3(v: Any):
    """The sizes of three components."""
    return vec3(absolute(v.x), absolute(v.y), absolute(v.z))


def make_resistance(parts):
    """The same drag for methods that ask for rates, with the parts of PARTS that some member has."""
    linear_force, linear_torque, quadratic_force, quadratic_torque = (part in parts for part in PARTS)

    @wp.func
    def resisted(k: Any, x: Any, p: Any):
        """p' = -(l/I + q/I |p|) p added to the rates, pi' likewise."""
        if wp.static(linear_force):
            k.p = k.p - p.linear_force * x.p
        if wp.static(quadratic_force):
            k.p = k.p - p.quadratic_force * size3(x.p) * x.p
        if wp.static(linear_torque):
            k.pi = k.pi - p.linear_torque * x.pi
        if wp.static(quadratic_torque):
            k.pi = k.pi - p.quadratic_torque * size3(x.pi) * x.pi
        return k

    return resisted


def make_taken(linear, quadratic):
    """(v, gain, loss) -> v (1 - loss) / (1 + gain |v|) - v per axis, without a difference of large numbers."""

    @wp.func
    def taken(v: Any, gain: Any, loss: Any):
        minus_one = v.x.dtype(-1.0)
        if wp.static(quadratic):
            unity = vec3(ones(v.x), ones(v.x), ones(v.x))
            g = gain * size3(v)
            if wp.static(linear):
                return minus_one * (((g + loss) / (unity + g)) * v)
            return minus_one * ((g / (unity + g)) * v)
        return minus_one * (loss * v)

    return taken


def make_E(parts, by_changes):
    """(prepare, E) with the parts of PARTS that some member has.

    by_changes: momenta change by what E takes off them, as compensated sums need it. A factor has more digits where drag
    leaves little of a momentum, a change where it takes little off.
    """
    linear_force, linear_torque, quadratic_force, quadratic_torque = (part in parts for part in PARTS)

    @wp.func
    def prepare(e: Any, p: Any, h: Any):
        """The constants of E for steps of h, made before the loop over steps: there it has no exponential."""
        e.h = h
        if wp.static(linear_force):
            x = h * p.linear_force
            s = decay3(x)
            e.decay_force = x * s
            if wp.static(not by_changes):
                e.decay_force = remaining3(x, s)
            if wp.static(quadratic_force):
                e.gain_force = h * (p.quadratic_force * s)
        else:
            if wp.static(quadratic_force):
                e.gain_force = h * p.quadratic_force
        if wp.static(linear_torque):
            y = h * p.linear_torque
            t = decay3(y)
            e.decay_torque = y * t
            if wp.static(not by_changes):
                e.decay_torque = remaining3(y, t)
            if wp.static(quadratic_torque):
                e.gain_torque = h * (p.quadratic_torque * t)
        else:
            if wp.static(quadratic_torque):
                e.gain_torque = h * p.quadratic_torque
        return e

    force, torque = linear_force or quadratic_force, linear_torque or quadratic_torque
    taken_from_p = make_taken(linear_force, quadratic_force)
    taken_from_pi = make_taken(linear_torque, quadratic_torque)

    @wp.func
    def E_by_changes(x: Any, e: Any, c: Any):
        """The same as E, by what it takes off: a momentum loses no digit of a small change."""
        if wp.static(force):
            x = pushed(x, taken_from_p(x.p, e.gain_force, e.decay_force))
        if wp.static(torque):
            x = twisted(x, taken_from_pi(x.pi, e.gain_torque, e.decay_torque))
        return x

    @wp.func
    def slowed(v: Any, gain: Any):
        """v / (1 + gain |v|) per axis."""
        unity = ones(v.x)
        return vec3(
            v.x / (unity + gain.x * absolute(v.x)),
            v.y / (unity + gain.y * absolute(v.y)),
            v.z / (unity + gain.z * absolute(v.z)),
        )

    @wp.func
    def E(x: Any, e: Any, c: Any):
        """The exact flow of drag alone over e.h."""
        p = x.p
        pi = x.pi
        if wp.static(quadratic_force):
            p = slowed(p, e.gain_force)
        if wp.static(linear_force):
            p = e.decay_force * p
        if wp.static(quadratic_torque):
            pi = slowed(pi, e.gain_torque)
        if wp.static(linear_torque):
            pi = e.decay_torque * pi
        x.p = p
        x.pi = pi
        return x

    return prepare, E_by_changes if by_changes else E
