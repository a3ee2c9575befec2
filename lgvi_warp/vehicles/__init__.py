# SPDX-License-Identifier: Apache-2.0
"""Vehicles that come with the package, and importers of Fossen's coefficients, YAML, SDF and URDF."""
