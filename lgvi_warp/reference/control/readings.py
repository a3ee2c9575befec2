# SPDX-License-Identifier: Apache-2.0
"""Readings of a sensor, as numbers that a part may change."""

from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement
from lgvi_warp.reference.rotation import Array, exp, norm


def heading(R: Array) -> float:
    """Heading [rad] of an attitude (3, 3), from the forward axis alone."""
    return float(np.arctan2(R[1, 0], R[0, 0]))


def about_vertical(angle: float) -> Array:
    """The turn (3, 3) by an angle [rad] about the vertical."""
    return exp(np.array([0.0, 0.0, angle]))


def angles(R: Array) -> Array:
    """Roll, pitch and yaw (3,) [rad] of an attitude (3, 3)."""
    return np.array([np.arctan2(R[2, 1], R[2, 2]), np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0])), heading(R)])


def attitude(roll: float, pitch: float, yaw: float) -> Array:
    """Attitude R (3, 3) from Euler angles [rad] about the forward, the starboard and the down axis."""
    about = [np.array(axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    return exp(yaw * about[2]) @ exp(pitch * about[1]) @ exp(roll * about[0])


def turn_to(A: Array, B: Array) -> Array:
    """The rotation vector w (3,) with B = A exp(hat(w))."""
    E = A.T @ B
    v = 0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])
    size = norm(v)
    return v * (np.arctan2(size, 0.5 * (np.trace(E) - 1.0)) / size if size > 0.0 else 1.0)


def values(y: Measurement, of: str) -> Array:
    """The numbers (1,) or (3,) of a reading; for an attitude: roll, pitch and yaw."""
    if of == "depth":
        return y.position[2:]
    if of == "heading":
        return np.array([heading(y.R)])
    return angles(y.R) if of == "attitude" else np.asarray(getattr(y, of))


def with_values(y: Measurement, of: str, v: Array) -> Measurement:
    """The measurement y with the numbers v, (1,) or (3,), as its reading of a quantity."""
    if of == "depth":
        return replace(y, position=np.array([*y.position[:2], v[0]]))
    if of == "heading":
        return replace(y, R=about_vertical(v[0] - heading(y.R)) @ y.R)
    if of == "attitude":
        return replace(y, R=attitude(*v))
    vectors: dict[str, Any] = {of: v}
    return replace(y, **vectors)


def shifted(y: Measurement, of: str, e: Array) -> Measurement:
    """The measurement with the error e (1,) or (3,) added; an attitude is turned by it."""
    return replace(y, R=y.R @ exp(e)) if of == "attitude" else with_values(y, of, values(y, of) + e)
