# SPDX-License-Identifier: Apache-2.0
"""Metrics of one member's whole path in plain NumPy, twins of lgvi_warp/statistics/metrics/tracking_metrics.py: same names.

t: times of the ticks under way (k,) [s]; y: actual numbers (k,), goal: one number; e: errors (k,), wanted less actual; end of
the run [s]; command, limit: commands (k, channels), and the limit of each channel (channels,).
"""

import numpy as np


def direction(y: np.ndarray, goal: float) -> float:
    """1 where the goal is above the first number or equals it, else -1."""
    return -1.0 if goal < y[0] else 1.0


def overshoot(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """Distance of y beyond the goal."""
    return max(0.0, float(np.max(direction(y, goal) * (y - goal))))


def undershoot(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """Distance of y in the wrong direction."""
    return max(0.0, float(np.max(direction(y, goal) * (y[0] - y))))


def peak(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """y where it is farthest in the direction of the step."""
    return float(y[np.argmax(direction(y, goal) * y)])


def peak_time(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """The time at which y is farthest in the direction of the step [s]."""
    return float(t[np.argmax(direction(y, goal) * y)])


def rise_time(t: np.ndarray, y: np.ndarray, goal: float) -> float:
    """From the first tick with 10 % of the step done to the first one with 90 %."""
    if goal == y[0]:
        return 0.0
    done = (y - y[0]) / (goal - y[0])
    if not np.any(done >= 0.9):
        return np.inf
    return float(t[np.argmax(done >= 0.9)] - t[np.argmax(done >= 0.1)])


def settling_time(t: np.ndarray, y: np.ndarray, goal: float, within: float) -> float:
    """The first tick from which on y is within the band."""
    outside = np.flatnonzero(np.abs(y - goal) > within)
    if not len(outside):
        return float(t[0])
    return float(t[outside[-1] + 1]) if outside[-1] + 1 < len(t) else np.inf


def steady_state_error(t: np.ndarray, e: np.ndarray, end: float, share: float = 0.1) -> float:
    """The mean error over the last part of the run."""
    if t[-1] < end:
        return np.nan
    return float(np.mean(e[t >= end * (1.0 - share) - 1e-9 * end]))


def max_error(t: np.ndarray, e: np.ndarray) -> float:
    """The largest |e| at any tick."""
    return float(np.max(np.abs(e)))


def iae(t: np.ndarray, e: np.ndarray) -> float:
    """The integral of |e| over time."""
    return float(np.trapezoid(np.abs(e), t))


def ise(t: np.ndarray, e: np.ndarray) -> float:
    """The integral of e^2 over time."""
    return float(np.trapezoid(e**2, t))


def itae(t: np.ndarray, e: np.ndarray) -> float:
    """The integral of t |e| over time."""
    return float(np.trapezoid(t * np.abs(e), t))


def rms(t: np.ndarray, e: np.ndarray) -> float:
    """The root of the mean of e^2 over time."""
    return float(np.sqrt(ise(t, e) / (t[-1] - t[0])))


def effort(t: np.ndarray, command: np.ndarray) -> float:
    """The integral of |command|, held from tick to tick and summed over channels; command: (k, channels)."""
    return float(np.sum(np.abs(command[:-1]) * np.diff(t)[:, None]))


def travel(t: np.ndarray, actuator: np.ndarray) -> float:
    """The sum of |change| from tick to tick; actuator: (k, channels)."""
    return float(np.sum(np.abs(np.diff(actuator, axis=0))))


def saturation_share(t: np.ndarray, command: np.ndarray, limit: np.ndarray) -> float:
    """The share of time with a command at its limit or beyond."""
    held = np.any(np.abs(command[:-1]) >= limit * (1.0 - 1e-6), axis=1)
    return float(np.sum(held * np.diff(t)) / (t[-1] - t[0]))


def energy(
    t: np.ndarray, wrench: np.ndarray, velocity: np.ndarray, angular_velocity: np.ndarray, held: bool = False
) -> float:
    """The integral of |power| [J] of a wrench (k, 6) [N, N m], held between ticks or not; velocities (k, 3) [m/s], [rad/s]."""
    twist = np.hstack([velocity, angular_velocity])
    first = np.sum(wrench[:-1] * twist[:-1], axis=1)
    last = np.sum((wrench[:-1] if held else wrench[1:]) * twist[1:], axis=1)
    return float(np.sum(0.5 * (np.abs(first) + np.abs(last)) * np.diff(t)))
