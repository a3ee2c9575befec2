# SPDX-License-Identifier: Apache-2.0
"""The loop as an ordinary Warp kernel, one vehicle a thread, as a competent Warp user would write it.

wp.vec3d and wp.quatd throughout, the loop over ticks and steps within the kernel, Warp's default module options.
"""

import numpy as np
import warp as wp

from benchmarks.cases.loop_peers.problem import LIMITS, Way
from lgvi_warp.physics import notation

LIMIT, LIMIT_R = LIMITS
SHARED = ("ki", "kd", "ki_r", "kw", "goal", "M", "J", "d0")


@wp.struct
class Shared:
    """Numbers that all members have."""

    ki: wp.vec3d
    kd: wp.vec3d
    ki_r: wp.vec3d
    kw: wp.vec3d
    goal: wp.vec3d
    R_d: wp.mat33d
    M: wp.vec3d
    J: wp.vec3d
    M_inverse: wp.vec3d
    J_inverse: wp.vec3d
    net0: wp.float64
    d0: wp.vec3d
    linear_force: wp.vec3d
    linear_torque: wp.vec3d
    quadratic_force: wp.vec3d
    quadratic_torque: wp.vec3d


@wp.struct
class State:
    b: wp.vec3d
    q: wp.quatd
    nu: wp.vec3d
    Om: wp.vec3d


@wp.func
def dragged(linear: wp.vec3d, quadratic: wp.vec3d, v: wp.vec3d):
    return wp.cw_mul(linear + wp.cw_mul(quadratic, wp.abs(v)), v)


@wp.func
def within(v: wp.vec3d, limit: wp.float64):
    largest = wp.vec3d(limit, limit, limit)
    return wp.min(wp.max(v, -largest), largest)


@wp.func
def moved(y: State, h: wp.float64, k: State):
    x = State()
    x.b = y.b + h * k.b
    x.q = y.q + h * k.q
    x.nu = y.nu + h * k.nu
    x.Om = y.Om + h * k.Om
    return x


@wp.func
def rates(y: State, force: wp.vec3d, torque: wp.vec3d, net: wp.float64, d: wp.vec3d, c: Shared):
    k = State()
    zero, half, one = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0)
    z = wp.quat_rotate_inv(y.q, wp.vec3d(zero, zero, one))
    p = wp.cw_mul(c.M, y.nu)
    f = wp.cross(p, y.Om) + force + net * z - dragged(c.linear_force, c.quadratic_force, y.nu)
    tau = wp.cross(wp.cw_mul(c.J, y.Om), y.Om) + wp.cross(p, y.nu) + torque - wp.cross(d, z)
    tau = tau - dragged(c.linear_torque, c.quadratic_torque, y.Om)
    k.b = wp.quat_rotate(y.q, y.nu)
    k.q = half * (y.q * wp.quatd(y.Om[0], y.Om[1], y.Om[2], zero))
    k.nu = wp.cw_mul(c.M_inverse, f)
    k.Om = wp.cw_mul(c.J_inverse, tau)
    return k


@wp.kernel(module="unique")
def loop(
    bs: wp.array(dtype=wp.vec3d),
    qs: wp.array(dtype=wp.quatd),
    nus: wp.array(dtype=wp.vec3d),
    Oms: wp.array(dtype=wp.vec3d),
    kps: wp.array(dtype=wp.vec3d),
    krs: wp.array(dtype=wp.vec3d),
    nets: wp.array(dtype=wp.float64),
    ds: wp.array(dtype=wp.vec3d),
    c: Shared,
    h: wp.float64,
    every: int,
    ticks: int,
):
    i = wp.tid()
    kp, kr, net, d = kps[i], krs[i], nets[i], ds[i]
    y = State()
    y.b = bs[i]
    y.q = qs[i]
    y.nu = nus[i]
    y.Om = Oms[i]
    total, total_R, e, e_R = wp.vec3d(), wp.vec3d(), wp.vec3d(), wp.vec3d()
    half, period = wp.float64(0.5) * h, h * wp.float64(every)
    sixth, third = h / wp.float64(6.0), h / wp.float64(3.0)
    for _ in range(ticks):
        y.q = wp.normalize(y.q)
        total = within(total + period * e, wp.float64(wp.static(LIMIT)))
        total_R = within(total_R + period * e_R, wp.float64(wp.static(LIMIT_R)))
        R = wp.quat_to_matrix(y.q)
        e = c.goal - y.b
        e_R = wp.float64(0.5) * (wp.cross(R[0], c.R_d[0]) + wp.cross(R[1], c.R_d[1]) + wp.cross(R[2], c.R_d[2]))
        force = wp.transpose(R) * (wp.cw_mul(kp, e) + wp.cw_mul(c.ki, total)) - wp.cw_mul(c.kd, y.nu) - c.net0 * R[2]
        torque = wp.cross(c.d0, R[2]) - wp.cw_mul(kr, e_R) - wp.cw_mul(c.ki_r, total_R) - wp.cw_mul(c.kw, y.Om)
        for _ in range(every):
            k1 = rates(y, force, torque, net, d, c)
            k2 = rates(moved(y, half, k1), force, torque, net, d, c)
            k3 = rates(moved(y, half, k2), force, torque, net, d, c)
            k4 = rates(moved(y, h, k3), force, torque, net, d, c)
            y = moved(moved(moved(moved(y, sixth, k1), third, k2), third, k3), sixth, k4)
    bs[i] = y.b
    qs[i] = y.q
    nus[i] = y.nu
    Oms[i] = y.Om


def make(problem):
    """The members in arrays, and a launch of the compiled kernel."""
    numbers = problem.numbers

    def array(values, dtype):
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device="cpu")

    def last(q):
        """Warp's quaternions have the scalar last."""
        return np.roll(q, -1, axis=-1)

    c = Shared()
    for name in SHARED:
        setattr(c, name, wp.vec3d(*numbers[name]))
    for name in ("M", "J"):
        setattr(c, f"{name}_inverse", wp.vec3d(*(1.0 / numbers[name])))
    for name in ("linear", "quadratic"):
        for part, values in zip(("force", "torque"), np.split(numbers[name], 2), strict=True):
            setattr(c, f"{name}_{part}", wp.vec3d(*values))
    c.net0, c.R_d = numbers["net0"], wp.mat33d(numbers["R_d"])
    starts = [array(numbers["b"], wp.vec3d), array(last(notation.quaternion_from_matrix(numbers["R"])), wp.quatd)]
    starts += [array(numbers[name], wp.vec3d) for name in ("nu", "Om")]
    states = [wp.clone(x) for x in starts]
    varied = [array(numbers["kp"], wp.vec3d), array(numbers["kr"], wp.vec3d)]
    varied += [array(numbers["net"], wp.float64), array(numbers["d"], wp.vec3d)]
    inputs = [*states, *varied, c, wp.float64(problem.h), problem.every, problem.ticks]
    launch = wp.launch(loop, problem.members, inputs=inputs, device="cpu", record_cmd=True)

    def begin():
        for state, start in zip(states, starts, strict=True):
            wp.copy(state, start)

    def end():
        return states[0].numpy(), notation.matrix_from_quaternion(np.roll(states[1].numpy(), 1, axis=-1))

    return Way(begin, launch.launch, end)
