# SPDX-License-Identifier: Apache-2.0
"""Distributions of the numbers that vary between members, for `Ensemble(vary={...})`."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
