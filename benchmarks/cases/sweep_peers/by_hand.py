# SPDX-License-Identifier: Apache-2.0
"""Common parts of both programs by hand: numbers of the scene, metrics of a path, and the answer with its intervals."""

import numpy as np

MASS, INERTIA, BUOYANCY, GRAVITY, LEVER = 15.0, np.array([0.5, 0.8, 0.8]), 147.15, 9.81, -0.02
LINEAR = np.array([20.0, 40.0, 40.0, 2.0, 4.0, 4.0])
QUADRATIC = np.array([30.0, 80.0, 80.0, 1.0, 2.0, 2.0])
LIMIT = np.array([80.0, 80.0, 80.0, 5.0, 5.0, 5.0])
GOAL, HEADING = np.array([2.0, -1.0, 5.0]), 0.5
GAINS = {"soft": dict(kp=20.0, kd=40.0, kr=4.0, kw=2.0), "stiff": dict(kp=60.0, kd=40.0, kr=12.0, kw=2.0)}
STEP, EVERY, TICKS, DELAYS = 0.01, 10, 300, (0.0, 0.2)
PERIOD = EVERY * STEP
CELLS = [(case, delay) for case in GAINS for delay in DELAYS]


def metrics_of(place, attitude, command):
    """Metrics of members (n,) by name from their ticks: place (k, 3, n), R (k, 3, 3, n), command (k - 1, 6, n)."""
    beyond = place[:, 2] - GOAL[2]
    outside = np.abs(beyond) > 0.1
    last = len(outside) - 1 - np.argmax(outside[::-1], axis=0)
    settled = np.where(outside.any(axis=0), (last + 1) * PERIOD, 0.0)
    away = np.linalg.norm(place - GOAL[:, None], axis=1)
    c, s = np.cos(HEADING), np.sin(HEADING)
    wanted = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])[:, :, None]
    angle = 2.0 * np.arcsin(np.minimum(1.0, np.sqrt(((attitude - wanted) ** 2).sum(axis=(1, 2)) / 8.0)))
    return {
        "overshoot depth": np.maximum(0.0, beyond.max(axis=0)),
        "settling_time depth": np.where(outside[-1], np.inf, settled),
        "iae position": np.trapezoid(away, dx=PERIOD, axis=0),
        "rms attitude": np.sqrt(np.trapezoid(angle**2, dx=PERIOD, axis=0) / (TICKS * PERIOD)),
        "saturation_share": (np.abs(command) >= LIMIT[:, None]).any(axis=1).mean(axis=0),
    }


def answer(cells):
    """Success with Wilson's interval by cell, and differences to the first case on the same members, at 95 %."""
    z, passed, rows, differences = 1.959963984540054, {}, {}, {}
    for cell, metrics in cells.items():
        good = metrics["overshoot depth"] < 0.1
        passed[cell] = good & (metrics["settling_time depth"] < 12.0) & (metrics["iae position"] < 25.0)
        n, p = len(good), passed[cell].mean()
        middle, half = p + z * z / (2.0 * n), z * np.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n))
        rows[cell] = (p, (middle - half) / (1.0 + z * z / n), (middle + half) / (1.0 + z * z / n))
    for case, delay in cells:
        for name, values in {**cells[case, delay], "success": passed[case, delay]}.items():
            base = {**cells["soft", delay], "success": passed["soft", delay]}[name]
            both = np.isfinite(values) & np.isfinite(base)
            step = values[both].astype(float) - base[both]
            differences[case, delay, name] = (step.mean(), z * step.std(ddof=1) / np.sqrt(len(step)))
    return rows, differences
