# SPDX-License-Identifier: Apache-2.0
"""Linear model predictive control: a problem of all inputs of a horizon, by ADMM."""

from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, pose_errors
from lgvi_warp.reference.rotation import Array

COORDINATES = [f"{name}[{i}]" for name in ("position", "rotation", "velocity", "angular_velocity") for i in range(3)]
COMPONENTS = "XYZKMN"


class LinearMPC(Part):
    """Numbers as those of `lw.control.LinearMPC`."""

    P = rate_limit = tracked = None
    disturbance_time, horizon, iterations = 5.0, 10, 30

    def begin(self) -> None:
        """Nothing is known of the last tick."""
        n, m = np.shape(self.B)
        self.begun, self.x, self.u, self.d = False, np.zeros(n), np.zeros(m), np.zeros(n)
        self.t, self.t_change = np.zeros((self.horizon, m)), np.zeros((self.horizon, m))

    def steady_state(self, d: Array) -> tuple[Array, Array]:
        """x_s and u_s with x_s = A x_s + B u_s + d and no error of what is tracked."""
        A, B = np.asarray(self.A), np.asarray(self.B)
        n, m = B.shape
        tracked = self.states[:m] if self.tracked is None else self.tracked
        goal = np.eye(n)[[list(self.states).index(name) for name in tracked]]
        both = np.block([[A - np.eye(n), B], [goal, np.zeros((len(goal), m))]])
        found = np.linalg.solve(both, np.concatenate([-d, np.zeros(len(goal))]))
        return found[:n], found[n:]

    def problem(self, x: Array, d: Array) -> tuple[Array, Array]:
        """H and f of U H U / 2 + f U, the cost of inputs U (horizon m,) from x on, up to what does not depend on them."""
        A, B, m = np.asarray(self.A), np.asarray(self.B), np.shape(self.B)[1]
        x_s, u_s = self.steady_state(d)
        size = self.horizon * m
        # The error at the ticks is e0 + E U.
        e0, E = x - x_s, np.zeros((len(x), size))
        H, f = np.kron(np.eye(self.horizon), np.diag(self.R)), -np.tile(self.R * u_s, self.horizon)
        for k in range(self.horizon):
            push = np.zeros((m, size))
            push[:, k * m : (k + 1) * m] = np.eye(m)
            e0, E = A @ e0 - B @ u_s, A @ E + B @ push
            last = k == self.horizon - 1 and self.P is not None
            W = np.asarray(self.P) if last else np.diag(self.Q)
            H, f = H + E.T @ W @ E, f + E.T @ W @ e0
        return H, f

    def solved(self, H: Array, f: Array, before: Array, change: Array | None) -> Array:
        """The inputs (horizon, m), as parts of their limits, after the iterations; before: the last; change: their limits."""
        size, m = len(f), len(before)
        best = -np.linalg.solve(H, f).reshape(-1, m)
        moves = np.diff(best, axis=0, prepend=before[None])
        if np.all(np.abs(best) <= 1.0) and (change is None or np.all(np.abs(moves) <= change)):
            self.t, self.t_change = best, moves
            return best
        D = np.eye(size) - np.eye(size, k=-m)
        since = np.concatenate([before, np.zeros(size - m)])
        eigenvalues = np.linalg.eigvalsh(H)
        rho = np.sqrt(eigenvalues[0] * eigenvalues[-1])
        M = H + rho * (np.eye(size) if change is None else np.eye(size) + D.T @ D)
        for _ in range(self.iterations):
            z = np.clip(self.t, -1.0, 1.0)
            w = self.t - z
            pull = rho * (z - w).ravel()
            if change is not None:
                z_change = np.clip(self.t_change, -change, change)
                w_change = self.t_change - z_change
                pull = pull + rho * D.T @ ((z_change - w_change).ravel() + since)
            v = np.linalg.solve(M, pull - f)
            self.t = v.reshape(-1, m) + w
            if change is not None:
                self.t_change = (D @ v - since).reshape(-1, m) + w_change
        return np.clip(self.t, -1.0, 1.0)

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """The first of the best inputs."""
        limit = np.asarray(self.limit, float)
        position, rotation, velocity, rate = pose_errors(r, y)
        errors = np.concatenate([-position, rotation, -velocity, -rate])
        x = errors[[COORDINATES.index(name) for name in self.states]]
        places = [COMPONENTS.index(name) for name in self.inputs]
        u = self.u - unmet[places]
        if self.begun:
            lacking = x - (self.A @ self.x + self.B @ u + self.d)
            self.d = self.d + (1.0 - np.exp(-y.period / self.disturbance_time)) * lacking
        H, f = self.problem(x, self.d)
        for t in (self.t, self.t_change):
            t[:-1] = t[1:].copy()
        before = u / limit
        change = None if self.rate_limit is None else y.period * np.asarray(self.rate_limit) / limit
        scale = np.tile(limit, self.horizon)
        first = self.solved(scale[:, None] * H * scale, scale * f, before, change)[0]
        if change is not None:
            first = np.clip(first, before - change, before + change)
        self.begun, self.x, self.u = True, x, limit * np.clip(first, -1.0, 1.0)
        made: Any = np.zeros(6)
        made[places] = self.u
        return np.asarray(w + made)
