# SPDX-License-Identifier: Apache-2.0
"""Allocation within the limits of the actuators, by a primal active-set method."""

from typing import Any

import numpy as np

from lgvi_warp.reference.control import cannot
from lgvi_warp.reference.control.pseudo_inverse import PseudoInverse
from lgvi_warp.reference.rotation import Array

# A line depends on others below this part of its size. No error, no slope, and no step beyond a limit, are below these parts
# of the demand, the steepest slope and the range; nothing is told back below the last part of the demand.
DEPENDENT, NONE, FLAT, BESIDE, TOLD = 1e-9, 1e-12, 1e-9, 1e-13, 1e-10


class BoundedLeastSquares(PseudoInverse):
    """Attributes as in `lw.control.BoundedLeastSquares`; effect, losses and the actuator as in `PseudoInverse`."""

    priorities = np.ones(6)
    iterations = 100

    def allocate(self, w: Array, actuators: dict[str, Any]) -> Array:
        """Efforts t with the smallest sum (priority (B t - w))^2 within the limits; w - B t remains."""
        actuator, B = actuators[self.to], self.effect
        root = 1.0 / np.sqrt(np.ones(B.shape[1]) if self.weights is None else np.asarray(self.weights))
        arm = np.sqrt(np.square(B[3:]).sum() / np.square(B[:3]).sum()) if B[:3].any() and B[3:].any() else 1.0
        units, priorities = np.repeat([1.0, 1.0 / arm], 3), np.asarray(self.priorities, float)
        S = units * priorities
        lines = root[:, None] * np.linalg.pinv(S[:, None] * B * root, rcond=1e-10) * S
        wanted = lines @ w
        low, high = self.limits(actuator)
        t = np.clip(wanted, low, high)
        if np.any(t != wanted):
            order = np.argsort(-priorities, kind="stable")
            A = (units[:, None] * B * root)[order]
            A[np.abs(A) < 1e-12 * np.abs(A).max()] = 0.0
            x = nearest(A, (units * w)[order], priorities[order], t / root, low / root, high / root, self.iterations)
            t = np.clip(root * x, low, high)
        actuator.command = np.clip(actuator.command_for(t), -actuator.limit, actuator.limit)
        left = cannot(B @ lines) @ w + B @ (wanted - t)
        return np.asarray(np.where(np.abs(units * left) > TOLD * np.linalg.norm(units * w), left, 0.0))

    def limits(self, actuator: Any) -> tuple[Array, Array]:
        """Efforts at full command astern and ahead; 0 for a channel that is known to be lost."""
        ends = (actuator.command_for(np.full(len(actuator.limit), side)) for side in (-1e9, 1e9))
        low, high = (actuator.effort(np.clip(end, -actuator.limit, actuator.limit)) for end in ends)
        lost = [channel for channel, time in self.losses if self.time >= time]
        low[lost] = high[lost] = 0.0
        return low, high


def nearest(A: Array, b: Array, s: Array, x: Array, low: Array, high: Array, iterations: int) -> Array:
    """x with the smallest sum s^2 (A x - b)^2 within limits, s decreasing, from x on, in at most this many steps."""
    state = np.where(x >= high, 1, np.where(x <= low, -1, 0))
    for _ in range(iterations):
        goal, slopes = free_solution(A, b, s, np.where(state == 0, 0.0, x), state == 0)
        goal = np.where(state == 0, goal, x)
        step = goal - x
        room, size = np.where(step > 0.0, high - x, x - low), np.abs(step)
        over = size > room + BESIDE * (high - low)
        ratio = np.where(over, room / np.where(over, size, 1.0), 1.0)
        first = int(ratio.argmin())
        x = np.clip(x + ratio[first] * step, low, high)
        if over.any():
            state[first] = 1 if step[first] > 0.0 else -1
            x[first] = high[first] if step[first] > 0.0 else low[first]
            continue
        if not released(A, s, slopes, x, state, low, high):
            break
    return x


def released(A: Array, s: Array, slopes: Array, x: Array, state: Array, low: Array, high: Array) -> bool:
    """Move channels from limits to their own least error: the one of the largest gain, others if that is the other limit."""
    flat, steep, width = FLAT * np.abs(slopes).max(), np.abs(A).sum(axis=0), high - low

    def gains() -> Array:
        gain = -state * (slopes @ A)
        return np.where((width > 0.0) & (gain > flat * steep), gain, 0.0)

    first, any_gain = gains().argmax(), gains().any()
    for k in range(len(x)):
        gain, side = gains()[k], state[k]
        curvature = np.square(s * A[:, k]).sum()
        across = gain > (width[k] - BESIDE * width[k]) * curvature
        if gain > 0.0 and (across or k == first):
            step = side * (width[k] if across else gain / curvature)
            x[k] = (low[k] if side > 0 else high[k]) if across else x[k] - step
            state[k] = -side if across else 0
            change = s**2 * A[:, k] * step
            slopes, flat = slopes + change, max(flat, FLAT * np.abs(change).max())
    return bool(any_gain)


def free_solution(A: Array, b: Array, s: Array, held: Array, free: Array) -> tuple[Array, Array]:
    """Smallest x of the free channels with the least error, and s^2 times this error, which is normal to their columns."""
    L, Q, kept = np.zeros((6, 6)), A * free, np.zeros(6, bool)
    for i in range(6):
        size = Q[i] @ Q[i]
        for j in range(i):
            L[i, j] = Q[i] @ Q[j]
            Q[i] -= L[i, j] * Q[j]
        left = Q[i] @ Q[i]
        kept[i] = left > DEPENDENT**2 * size
        L[i, i] = np.sqrt(left)
        Q[i] = Q[i] / L[i, i] if kept[i] else 0.0
    lost, K = ~kept, L[np.ix_(kept, kept)]
    r = b - A @ held
    E = np.linalg.solve(K.T, L[np.ix_(lost, kept)].T).T
    beside = r[lost] - E @ r[kept]
    beside[np.abs(beside) <= NONE * np.abs(b).max()] = 0.0
    scaled = s[lost, None] * E / s[kept]
    slopes = np.zeros(6)
    slopes[lost] = s[lost] * np.linalg.solve(np.eye(lost.sum()) + scaled @ scaled.T, s[lost] * beside)
    slopes[kept] = -E.T @ slopes[lost]
    return Q[kept].T @ np.linalg.solve(K, r[kept] - slopes[kept] / s[kept] ** 2), slopes
