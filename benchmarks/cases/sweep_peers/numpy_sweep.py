# SPDX-License-Identifier: Apache-2.0
"""The sweep by hand in NumPy: all members of a block at once, a row for each number."""

import numpy as np

from benchmarks.cases.sweep_peers import by_hand

BLOCK = 1024


def cross(a, b):
    """a x b of rows (3, n)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def rotation(q):
    """The matrix (3, 3, n) of unit quaternions (4, n)."""
    w, x, y, z = q
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * x, y * y, z * z, x * y, x * z, y * z, w * x, w * y, w * z
    return np.array([
        [1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy)],
        [2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx)],
        [2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy)],
    ])  # fmt: skip


def rates(state, wrench, buoyancy, current, out):
    """Rates of place, quaternion, velocity through the water and angular velocity (13, n)."""
    (w, *_), vector, velocity, turn = state[3:7], state[4:7], state[7:10], state[10:13]
    twice = 2.0 * cross(vector, velocity)
    np.add(velocity + w * twice, cross(vector, twice), out=out[:3])
    out[:3] += current
    np.multiply(-0.5, (vector * turn).sum(axis=0), out=out[3])
    np.multiply(0.5, w * turn + cross(vector, turn), out=out[4:7])
    q0, q1, q2, q3 = state[3:7]
    down = np.stack([2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2)])
    both = state[7:13]
    np.subtract(wrench, (by_hand.LINEAR[:, None] + by_hand.QUADRATIC[:, None] * np.abs(both)) * both, out=out[7:])
    out[7:10] += (by_hand.MASS * by_hand.GRAVITY - buoyancy) * down
    out[7:10] /= by_hand.MASS
    out[7:10] -= cross(turn, velocity)
    lift = by_hand.LEVER * buoyancy
    out[10] += lift * down[1]
    out[11] -= lift * down[0]
    out[10:13] -= cross(turn, by_hand.INERTIA[:, None] * turn)
    out[10:13] /= by_hand.INERTIA[:, None]


def law(state, current, gains):
    """The command (6, n) of a tick."""
    R = rotation(state[3:7])
    c, s = np.cos(by_hand.HEADING), np.sin(by_hand.HEADING)
    wanted = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    error = 0.5 * sum(cross(R[i], wanted[i][:, None]) for i in range(3))
    away = gains["kp"] * (by_hand.GOAL[:, None] - state[:3]) - gains["kd"] * current
    force = (R * away[:, None]).sum(axis=0) - gains["kd"] * state[7:10]
    torque = -gains["kr"] * error - gains["kw"] * state[10:13]
    return np.clip(np.concatenate([force, torque]), -by_hand.LIMIT[:, None], by_hand.LIMIT[:, None]), R


def run(buoyancy, current, gains, delay, parts):
    """Metrics of a block of members in one cell."""
    n, late, h = len(buoyancy), round(delay / by_hand.PERIOD), by_hand.STEP / parts
    state, k1, k2, k3, k4 = (np.zeros((13, n)) for _ in range(5))
    state[3], state[7:10] = 1.0, -current
    place, attitude = np.empty((by_hand.TICKS + 1, 3, n)), np.empty((by_hand.TICKS + 1, 3, 3, n))
    command = np.empty((by_hand.TICKS, 6, n))
    for tick in range(by_hand.TICKS):
        place[tick] = state[:3]
        command[tick], attitude[tick] = law(state, current, gains)
        wrench = command[tick - late] if tick >= late else np.zeros((6, n))
        for _ in range(by_hand.EVERY * parts):
            rates(state, wrench, buoyancy, current, k1)
            rates(state + 0.5 * h * k1, wrench, buoyancy, current, k2)
            rates(state + 0.5 * h * k2, wrench, buoyancy, current, k3)
            rates(state + h * k3, wrench, buoyancy, current, k4)
            state += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            state[3:7] /= np.sqrt((state[3:7] ** 2).sum(axis=0))
    place[by_hand.TICKS], attitude[by_hand.TICKS] = state[:3], rotation(state[3:7])
    return by_hand.metrics_of(place, attitude, command)


def sweep(members, parts=1):
    """Metrics by cell, and the answer; members: buoyancy (n,) [N], current (n, 3) [m/s]; parts: steps in one of ours."""
    cells = {}
    for case, delay in by_hand.CELLS:
        blocks = []
        for first in range(0, len(members["buoyancy"]), BLOCK):
            some = slice(first, first + BLOCK)
            current = np.ascontiguousarray(members["current"][some].T)
            blocks.append(run(members["buoyancy"][some], current, by_hand.GAINS[case], delay, parts))
        cells[case, delay] = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    return cells, by_hand.answer(cells)
