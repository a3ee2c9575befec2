# SPDX-License-Identifier: Apache-2.0
"""Common parts of laws of the pose: errors on SE(3), their integrals, and the balance of weight and buoyancy."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.integral import integral3, remember3, remembered3, unhindered


@functools.cache
def pose_params(name, gains, width, real):
    """The struct of a law of the pose: gains, vectors by name; limits of the integrals; net_weight and moment, of `balance`.

    Then the first of twelve rows of the memory, I, I_R, e_b and e_R; the first of six rows of what was not delivered.
    """
    numbers = dict.fromkeys(("position_limit", "attitude_limit", "net_weight"), lane(width, real))
    vectors = dict.fromkeys((*gains, "moment"), lane3(width, real))
    return struct(name, **numbers, **vectors, memory=wp.int32, unmet=wp.int32, conditional=wp.int32)


@wp.func
def attitude_error(r: Any, y: Any):
    """e_R = vee(R_d^T R - R^T R_d) / 2, body axes: half the sum of R_i x R_d,i, R_i the directions of inertial axes."""
    return y.period.dtype(0.5) * (cross(y.north, r.north) + cross(y.east, r.east) + cross(y.down, r.down))


@wp.func
def velocity_error(r: Any, y: Any):
    """R^T v_d - nu: wanted less measured velocity, body axes."""
    return to_body(y, r.velocity) - y.velocity


@wp.func
def rate_error(r: Any, y: Any):
    """R^T R_d Omega_d - Omega: wanted less measured angular velocity, body axes."""
    return to_body(y, to_inertial(r, r.angular_velocity)) - y.angular_velocity


@wp.func
def position_integral(y: Any, p: Any, e: Any):
    """I of e_b, inertial axes; e, that of this tick, is kept for the next one.

    It waits along the body's axes: these are the ones along which actuators push.
    """
    error = to_body(y, remembered3(y, p.memory + 6))
    error = unhindered(error, remembered3(y, p.unmet), p.conditional)
    remember3(y, p.memory + 6, e)
    return integral3(y, p.memory, p.position_limit, to_inertial(y, error))


@wp.func
def attitude_integral(y: Any, p: Any, e: Any):
    """I_R of e_R, body axes; the demand goes against it."""
    error = unhindered(remembered3(y, p.memory + 9), neg(remembered3(y, p.unmet + 3)), p.conditional)
    remember3(y, p.memory + 9, e)
    return integral3(y, p.memory + 3, p.attitude_limit, error)


@wp.func
def balance(w: Any, y: Any, p: Any, force: Any, torque: Any):
    """w plus force and torque, plus what balances weight and buoyancy, whose moment is p.moment x down."""
    w.force = w.force + force - p.net_weight * y.down
    w.torque = w.torque + torque + cross(y.down, p.moment)
    return w
