# SPDX-License-Identifier: Apache-2.0
"""Designs, the rules that choose the members' numbers, for `Ensemble(sampling=...)`."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
