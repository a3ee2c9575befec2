# SPDX-License-Identifier: Apache-2.0
"""Readers of vehicles: SDF, URDF and YAML files."""
