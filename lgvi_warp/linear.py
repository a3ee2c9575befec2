# SPDX-License-Identifier: Apache-2.0
"""Steady motions, linear models of a period, and how far a loop is from the edge."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
