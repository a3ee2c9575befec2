# SPDX-License-Identifier: Apache-2.0
"""Steady motions, linear models of one control period, and stability margins of a control loop."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
