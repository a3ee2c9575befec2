# SPDX-License-Identifier: Apache-2.0
"""A uniform current that is a sum of harmonics in time, such as tides: u(t) = sum_j a_j cos(omega_j t + phase_j)."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

FLOW = "uniform"

# Rows of one harmonic: amplitude (3) [m/s, inertial], omega [rad/s], phase [rad].
ROWS = 5


# First row of its table, ROWS for each harmonic, and count of harmonics.
params = make_params("CurrentHarmonics", words="first count")


@wp.func
def flow(f: Any, view: Any, p: Any):
    """u and du/dt = -sum_j omega_j a_j sin(omega_j t + phase_j)."""
    for j in range(p.count):
        at = p.first + wp.static(ROWS) * j
        amplitude = row3(view, at)
        omega = row1(view, at + 3)
        angle = fused(view.t * ones(omega), omega, row1(view, at + 4))
        f.velocity = f.velocity + cosine(angle) * amplitude
        f.rate = f.rate + -(omega * sine(angle)) * amplitude
    return f
