# SPDX-License-Identifier: Apache-2.0
"""Statistics over members, gathered while a run goes: one module for each kind, a table of them for scene files."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
