# SPDX-License-Identifier: Apache-2.0
"""Cost of a run on this machine: against members and threads, and by term."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
