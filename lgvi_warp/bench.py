# SPDX-License-Identifier: Apache-2.0
"""Cost of a run on this machine: as a function of members and threads, and of each term."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
