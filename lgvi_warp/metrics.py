# SPDX-License-Identifier: Apache-2.0
"""Metrics of a control loop, one number for each member, and risk measures of a fleet's numbers."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
