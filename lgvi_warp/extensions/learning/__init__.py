# SPDX-License-Identifier: Apache-2.0
"""Vehicles as environments of Gymnasium and Stable-Baselines3: `lw.gym`."""

# The core looks no word of it up.
HOLDS: dict[str, dict[str, str]] = {}
