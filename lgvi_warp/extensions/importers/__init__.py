# SPDX-License-Identifier: Apache-2.0
"""Importers of vehicles from SDF, URDF and YAML files of robotics packages; they are public as `lw.vehicles`."""

# The core looks no word of it up.
HOLDS: dict[str, dict[str, str]] = {}
