# SPDX-License-Identifier: Apache-2.0
"""The loop in numba, one vehicle after the other: small functions that are inlined, every number of a state in a register."""

import math

import numba as nb
import numpy as np

from benchmarks.cases.loop_peers.problem import LIMITS, Way
from lgvi_warp.physics import notation

njit = nb.njit(fastmath=False, error_model="numpy", inline="always")
LIMIT, LIMIT_R = LIMITS


@njit
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit
def plus(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit
def minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit
def times(a, b):
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@njit
def along(s, a):
    return s * a[0], s * a[1], s * a[2]


@njit
def dragged(linear, quadratic, v):
    return (
        (linear[0] + quadratic[0] * abs(v[0])) * v[0],
        (linear[1] + quadratic[1] * abs(v[1])) * v[1],
        (linear[2] + quadratic[2] * abs(v[2])) * v[2],
    )


@njit
def rows(q):
    """The rows of the matrix of a unit quaternion, scalar first."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@njit
def turned(q, v):
    """R v."""
    s = q[1], q[2], q[3]
    t = along(2.0, cross(s, v))
    return plus(plus(v, along(q[0], t)), cross(s, t))


@njit
def to_body(R, v):
    """R^T v from the rows of R."""
    return plus(along(v[0], R[0]), plus(along(v[1], R[1]), along(v[2], R[2])))


@njit
def within(a, limit):
    return min(max(a[0], -limit), limit), min(max(a[1], -limit), limit), min(max(a[2], -limit), limit)


@njit
def moved(y, h, k):
    b, q, nu, Om = y
    q_rate = k[1]
    q = q[0] + h * q_rate[0], q[1] + h * q_rate[1], q[2] + h * q_rate[2], q[3] + h * q_rate[3]
    return plus(b, along(h, k[0])), q, plus(nu, along(h, k[2])), plus(Om, along(h, k[3]))


def make_advance(numbers, h, every, ticks):
    """(b, q, nu, Om, kp, kr, net, d), each (n, ...), to the end, in place; numbers that all members share are constants."""
    three = {name: tuple(float(x) for x in value) for name, value in numbers.items() if np.shape(value) == (3,)}
    ki, kd, ki_r, kw, goal, M, J, d0 = (three[name] for name in ("ki", "kd", "ki_r", "kw", "goal", "M", "J", "d0"))
    lighter, slower = tuple(1.0 / x for x in M), tuple(1.0 / x for x in J)
    linear, quadratic = (tuple(float(x) for x in numbers[name]) for name in ("linear", "quadratic"))
    l_force, l_torque, q_force, q_torque = linear[:3], linear[3:], quadratic[:3], quadratic[3:]
    wanted = tuple(tuple(float(x) for x in row) for row in numbers["R_d"])
    net0, period = float(numbers["net0"]), h * every

    @njit
    def rates(y, force, torque, net, d):
        _, q, nu, Om = y
        w, x, y_, z_ = q
        z = 2.0 * (x * z_ - w * y_), 2.0 * (y_ * z_ + w * x), 1.0 - 2.0 * (x * x + y_ * y_)
        p = times(M, nu)
        q_rate = (
            -0.5 * (x * Om[0] + y_ * Om[1] + z_ * Om[2]),
            0.5 * (w * Om[0] + y_ * Om[2] - z_ * Om[1]),
            0.5 * (w * Om[1] + z_ * Om[0] - x * Om[2]),
            0.5 * (w * Om[2] + x * Om[1] - y_ * Om[0]),
        )
        f = plus(cross(p, Om), minus(plus(force, along(net, z)), dragged(l_force, q_force, nu)))
        turning = plus(cross(times(J, Om), Om), cross(p, nu))
        tau = plus(turning, minus(minus(torque, cross(d, z)), dragged(l_torque, q_torque, Om)))
        return turned(q, nu), q_rate, times(lighter, f), times(slower, tau)

    @nb.njit(fastmath=False, error_model="numpy")
    def advance(bs, qs, nus, Oms, kps, krs, nets, ds):
        for i in range(len(bs)):
            b, nu, Om = (
                (bs[i, 0], bs[i, 1], bs[i, 2]),
                (nus[i, 0], nus[i, 1], nus[i, 2]),
                (Oms[i, 0], Oms[i, 1], Oms[i, 2]),
            )
            q, net = (qs[i, 0], qs[i, 1], qs[i, 2], qs[i, 3]), nets[i]
            kp, kr = (kps[i, 0], kps[i, 1], kps[i, 2]), (krs[i, 0], krs[i, 1], krs[i, 2])
            d = ds[i, 0], ds[i, 1], ds[i, 2]
            y, zero = (b, q, nu, Om), (0.0, 0.0, 0.0)
            total, total_R, e, e_R = zero, zero, zero, zero
            for _ in range(ticks):
                b, q, nu, Om = y
                size = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
                q = q[0] * size, q[1] * size, q[2] * size, q[3] * size
                y = b, q, nu, Om
                R = rows(q)
                total = within(plus(total, along(period, e)), LIMIT)
                total_R = within(plus(total_R, along(period, e_R)), LIMIT_R)
                e = minus(goal, b)
                e_R = plus(cross(R[0], wanted[0]), plus(cross(R[1], wanted[1]), cross(R[2], wanted[2])))
                e_R = along(0.5, e_R)
                force = to_body(R, plus(times(kp, e), times(ki, total)))
                force = minus(minus(force, times(kd, nu)), along(net0, R[2]))
                torque = minus(cross(d0, R[2]), plus(times(kr, e_R), plus(times(ki_r, total_R), times(kw, Om))))
                for _ in range(every):
                    k1 = rates(y, force, torque, net, d)
                    k2 = rates(moved(y, 0.5 * h, k1), force, torque, net, d)
                    k3 = rates(moved(y, 0.5 * h, k2), force, torque, net, d)
                    k4 = rates(moved(y, h, k3), force, torque, net, d)
                    y = moved(y, h / 6.0, k1)
                    y = moved(y, h / 3.0, k2)
                    y = moved(y, h / 3.0, k3)
                    y = moved(y, h / 6.0, k4)
            b, q, nu, Om = y
            for j in range(3):
                bs[i, j], nus[i, j], Oms[i, j] = b[j], nu[j], Om[j]
            for j in range(4):
                qs[i, j] = q[j]

    return advance


def make(problem):
    """The members in arrays, and the compiled loop over them."""
    numbers = problem.numbers
    starts = numbers["b"], notation.quaternion_from_matrix(numbers["R"]), numbers["nu"], numbers["Om"]
    states = [np.array(x, order="C") for x in starts]
    varied = [np.ascontiguousarray(numbers[name]) for name in ("kp", "kr", "net", "d")]
    compiled = make_advance(numbers, problem.h, problem.every, problem.ticks)

    def begin():
        for state, start in zip(states, starts, strict=True):
            state[...] = start

    def end():
        return states[0].copy(), notation.matrix_from_quaternion(states[1])

    return Way(begin, lambda: compiled(*states, *varied), end)
