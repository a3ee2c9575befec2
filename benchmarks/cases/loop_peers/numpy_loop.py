# SPDX-License-Identifier: Apache-2.0
"""The loop over arrays of members in NumPy, as an expert would write it.

A row is one number of all members of a block, so that every operation runs over contiguous memory; results go into arrays
that exist already; a block is so large that calls cost little, and so small that a few rows stay in the caches. Cross products
are differences of shifted rows: the first two of three rows stand once more after the third. The attitude is three columns,
which a step turns like any other numbers.
"""

import numpy as np

from benchmarks.cases.loop_peers.problem import LIMITS, Way

# Rows of a state: b, the columns of R, nu, Om.
ROWS, COLUMNS, NU, OM, VELOCITIES = 18, slice(3, 12), slice(12, 15), slice(15, 18), slice(12, 18)
BLOCK = 2048
LIMIT, LIMIT_R = LIMITS


def by_rows(values, members):
    """(3, members), contiguous, of numbers (3,) or (members, 3)."""
    return np.ascontiguousarray(np.broadcast_to(values, (members, 3)).T)


class Block:
    """Some members, and all arrays that their steps need."""

    def __init__(self, problem, members):
        """members: a slice of them."""
        numbers, n = problem.numbers, members.stop - members.start
        self.h, self.every, self.ticks = problem.h, problem.every, problem.ticks
        R = numbers["R"][members].transpose(2, 1, 0).reshape(9, n)
        self.start = np.concatenate([numbers["b"][members].T, R, numbers["nu"][members].T, numbers["Om"][members].T])
        self.net = np.ascontiguousarray(numbers["net"][members])
        self.d = np.empty((5, n))
        self.d[:3], self.d[3:] = numbers["d"][members].T, numbers["d"][members].T[:2]
        self.kp, self.kr = (by_rows(numbers[name][members], n) for name in ("kp", "kr"))
        self.ki, self.kd, self.ki_r, self.kw, self.goal = (
            numbers[name][:, None] for name in ("ki", "kd", "ki_r", "kw", "goal")
        )
        self.net0, self.d0, self.R_d = numbers["net0"], numbers["d0"], numbers["R_d"]
        self.inertia = np.concatenate([numbers["M"], numbers["J"]]).reshape(2, 3, 1)
        self.inverse = 1.0 / self.inertia.reshape(6, 1)
        self.linear, self.quadratic = numbers["linear"][:, None], numbers["quadratic"][:, None]
        self.y, self.stage, self.rate, self.sum, self.moved = (np.empty((ROWS, n)) for _ in range(5))
        self.momentum, self.velocity, self.down = np.empty((2, 5, n)), np.empty((2, 5, n)), np.empty((5, n))
        self.wrench, self.six, self.integral, self.error = (np.empty((6, n)) for _ in range(4))
        self.pairs, self.three = np.empty((2, 3, n)), np.empty((3, n))

    def begin(self):
        """The start, and no error before it."""
        self.y[...] = self.start
        self.integral.fill(0.0)
        self.error.fill(0.0)

    def cross_add(self, out, a, b):
        """out + a x b; a, b: (5, n)."""
        np.multiply(a[1:4], b[2:5], out=self.three)
        out += self.three
        np.multiply(a[2:5], b[1:4], out=self.three)
        out -= self.three

    def turned(self, out, c, v):
        """out = R v from the columns of R (3, 3, n); v: (3, n)."""
        np.multiply(c[0], v[0], out=out)
        np.multiply(c[1], v[1], out=self.three)
        out += self.three
        np.multiply(c[2], v[2], out=self.three)
        out += self.three

    def turned_back(self, out, c, v):
        """out = R^T v."""
        for i in range(3):
            np.multiply(c[i], v, out=self.three)
            np.add(self.three[0], self.three[1], out=out[i])
            out[i] += self.three[2]

    def rates(self, y):
        """The rates of a state, into self.rate."""
        rate, c, V = self.rate, y[COLUMNS].reshape(3, 3, -1), self.velocity
        V[:, :3] = y[VELOCITIES].reshape(2, 3, -1)
        V[:, 3:] = V[:, :2]
        nu, Om = V
        np.multiply(V[:, :3], self.inertia, out=self.momentum[:, :3])
        self.momentum[:, 3:] = self.momentum[:, :2]
        self.down[:3] = y[5:12:3]
        self.down[3:] = self.down[:2]
        self.turned(rate[:3], c, nu)
        turning = rate[COLUMNS].reshape(3, 3, -1)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            np.multiply(c[j], Om[k], out=turning[i])
            np.multiply(c[k], Om[j], out=self.three)
            turning[i] -= self.three
        push, six = rate[VELOCITIES], self.six
        np.abs(y[VELOCITIES], out=six)
        six *= self.quadratic
        six += self.linear
        six *= y[VELOCITIES]
        np.subtract(self.wrench, six, out=push)
        both = push.reshape(2, 3, -1)
        np.multiply(self.momentum[:, 1:4], Om[2:5], out=self.pairs)
        both += self.pairs
        np.multiply(self.momentum[:, 2:5], Om[1:4], out=self.pairs)
        both -= self.pairs
        self.cross_add(push[3:], self.momentum[0], nu)
        self.cross_add(push[3:], self.down, self.d)
        np.multiply(self.down[:3], self.net, out=self.three)
        push[:3] += self.three
        push *= self.inverse

    def step(self):
        """One step of rk4."""
        y, h = self.y, self.h
        at, self.sum[...] = y, y
        for weight, ahead in ((h / 6.0, 0.5 * h), (h / 3.0, 0.5 * h), (h / 3.0, h), (h / 6.0, 0.0)):
            self.rates(at)
            if ahead:
                np.multiply(self.rate, ahead, out=self.stage)
                self.stage += y
                at = self.stage
            self.rate *= weight
            self.sum += self.rate
        self.y, self.sum = self.sum, self.y

    def look(self):
        """Set the wrench that is held until the next tick."""
        y, error, integral, six, moved = self.y, self.error, self.integral, self.six, self.moved
        c, period = y[COLUMNS].reshape(3, 3, -1), self.every * self.h
        np.multiply(error, period, out=six)
        integral += six
        for part, limit in ((integral[:3], LIMIT), (integral[3:], LIMIT_R)):
            np.clip(part, -limit, limit, out=part)
        np.subtract(self.goal, y[:3], out=error[:3])
        # Rows of R are directions of inertial axes in the body; half the sum of R_i x R_d,i.
        e_R = error[3:]
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            np.matmul(0.5 * self.R_d[:, k], c[j], out=e_R[i])
            np.matmul(0.5 * self.R_d[:, j], c[k], out=moved[0])
            e_R[i] -= moved[0]
        force, torque, down = self.wrench[:3], self.wrench[3:], y[5:12:3]
        np.multiply(self.kp, error[:3], out=moved[:3])
        np.multiply(self.ki, integral[:3], out=six[:3])
        moved[:3] += six[:3]
        self.turned_back(force, c, moved[:3])
        np.multiply(self.kd, y[NU], out=six[:3])
        force -= six[:3]
        np.multiply(down, self.net0, out=six[:3])
        force -= six[:3]
        np.multiply(self.kr, e_R, out=torque)
        np.multiply(self.ki_r, integral[3:], out=six[:3])
        torque += six[:3]
        np.multiply(self.kw, y[OM], out=six[:3])
        torque += six[:3]
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            np.multiply(down[k], self.d0[j], out=six[i])
            np.multiply(down[j], self.d0[k], out=six[3])
            six[i] -= six[3]
        np.subtract(six[:3], torque, out=torque)

    def advance(self):
        """All ticks and steps."""
        for _ in range(self.ticks):
            self.look()
            for _ in range(self.every):
                self.step()


def make(problem):
    """The members in blocks."""
    edges = range(0, problem.members, BLOCK)
    blocks = [Block(problem, slice(first, min(first + BLOCK, problem.members))) for first in edges]

    def begin():
        for block in blocks:
            block.begin()

    def advance():
        for block in blocks:
            block.advance()

    def end():
        y = np.concatenate([block.y for block in blocks], axis=1)
        return y[:3].T, y[COLUMNS].reshape(3, 3, -1).transpose(2, 1, 0)

    return Way(begin, advance, end)
