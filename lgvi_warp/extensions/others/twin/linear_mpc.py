# SPDX-License-Identifier: Apache-2.0
"""Linear model predictive control: a quadratic program in all inputs of a horizon, by an interior-point method."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lgvi_warp.reference.control import NO_WISH, Measurement, Part, Reference, pose_errors
from lgvi_warp.reference.rotation import Array

COORDINATES = [f"{name}[{i}]" for name in ("position", "rotation", "velocity", "angular_velocity") for i in range(3)]
COMPONENTS = "XYZKMN"


class LinearMPC(Part):
    """Numbers of `lw.control.LinearMPC`."""

    P = rate_limit = tracked = lower = outputs = output_limit = excess_cost = None
    preview = False
    # How references of later ticks differ from the present one; None where it goes on at its rates.
    shifts: Sequence[Array] | None = None
    disturbance_time, horizon, iterations = 5.0, 10, 50

    def begin(self) -> None:
        """Begin without a previous tick."""
        n, m = np.shape(self.B)
        self.begun, self.x, self.u, self.d = False, np.zeros(n), np.zeros(m), np.zeros(n)
        self.shifts, self.wanted = None, NO_WISH

    @property
    def ahead(self) -> int:  # type: ignore[override]
        """The number of future references needed: the horizon with preview, else 0."""
        return self.horizon if self.preview else 0

    def errors(self, r: Reference, y: Measurement) -> Array:
        """The states: measured minus wanted values."""
        position, rotation, velocity, rate = pose_errors(r, y)
        errors = np.concatenate([-position, rotation, -velocity, -rate])
        return errors[[COORDINATES.index(name) for name in self.states]]

    def errors_later(self, r: Reference, y: Measurement, time: float) -> Array:
        """The states if the reference had continued at its rates for a time."""
        going = np.concatenate([r.velocity, y.R.T @ r.R @ r.angular_velocity, np.zeros(6)])
        return self.errors(r, y) - time * going[[COORDINATES.index(name) for name in self.states]]

    def foresee(self, later: Sequence[Reference], r: Reference, y: Measurement) -> None:
        """Store the differences between errors for future references and for r continued at its rates."""
        self.shifts = [self.errors(s, y) - self.errors_later(r, y, (j + 1) * y.period) for j, s in enumerate(later)]

    def steady_state(self, d: Array) -> tuple[Array, Array]:
        """x_s and u_s with x_s = A x_s + B u_s + d and zero tracked errors."""
        A, B = np.asarray(self.A), np.asarray(self.B)
        n, m = B.shape
        tracked = self.states[:m] if self.tracked is None else self.tracked
        goal = np.eye(n)[[list(self.states).index(name) for name in tracked]]
        both = np.block([[A - np.eye(n), B], [goal, np.zeros((len(goal), m))]])
        found = np.linalg.solve(both, np.concatenate([-d, np.zeros(len(goal))]))
        return found[:n], found[n:]

    def problem(self, x: Array, d: Array) -> tuple[Array, Array]:
        """H and f of U H U / 2 + f U, the cost of inputs U (horizon m,) from state x, up to a constant."""
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
            e = e0 if self.shifts is None else e0 + self.shifts[k]
            H, f = H + E.T @ W @ E, f + E.T @ W @ e
        return H, f

    def solved(self, H: Array, f: Array, before: Array, change: Array | None) -> Array:
        """The best inputs (horizon, m), divided by their limits; before: last inputs; change: limits of changes."""
        size, m = len(f), len(before)
        best = -np.linalg.solve(H, f)
        C, middle, half = np.eye(size), np.zeros(size), np.ones(size)
        if change is not None:
            before = np.clip(before, -1.0 - 0.999 * change, 1.0 + 0.999 * change)
            C = np.concatenate([C, np.eye(size) - np.eye(size, k=-m)])
            middle = np.concatenate([middle, before, np.zeros(size - m)])
            half = np.concatenate([half, np.tile(change, self.horizon)])
        if np.all(np.abs(C @ best - middle) <= half):
            return best.reshape(-1, m)
        both, ends = np.concatenate([C, -C]), np.concatenate([half + middle, half - middle])
        return interior(H, f, both, ends, np.concatenate([half, half]), self.iterations).reshape(-1, m)

    def sides(self, x: Array, d: Array, before: Array, change: Array | None) -> tuple[Array, Array, Array]:
        """C, bounds and costs of C v <= bound + excess for inputs v divided by their limits; input limits cost inf."""
        limit, m, N = np.asarray(self.limit, float), len(self.limit), self.horizon
        lower = -np.ones(m) if self.lower is None else np.asarray(self.lower) / limit
        size, eye = N * m, np.eye(N * m)
        C, room = [eye, -eye], [np.ones(size), -np.tile(lower, N)]
        if change is not None:
            before = np.clip(before, lower - 0.999 * change, 1.0 + 0.999 * change)
            since, most = np.concatenate([before, np.zeros(size - m)]), np.tile(change, N)
            steps = eye - np.eye(size, k=-m)
            C, room = [*C, steps, -steps], [*room, most + since, most - since]
        cost = [np.full(sum(map(len, room)), np.inf)]
        if self.outputs is not None:
            A, B = np.asarray(self.A), np.asarray(self.B) * limit
            at, made = x, np.zeros((len(x), size))
            answers = []
            for j in range(N):
                at, made = A @ at + d, A @ made
                made[:, j * m : (j + 1) * m] += B
                answers.append((self.outputs @ at, self.outputs @ made))
            units = np.max([np.abs(gains).max(axis=1) for _, gains in answers], axis=0)
            shifts = np.zeros((N, len(x))) if self.shifts is None else self.shifts
            for (still, gains), shift in zip(answers, shifts, strict=True):
                C, room = (
                    [*C, gains / units[:, None]],
                    [*room, (self.output_limit - still - self.outputs @ shift) / units],
                )
                cost.append(0.5 * self.excess_cost * units)
        return np.concatenate(C), np.concatenate(room), np.concatenate(cost)

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """The demand: the first of the best inputs."""
        limit = np.asarray(self.limit, float)
        x = self.errors(r, y)
        places = [COMPONENTS.index(name) for name in self.inputs]
        u = self.u - unmet[places]
        if self.begun:
            lacking = self.errors_later(self.wanted, y, y.period) - (self.A @ self.x + self.B @ u + self.d)
            self.d = self.d + (1.0 - np.exp(-y.period / self.disturbance_time)) * lacking
        H, f = self.problem(x, self.d)
        before = u / limit
        change = None if self.rate_limit is None else y.period * np.asarray(self.rate_limit) / limit
        scale = np.tile(limit, self.horizon)
        H, f, lower = scale[:, None] * H * scale, scale * f, -np.ones(len(limit))
        if self.lower is None and self.outputs is None and not self.preview:
            first = self.solved(H, f, before, change)[0]
        else:
            lower = lower if self.lower is None else np.asarray(self.lower) / limit
            sides = self.sides(x, self.d, before, change)
            first = softened(H, f, *sides, self.iterations)[: len(limit)]
        if change is not None:
            before = np.clip(before, lower - 0.999 * change, 1.0 + 0.999 * change)
            first = np.clip(first, before - change, before + change)
        self.begun, self.x, self.u, self.wanted = True, x, limit * np.clip(first, lower, 1.0), r
        made: Any = np.zeros(6)
        made[places] = self.u
        return np.asarray(w + made)


def interior(H: Array, f: Array, C: Array, d: Array, slacks: Array, iterations: int) -> Array:
    """Minimiser v of v H v / 2 + f v with C v <= d, by Mehrotra's predictor-corrector method from v = 0 and `slacks`."""
    v, s, size = np.zeros(len(f)), slacks.copy(), max(H[0, 0], np.abs(f).max())
    multipliers = np.full(len(d), size)
    for _ in range(iterations):
        off, slope, gap = C @ v + s - d, H @ v + f + C.T @ multipliers, s @ multipliers / len(d)
        if gap <= 1e-15 * size and np.abs(off).max() <= 1e-9 and np.abs(slope).max() <= 1e-9 * size:
            break
        K, c = H + C.T @ ((multipliers / s)[:, None] * C), s * multipliers
        for corrects in (False, True):
            move = np.linalg.solve(K, -slope - C.T @ ((multipliers * off - c) / s))
            ds = -off - C @ move
            dm = -(c + multipliers * ds) / s
            most = max(1.0, np.max(-ds / s), np.max(-dm / multipliers))
            if not corrects:
                ahead = (s + ds / most) @ (multipliers + dm / most) / len(d)
                c = c + ds * dm - (ahead / gap) ** 3 * gap
        length = min(1.0, 0.99 / most)
        v, s, multipliers = v + length * move, s + length * ds, multipliers + length * dm
    return np.asarray(v)


def softened(H: Array, f: Array, C: Array, room: Array, cost: Array, iterations: int) -> Array:
    """Minimiser v of v H v / 2 + f v + cost e with C v <= room + e and e >= 0; infinite costs mean e = 0.

    Mehrotra's predictor-corrector method, with the excess e and the multiplier of e >= 0, cost - multiplier, eliminated.
    """
    v = -np.linalg.solve(H, f)
    if np.all(C @ v <= room):
        return np.asarray(v)
    v, size, soft = np.zeros(len(f)), max(H[0, 0], np.abs(f).max()), np.isfinite(cost)
    s, e = np.maximum(room, 1.0), np.where(soft, np.maximum(-room, 1.0), 0.0)
    multipliers, count, large = np.minimum(size, 0.5 * cost), len(room) + soft.sum(), np.maximum(1.0, np.abs(room))
    # What multipliers leave of the cost is kept, not computed: near a solution it is far below the cost's round-off.
    left = np.where(soft, cost - multipliers, 1.0)
    for _ in range(iterations):
        off, slope = C @ v + s - e - room, H @ v + f + C.T @ multipliers
        target, of_excess = s * multipliers, e * left
        gap = (target.sum() + of_excess.sum()) / count
        if gap <= 1e-15 * size and np.abs(off / large).max() <= 1e-9 and np.abs(slope).max() <= 1e-9 * size:
            break
        weight = 1.0 / (s / multipliers + e / left)
        K = H + C.T @ (weight[:, None] * C)
        for corrects in (False, True):
            rest = off - target / multipliers + of_excess / left
            move = np.linalg.solve(K, -slope - C.T @ (weight * rest))
            dm = weight * (C @ move + rest)
            ds, de = -(target + s * dm) / multipliers, np.where(soft, -(of_excess - e * dm) / left, 0.0)
            shrinks = [-ds / s, -dm / multipliers, np.where(soft, -de / np.where(soft, e, 1.0), 0.0),
                       np.where(soft, dm / left, 0.0)]  # fmt: skip
            most = max(1.0, *(np.max(ratio) for ratio in shrinks))
            if not corrects:
                ahead = (s + ds / most) @ (multipliers + dm / most)
                ahead = (ahead + (soft * (e + de / most)) @ (left - dm / most)) / count
                aim = (ahead / gap) ** 3 * gap
                target, of_excess = target + ds * dm - aim, np.where(soft, of_excess - de * dm - aim, 0.0)
        length = min(1.0, 0.99 / most)
        v, s, e, multipliers = v + length * move, s + length * ds, e + length * de, multipliers + length * dm
        left = np.where(soft, left - length * dm, 1.0)
    return np.asarray(v)
