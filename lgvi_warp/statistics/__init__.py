# SPDX-License-Identifier: Apache-2.0
"""Statistics over members, gathered during a run: one module for each kind."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
