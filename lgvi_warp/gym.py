# SPDX-License-Identifier: Apache-2.0
"""Vehicles as a vector environment of Gymnasium or Stable-Baselines3."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
