# SPDX-License-Identifier: Apache-2.0
"""Inertial navigation: an IMU, a Doppler velocity log, an error-state Kalman filter, and tests of its consistency."""

# Where the device code of the parts is.
DEVICE = f"{__name__}.device"
HOLDS = {
    "events": {"position_uncertain": ".events"},
    "sensors": {"dvl": ".control.dvl", "error_state_filter": ".control.error_state_filter", "imu": ".control.imu"},
    "signals": dict.fromkeys(
        ("estimate_sigma", "estimate_bias", "nees", "nis", "nis_count", "innovation", "innovation_sigma", "rejected"),
        ".signals",
    ),
    "statistics": {"nees": ".metrics", "nis": ".metrics", "rejected": ".metrics"},
}
