# SPDX-License-Identifier: Apache-2.0
"""Signals of the filter's estimates, from the rows of the bus that device/error_state_filter.py writes."""

from lgvi_warp.control.signals import ESTIMATE, REJECTED, Signal, add_signals
from lgvi_warp.physics.fields import Field

_BLOCKS = "position [m], velocity [m/s], attitude [rad], biases of accelerometer [m/s^2] and gyroscope [rad/s]"
_SLOTS = "four beams [m/s], fix and delayed fix, each three [m], depth [m], heading [rad]"
add_signals(
    Signal(
        Field("estimate_sigma", (15,), "1", f"standard deviations that the filter believes: {_BLOCKS}"), ESTIMATE, 0
    ),
    Signal(
        Field("estimate_bias", (6,), "1", "estimated biases of accelerometer [m/s^2] and gyroscope [rad/s]"),
        ESTIMATE,
        15,
    ),
    Signal(Field("nees", (), "1", "e^T P^-1 e of the 15 errors of the estimate, by the truth"), ESTIMATE, 21),
    Signal(Field("nis", (), "1", "sum of the squared innovations over their variances at the last tick"), ESTIMATE, 22),
    Signal(Field("nis_count", (), "1", "how many innovations that are"), ESTIMATE, 23),
    Signal(Field("innovation", (12,), "1", f"innovations of the last tick, 0 where none: {_SLOTS}"), ESTIMATE, 24),
    Signal(
        Field("innovation_sigma", (12,), "1", f"standard deviations that these should have: {_SLOTS}"),
        ESTIMATE,
        36,
    ),
    absent=(
        "is reported by a filter; this scene has none, or its filter does not report it",
        'give [[controller.sensors]] type = "error_state_filter" with report = true',
    ),
)
add_signals(
    Signal(
        Field(
            "rejected",
            (5,),
            "1",
            "numbers rejected by the gate since the start, of dvl, fix, delayed_fix, depth, heading",
        ),
        REJECTED,
    ),
    absent=(
        "is counted by a filter with a gate that reports, and this scene has none",
        'give [[controller.sensors]] type = "error_state_filter" with gate = 4 and report = true',
    ),
)
