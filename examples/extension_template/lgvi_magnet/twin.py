# SPDX-License-Identifier: Apache-2.0
"""The law a second time, for one vehicle, in NumPy: what the test compares the device code with."""

import numpy as np


def torque(moment: np.ndarray, field: np.ndarray, attitude: np.ndarray) -> np.ndarray:
    """Torque (3,) [N m] in body axes at an attitude (3, 3), body to inertial axes."""
    return np.cross(moment, attitude.T @ field)
