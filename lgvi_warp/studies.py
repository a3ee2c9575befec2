# SPDX-License-Identifier: Apache-2.0
"""Studies with many runs: cost against accuracy, suggested settings, stability maps and sensitivity."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
