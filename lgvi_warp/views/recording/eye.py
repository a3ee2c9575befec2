# SPDX-License-Identifier: Apache-2.0
"""Position of the camera of a recording, and the apparent size of things."""

from __future__ import annotations

import numpy as np

# Where the eye looks: to the north-east, a little down. Half its field of view upward, as a tangent, and the width of the
# view over its height, on a window of usual size; the height of the view in pixels.
SIGHT = np.array([0.48, 0.82, 0.31]) / np.linalg.norm([0.48, 0.82, 0.31])
TANGENT = np.tan(np.radians(27.5))
FIELD, ASPECT, HIGH = 0.9 * TANGENT, 1.3, 600.0


def distance(low: np.ndarray, high: np.ndarray, aspect: float) -> float:
    """Distance [m] of the camera from the middle of a box from low to high (3,) [m] at which all of the box is visible."""
    across = np.cross(SIGHT, (0.0, 0.0, -1.0))
    across /= np.linalg.norm(across)
    above = np.cross(across, SIGHT)
    corners = _corners(low, high)
    needed = np.maximum(np.abs(corners @ across) / (FIELD * aspect), np.abs(corners @ above) / FIELD)
    return float((needed - corners @ SIGHT).max())


def far_pixel(low: np.ndarray, high: np.ndarray, aspect: float) -> float:
    """Width of one pixel [m] at the far end of a box from low to high (3,) [m]."""
    farthest = distance(low, high, aspect) + float((_corners(low, high) @ SIGHT).max())
    return 2.0 * TANGENT * farthest / HIGH


def _corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Corners of a box (8, 3), relative to its middle."""
    return 0.5 * (high - low) * np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
