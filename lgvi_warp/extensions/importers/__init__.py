# SPDX-License-Identifier: Apache-2.0
"""Readers of vehicles: SDF, URDF and YAML files of robotics packages. `lw.vehicles` names them."""

# The core looks no word of it up.
HOLDS: dict[str, dict[str, str]] = {}
