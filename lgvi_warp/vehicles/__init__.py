# SPDX-License-Identifier: Apache-2.0
"""Vehicles that come with the package, and importers of Fossen's coefficients, YAML, SDF and URDF."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
