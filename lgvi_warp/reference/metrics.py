# SPDX-License-Identifier: Apache-2.0
"""Metrics of one member's path in plain NumPy, with the names of lgvi_warp/statistics/metrics/tracking_metrics.py.

t: times (k,) [s] of the ticks at which the member is under way; y: actual values (k,); goal: one value; e: errors (k,),
goal minus actual; end: end of the run [s]; command, limit: commands (k, channels), and the limit of each channel
(channels,).
"""

import numpy as np


def direction(y: np.ndarray, goal: float) -> float:
    """1 if the goal is at least the first value, else -1."""
    return -1.0 if goal < y[0] else 1.0


def overshoot(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """Largest distance of y beyond the goal."""
    return max(0.0, float(np.max(direction(y, goal) * (y - goal))))


def undershoot(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """Largest distance of y in the wrong direction."""
    return max(0.0, float(np.max(direction(y, goal) * (y[0] - y))))


def peak(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """Value of y that is farthest in the direction of the step."""
    return float(y[np.argmax(direction(y, goal) * y)])


def peak_time(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """Time at which y is farthest in the direction of the step [s]."""
    return float(t[np.argmax(direction(y, goal) * y)])


def rise_time(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """Time from the first tick with 10 % of the step done to the first tick with 90 %."""
    if goal == y[0]:
        return 0.0
    done = (y - y[0]) / (goal - y[0])
    if not np.any(done >= 0.9):
        return np.inf
    return float(t[np.argmax(done >= 0.9)] - t[np.argmax(done >= 0.1)])


def settling_time(t: np.ndarray, y: np.ndarray, goal: float, within: float) -> float:
    """First tick after which y stays within the band."""
    outside = np.flatnonzero(np.abs(y - goal) > within)
    if not len(outside):
        return float(t[0])
    return float(t[outside[-1] + 1]) if outside[-1] + 1 < len(t) else np.inf


def steady_state_error(t: np.ndarray, e: np.ndarray, end: float, share: float = 0.1) -> float:
    """Mean error over the last part of the run."""
    if t[-1] < end:
        return np.nan
    return float(np.mean(e[t >= end * (1.0 - share) - 1e-9 * end]))


def max_error(t: np.ndarray, e: np.ndarray) -> float:
    """Largest |e| at any tick."""
    return float(np.max(np.abs(e)))


def iae(t: np.ndarray, e: np.ndarray) -> float:
    """Integral of |e| over time."""
    return float(np.trapezoid(np.abs(e), t))


def ise(t: np.ndarray, e: np.ndarray) -> float:
    """Integral of e^2 over time."""
    return float(np.trapezoid(e**2, t))


def itae(t: np.ndarray, e: np.ndarray) -> float:
    """Integral of t |e| over time."""
    return float(np.trapezoid(t * np.abs(e), t))


def rms(t: np.ndarray, e: np.ndarray) -> float:
    """Root mean square of e over time."""
    return float(np.sqrt(ise(t, e) / (t[-1] - t[0])))


def effort(t: np.ndarray, command: np.ndarray) -> float:
    """Integral of |command|, held from tick to tick and summed over channels; command: (k, channels)."""
    return float(np.sum(np.abs(command[:-1]) * np.diff(t)[:, None]))


def travel(t: np.ndarray, actuator: np.ndarray) -> float:
    """Sum of |change| from tick to tick; actuator: (k, channels)."""
    return float(np.sum(np.abs(np.diff(actuator, axis=0))))


def saturation_share(t: np.ndarray, command: np.ndarray, limit: np.ndarray) -> float:
    """Fraction of time with a command at its limit or beyond."""
    held = np.any(np.abs(command[:-1]) >= limit * (1.0 - 1e-6), axis=1)
    return float(np.sum(held * np.diff(t)) / (t[-1] - t[0]))


def energy(
    t: np.ndarray, wrench: np.ndarray, velocity: np.ndarray, angular_velocity: np.ndarray, held: bool = False
) -> float:
    """Integral of |power| [J] of a wrench (k, 6) [N, N m], held between ticks or not; velocities (k, 3) [m/s], [rad/s]."""
    twist = np.hstack([velocity, angular_velocity])
    first = np.sum(wrench[:-1] * twist[:-1], axis=1)
    last = np.sum((wrench[:-1] if held else wrench[1:]) * twist[1:], axis=1)
    return float(np.sum(0.5 * (np.abs(first) + np.abs(last)) * np.diff(t)))
